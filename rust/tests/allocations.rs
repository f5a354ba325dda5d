//! A warmed-up cycle allocates nothing.

use allocation_counter::measure;
use motorprime::gaussian::Gaussian;
use motorprime::gibbs::{Gibbs, Schedule};
use motorprime::kernel::{self, Kernel, Trajectory, Widths};
use motorprime::masses::{Landscape, Masses};
use motorprime::mlp::{self, Mlp, Scale, Weights};
use motorprime::rng::{Xoshiro256PlusPlus, uniform};
use motorprime::sample::{self, sample};
use motorprime::step::{self, Look, Map, Plan, Sight, View};
use motorprime::threshold::{self, Method, Pixel, Wanted, threshold_on};
use motorprime::{Shape, Simd, Support};

/// (height, width): the image shrinks either way and grows back.
const SIZES: [(usize, usize); 6] = [(120, 160), (30, 50), (1, 1), (160, 120), (7, 160), (120, 160)];

/// Runs a cycle over all sizes once to warm up, and then again, counting.
fn allocates_nothing(what: &str, mut cycle: impl FnMut(Simd, Shape)) {
    for simd in Simd::all() {
        let mut sizes = || SIZES.iter().for_each(|&(h, w)| cycle(simd, Shape::new(h, w).unwrap()));
        sizes();
        let count = measure(&mut sizes).count_total;
        assert_eq!(count, 0, "{what} on {}", simd.name());
    }
}

fn points(shape: Shape, count: usize) -> Vec<[f64; 2]> {
    let mut rng = Xoshiro256PlusPlus::new(3);
    (0..count)
        .map(|_| [uniform(&mut rng) * shape.width() as f64, uniform(&mut rng) * shape.height() as f64])
        .collect()
}

fn noise(shape: Shape) -> Vec<f32> {
    let mut rng = Xoshiro256PlusPlus::new(4);
    (0..shape.pixels()).map(|_| uniform(&mut rng) as f32).collect()
}

/// Images of the largest size; a cycle takes the front.
fn largest() -> Shape {
    Shape::new(160, 160).unwrap()
}

fn network(sizes: &[usize]) -> Mlp {
    let mut rng = Xoshiro256PlusPlus::new(5);
    let mut numbers = |n: usize| (0..n).map(|_| uniform(&mut rng) - 0.5).collect::<Vec<f64>>();
    let weights = sizes
        .windows(2)
        .map(|s| Weights { outputs: s[1], inputs: s[0], values: numbers(s[0] * s[1]) })
        .collect();
    let biases = sizes[1..].iter().map(|&n| numbers(n)).collect();
    let scale = |n, mean, std| Scale { mean: vec![mean; n], std: vec![std; n] };
    Mlp::new(weights, biases, scale(sizes[0], 0.0, 1.0), scale(sizes[sizes.len() - 1], 2.0, 1.0)).unwrap()
}

#[test]
fn landscapes_of_trajectories() {
    for kernel in [Kernel::Triangular, Kernel::Gaussian] {
        for count in [1, 100, 700] {
            let points = points(largest(), count);
            let widths: Vec<[f64; 2]> = (0..count).map(|n| [9.0, (1 << (n % 8)) as f64]).collect();
            let weights: Vec<f64> = (0..count).map(|n| 0.9_f64.powi(n as i32)).collect();
            let trajectories = [Widths::Common([20.0, 15.0]), Widths::PerPoint(&widths)].map(|widths| {
                [None, Some(&weights[..])].map(|weights| Trajectory {
                    points: &points,
                    widths,
                    kernel,
                    weights,
                })
            });
            let (mut space, mut support) = (kernel::Workspace::default(), Support::default());
            let mut out = vec![0.0; largest().pixels()];
            allocates_nothing(&format!("{kernel:?} of {count}"), |simd, shape| {
                for trajectory in trajectories.iter().flatten() {
                    let out = &mut out[..shape.pixels()];
                    trajectory.landscape_on(simd, shape, &mut space, &mut support, out).unwrap();
                }
            });
        }
    }
}

#[test]
fn ellipses() {
    let gaussian = Gaussian { mean: [40.0, 30.0], chol: [20.0, 5.0, 15.0], cutoff: 3.0, mixing: 0.7 };
    let (mut support, mut out) = (Support::default(), vec![0.0; largest().pixels()]);
    allocates_nothing("ellipse", |simd, shape| {
        gaussian.landscape_on(simd, shape, &mut support, &mut out[..shape.pixels()]).unwrap();
    });
}

#[test]
fn samplers() {
    let (pixels, mut rng) = (noise(largest()), Xoshiro256PlusPlus::new(1));
    let mut masses = Masses::default();
    let mut out = [0; 200];
    allocates_nothing("chain", |simd, shape| {
        let landscape = Landscape { pixels: &pixels[..shape.pixels()], shape, support: None };
        let mut chain = Gibbs::new(simd, landscape, &mut masses).unwrap();
        chain.start_at([0, 0]).unwrap();
        chain.start_drawn(&mut rng);
        chain.run(&mut rng, u64::MAX, &mut Schedule::new(3, 2), &mut out);
    });
    for distance in [0.0, 1.0, 12.0] {
        let mut space = sample::Workspace::default();
        allocates_nothing(&format!("samples {distance} apart"), |simd, shape| {
            // The same draws every time, so that the first time is a warm-up for all.
            let mut rng = Xoshiro256PlusPlus::new(2);
            let landscape = Landscape { pixels: &pixels[..shape.pixels()], shape, support: None };
            sample(simd, landscape, distance, &mut rng, &mut space, &mut out).unwrap();
        });
    }
}

#[test]
fn samples_that_meet_a_harder_landscape_of_the_same_size() {
    // What is drawn decides whether places that are left are summed anew, and must not make a call allocate.
    let shape = Shape::new(40, 40).unwrap();
    let (even, mut uneven) = (vec![1.0; shape.pixels()], vec![1e-30; shape.pixels()]);
    uneven[77] = 1.0;
    let (mut space, mut out) = (sample::Workspace::default(), [0; 10]);
    let mut cycle = |pixels: &[f32]| {
        let mut rng = Xoshiro256PlusPlus::new(2);
        let landscape = Landscape { pixels, shape, support: None };
        sample(Simd::best(), landscape, 2.0, &mut rng, &mut space, &mut out).unwrap();
    };
    cycle(&even);
    assert_eq!(measure(|| cycle(&uneven)).count_total, 0);
}

#[test]
fn thresholds() {
    fn of<T: Pixel>(pixels: &[T]) {
        let mut space = threshold::Workspace::default();
        allocates_nothing("threshold", |simd, shape| {
            for method in [Method::Select, Method::Quicksort] {
                for (wanted, stride) in
                    [(Wanted::Fraction(0.1), 1), (Wanted::Count(50), 4), (Wanted::Count(1), 3)]
                {
                    let pixels = &pixels[..shape.pixels()];
                    threshold_on(simd, pixels, shape, wanted, stride, method, &mut space).unwrap();
                }
            }
        });
    }
    let single = noise(largest());
    of(&single);
    of(&single.iter().map(|&p| f64::from(p)).collect::<Vec<_>>());
}

#[test]
fn networks() {
    let mlp = network(&[12, 25, 25, 2]);
    let x: Vec<f64> = (0..12 * 100).map(|i| (i as f64).sin()).collect();
    let (mut y, mut slopes) = (vec![0.0; 200], vec![0.0; 2400]);
    let mut space = mlp::Workspace::default();
    allocates_nothing("network", |simd, shape| {
        let rows = shape.height().min(100);
        mlp.forward_on(simd, &x[..12 * rows], &mut space, &mut y[..2 * rows]).unwrap();
        mlp.jacobian_on(simd, &x[..12 * rows], &mut space, &mut slopes[..24 * rows]).unwrap();
    });
}

#[test]
fn whole_cycles() {
    let path: Vec<[f64; 3]> = (0..60).map(|n| [0.01 * n as f64 - 0.3, 0.1, 0.5]).collect();
    let pixels = points(Shape::new(120, 160).unwrap(), 50);
    let joints = [0.1; 9];
    let matrix = [80.0, 0.0, 60.0, 0.0, 0.0, 80.0, 30.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let [projection, reach] = [network(&[12, 20, 2]), network(&[9, 20, 5])];
    let maps =
        [Map::Pixels(&pixels), Map::Matrix(&matrix), Map::Network(&projection, None), Map::Ellipse(&reach)];
    for (map, kernel) in maps.into_iter().flat_map(|m| [(m, Kernel::Triangular), (m, Kernel::Gaussian)]) {
        let plan = Plan { points: &path, joints: &joints, kernel, cutoff: 3.0, mixing: 0.8 };
        let mut space = step::Workspace::default();
        let (mut out, mut mask) = (vec![0.0; largest().pixels()], vec![false; largest().pixels()]);
        let (mut centres, mut seen) = ([0; 40], 0);
        allocates_nothing(&format!("{map:?}"), |simd, shape| {
            for masked in [false, true] {
                let look = if masked {
                    Look::Mask(Wanted::Fraction(0.05), &mut mask[..shape.pixels()])
                } else {
                    Look::Windows(&mut centres)
                };
                let landscape = &mut out[..shape.pixels()];
                let mut view = View { shape, stride: 1, map, width: [20.0, 15.0], seed: 7, landscape, look };
                let sight = view.run(simd, &plan, &mut space).unwrap();
                seen += u32::from(matches!(sight, Sight::Seen(_)));
            }
        });
        assert!(seen > 4, "{map:?} sees next to nothing");
    }
}
