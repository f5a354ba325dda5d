//! Landscapes of trajectories.

use motorprime::kernel::{Kernel, Trajectory, Widths, Workspace};
use motorprime::{Shape, Simd, Support};

use crate::case::{Case, Draw, ensure, same_bits, stress};

#[test]
fn triangular_kernels() {
    stress::<Path<true>>(5000);
}

#[test]
fn gaussian_kernels() {
    stress::<Path<false>>(2000);
}

/// Of the larger of the largest pixel and the peak of a kernel that reaches the image.
const TOLERANCE: f64 = 1e-5;
/// Just above the smallest float32: what is below may become 0.
const VANISHING: f64 = 1.42e-45;

#[derive(Debug)]
struct Path<const TRIANGULAR: bool> {
    shape: Shape,
    points: Vec<[f64; 2]>,
    /// One for all points, or one for each.
    widths: Vec<[f64; 2]>,
    common: bool,
    weights: Option<Vec<f64>>,
}

#[derive(Default)]
struct Space {
    kernel: Workspace,
    support: Support,
    density: Vec<f64>,
    inside: Vec<bool>,
}

impl<const TRIANGULAR: bool> Case for Path<TRIANGULAR> {
    type Space = Space;
    const NAME: &str = if TRIANGULAR { "triangular kernels" } else { "gaussian kernels" };

    fn draw(draw: &mut Draw) -> Self {
        let shape = draw.shape();
        let count = match draw.below(100) {
            _ if shape.pixels() > 2000 => 1 + draw.below(40),
            0 => 1 + draw.below(1200),
            1..5 => 1 + draw.below(200),
            5..30 => 1 + draw.below(40),
            _ => 1 + draw.below(6),
        };
        let common = draw.chance(0.5);
        // Widths all alike, close to each other, or anything.
        let (base, spread) = (width(draw), draw.below(3));
        let mut widths: Vec<[f64; 2]> = Vec::new();
        for _ in 0..if common { 1 } else { count } {
            widths.push(match spread {
                0 => [base[0] * draw.octaves(-2, 2), base[1] * draw.octaves(-2, 2)],
                1 if draw.chance(0.9) => base,
                _ => width(draw),
            });
        }
        let repeats = draw.pick(&[0.0, 0.0, 0.2, 0.9, 1.0]);
        let places = 1 + draw.below(3);
        let mut points: Vec<[f64; 2]> = Vec::new();
        for n in 0..count {
            let [wide, high] = widths[if common { 0 } else { n }];
            if n >= places && draw.chance(repeats) {
                points.push(points[draw.below(places)]);
            } else {
                let size = [shape.width() as f64, shape.height() as f64];
                points.push([place(draw, size[0], wide), place(draw, size[1], high)]);
            }
        }
        let mut weights = draw.chance(0.5).then(|| weights(draw, count));
        if draw.chance(0.01) {
            let bad = draw.pick(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
            match (draw.below(3), &mut weights) {
                (0, Some(weights)) => weights[draw.below(count)] = bad,
                (1, _) => {
                    let at = draw.below(widths.len());
                    widths[at][draw.below(2)] = draw.pick(&[bad, 0.0, -1.0]);
                }
                _ => points[draw.below(count)][draw.below(2)] = bad,
            }
        }
        Self { shape, points, widths, common, weights }
    }

    fn check(&self, space: &mut Space) -> Result<f64, String> {
        let kernel = if TRIANGULAR { Kernel::Triangular } else { Kernel::Gaussian };
        let widths =
            if self.common { Widths::Common(self.widths[0]) } else { Widths::PerPoint(&self.widths) };
        let trajectory =
            Trajectory { points: &self.points, widths, kernel, weights: self.weights.as_deref() };
        let valid = self.valid();
        let mut first: Option<Vec<f32>> = None;
        for simd in Simd::all() {
            let mut out = vec![f32::NAN; self.shape.pixels()];
            let done =
                trajectory.landscape_on(simd, self.shape, &mut space.kernel, &mut space.support, &mut out);
            if valid.is_some_and(|valid| valid != done.is_ok()) {
                return Err(format!("{}: {done:?}", simd.name()));
            }
            if done.is_err() {
                return Ok(0.0);
            }
            self.follows_support(simd, space, &out)?;
            if let Some(first) = &first {
                ensure(same_bits(first, &out), || format!("{} gives other bits", simd.name()))?;
            }
            first.get_or_insert(out);
        }
        self.compare(space, &first.unwrap_or_default())
    }
}

impl<const TRIANGULAR: bool> Path<TRIANGULAR> {
    fn width(&self, n: usize) -> [f64; 2] {
        self.widths[if self.common { 0 } else { n }]
    }

    fn weight(&self, n: usize) -> f64 {
        self.weights.as_ref().map_or(1.0, |w| w[n])
    }

    /// Whether the input is in the domain; `None` where that hangs on a rounding.
    fn valid(&self) -> Option<bool> {
        let finite = self.points.iter().flatten().all(|x| x.is_finite());
        let total: f64 = (0..self.points.len()).map(|n| self.weight(n)).sum();
        let weights = (0..self.points.len()).all(|n| self.weight(n) >= 0.0)
            && (f64::MIN_POSITIVE..f64::INFINITY).contains(&total);
        if !finite || !weights || !self.widths.iter().flatten().all(|&w| w > 0.0 && w.is_finite()) {
            return Some(false);
        }
        let top = if TRIANGULAR { 1.0 } else { 0.5 / std::f64::consts::PI };
        let range = |low, high| {
            self.widths.iter().all(|w| {
                let density = top / (w[0] * w[1]);
                let share = density / self.points.len() as f64;
                density <= high && share >= low
            })
        };
        match [range(1.001e-30, 0.999e37), range(0.999e-30, 1.001e37)] {
            [inner, outer] if inner == outer => Some(inner),
            _ => None,
        }
    }

    /// Whether a pixel at this distance from the centre is in the support, and the profile there.
    fn profile(width: f64, distance: f64) -> Option<f64> {
        let distance = distance.abs();
        if TRIANGULAR {
            (width - distance > 0.0).then(|| (width - distance) / width)
        } else {
            let z = distance / width;
            (distance <= 5.0 * width).then(|| (-z * z / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt())
        }
    }

    /// Zero and the support where they should be, whatever the values are.
    fn follows_support(&self, simd: Simd, space: &Space, out: &[f32]) -> Result<(), String> {
        for (v, row) in out.chunks_exact(self.shape.width()).enumerate() {
            let columns = space.support.columns(v);
            for (u, &p) in row.iter().enumerate() {
                let good = p >= 0.0 && p.is_finite() && (p == 0.0 || columns.contains(&u));
                ensure(good, || format!("{}: {p:e} at ({u}, {v}), support {columns:?}", simd.name()))?;
            }
        }
        Ok(())
    }

    fn compare(&self, space: &mut Space, out: &[f32]) -> Result<f64, String> {
        let (width, height) = (self.shape.width(), self.shape.height());
        let Space { density, inside, support, .. } = space;
        density.clear();
        density.resize(out.len(), 0.0);
        inside.clear();
        inside.resize(out.len(), false);
        let total: f64 = (0..self.points.len()).map(|n| self.weight(n)).sum();
        let (mut largest, mut reaching, mut peaks) = (0.0_f64, 0, vec![0.0; height]);
        for (n, point) in self.points.iter().enumerate() {
            let ([wide, high], weight) = (self.width(n), self.weight(n));
            if weight == 0.0 {
                continue;
            }
            let scale = weight / total / (wide * high);
            let mut reached = false;
            let across: Vec<_> = (0..width).map(|u| Self::profile(wide, u as f64 - point[0])).collect();
            for v in 0..height {
                let mut reaches = false;
                let Some(down) = Self::profile(high, v as f64 - point[1]) else { continue };
                for (u, across) in across.iter().enumerate() {
                    let Some(across) = across else { continue };
                    density[v * width + u] += scale * down * across;
                    inside[v * width + u] = true;
                    reaches = true;
                }
                if reaches {
                    peaks[v] += scale;
                    largest = largest.max(if TRIANGULAR { scale } else { scale / 6.3 });
                }
                reached |= reaches;
            }
            reaching += usize::from(reached);
        }
        let largest = density.iter().copied().fold(largest, f64::max);
        // Many borders on one pixel may take a step each, see the kernel, and steps are coarser where a slope has
        // a fraction. There they are measured by the sum of the peaks; up to 16 kernels by the largest pixel or
        // one peak.
        let wide = self.widths.iter().any(|w| w[1] >= 131_072.0);
        let summed = peaks.iter().copied().fold(0.0, f64::max);
        let largest = if TRIANGULAR && (reaching > 16 || wide) { largest.max(summed) } else { largest };
        // Products of float32 factors are rounded to whole steps of its smallest number, each by itself.
        let rounding = VANISHING * (if TRIANGULAR { 1.0 } else { 1.0 + reaching as f64 });
        let mut worst = 0.0_f64;
        for (i, (&value, &density)) in out.iter().zip(&*density).enumerate() {
            let place = || format!("{value:e} for {density:e} at ({}, {})", i % width, i / width);
            ensure(value == 0.0 || inside[i] || !TRIANGULAR && self.borderline(i), place)?;
            ensure(value > 0.0 || !inside[i] || density <= VANISHING || !TRIANGULAR, place)?;
            let error = (f64::from(value) - density).abs();
            if error > rounding {
                worst = worst.max(error / largest);
                let told = || format!("{}, largest {largest:e}, {:e}", place(), error / largest);
                ensure(error <= TOLERANCE * largest, told)?;
            }
        }
        for v in 0..if TRIANGULAR { height } else { 0 } {
            let row = &inside[v * width..(v + 1) * width];
            let hull = row
                .iter()
                .position(|&x| x)
                .map_or(0..0, |first| first..row.iter().rposition(|&x| x).map_or(0, |last| last + 1));
            let columns = support.columns(v);
            ensure(columns == hull, || format!("support {columns:?} of row {v}, hull {hull:?}"))?;
        }
        Ok(worst)
    }

    /// Whether a pixel lies within a rounding of the border of a Gaussian.
    fn borderline(&self, i: usize) -> bool {
        let at = [(i % self.shape.width()) as f64, (i / self.shape.width()) as f64];
        (0..self.points.len()).any(|n| {
            (0..2).all(|k| (at[k] - self.points[n][k]).abs() <= 5.0 * self.width(n)[k] * (1.0 + 1e-12))
        })
    }
}

fn width(draw: &mut Draw) -> [f64; 2] {
    let mut one = || match draw.below(40) {
        0..8 => draw.pick(&[0.5, 1.0, 2.0, 3.0, 8.0, 40.0]),
        8..20 => draw.between(0.3, 30.0),
        20..28 => draw.octaves(-5, 12),
        28..31 => draw.octaves(-1, 4),
        31..33 => draw.octaves(20, 34),
        33 => draw.octaves(-1022, 996),
        34 => draw.pick(&[1e-300, 1e300, 4_194_304.0, 8_388_607.5, 1e9, 1e15, 5e-324, 1e-309]),
        35 => (1 + draw.below(30)) as f64 * draw.nearly_one(),
        _ => (1 + draw.below(30)) as f64,
    };
    let [wide, high] = [one(), one()];
    // Far beyond the image the other width has to make up for it, or float32 cannot hold the density.
    if (1e-30..1e30).contains(&(wide * high)) || draw.chance(0.1) {
        [wide, high]
    } else if draw.chance(0.5) {
        [wide, draw.octaves(-4, 4) / wide]
    } else {
        [draw.octaves(-4, 4) / high, high]
    }
}

fn place(draw: &mut Draw, size: f64, width: f64) -> f64 {
    let inside = (draw.unit() * size).floor();
    match draw.below(32) {
        0..6 => inside,
        6..9 => inside + 0.5,
        9..20 => draw.between(-0.3, 1.3) * size,
        20 => draw.pick(&[0.0, -0.0, 1e-300, -1e-300, -1e-9]),
        21 => draw.pick(&[-1.0, size, size - 1.0, -0.5, size - 0.5]) * draw.nearly_one(),
        22 => draw.pick(&[1e300, -1e300, 1e9, -1e9, 1e15, f64::MAX]),
        // The kernel's border falls on a pixel, or beside it by a rounding.
        23..28 => inside + draw.sign() * width * draw.nearly_one(),
        28 => inside + draw.sign() * (width - draw.unit()),
        29 => inside * draw.nearly_one(),
        _ => inside + draw.sign() * draw.unit() * width,
    }
}

fn weights(draw: &mut Draw, count: usize) -> Vec<f64> {
    let (style, level) = (draw.below(7), draw.octaves(-40, 1));
    let mut weights: Vec<f64> = (0..count)
        .map(|n| match style {
            0 => draw.unit(),
            1 => draw.pick(&[0.0, 1.0]),
            2 => 0.8_f64.powi(n as i32),
            3 => draw.octaves(-30, 1),
            // One that outweighs all others, which are alike.
            4 => {
                if n == 0 {
                    1.0
                } else {
                    level
                }
            }
            5 => draw.pick(&[1e-300, 1.0, level, 1e20]),
            _ => draw.pick(&[1.0, 1e300 / count as f64]),
        })
        .collect();
    if draw.chance(0.05) {
        weights[draw.below(count)] = 0.0;
    }
    if draw.chance(0.9) && weights.iter().all(|&w| w == 0.0) {
        weights[draw.below(count)] = level;
    }
    weights
}
