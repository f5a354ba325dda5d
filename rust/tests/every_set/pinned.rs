//! Inputs that once went wrong.

use motorprime::gaussian::Gaussian;
use motorprime::kernel::{Kernel, Trajectory, Widths, Workspace};
use motorprime::masses::{Landscape, Masses};
use motorprime::mlp::{Mlp, Scale, Weights};
use motorprime::rng::Xoshiro256PlusPlus;
use motorprime::sample::{Workspace as Sampler, sample};
use motorprime::{Shape, Simd, Support, gibbs};

/// The landscape, in units of the peak that one of the kernels would have alone.
fn landscape(
    kernel: Kernel,
    (height, width): (usize, usize),
    points: &[[f64; 2]],
    widths: [f64; 2],
    weights: Option<&[f64]>,
) -> Vec<f64> {
    let shape = Shape::new(height, width).unwrap();
    let widths_of = Widths::Common(widths);
    let trajectory = Trajectory { points, widths: widths_of, kernel, weights };
    let mut out = vec![f32::NAN; shape.pixels()];
    trajectory.landscape(shape, &mut Workspace::default(), &mut Support::default(), &mut out).unwrap();
    out.iter().map(|&p| f64::from(p) * (widths[0] * widths[1])).collect()
}

#[test]
fn kernels_much_narrower_than_the_image_can_tell_have_one_pixel() {
    // The steps of such a grid from row to row are beyond float64, and so is the inverse of a subnormal width.
    for high in [1e-300_f64, 1e-301, 1e-308, 1e-309] {
        for (kernel, peak) in [(Kernel::Triangular, 1.0), (Kernel::Gaussian, 0.159_154_943)] {
            let out = landscape(kernel, (40, 1), &[[0.0, 20.0]], [1.0 / high.max(1e-305), high], None);
            for (v, value) in out.iter().enumerate() {
                let expected = if v == 20 { peak } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{high:e} {v} {value}");
            }
        }
    }
}

#[test]
fn kernels_wider_than_float32_are_flat() {
    let out = landscape(Kernel::Triangular, (1, 30), &[[4.0, 0.0]], [1e200, 1e-200], None);
    assert!(out.iter().all(|p| (p - 1.0).abs() < 1e-6), "{out:?}");
    let out = landscape(Kernel::Triangular, (1, 30), &[[0.75e200, 0.0]], [1e200, 1e-200], None);
    assert!(out.iter().all(|p| (p - 0.25).abs() < 1e-6), "{out:?}");
}

#[test]
fn a_kernel_from_afar_ends_on_the_column_where_it_should() {
    // In float64 a pixel's distance to such a centre is rounded, more than once to the next whole number.
    for (centre, width) in
        [(1e9 + 0.3, 1e9 - 21.8), (1e15, 1e15 - 24.125), (-1e17, 1e17 + 16.0), (1e16, 1e16)]
    {
        let out = landscape(Kernel::Triangular, (1, 60), &[[centre, 0.0]], [width, 1.0], None);
        for (u, value) in out.iter().enumerate() {
            let height: f64 = width - (u as f64 - centre).abs();
            assert_eq!(*value > 0.0, height > 0.0, "{centre} {width} {u}");
        }
    }
}

#[test]
fn hundreds_of_faint_kernels_beside_a_strong_one_keep_their_mass() {
    for faint in [1e-3, 1e-5, 1e-7, 1e-12] {
        let points = [[20.0, 20.0]; 512];
        let mut weights = [faint; 512];
        weights[100] = 1.0;
        // Not next to each other, so that they count as many.
        let mut points = points;
        points.iter_mut().step_by(2).for_each(|p| p[0] += 1e-9);
        let total: f64 = weights.iter().sum();
        let out = landscape(Kernel::Triangular, (41, 41), &points, [9.0, 9.0], Some(&weights));
        for (i, value) in out.iter().enumerate() {
            let [u, v] = [(i % 41) as f64, (i / 41) as f64];
            let expected = (1.0 - (u - 20.0).abs() / 9.0).max(0.0) * (1.0 - (v - 20.0).abs() / 9.0).max(0.0);
            assert!((value - expected).abs() < 1e-5, "{faint} {value} {expected} of {total}");
        }
    }
}

#[test]
fn a_pixel_that_rounding_puts_into_a_needle_has_a_value() {
    let needle = |mean, chol| Gaussian { mean, chol, cutoff: 3.0, mixing: 1.0 };
    let needles = [
        needle([17.0, 9.0], [7.453039203594755, 2.2359117610784263, 5.368453958102756e-49]),
        // Here a step along the row is lost in the rounding of the rows.
        needle([9.0, -1e9], [1.0, 1e-8, 1e-60]),
        needle([-1e9, -1e9], [1.0, 1.0, 1e-60]),
    ];
    for (gaussian, simd) in needles.iter().flat_map(|n| Simd::all().into_iter().map(move |s| (n, s))) {
        let mut out = vec![f32::NAN; 12 * 18];
        gaussian.landscape_on(simd, Shape::new(12, 18).unwrap(), &mut Support::default(), &mut out).unwrap();
        assert!(out.iter().all(|p| (0.0..=1.0).contains(p)), "{gaussian:?} {out:?}");
    }
}

#[test]
fn a_pixel_is_too_near_to_itself_at_any_distance() {
    let (pixels, shape) = ([1.0; 4], Shape::new(2, 2).unwrap());
    for distance in [5e-324, 1e-300, 1e-160, 0.5, 1.0] {
        let landscape = Landscape { pixels: &pixels, shape, support: None };
        let (mut rng, mut out) = (Xoshiro256PlusPlus::new(1), [0; 20]);
        let drawn =
            sample(Simd::best(), landscape, distance, &mut rng, &mut Sampler::default(), &mut out).unwrap();
        assert_eq!(drawn, 4, "{distance:e}");
    }
}

#[test]
fn a_support_of_another_image_is_an_error() {
    let mut support = Support::default();
    support.clear(Shape::new(3, 3).unwrap());
    let (pixels, shape) = ([1.0; 100], Shape::new(10, 10).unwrap());
    let landscape = Landscape { pixels: &pixels, shape, support: Some(&support) };
    let error = gibbs::Gibbs::new(Simd::best(), landscape, &mut Masses::default()).unwrap_err();
    assert_eq!(error.to_string(), "support belongs to an image of another size");
}

#[test]
fn a_matrix_larger_than_memory_is_an_error() {
    let weights = vec![Weights { outputs: usize::MAX, inputs: 2, values: vec![] }];
    let scale = |n| Scale { mean: vec![0.0; n], std: vec![1.0; n] };
    assert!(Mlp::new(weights, vec![vec![]], scale(2), scale(1)).is_err());
}
