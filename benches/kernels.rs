//! The kernels without Python, over sizes of images, beside a copy of each size.
//!
//! `cargo bench`, or `cargo bench -- gibbs` for some of them, `cargo bench -- 320x240` for one size. Lengths
//! are those of 320 x 240, stretched with the image. `motorprime bench` measures them from Python.

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use motorprime::gaussian::Gaussian;
use motorprime::gibbs::Gibbs;
use motorprime::kernel::{Kernel, Trajectory, Widths};
use motorprime::mlp::{Mlp, Scale, Weights};
use motorprime::rng::{Xoshiro256PlusPlus, uniform};
use motorprime::threshold::{Method, Wanted, threshold};
use motorprime::{Shape, parallel};

/// (width, height) of the images.
const SIZES: [(usize, usize); 5] = [(160, 120), (320, 240), (640, 480), (1280, 720), (1920, 1080)];

/// An image's size and how much larger than 320 x 240 it is.
#[derive(Clone, Copy)]
struct Image {
    shape: Shape,
    stretch: [f64; 2],
}

impl Image {
    fn new((width, height): (usize, usize)) -> Self {
        let stretch = [width as f64 / 320.0, height as f64 / 240.0];
        Self { shape: Shape::new(height, width).unwrap(), stretch }
    }

    fn paper() -> Self {
        Self::new((320, 240))
    }

    fn name(&self) -> String {
        format!("{}x{}", self.shape.width(), self.shape.height())
    }

    fn buffer(&self) -> Vec<f32> {
        vec![0.0; self.shape.pixels()]
    }

    /// A reach across the image, in a gentle arc.
    fn reach(&self, points: usize) -> Vec<[f64; 2]> {
        let along = |n: usize| n as f64 / (points - 1) as f64;
        let at = |a: f64| [40.3 + 230.0 * a, 190.7 - 400.0 * a * (1.0 - 0.7 * a)];
        (0..points).map(|n| self.stretched(at(along(n)))).collect()
    }

    fn stretched(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [u * self.stretch[0], v * self.stretch[1]]
    }

    /// The landscape of the reach of 100 points, width 40.
    fn landscape(&self) -> Vec<f32> {
        let mut out = self.buffer();
        plan(self, &self.reach(100), 40.0, Kernel::Triangular, &mut out);
        out
    }

    /// Random floats, the worst landscape to sort.
    fn noise(&self) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::new(0);
        (0..self.shape.pixels()).map(|_| uniform(&mut rng) as f32).collect()
    }
}

/// Calls of the kernels: what a change of their arguments has to touch.
fn plan(image: &Image, points: &[[f64; 2]], width: f64, kernel: Kernel, out: &mut [f32]) {
    let widths = Widths::Common(image.stretched([width, width]));
    Trajectory { points, widths, kernel, weights: None }.landscape(image.shape, out).unwrap();
}

fn ellipse(image: &Image, out: &mut [f32]) {
    let [across, down] = image.stretch;
    let mean = image.stretched([150.2, 130.6]);
    let chol = [36.9 * across, 9.8 * down, 24.5 * down];
    Gaussian { mean, chol, cutoff: 3.0, mixing: 1.0 }.landscape(image.shape, out).unwrap();
}

fn top_third(image: &Image, pixels: &[f32], stride: usize, method: Method) -> f64 {
    threshold(pixels, image.shape, Wanted::Fraction(0.3), stride, method).unwrap()
}

fn windows(image: &Image, pixels: &[f32], count: usize, seed: u64) -> [usize; 2] {
    let mut rng = Xoshiro256PlusPlus::new(seed);
    let mut chain = Gibbs::new(pixels, image.shape).unwrap();
    chain.start_drawn(&mut rng);
    (0..count).fold([0; 2], |_, _| chain.sweep(&mut rng))
}

fn network() -> Mlp {
    let mut rng = Xoshiro256PlusPlus::new(2);
    let mut vector = |n: usize| (0..n).map(|_| uniform(&mut rng) - 0.5).collect::<Vec<f64>>();
    let sizes = [12, 25, 25, 2];
    let layers =
        sizes.windows(2).map(|s| Weights { outputs: s[1], inputs: s[0], values: vector(s[0] * s[1]) });
    let layers: Vec<Weights> = layers.collect();
    let biases = sizes[1..].iter().map(|&n| vector(n)).collect();
    let scale = |n: usize| Scale { mean: vec![0.0; n], std: vec![1.0; n] };
    Mlp::new(layers, biases, scale(12), scale(2)).unwrap()
}

/// Measures `prepare(image)`'s function for images of every size; throughput is pixels per second.
fn over_sizes<F: FnMut()>(c: &mut Criterion, name: &str, prepare: impl Fn(Image) -> F) {
    let mut group = c.benchmark_group(name);
    for image in SIZES.map(Image::new) {
        let mut run = prepare(image);
        measure(&mut group, &image, &mut run);
    }
    group.finish();
}

fn measure(group: &mut BenchmarkGroup<'_, WallTime>, image: &Image, run: &mut impl FnMut()) {
    group.throughput(Throughput::Elements(image.shape.pixels() as u64));
    group.bench_function(BenchmarkId::from_parameter(image.name()), |b| b.iter(&mut *run));
}

fn copies(c: &mut Criterion) {
    over_sizes(c, "memory/copy, for scale", |image| {
        let (source, mut out) = (image.landscape(), image.buffer());
        move || black_box(&mut out).copy_from_slice(black_box(&source))
    });
}

fn landscapes(c: &mut Criterion) {
    over_sizes(c, "landscape/gaussian ellipse", |image| {
        let mut out = image.buffer();
        move || ellipse(black_box(&image), &mut out)
    });
    for (name, kernel) in [("triangular", Kernel::Triangular), ("gaussian", Kernel::Gaussian)] {
        for (count, width) in [(100, 40.0), (100, 120.0), (400, 40.0)] {
            over_sizes(c, &format!("landscape/{name}, {count} points, width {width}"), |image| {
                let (points, mut out) = (image.reach(count), image.buffer());
                move || plan(&image, black_box(&points), width, kernel, &mut out)
            });
        }
    }
}

fn thresholds(c: &mut Criterion) {
    for content in ["landscape", "noise"] {
        for (part, stride) in [("all pixels", 1), ("every 4th row and column", 4)] {
            for (name, method) in [("select", Method::Select), ("quicksort", Method::Quicksort)] {
                over_sizes(c, &format!("threshold/{name}, {content}, {part}"), |image| {
                    let pixels = if content == "noise" { image.noise() } else { image.landscape() };
                    move || {
                        black_box(top_third(&image, black_box(&pixels), stride, method));
                    }
                });
            }
        }
    }
}

fn samples(c: &mut Criterion) {
    over_sizes(c, "gibbs/check of the landscape alone", |image| {
        let pixels = image.landscape();
        move || {
            black_box(Gibbs::new(black_box(&pixels), image.shape).unwrap());
        }
    });
    over_sizes(c, "gibbs/50 windows", |image| {
        let (pixels, mut seed) = (image.landscape(), 0);
        move || {
            seed += 1;
            black_box(windows(&image, black_box(&pixels), 50, seed));
        }
    });
}

fn stereo(c: &mut Criterion) {
    let image = Image::paper();
    let points = image.reach(100);
    let mut outs = [image.buffer(), image.buffer()];
    c.bench_function("stereo/triangular, one after the other", |b| {
        b.iter(|| {
            for out in &mut outs {
                plan(&image, black_box(&points), 40.0, Kernel::Triangular, out);
            }
        });
    });
    c.bench_function("stereo/triangular, side by side", |b| {
        b.iter(|| {
            parallel::for_each(&mut outs, |_, out| {
                plan(&image, black_box(&points), 40.0, Kernel::Triangular, out);
            });
        });
    });
}

fn networks(c: &mut Criterion) {
    let mlp = network();
    for points in [1, 50, 100] {
        let inputs = vec![0.1; points * 12];
        let (mut out, mut jacobian) = (vec![0.0; points * 2], vec![0.0; points * 2 * 12]);
        c.bench_function(&format!("mlp/12-25-25-2, {points} points"), |b| {
            b.iter(|| mlp.forward(black_box(&inputs), &mut out).unwrap());
        });
        c.bench_function(&format!("mlp/Jacobian of 12-25-25-2, {points} points"), |b| {
            b.iter(|| mlp.jacobian(black_box(&inputs), &mut jacobian).unwrap());
        });
    }
}

/// Short: there are many, and a copy of the same size stands beside them.
fn short() -> Criterion {
    Criterion::default()
        .sample_size(12)
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(500))
}

criterion_group! {
    name = benches;
    config = short();
    targets = copies, landscapes, thresholds, samples, stereo, networks
}
criterion_main!(benches);
