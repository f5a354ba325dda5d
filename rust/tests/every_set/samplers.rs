//! Gibbs chains and independent samples.

use std::collections::HashSet;

use motorprime::gaussian::Gaussian;
use motorprime::gibbs::{Gibbs, Schedule};
use motorprime::masses::{Landscape, Masses};
use motorprime::rng::Xoshiro256PlusPlus;
use motorprime::sample::{Workspace, sample};
use motorprime::{Shape, Simd, Support};

use crate::case::{Case, Draw, ensure, stress};

#[test]
fn chains() {
    stress::<Chain>(2500);
}

#[test]
fn independent_samples() {
    stress::<Samples>(2500);
}

#[derive(Debug)]
struct Image {
    shape: Shape,
    pixels: Vec<f32>,
    support: Option<Support>,
}

impl Image {
    fn draw(draw: &mut Draw) -> Self {
        let shape = draw.shape();
        let mut pixels = vec![0.0_f32; shape.pixels()];
        if draw.chance(0.3) {
            let mut support = Support::default();
            let mean = [
                draw.between(-0.2, 1.2) * shape.width() as f64,
                draw.between(-0.2, 1.2) * shape.height() as f64,
            ];
            let chol = [draw.octaves(-3, 5), draw.between(-9.0, 9.0), draw.octaves(-3, 5)];
            let gaussian = Gaussian { mean, chol, cutoff: draw.pick(&[1.0, 3.0, 20.0]), mixing: draw.unit() };
            gaussian.landscape(shape, &mut support, &mut pixels).expect("a Gaussian of moderate size");
            return Self { shape, pixels, support: Some(support) };
        }
        let (style, zeros) = (draw.below(6), draw.pick(&[0.0, 0.3, 0.95, 1.0]));
        for p in &mut pixels {
            *p = match style {
                _ if draw.chance(zeros) => draw.pick(&[0.0, -0.0]),
                0 => draw.pick(&[f32::from_bits(1), f32::MAX]),
                1 => draw.octaves(-148, 127) as f32,
                2 => f32::from_bits(1 + draw.below(3) as u32),
                3 => f32::MAX,
                _ => draw.unit() as f32,
            };
        }
        let at = draw.below(pixels.len());
        match draw.below(20) {
            0 => pixels[at] = draw.pick(&[f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-45]),
            1..10 => pixels[at] = draw.pick(&[1.0, f32::MAX, f32::from_bits(1)]),
            _ => {}
        }
        Self { shape, pixels, support: None }
    }

    /// Whether there is something to sample and nothing wrong.
    fn valid(&self) -> bool {
        self.pixels.iter().all(|p| *p >= 0.0 && p.is_finite()) && self.pixels.iter().any(|&p| p > 0.0)
    }

    /// The image with its support, if it has one, and without.
    fn landscapes(&self) -> impl Iterator<Item = Landscape<'_>> {
        let supports = [None, self.support.as_ref()];
        let count = 1 + usize::from(self.support.is_some());
        let landscape = |&support: &Option<_>| Landscape { pixels: &self.pixels, shape: self.shape, support };
        supports.into_iter().take(count).map(move |support| landscape(&support))
    }

    fn positive(&self, drawn: &[i32]) -> Result<(), String> {
        for &[u, v] in drawn.as_chunks::<2>().0 {
            let [width, height] = [self.shape.width(), self.shape.height()];
            let inside = (0..width as i32).contains(&u) && (0..height as i32).contains(&v);
            let positive = inside && self.pixels[v as usize * width + u as usize] > 0.0;
            ensure(positive, || format!("drew ({u}, {v})"))?;
        }
        Ok(())
    }
}

/// Whether all results are the same.
fn agree(first: &mut Option<Vec<i32>>, drawn: Vec<i32>, simd: Simd) -> Result<(), String> {
    match first {
        Some(first) => {
            ensure(*first == drawn, || format!("{} draws other pixels: {first:?} {drawn:?}", simd.name()))
        }
        None => {
            *first = Some(drawn);
            Ok(())
        }
    }
}

#[derive(Debug)]
struct Chain {
    image: Image,
    start: Option<[usize; 2]>,
    burn_in: u64,
    thin: u64,
    count: usize,
    seed: u64,
}

impl Case for Chain {
    type Space = Masses;
    const NAME: &str = "chains";

    fn draw(draw: &mut Draw) -> Self {
        let image = Image::draw(draw);
        let (width, height) = (image.shape.width(), image.shape.height());
        let start = draw.chance(0.3).then(|| [draw.below(width + 1), draw.below(height + 1)]);
        let (burn_in, thin) = (draw.below(4) as u64, draw.below(4) as u64);
        Self { image, start, burn_in, thin, count: draw.below(30), seed: draw.below(usize::MAX) as u64 }
    }

    fn check(&self, masses: &mut Masses) -> Result<f64, String> {
        let valid = self.image.valid();
        let mut first = None;
        for simd in Simd::all() {
            for landscape in self.image.landscapes() {
                let mut rng = Xoshiro256PlusPlus::new(self.seed);
                let mut chain = match Gibbs::new(simd, landscape, masses) {
                    Ok(chain) if valid => chain,
                    Err(_) if !valid => continue,
                    other => return Err(format!("{}: {:?}", simd.name(), other.map(|_| ()))),
                };
                if let Some([u, v]) = self.start {
                    let (width, height) = (self.image.shape.width(), self.image.shape.height());
                    let good = u < width
                        && v < height
                        && self.image.pixels[v * width..(v + 1) * width].iter().any(|&p| p > 0.0);
                    let started = chain.start_at([u, v]);
                    ensure(started.is_ok() == good, || format!("{}: {started:?}", simd.name()))?;
                    if !good {
                        continue;
                    }
                } else {
                    chain.start_drawn(&mut rng);
                }
                let mut out = vec![-1; 2 * self.count];
                let mut schedule = Schedule::new(self.burn_in, self.thin);
                let kept = chain.run(&mut rng, u64::MAX, &mut schedule, &mut out);
                ensure(kept == self.count, || format!("kept {kept}"))?;
                self.image.positive(&out)?;
                agree(&mut first, out, simd)?;
            }
        }
        Ok(0.0)
    }
}

#[derive(Debug)]
struct Samples {
    image: Image,
    distance: f64,
    count: usize,
    seed: u64,
}

impl Case for Samples {
    type Space = Workspace;
    const NAME: &str = "independent samples";

    fn draw(draw: &mut Draw) -> Self {
        let image = Image::draw(draw);
        let distance = match draw.below(10) {
            0..4 => 0.0,
            4 => draw.pick(&[1e-300, 5e-324, 1e300, f64::MAX, -1.0, f64::NAN, f64::INFINITY, 1e-9]),
            5 => (draw.below(30) as f64).sqrt() * draw.nearly_one(),
            6..8 => draw.below(9) as f64,
            _ => draw.between(0.0, 12.0),
        };
        Self { image, distance, count: draw.below(30), seed: draw.below(usize::MAX) as u64 }
    }

    fn check(&self, workspace: &mut Workspace) -> Result<f64, String> {
        let valid = self.image.valid() && (0.0..f64::INFINITY).contains(&self.distance);
        let mut first = None;
        for simd in Simd::all() {
            for landscape in self.image.landscapes() {
                let mut rng = Xoshiro256PlusPlus::new(self.seed);
                let mut out = vec![-1; 2 * self.count];
                let drawn = sample(simd, landscape, self.distance, &mut rng, workspace, &mut out);
                ensure(drawn.is_ok() == valid, || format!("{}: {drawn:?}", simd.name()))?;
                let Ok(drawn) = drawn else { continue };
                out.truncate(2 * drawn);
                self.image.positive(&out)?;
                self.apart(&out)?;
                agree(&mut first, out, simd)?;
            }
        }
        Ok(0.0)
    }
}

impl Samples {
    /// Whether all keep their distance and, where there are fewer than asked, no place is left.
    fn apart(&self, drawn: &[i32]) -> Result<(), String> {
        let (pixels, _) = drawn.as_chunks::<2>();
        if self.distance == 0.0 {
            return ensure(pixels.len() == self.count, || format!("drew {}", pixels.len()));
        }
        let distance = |a: &[i32; 2], b: &[i32; 2]| f64::from(a[0] - b[0]).hypot(f64::from(a[1] - b[1]));
        // Where the square of the distance is a whole number that rounding missed either is right.
        let slack = 1e-15 * self.distance;
        for (n, a) in pixels.iter().enumerate() {
            let near = pixels[..n].iter().find(|b| distance(a, b) < self.distance - slack);
            ensure(near.is_none(), || format!("{a:?} is too near to {near:?}"))?;
        }
        let distinct: HashSet<_> = pixels.iter().collect();
        ensure(distinct.len() == pixels.len(), || "drew a pixel twice".into())?;
        if pixels.len() == self.count {
            return Ok(());
        }
        let width = self.image.shape.width();
        for (i, _) in self.image.pixels.iter().enumerate().filter(|(_, p)| **p > 0.0) {
            let at = [(i % width) as i32, (i / width) as i32];
            let free = pixels.iter().all(|p| distance(&at, p) >= self.distance + slack);
            ensure(!free, || format!("{at:?} was left of {drawn:?}"))?;
        }
        Ok(())
    }
}
