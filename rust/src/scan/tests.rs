use proptest::prelude::*;

use super::{Scan, Workspace};
use crate::shape::Shape;
use crate::simd::Simd;

/// The scores by counting each window's pixels.
fn counted(scan: &Scan<'_>, bins: &[u16], image: Shape) -> Vec<f64> {
    let places = scan.places(image).unwrap();
    let [height, width] = scan.window;
    let mut scores = vec![0.0; places.pixels()];
    for (k, score) in scores.iter_mut().enumerate() {
        if scan.wanted.is_some_and(|wanted| !wanted[k]) {
            continue;
        }
        let [top, left] = [k / places.width() * scan.stride, k % places.width() * scan.stride];
        let mut histogram = vec![0_u32; scan.target.len()];
        for v in top..top + height {
            for &bin in &bins[v * image.width() + left..][..width] {
                if let Some(count) = histogram.get_mut(usize::from(bin)) {
                    *count += 1;
                }
            }
        }
        let area = (height * width) as f64;
        let shares = histogram.iter().zip(scan.target);
        *score = shares.map(|(&n, &t)| (f64::from(n) / area).min(f64::from(t))).sum();
    }
    scores
}

fn run(scan: &Scan<'_>, bins: &[u16], image: Shape, simd: Simd, bands: usize) -> Vec<f32> {
    let mut out = vec![f32::NAN; scan.places(image).unwrap().pixels()];
    scan.run_on(simd, bins, image, bands, &mut Workspace::default(), &mut out).unwrap();
    out
}

prop_compose! {
    fn images()(height in 1_usize..40, width in 1_usize..90, kinds in 1_u16..12, patches in 1_usize..30)(
        height in Just(height),
        width in Just(width),
        window in (1..=height, 1..=width),
        stride in prop::sample::select(vec![1, 1, 2, 3, 7]),
        bins in prop::collection::vec(0..kinds + 2, height * width),
        empty in prop::collection::vec((0..height, 0..width), 0..patches),
        target in prop::collection::vec(prop_oneof![Just(0.0_f32), 0.0..0.4_f32], kinds as usize),
        wanted in prop::option::of(prop::collection::vec(prop::bool::weighted(0.1), height * width)),
    ) -> (Shape, [usize; 2], usize, Vec<u16>, Vec<f32>, Option<Vec<bool>>) {
        let mut bins = bins;
        // Stretches without any bin, which the scan leaves out.
        for (v, u) in empty {
            bins[v * width + u..(v + 1) * width].fill(u16::MAX);
        }
        (Shape::new(height, width).unwrap(), [window.0, window.1], stride, bins, target, wanted)
    }
}

proptest! {
    #[test]
    fn every_window_scores_what_counting_its_pixels_gives(
        (image, window, stride, bins, mut target, wanted) in images(), bands in 1_usize..9
    ) {
        target.push(0.1);
        let mut scan = Scan { target: &target, window, stride, wanted: None };
        let places = scan.places(image).unwrap().pixels();
        let wanted = wanted.map(|wanted| wanted[..places].to_vec());
        scan.wanted = wanted.as_deref();
        let first = run(&scan, &bins, image, Simd::best(), 1);
        for (found, expected) in first.iter().zip(counted(&scan, &bins, image)) {
            prop_assert!((f64::from(*found) - expected).abs() < 1e-6, "{found} {expected}");
        }
        // Whatever is wanted, and on however many threads and lanes: the same bits.
        for simd in Simd::all() {
            let again = run(&scan, &bins, image, simd, bands);
            prop_assert!(first.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", simd.name());
        }
        let everywhere = run(&Scan { wanted: None, ..scan }, &bins, image, Simd::best(), 1);
        for (k, found) in first.iter().enumerate() {
            let taken = wanted.as_ref().is_none_or(|wanted| wanted[k]);
            prop_assert_eq!(found.to_bits(), if taken { everywhere[k].to_bits() } else { 0 });
        }
    }
}

#[test]
fn windows_of_more_pixels_than_a_narrow_count_holds_are_counted() {
    let image = Shape::new(300, 300).unwrap();
    let bins: Vec<u16> = (0..image.pixels()).map(|i| (i % 3) as u16).collect();
    let scan = Scan { target: &[0.0, 1.0, 1.0], window: [299, 300], stride: 1, wanted: None };
    for (found, expected) in
        run(&scan, &bins, image, Simd::best(), 1).iter().zip(counted(&scan, &bins, image))
    {
        assert!((f64::from(*found) - expected).abs() < 1e-6);
    }
}

#[test]
fn bytes_are_as_good_as_wider_indices() {
    let image = Shape::new(9, 11).unwrap();
    let bytes: Vec<u8> = (0..99).map(|i| (i * i % 7) as u8).collect();
    let bins: Vec<u16> = bytes.iter().map(|&b| b.into()).collect();
    let scan = Scan { target: &[0.2, 0.0, 0.3, 0.1], window: [4, 3], stride: 2, wanted: None };
    let mut out = [f32::NAN; 15];
    scan.run(&bytes, image, &mut Workspace::default(), &mut out).unwrap();
    assert_eq!(out.as_slice(), run(&scan, &bins, image, Simd::best(), 1));
}

#[test]
fn what_cannot_be_scanned_is_named() {
    let image = Shape::new(4, 6).unwrap();
    let good = Scan { target: &[0.5, 0.5], window: [2, 2], stride: 1, wanted: None };
    let error = |scan: Scan<'_>| {
        scan.run(&[0_u8; 24], image, &mut Workspace::default(), &mut [0.0; 15]).unwrap_err().to_string()
    };
    let window = "window must be (height, width) of 1 to (4, 6), the image's, got ";
    assert_eq!(error(Scan { window: [5, 2], ..good }), format!("{window}(5, 2)"));
    assert_eq!(error(Scan { window: [2, 7], ..good }), format!("{window}(2, 7)"));
    assert_eq!(error(Scan { window: [0, 2], ..good }), format!("{window}(0, 2)"));
    assert_eq!(error(Scan { stride: 0, ..good }), "stride must be at least 1, got 0");
    let element = "target must be finite and >= 0, got ";
    assert_eq!(error(Scan { target: &[0.5, -0.1], ..good }), format!("{element}-0.1 at target[1]"));
    assert_eq!(error(Scan { target: &[f32::NAN], ..good }), format!("{element}NaN at target[0]"));
    let nothing = "target is zero everywhere: there is nothing to look for";
    assert_eq!(error(Scan { target: &[0.0, 0.0], ..good }), nothing);
    assert_eq!(error(Scan { target: &[], ..good }), nothing);
    assert_eq!(error(Scan { wanted: Some(&[true; 3]), ..good }), "wanted must be of 3 x 5 elements, got 3");
}
