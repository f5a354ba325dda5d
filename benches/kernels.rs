//! The kernels without Python, over sizes of images, beside a copy of each size.
//!
//! `cargo bench`, or `cargo bench -- gibbs` for some of them, `cargo bench -- 320x240` for one size. Lengths
//! are those of 320 x 240, stretched with the image. `motorprime bench` measures them from Python.

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use motorprime::dynamics::{self, CoupledSystem, Coupling, Gaussians, Rates, System, Watch};
use motorprime::gaussian::Gaussian;
use motorprime::gibbs::{Gibbs, Schedule};
use motorprime::integral::IntegralHistogram;
use motorprime::kernel::{Kernel, Trajectory, Widths};
use motorprime::masses::{Landscape, Masses};
use motorprime::mlp::{Mlp, Scale, Weights};
use motorprime::rng::{Xoshiro256PlusPlus, uniform};
use motorprime::sample::sample;
use motorprime::scan::{self, Scan};
use motorprime::step::{Look, Map, Plan, Sight, Task, View, run};
use motorprime::surf::Surf;
use motorprime::threshold::{Method, Wanted, threshold};
use motorprime::{
    Shape, Simd, Support, kernel, mlp, parallel, sample as samplers, step, surf, threshold as thresholds,
};

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
        plan(self, &self.reach(100), 40.0, Kernel::Triangular, &mut Scratch::default(), &mut out);
        out
    }

    /// Random floats, the worst landscape to sort.
    fn noise(&self) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::new(0);
        (0..self.shape.pixels()).map(|_| uniform(&mut rng) as f32).collect()
    }
}

/// Buffers of a landscape.
#[derive(Default)]
struct Scratch {
    kernel: kernel::Workspace,
    support: Support,
}

/// Calls of the kernels: what a change of their arguments has to touch.
fn plan(
    image: &Image,
    points: &[[f64; 2]],
    width: f64,
    kernel: Kernel,
    scratch: &mut Scratch,
    out: &mut [f32],
) {
    let widths = Widths::Common(image.stretched([width, width]));
    let trajectory = Trajectory { points, widths, kernel, weights: None };
    trajectory.landscape(image.shape, &mut scratch.kernel, &mut scratch.support, out).unwrap();
}

fn ellipse(image: &Image, support: &mut Support, out: &mut [f32]) {
    let [across, down] = image.stretch;
    let mean = image.stretched([150.2, 130.6]);
    let chol = [36.9 * across, 9.8 * down, 24.5 * down];
    Gaussian { mean, chol, cutoff: 3.0, mixing: 1.0 }.landscape(image.shape, support, out).unwrap();
}

fn windows(image: &Image, pixels: &[f32], seed: u64, masses: &mut Masses, out: &mut [i32]) {
    let mut rng = Xoshiro256PlusPlus::new(seed);
    let landscape = Landscape { pixels, shape: image.shape, support: None };
    let mut chain = Gibbs::new(Simd::best(), landscape, masses).unwrap();
    chain.start_drawn(&mut rng);
    chain.run(&mut rng, u64::MAX, &mut Schedule::new(0, 1), out);
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
    let output = Scale { mean: vec![160.0, 120.0], std: vec![80.0, 60.0] };
    Mlp::new(layers, biases, scale(12), output).unwrap()
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
        let (mut support, mut out) = (Support::default(), image.buffer());
        move || ellipse(black_box(&image), &mut support, &mut out)
    });
    for (name, kernel) in [("triangular", Kernel::Triangular), ("gaussian", Kernel::Gaussian)] {
        for (count, width) in [(100, 40.0), (100, 120.0), (400, 40.0)] {
            over_sizes(c, &format!("landscape/{name}, {count} points, width {width}"), |image| {
                let (points, mut out) = (image.reach(count), image.buffer());
                let mut scratch = Scratch::default();
                move || plan(&image, black_box(&points), width, kernel, &mut scratch, &mut out)
            });
        }
    }
}

fn selections(c: &mut Criterion) {
    for content in ["landscape", "noise"] {
        for (part, stride) in [("all pixels", 1), ("every 4th row and column", 4)] {
            for (name, method) in [("select", Method::Select), ("quicksort", Method::Quicksort)] {
                over_sizes(c, &format!("threshold/{name}, {content}, {part}"), |image| {
                    let pixels = if content == "noise" { image.noise() } else { image.landscape() };
                    let (wanted, mut space) = (Wanted::Fraction(0.3), thresholds::Workspace::default());
                    move || {
                        let pixels = black_box(&pixels);
                        black_box(
                            threshold(pixels, image.shape, wanted, stride, method, &mut space).unwrap(),
                        );
                    }
                });
            }
        }
    }
}

fn samples(c: &mut Criterion) {
    over_sizes(c, "gibbs/50 windows", |image| {
        let (pixels, mut seed) = (image.landscape(), 0);
        let (mut masses, mut out) = (Masses::default(), [0; 100]);
        move || {
            seed += 1;
            windows(&image, black_box(&pixels), seed, &mut masses, black_box(&mut out));
        }
    });
    for distance in [0.0, 10.0] {
        over_sizes(c, &format!("sample/50 windows, distance {distance}"), |image| {
            let (pixels, mut rng) = (image.landscape(), Xoshiro256PlusPlus::new(1));
            let (mut space, mut out) = (samplers::Workspace::default(), [0; 100]);
            move || {
                let landscape = Landscape { pixels: black_box(&pixels), shape: image.shape, support: None };
                let distance = distance * image.stretch[0];
                sample(Simd::best(), landscape, distance, &mut rng, &mut space, &mut out).unwrap();
            }
        });
    }
}

/// Histogram intersections of all windows of 20 x 20 with nine bins, on every pixel one of 12 bins or, as is
/// usual, on one patch of the image; and the planes of an integral histogram, which would only be the beginning.
fn scans(c: &mut Criterion) {
    let target: Vec<f32> = (0..9).map(|bin| 0.02 + 0.02 * bin as f32).collect();
    for (content, patch) in [("a patch", 60.0), ("noise", 1e9)] {
        let bins_of = |image: &Image| -> Vec<u16> {
            let mut rng = Xoshiro256PlusPlus::new(6);
            let bins = (0..image.shape.pixels()).map(|i| {
                let [u, v] = [i % image.shape.width(), i / image.shape.width()];
                let inside = (u as f64) < patch * image.stretch[0] && (v as f64) < patch * image.stretch[1];
                if inside { (12.0 * uniform(&mut rng)) as u16 } else { u16::MAX }
            });
            bins.collect()
        };
        for (name, bands) in [("one thread", 1), ("side by side", 4)] {
            over_sizes(c, &format!("scan/20 x 20, 9 bins, {content}, {name}"), |image| {
                let (bins, mut out, mut space) =
                    (bins_of(&image), image.buffer(), scan::Workspace::default());
                let target = target.clone();
                move || {
                    let scan = Scan { target: &target, window: [20, 20], stride: 1, wanted: None };
                    let out = &mut out[..scan.places(image.shape).unwrap().pixels()];
                    let bins = black_box(&bins);
                    scan.run_on(Simd::best(), bins, image.shape, bands, &mut space, out).unwrap();
                }
            });
        }
        over_sizes(c, &format!("scan/integral histogram of 9 bins, {content}"), |image| {
            let bins = bins_of(&image);
            move || {
                black_box(IntegralHistogram::new(black_box(&bins), image.shape, 9).unwrap());
            }
        });
    }
}

fn stereo(c: &mut Criterion) {
    let image = Image::paper();
    let points = image.reach(100);
    for (name, threads) in [("one after the other", false), ("side by side", true)] {
        let mut eyes = [0, 1].map(|_| (Scratch::default(), image.buffer()));
        let work = |_: usize, (scratch, out): &mut (Scratch, Vec<f32>)| {
            plan(&image, black_box(&points), 40.0, Kernel::Triangular, scratch, out);
        };
        c.bench_function(&format!("stereo/triangular, {name}"), |b| {
            b.iter(|| {
                if threads {
                    parallel::for_each(&mut eyes, work);
                } else {
                    eyes.iter_mut().for_each(|eye| work(0, eye));
                }
            });
        });
    }
}

/// The whole cycle of a stereo pair: a plan of 100 points through a network, to 50 windows per eye.
fn steps(c: &mut Criterion) {
    let (image, network) = (Image::paper(), network());
    let points: Vec<[f64; 3]> = (0..100).map(|n| [-0.3 + 0.002 * f64::from(n), 0.1, 0.2]).collect();
    for (name, threads) in [("one thread", false), ("two threads", true)] {
        let mut spaces = [0, 1].map(|_| step::Workspace::default());
        let mut outs = [0, 1].map(|_| (image.buffer(), [0; 100]));
        c.bench_function(&format!("step/{name}"), |b| {
            b.iter(|| {
                let plan = Plan {
                    points: black_box(&points),
                    joints: &[0.0; 9],
                    kernel: Kernel::Triangular,
                    cutoff: 3.0,
                    mixing: 1.0,
                };
                let eyes = outs.iter_mut().zip(&mut spaces);
                let tasks = eyes.map(|((landscape, centres), workspace)| {
                    let (map, look) = (Map::Network(&network, None), Look::Windows(centres));
                    let view = View {
                        shape: image.shape,
                        stride: 1,
                        map,
                        width: [40.0; 2],
                        seed: 1,
                        landscape,
                        look,
                    };
                    Task { view, workspace, result: Ok(Sight::Behind) }
                });
                let mut tasks: Vec<_> = tasks.collect();
                run(&plan, &mut tasks, threads);
                assert!(tasks.iter().all(|task| matches!(task.result, Ok(Sight::Seen(_)))));
            });
        });
    }
}

fn networks(c: &mut Criterion) {
    let network = network();
    for points in [1, 50, 100] {
        let inputs = vec![0.1; points * 12];
        let (mut out, mut jacobian) = (vec![0.0; points * 2], vec![0.0; points * 2 * 12]);
        let mut space = mlp::Workspace::default();
        c.bench_function(&format!("mlp/12-25-25-2, {points} points"), |b| {
            b.iter(|| network.forward(black_box(&inputs), &mut space, &mut out).unwrap());
        });
        c.bench_function(&format!("mlp/Jacobian of 12-25-25-2, {points} points"), |b| {
            b.iter(|| network.jacobian(black_box(&inputs), &mut space, &mut jacobian).unwrap());
        });
    }
}

/// Systems with K components in a row, each turning a little more than the one before.
fn coupled(components: usize) -> CoupledSystem {
    let diagonal = |n: usize, value: f64| -> Vec<f64> {
        (0..n * n).map(|at| if at / n == at % n { value } else { 0.0 }).collect()
    };
    let mixture = |m: usize| Gaussians {
        weights: vec![1.0 / components as f64; components],
        means: (0..components * m).map(|at| 0.1 * (at / m) as f64).collect(),
        covariances: (0..components).flat_map(|_| diagonal(m, 0.02)).collect(),
    };
    let system = |d: usize, m: usize, rate: f64| {
        let turned = |k: usize| {
            let mut matrix = diagonal(d, -rate);
            if d > 1 {
                (matrix[1], matrix[d]) = (0.3 * k as f64, -0.3 * k as f64);
            }
            matrix
        };
        System { mixture: mixture(m), matrices: (0..components).flat_map(turned).collect() }
    };
    let coupling = Coupling { mixture: mixture(2), near: 0.02 };
    let rates = Rates { alpha: [1.0; 3], beta: [1.0; 3], close: 0.001 };
    let systems = [&system(3, 3, 6.0), &system(6, 3, 2.0), &system(1, 1, 5.0)];
    CoupledSystem::new(systems, [&coupling; 2], rates).unwrap()
}

fn movements(c: &mut Criterion) {
    let tolerance = |t: f64| dynamics::Tolerance { fixation: t, place: t, turn: 10.0 * t, opening: 10.0 * t };
    let start = [0.2, -0.3, 0.1, -0.3, 0.1, 0.2, 0.5, -0.4, 0.9, 0.8];
    for components in [1, 3, 6, 12] {
        let (system, mut path) = (coupled(components), Vec::new());
        c.bench_function(&format!("dynamics/200 steps, {components} components"), |b| {
            b.iter(|| {
                system.roll_out(black_box(&start), 1.0, 0.01, 200, &tolerance(0.0), &mut path).unwrap()
            });
        });
    }
    let (system, watch) = (coupled(6), Watch { opening: 0.1, distance: 0.02 });
    let starts: Vec<_> = (0..100).map(|n| start.map(|x| x * (1.0 + 0.01 * f64::from(n)))).collect();
    c.bench_function("dynamics/100 movements until they arrive, 6 components", |b| {
        b.iter(|| {
            system.ends(black_box(&starts), 1.0, 0.01, &[6000; 100], &tolerance(0.001), &watch).unwrap()
        });
    });
}

/// Discs of many sizes and greys, which SURF finds hundreds of keypoints in.
fn discs(image: &Image) -> Vec<u8> {
    let (height, width) = (image.shape.height(), image.shape.width());
    let (mut rng, mut pixels) = (Xoshiro256PlusPlus::new(5), vec![128; image.shape.pixels()]);
    for _ in 0..image.shape.pixels() / 150 {
        let mut below = |n: usize| (uniform(&mut rng) * n as f64) as usize;
        let (u, v, radius, grey) = (below(width), below(height), 2 + below(6) * below(6) / 2, below(256));
        for y in v.saturating_sub(radius)..(v + radius + 1).min(height) {
            let half = (radius * radius - y.abs_diff(v).pow(2)).isqrt();
            let columns = u.saturating_sub(half)..(u + half + 1).min(width);
            pixels[y * width..][columns].fill(grey as u8);
        }
    }
    pixels
}

fn keypoints(c: &mut Criterion) {
    let surf = Surf::new(300.0, 4, 3, false, false).unwrap();
    for (name, share, threads) in
        [("whole", 1.0, 1), ("whole, two threads", 1.0, 2), ("30 %", 0.3, 1), ("10 %", 0.1, 1)]
    {
        over_sizes(c, &format!("surf/{name}"), |image| {
            let (pixels, surf, mut space) = (discs(&image), &surf, surf::Workspace::default());
            let [rows, columns] = [image.shape.height(), image.shape.width()]
                .map(|size| 0..(size as f64 * f64::sqrt(share)) as usize);
            let inside = |at: usize| {
                rows.contains(&(at / image.shape.width())) && columns.contains(&(at % image.shape.width()))
            };
            let mask: Vec<bool> = (0..image.shape.pixels()).map(inside).collect();
            move || {
                let mask = (share < 1.0).then_some(&mask[..]);
                black_box(surf.detect(black_box(&pixels), mask, image.shape, threads, &mut space).unwrap());
            }
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
    targets =
        copies, landscapes, selections, samples, scans, stereo, networks, steps, movements, keypoints
}
criterion_main!(benches);
