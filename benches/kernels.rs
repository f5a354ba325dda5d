//! The kernels at the paper's sizes: `cargo bench`, or `cargo bench -- gibbs` for some of them.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use motorprime::gaussian::Gaussian;
use motorprime::gibbs::Gibbs;
use motorprime::kernel::{Kernel, Trajectory, Widths};
use motorprime::mlp::{Mlp, Scale, Weights, Workspace};
use motorprime::rng::{Xoshiro256PlusPlus, uniform};
use motorprime::threshold::{Method, Wanted, Workspace, threshold};
use motorprime::{Shape, parallel};

/// A reach across the image, in a gentle arc.
fn reach(points: usize) -> Vec<[f64; 2]> {
    let along = |n: usize| n as f64 / (points - 1) as f64;
    (0..points)
        .map(|n| [40.3 + 230.0 * along(n), 190.7 - 400.0 * along(n) * (1.0 - 0.7 * along(n))])
        .collect()
}

fn trajectory(points: &[[f64; 2]], kernel: Kernel) -> Trajectory<'_> {
    Trajectory { points, widths: Widths::Common([40.0, 40.0]), kernel, weights: None }
}

const ELLIPSE: Gaussian =
    Gaussian { mean: [150.2, 130.6], chol: [45.0, 12.0, 30.0], cutoff: 3.0, mixing: 1.0 };

fn image() -> Shape {
    Shape::new(240, 320).unwrap()
}

fn landscape(points: usize) -> Vec<f32> {
    let mut out = vec![0.0; image().pixels()];
    trajectory(&reach(points), Kernel::Triangular).landscape(image(), &mut out).unwrap();
    out
}

fn landscapes(c: &mut Criterion) {
    let shape = image();
    let mut out = vec![0.0; shape.pixels()];
    let source = landscape(100);
    c.bench_function("memory/copy of 320x240 float32, for scale", |b| {
        b.iter(|| black_box(&mut out).copy_from_slice(black_box(&source)));
    });
    c.bench_function("landscape/gaussian ellipse", |b| {
        b.iter(|| black_box(&ELLIPSE).landscape(shape, &mut out));
    });
    for (name, kernel) in [("triangular", Kernel::Triangular), ("gaussian", Kernel::Gaussian)] {
        for count in [50, 100] {
            let points = reach(count);
            c.bench_function(&format!("landscape/{name}, {count} points, width 40"), |b| {
                b.iter(|| trajectory(black_box(&points), kernel).landscape(shape, &mut out));
            });
        }
    }
}

fn stereo(c: &mut Criterion) {
    let shape = image();
    let points = reach(100);
    let mut outs = [vec![0.0; shape.pixels()], vec![0.0; shape.pixels()]];
    c.bench_function("stereo/triangular, 100 points, one after the other", |b| {
        b.iter(|| {
            for out in &mut outs {
                trajectory(black_box(&points), Kernel::Triangular).landscape(shape, out).unwrap();
            }
        });
    });
    c.bench_function("stereo/triangular, 100 points, side by side", |b| {
        b.iter(|| {
            parallel::for_each(&mut outs, |_, out| {
                trajectory(black_box(&points), Kernel::Triangular).landscape(shape, out).unwrap();
            });
        });
    });
}

fn thresholds(c: &mut Criterion) {
    let shape = image();
    let trajectory = landscape(100);
    let mut rng = Xoshiro256PlusPlus::new(0);
    let noise: Vec<f32> = (0..shape.pixels()).map(|_| uniform(&mut rng) as f32).collect();
    for (content, pixels) in [("landscape", &trajectory), ("noise", &noise)] {
        for (size, stride) in [("4,800 px", 4), ("76,800 px", 1)] {
            for (name, method) in [("select", Method::Select), ("quicksort", Method::Quicksort)] {
                let mut workspace = Workspace::default();
                c.bench_function(&format!("threshold/{name}, {content}, {size}"), |b| {
                    let wanted = Wanted::Fraction(0.3);
                    b.iter(|| threshold(black_box(pixels), shape, wanted, stride, method, &mut workspace));
                });
            }
        }
    }
}

fn samples(c: &mut Criterion) {
    let shape = image();
    let mut ellipse = vec![0.0; shape.pixels()];
    ELLIPSE.landscape(shape, &mut ellipse).unwrap();
    for (name, pixels) in [("trajectory", landscape(100)), ("ellipse", ellipse)] {
        c.bench_function(&format!("gibbs/check of the {name} alone"), |b| {
            b.iter(|| Gibbs::new(black_box(&pixels), shape));
        });
        c.bench_function(&format!("gibbs/50 windows from the {name}"), |b| {
            b.iter(|| {
                let mut rng = Xoshiro256PlusPlus::new(1);
                let mut chain = Gibbs::new(black_box(&pixels), shape).unwrap();
                chain.start_drawn(&mut rng);
                for _ in 0..50 {
                    black_box(chain.sweep(&mut rng));
                }
            });
        });
    }
}

fn network(c: &mut Criterion) {
    let mut rng = Xoshiro256PlusPlus::new(2);
    let mut vector = |n: usize| (0..n).map(|_| uniform(&mut rng) - 0.5).collect::<Vec<f64>>();
    let sizes = [12, 25, 25, 2];
    let layers =
        sizes.windows(2).map(|s| Weights { outputs: s[1], inputs: s[0], values: vector(s[0] * s[1]) });
    let layers: Vec<Weights> = layers.collect();
    let biases = sizes[1..].iter().map(|&n| vector(n)).collect();
    let scale = |n: usize| Scale { mean: vec![0.0; n], std: vec![1.0; n] };
    let mlp = Mlp::new(layers, biases, scale(12), scale(2)).unwrap();
    let inputs = vector(50 * 12);
    let mut workspace = Workspace::default();
    let (mut out, mut jacobian) = (vec![0.0; 50 * 2], vec![0.0; 50 * 2 * 12]);
    c.bench_function("mlp/12-25-25-2, 50 points, 2 cameras", |b| {
        b.iter(|| {
            for _camera in 0..2 {
                mlp.forward(black_box(&inputs), &mut workspace, &mut out).unwrap();
            }
        });
    });
    c.bench_function("mlp/Jacobian of 12-25-25-2, 50 points", |b| {
        b.iter(|| mlp.jacobian(black_box(&inputs), &mut workspace, &mut jacobian));
    });
}

criterion_group!(benches, landscapes, stereo, thresholds, samples, network);
criterion_main!(benches);
