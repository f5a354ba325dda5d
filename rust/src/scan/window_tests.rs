use proptest::prelude::*;

use super::{Picture, Scan, WindowSpace, Workspace};
use crate::colours::Colours;
use crate::error::Result;
use crate::shape::Shape;
use crate::simd::Simd;

/// Few colours, so that windows share some with a target.
const PALETTE: [[u8; 3]; 5] = [[200, 30, 30], [210, 40, 20], [30, 90, 200], [120, 120, 120], [20, 200, 60]];

fn colours() -> Colours {
    Colours::new(12, 4, 70, 25).unwrap()
}

fn score(
    scan: &Scan<'_>,
    simd: Simd,
    rgb: &[u8],
    image: Shape,
    corners: &[[i32; 2]],
    space: &mut WindowSpace,
) -> Result<Vec<f32>> {
    let mut out = vec![f32::NAN; corners.len()];
    let picture = Picture { rgb, shape: image, colours: colours() };
    scan.windows(simd, picture, corners, space, &mut out).map(|()| out)
}

/// A share for each bin, positive where a colour of the palette may be.
fn target() -> Vec<f32> {
    (0..colours().count()).map(|bin| if bin % 5 == 0 { 0.0 } else { 0.01 * (bin % 7) as f32 }).collect()
}

proptest! {
    #[test]
    fn windows_score_what_the_scan_of_the_whole_image_gives_them(
        (height, width) in (1_usize..40, 1_usize..150),
        sides in prop::array::uniform2(0.0..1.0_f64),
        places in prop::collection::vec(prop::array::uniform2(0.0..1.0_f64), 0..12),
        kinds in prop::collection::vec(0_usize..5, 1..200),
        earlier in (1_usize..60, 1_usize..60),
    ) {
        let image = Shape::new(height, width).unwrap();
        let [high, wide] = [(height, sides[0]), (width, sides[1])].map(|(side, s)| 1 + (s * side as f64) as usize);
        let [high, wide] = [high.min(height), wide.min(width)];
        let rgb: Vec<u8> =
            (0..image.pixels()).flat_map(|i| PALETTE[kinds[(i / 3) % kinds.len()]]).collect();
        let target = target();
        let scan = Scan { target: &target, window: [high, wide], stride: 1, wanted: None };
        let at = |s: f64, most: usize| (s * most as f64) as i32;
        let corners: Vec<[i32; 2]> =
            places.iter().map(|&[u, v]| [at(u, width - wide + 1), at(v, height - high + 1)]).collect();

        let mut bins = vec![0; image.pixels()];
        colours().bins(Simd::best(), &rgb, &mut bins).unwrap();
        let mut everywhere = vec![0.0; scan.places(image).unwrap().pixels()];
        scan.run(&bins, image, &mut Workspace::default(), &mut everywhere).unwrap();
        let expected: Vec<u32> = corners
            .iter()
            .map(|&[u, v]| everywhere[v as usize * (width - wide + 1) + u as usize].to_bits())
            .collect();

        // Another image was looked at before, with all that it left behind.
        let mut space = WindowSpace::default();
        let before = Shape::new(earlier.0, earlier.1).unwrap();
        let whole = Scan { window: [earlier.0, earlier.1], ..scan };
        score(&whole, Simd::best(), &vec![200; 3 * before.pixels()], before, &[[0, 0]], &mut space).unwrap();
        for simd in Simd::all() {
            let found = score(&scan, simd, &rgb, image, &corners, &mut space).unwrap();
            let found: Vec<u32> = found.into_iter().map(f32::to_bits).collect();
            prop_assert_eq!(&found, &expected, "{}", simd.name());
        }
    }
}

#[test]
fn pixels_that_no_window_covers_are_not_looked_at() {
    // What is beside the windows may be anything, which shows in nothing but the time; what is in them counts.
    let image = Shape::new(8, 130).unwrap();
    let target = target();
    let scan = Scan { target: &target, window: [3, 70], stride: 1, wanted: None };
    let mut rgb = PALETTE[0].repeat(image.pixels());
    let corners = [[60, 5], [0, 0]];
    let mut space = WindowSpace::default();
    let first = score(&scan, Simd::best(), &rgb, image, &corners, &mut space).unwrap();
    for v in 0..8 {
        for u in 0..130 {
            let inside = corners.iter().any(|&[left, top]| {
                (left..left + 70).contains(&(u as i32)) && (top..top + 3).contains(&(v as i32))
            });
            if !inside {
                rgb[3 * (v * 130 + u)..][..3].copy_from_slice(&PALETTE[2]);
            }
        }
    }
    assert_eq!(score(&scan, Simd::best(), &rgb, image, &corners, &mut space).unwrap(), first);
    rgb[3 * (5 * 130 + 60)..].fill(120);
    assert_ne!(score(&scan, Simd::best(), &rgb, image, &corners, &mut space).unwrap(), first);
}

#[test]
fn what_is_no_window_of_the_image_is_named() {
    let image = Shape::new(4, 6).unwrap();
    let target = target();
    let good = Scan { target: &target, window: [2, 3], stride: 1, wanted: None };
    let error = |scan: Scan<'_>, rgb: &[u8], corner: [i32; 2]| {
        score(&scan, Simd::best(), rgb, image, &[[0, 0], corner], &mut WindowSpace::default())
            .unwrap_err()
            .to_string()
    };
    let rgb = [9; 72];
    let inside = "corners must be a window inside the image, from 0 to ";
    assert_eq!(error(good, &rgb, [4, 0]), format!("{inside}3, got 4 at corners[1, 0]"));
    assert_eq!(error(good, &rgb, [0, 3]), format!("{inside}2, got 3 at corners[1, 1]"));
    assert_eq!(error(good, &rgb, [-1, 0]), format!("{inside}3, got -1 at corners[1, 0]"));
    assert!(error(good, &rgb[1..], [0, 0]).contains("4 x 6 x 3"));
    assert!(error(Scan { target: &target[1..], ..good }, &rgb, [0, 0]).contains("48 bins"));
    assert!(error(Scan { window: [5, 3], ..good }, &rgb, [0, 0]).contains("(5, 3)"));
    assert!(error(Scan { target: &[0.0; 48], ..good }, &rgb, [0, 0]).contains("zero everywhere"));
}
