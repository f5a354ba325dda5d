//! Both methods on every instruction set against a full sort.

use proptest::prelude::*;
use rand_core::RngCore;

use super::pack::CHUNK;
use super::select::{SMALL, step};
use super::*;
use crate::rng::{Xoshiro256PlusPlus, uniform};

/// What an image may be made of.
#[derive(Clone, Copy, Debug)]
enum Content {
    Noise,
    /// A handful of values, zeros of both signs among them.
    Ties,
    /// Half of the pixels share one value.
    Plateau,
    AllEqual,
    Denormals,
    /// From the least to the largest magnitude there is.
    Magnitudes,
    OnePositive,
    Rising,
    Falling,
    /// The pixels that the sample meets are extreme, so that the bracket misses or takes in almost everything.
    Misleading,
    /// The same, so that the wanted pixel lies below the bracket.
    SampleAbove,
    /// The same, so that it lies above.
    SampleBelow,
}

use Content::*;

const CONTENTS: &[Content] = &[
    Noise,
    Ties,
    Plateau,
    AllEqual,
    Denormals,
    Magnitudes,
    OnePositive,
    Rising,
    Falling,
    Misleading,
    SampleAbove,
    SampleBelow,
];

impl Content {
    fn pixels(self, size: usize, width: usize, seed: u64) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::new(seed);
        let one = rng.next_u64() as usize % size;
        let sampled = |at: usize| at.is_multiple_of(step(size, width));
        let pixel = |at: usize| {
            let noise = uniform(&mut rng) as f32;
            let place = (at + 1) as f32;
            match self {
                Noise => noise,
                Ties => {
                    [0.0, -0.0, 0.5, 1.0, 1.0, 2.0, f32::MAX, f32::from_bits(1)][(noise * 8.0) as usize % 8]
                }
                Plateau if at.is_multiple_of(2) => 0.6,
                Plateau => noise,
                AllEqual => 0.25,
                Denormals => f32::from_bits((noise * 1000.0) as u32),
                Magnitudes => f32::from_bits((f64::from(noise) * f64::from(f32::MAX.to_bits())) as u32),
                OnePositive if at == one => noise + 1.0,
                OnePositive => [0.0, -0.0][usize::from(noise > 0.5)],
                Rising => place,
                Falling => 1.0 / place,
                Misleading if sampled(at) => [f32::from_bits(1), f32::MAX][usize::from(noise > 0.5)],
                SampleAbove if sampled(at) => 2.0 + noise,
                SampleBelow if sampled(at) => noise / 1000.0,
                Misleading | SampleAbove | SampleBelow => 0.5 + noise,
            }
        };
        (0..size).map(pixel).collect()
    }
}

/// The definition, read off a full sort.
fn by_sorting(pixels: &[f32], wanted: u64) -> Option<f64> {
    let mut positive: Vec<f32> = pixels.iter().copied().filter(|&p| p > 0.0).collect();
    positive.sort_unstable_by(|a, b| b.total_cmp(a));
    let at = positive.len().min(usize::try_from(wanted).unwrap()).checked_sub(1)?;
    Some(f64::from(positive[at]))
}

/// Compares everything that answers the same question.
fn check(pixels: &[f32], width: usize, wanted: u64, workspace: &mut Workspace) {
    let shape = Shape::new(pixels.len() / width, width).unwrap();
    let expected = by_sorting(pixels, wanted);
    let double: Vec<f64> = pixels.iter().map(|&p| f64::from(p)).collect();
    let wanted = Wanted::Count(wanted);
    for simd in Simd::all() {
        for method in [Method::Select, Method::Quicksort] {
            let found = threshold_on(simd, pixels, shape, wanted, 1, method, workspace);
            assert_eq!(found.ok(), expected, "{} {method:?}", simd.name());
            let found = threshold_on(simd, &double, shape, wanted, 1, method, workspace);
            assert_eq!(found.ok(), expected, "{} {method:?} in float64", simd.name());
        }
    }
}

fn sizes() -> impl Strategy<Value = usize> {
    prop_oneof![
        4 => 1..3 * CHUNK,
        2 => SMALL - 2..=SMALL + 2,
        2 => SMALL / CHUNK..2 * SMALL / CHUNK,
        2 => SMALL..4 * SMALL,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn every_instruction_set_finds_what_a_sort_finds(
        content in prop::sample::select(CONTENTS),
        size in sizes(),
        share in 0.0..1.1_f64,
        seed: u64,
    ) {
        let pixels = content.pixels(size, size, seed);
        let wanted = ((share * size as f64) as u64).max(1);
        check(&pixels, size, wanted, &mut Workspace::default());
    }
}

proptest! {
    #[test]
    fn both_methods_find_the_largest_value_that_leaves_enough(
        pixels in prop::collection::vec(prop::sample::select(vec![0.0_f32, 0.5, 1.0, 2.0, 3.0]), 1..300),
        wanted in 1_u64..320,
    ) {
        prop_assume!(pixels.iter().any(|&p| p > 0.0));
        let shape = Shape::new(1, pixels.len()).unwrap();
        let mut workspace = Workspace::default();
        let mut find = |method| threshold(&pixels, shape, Wanted::Count(wanted), 1, method, &mut workspace).unwrap();
        let d = find(Method::Select);
        prop_assert_eq!(d, find(Method::Quicksort));
        let at_least = |d: f64| pixels.iter().filter(|&&p| p > 0.0 && f64::from(p) >= d).count() as u64;
        let positive = at_least(0.0);
        prop_assert!(at_least(d) >= wanted.min(positive));
        let above = pixels.iter().filter(|&&p| f64::from(p) > d).count() as u64;
        prop_assert!(above < wanted);
    }

    #[test]
    fn a_stride_reads_and_checks_its_pixels_only(
        (height, width) in (1..40_usize, 1..90_usize),
        stride in 1..12_usize,
        wanted in 1..4000_u64,
        seed: u64,
    ) {
        let shape = Shape::new(height, width).unwrap();
        let mut pixels = Noise.pixels(shape.pixels(), width, seed);
        let mut read = Vec::new();
        for (at, pixel) in pixels.iter_mut().enumerate() {
            if (at / width).is_multiple_of(stride) && (at % width).is_multiple_of(stride) {
                read.push(*pixel);
            } else {
                *pixel = f32::NAN;
            }
        }
        let square = (stride * stride) as u64;
        let expected = by_sorting(&read, wanted.div_ceil(square));
        let mut workspace = Workspace::default();
        for simd in Simd::all() {
            for method in [Method::Select, Method::Quicksort] {
                let mut find = |pixels: &[f32]| {
                    threshold_on(simd, pixels, shape, Wanted::Count(wanted), stride, method, &mut workspace)
                };
                prop_assert_eq!(find(&pixels).ok(), expected);
                let [v, u] = [(height - 1) / stride * stride, (width - 1) / stride * stride];
                let mut spoilt = pixels.clone();
                spoilt[v * width + u] = f32::INFINITY;
                let error = find(&spoilt).unwrap_err().to_string();
                let place = format!("at landscape[{v}, {u}]");
                prop_assert!(error.ends_with(&place), "{}", error);
            }
        }
    }
}

#[test]
fn a_large_image_is_narrowed_several_times() {
    let mut workspace = Workspace::default();
    for (seed, &content) in CONTENTS.iter().enumerate() {
        let pixels = content.pixels(320 * 240, 320, seed as u64);
        for wanted in [1, 23_040, 1_000_000] {
            check(&pixels, 320, wanted, &mut workspace);
        }
    }
}

#[test]
fn a_bad_pixel_is_named_wherever_it_stands() {
    let mut workspace = Workspace::default();
    for [height, width] in [[1, CHUNK + 3], [1, SMALL + CHUNK + 1]] {
        let shape = Shape::new(height, width).unwrap();
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-45] {
            let near = 2 * CHUNK + 2;
            for at in (0..width).filter(|&at| at < near || at + near >= width) {
                let mut pixels = Noise.pixels(width, width, 1);
                pixels[at] = bad;
                for simd in Simd::all() {
                    for method in [Method::Select, Method::Quicksort] {
                        let wanted = Wanted::Fraction(0.3);
                        let found = threshold_on(simd, &pixels, shape, wanted, 1, method, &mut workspace);
                        let error = found.unwrap_err().to_string();
                        assert!(error.ends_with(&format!("at landscape[0, {at}]")), "{error}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_warm_workspace_keeps_its_buffers_whatever_the_content() {
    let shape = Shape::new(60, 80).unwrap();
    let find = |pixels: &[f32], stride, workspace: &mut Workspace| {
        threshold(pixels, shape, Wanted::Fraction(0.3), stride, Method::Select, workspace).unwrap();
        let Buffers { read, sample, gathered: [inside, spare] } = &workspace.single;
        [read, sample, inside, spare].map(|buffer| (buffer.as_ptr(), buffer.capacity()))
    };
    let mut workspace = Workspace::default();
    let ones = vec![1.0; shape.pixels()];
    find(&ones, 2, &mut workspace);
    let warm = find(&ones, 1, &mut workspace);
    for (seed, &content) in CONTENTS.iter().enumerate() {
        for stride in [1, 2, 3] {
            let mut pixels = content.pixels(shape.pixels(), 80, seed as u64);
            pixels[0] = 1.0;
            assert_eq!(find(&pixels, stride, &mut workspace), warm, "{content:?}");
        }
    }
}
