//! Thresholds.

use motorprime::threshold::{Method, Pixel, Wanted, Workspace, threshold_on};
use motorprime::{Shape, Simd};

use crate::case::{Case, Draw, ensure, stress};

#[test]
fn thresholds_of_float32() {
    stress::<Sorted<f32>>(2500);
}

#[test]
fn thresholds_of_float64() {
    stress::<Sorted<f64>>(2500);
}

#[derive(Debug)]
struct Sorted<T> {
    shape: Shape,
    landscape: Vec<T>,
    wanted: Wanted,
    stride: usize,
}

/// What differs between the two types.
trait Float: Pixel {
    const NAME: &str;
    /// The smallest positive number, the smallest normal one and the largest.
    const EXTREMES: [Self; 3];
    const BAD: [Self; 4];
    fn of(x: f64) -> Self;
    fn random_bits(bits: u64) -> Self;
}

impl Float for f32 {
    const NAME: &str = "thresholds of float32";
    const EXTREMES: [f32; 3] = [f32::from_bits(1), f32::MIN_POSITIVE, f32::MAX];
    const BAD: [f32; 4] = [f32::from_bits(0x7fff_ffff), -f32::NAN, f32::INFINITY, -f32::from_bits(1)];
    fn of(x: f64) -> f32 {
        x as f32
    }
    fn random_bits(bits: u64) -> f32 {
        f32::from_bits((bits % (f32::INFINITY.to_bits() as u64)) as u32)
    }
}

impl Float for f64 {
    const NAME: &str = "thresholds of float64";
    const EXTREMES: [f64; 3] = [f64::from_bits(1), f64::MIN_POSITIVE, f64::MAX];
    const BAD: [f64; 4] = [f64::from_bits(u64::MAX >> 1), -f64::NAN, f64::INFINITY, -f64::from_bits(1)];
    fn of(x: f64) -> f64 {
        x
    }
    fn random_bits(bits: u64) -> f64 {
        f64::from_bits(bits % f64::INFINITY.to_bits())
    }
}

impl<T: Float> Case for Sorted<T> {
    type Space = Workspace;
    const NAME: &str = T::NAME;

    fn draw(draw: &mut Draw) -> Self {
        let shape = draw.shape();
        let levels = 1 + draw.below(5);
        let (style, zeros) = (draw.below(8), draw.pick(&[0.0, 0.0, 0.3, 0.95]));
        let level = T::random_bits((draw.unit() * 1e19) as u64);
        let mut landscape: Vec<T> = (0..shape.pixels())
            .map(|i| {
                if draw.chance(zeros) {
                    return T::of(draw.pick(&[0.0, -0.0]));
                }
                match style {
                    0 => T::random_bits((draw.unit() * 1e19) as u64),
                    1 => level,
                    2 => draw.pick(&T::EXTREMES),
                    3 => T::of(draw.below(levels) as f64),
                    // Smooth, or so that a regular sample is unlike the rest.
                    4 => T::of(i as f64),
                    5 => T::of(f64::from(u8::from(i % 7 == 0)) * draw.unit() + 1.0),
                    6 => T::of((shape.pixels() - i) as f64 * 1e-44),
                    _ => T::of(draw.unit()),
                }
            })
            .collect();
        for _ in 0..if draw.chance(0.1) { 1 + draw.below(3) } else { 0 } {
            landscape[draw.below(shape.pixels())] = draw.pick(&T::BAD);
        }
        let stride = if draw.chance(0.6) { 1 } else { draw.pick(&[2, 3, 4, 5, 64, 1000]) };
        let wanted = match draw.below(4) {
            0 => Wanted::Fraction(draw.unit()),
            1 => Wanted::Fraction(draw.pick(&[1.0, 1e-300, 0.5, 0.0, f64::NAN, 1.5])),
            2 => Wanted::Count(draw.pick(&[0, 1, 2, u64::MAX])),
            _ => Wanted::Count(1 + draw.below(shape.pixels()) as u64),
        };
        Self { shape, landscape, wanted, stride }
    }

    fn check(&self, workspace: &mut Workspace) -> Result<f64, String> {
        let Self { shape, landscape, wanted, stride } = self;
        let expected = self.twin();
        for simd in Simd::all() {
            for method in [Method::Select, Method::Quicksort] {
                let found = threshold_on(simd, landscape, *shape, *wanted, *stride, method, workspace);
                let good = match (&found, &expected) {
                    (Ok(found), Ok(expected)) => found.to_bits() == expected.to_bits(),
                    (Err(error), Err(part)) => error.to_string().contains(part),
                    _ => false,
                };
                ensure(good, || format!("{} {method:?}: {found:?}, not {expected:?}", simd.name()))?;
            }
        }
        Ok(0.0)
    }
}

impl<T: Float> Sorted<T> {
    /// The threshold by sorting, or a part of the error's message.
    fn twin(&self) -> Result<f64, String> {
        let Self { shape, landscape, wanted, stride } = self;
        let rows = landscape.chunks_exact(shape.width()).enumerate().step_by(*stride);
        let read: Vec<(usize, usize, T)> = rows
            .flat_map(|(v, row)| row.iter().enumerate().step_by(*stride).map(move |(u, &p)| (v, u, p)))
            .collect();
        let wanted = match *wanted {
            Wanted::Fraction(f) if f > 0.0 && f <= 1.0 => {
                ((f * read.len() as f64 - 1e-9).ceil() as usize).max(1)
            }
            Wanted::Fraction(_) => return Err("fraction must".into()),
            Wanted::Count(0) => return Err("count must".into()),
            Wanted::Count(count) => count.div_ceil((stride * stride) as u64) as usize,
        };
        if let Some((v, u, _)) = read.iter().find(|(_, _, p)| !p.valid()) {
            return Err(format!("at landscape[{v}, {u}]"));
        }
        let mut positive: Vec<f64> = read.iter().map(|&(_, _, p)| p.into()).filter(|&p| p > 0.0).collect();
        positive.sort_by(|a, b| b.total_cmp(a));
        let last = positive.len().checked_sub(1).ok_or("is zero")?;
        Ok(positive[last.min(wanted - 1)])
    }
}
