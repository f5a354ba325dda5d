//! The whole on drawn images.

use std::f32::consts::{FRAC_PI_2, TAU};

use super::{Features, Keypoint, Surf, Workspace};
use crate::shape::Shape;

/// A grey image with (u, v, radius, brightness) discs.
fn discs(shape: Shape, discs: &[(f32, f32, f32, u8)]) -> Vec<u8> {
    let mut image = vec![128; shape.pixels()];
    for (at, pixel) in image.iter_mut().enumerate() {
        let (u, v) = ((at % shape.width()) as f32, (at / shape.width()) as f32);
        for &(x, y, radius, brightness) in discs {
            if (u - x).powi(2) + (v - y).powi(2) <= radius * radius {
                *pixel = brightness;
            }
        }
    }
    image
}

/// Brightness that changes everywhere.
fn texture(shape: Shape) -> Vec<u8> {
    let mut state = 1_u32;
    let mut draw = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let spots: Vec<_> = (0..shape.pixels() / 60)
        .map(|_| {
            let place = (draw() * shape.width() as f32, draw() * shape.height() as f32);
            (place.0, place.1, 2.0 + 9.0 * draw() * draw(), (255.0 * draw()) as u8)
        })
        .collect();
    discs(shape, &spots)
}

fn surf() -> Surf {
    Surf::new(300.0, 4, 3, false, false).unwrap()
}

fn found(surf: &Surf, image: &[u8], mask: Option<&[bool]>, shape: Shape) -> Features {
    surf.detect(image, mask, shape, 1, &mut Workspace::default()).unwrap()
}

#[test]
fn a_disc_is_a_keypoint_of_its_place_size_and_sign() {
    let shape = Shape::new(120, 160).unwrap();
    for (brightness, sign, radius) in [(250, -1, 5.0), (5, 1, 5.0), (250, -1, 8.0), (5, 1, 12.0)] {
        let image = discs(shape, &[(70.0, 55.0, radius, brightness)]);
        let features = found(&surf(), &image, None, shape);
        let best = features.keypoints[0];
        assert!((best.u - 70.0).abs() < 0.1 && (best.v - 55.0).abs() < 0.1, "{best:?}");
        // The middle of the filter, five ninths of its side long, is about as long as the disc is wide.
        let middle = best.size * 5.0 / 9.0 / (2.0 * radius);
        assert!((0.9..1.2).contains(&middle) && best.laplacian == sign, "{best:?}");
    }
}

#[test]
fn a_turned_image_has_turned_keypoints_and_the_same_descriptors() {
    let (shape, turned) = (Shape::new(150, 150).unwrap(), Shape::new(150, 150).unwrap());
    let image = texture(shape);
    // A quarter turn from the u axis to the v axis: (u, v) goes to (149 - v, u).
    let quarter: Vec<u8> = (0..150 * 150).map(|at| image[(149 - at % 150) * 150 + at / 150]).collect();
    let (one, two) = (found(&surf(), &image, None, shape), found(&surf(), &quarter, None, turned));
    assert!(one.keypoints.len() > 50);
    let mut alike = 0;
    for (k, a) in one.keypoints.iter().enumerate() {
        let same = |b: &Keypoint| {
            (b.u - (149.0 - a.v)).abs() < 0.6
                && (b.v - a.u).abs() < 0.6
                && (b.size / a.size - 1.0).abs() < 0.1
        };
        let Some(at) = two.keypoints.iter().position(same) else { continue };
        let product: f32 = (0..64).map(|i| one.descriptors[64 * k + i] * two.descriptors[64 * at + i]).sum();
        let turn = (two.keypoints[at].angle - a.angle).rem_euclid(TAU);
        alike += usize::from(product > 0.98 && (turn - FRAC_PI_2).abs() < 0.1);
    }
    assert!(alike * 10 > one.keypoints.len() * 8, "{alike} of {}", one.keypoints.len());
}

#[test]
fn descriptors_have_length_one_and_keypoints_come_by_strength() {
    let shape = Shape::new(100, 140).unwrap();
    let image = texture(shape);
    for (upright, extended) in [(false, false), (false, true), (true, false), (true, true)] {
        let surf = Surf::new(100.0, 3, 4, upright, extended).unwrap();
        let features = found(&surf, &image, None, shape);
        assert!(features.keypoints.len() > 20);
        for descriptor in features.descriptors.chunks_exact(surf.numbers()) {
            let square: f32 = descriptor.iter().map(|x| x * x).sum();
            assert!((square - 1.0).abs() < 1e-5);
        }
        assert!(features.keypoints.is_sorted_by(|a, b| a.response >= b.response));
        assert!(features.keypoints.iter().all(|k| (0.0..TAU).contains(&k.angle) && k.response > 100.0));
        assert!(!upright || features.keypoints.iter().all(|k| (k.angle - 3.0 * FRAC_PI_2).abs() < 1e-6));
    }
}

#[test]
fn images_that_no_filter_fits_into_and_empty_masks_have_no_keypoints() {
    for (height, width) in [(1, 1), (1, 500), (500, 1), (2, 2), (8, 9), (15, 15), (20, 24)] {
        let shape = Shape::new(height, width).unwrap();
        let image = texture(shape);
        for octaves in [1, 4, 16] {
            let surf = Surf::new(0.0, octaves, 3, false, false).unwrap();
            assert_eq!(found(&surf, &image, None, shape), Features::default());
        }
    }
    let shape = Shape::new(90, 120).unwrap();
    let (image, mask) = (texture(shape), vec![false; 90 * 120]);
    assert_eq!(found(&surf(), &image, Some(&mask), shape), Features::default());
}

#[test]
fn a_flat_image_has_no_keypoints_whatever_the_threshold() {
    let shape = Shape::new(90, 120).unwrap();
    let surf = Surf::new(0.0, 4, 3, false, false).unwrap();
    assert_eq!(found(&surf, &vec![77; 90 * 120], None, shape), Features::default());
}

#[test]
fn parameters_outside_their_domains_are_named() {
    let error = |threshold, octaves, layers| {
        Surf::new(threshold, octaves, layers, false, false).unwrap_err().to_string()
    };
    for threshold in [-1.0, f64::NAN, f64::INFINITY, 1e300] {
        assert!(error(threshold, 4, 3).starts_with("hessian_threshold must be finite and not negative"));
    }
    assert_eq!(error(300.0, 0, 3), "octaves must be a whole number from 1 to 16, got 0");
    assert_eq!(error(300.0, 4, 17), "layers must be a whole number from 1 to 16, got 17");
    let shape = Shape::new(3, 3).unwrap();
    let short = surf().detect(&[0; 8], None, shape, 1, &mut Workspace::default());
    assert_eq!(short.unwrap_err().to_string(), "gray must be of 3 x 3 elements, got 8");
    let short = surf().detect(&[0; 9], Some(&[true; 10]), shape, 1, &mut Workspace::default());
    assert_eq!(short.unwrap_err().to_string(), "mask must be of 3 x 3 elements, got 10");
}
