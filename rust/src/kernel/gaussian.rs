//! Gaussian product kernels, cut at 5 widths.
//!
//! A sum of separable kernels is a product of two thin matrices. Points go through in groups whose horizontal
//! factors fit the caches, four at a time over four rows, so that neither rows nor factors are read for each.

use super::Trajectory;
use crate::math::exp2_nonpositive;
use crate::shape::{Shape, pixels_between};
use crate::simd::{Kernel, Simd};
use crate::support::Support;

/// `|z|` beyond which the profile is 0.
const REACH: f64 = 5.0;
/// Most points whose sum is formed in float32; the sums of several groups are added in float64.
const GROUP: usize = 256;
/// Horizontal factors of a group, unless it would be smaller than [`LEAST`] points: half a megabyte.
const FACTORS: usize = 1 << 17;
const LEAST: usize = 16;
/// Points that pass together over as many rows.
const TOGETHER: usize = 4;

/// A kernel that reaches into the image, and where its factors begin.
#[derive(Clone, Copy, Debug)]
struct Bump {
    columns: [u32; 2],
    rows: [u32; 2],
    across: usize,
    down: usize,
}

/// What a warmed-up call reuses.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers {
    bumps: Vec<Bump>,
    /// Horizontal factors, a whole row of the image for each kernel.
    across: Vec<f32>,
    /// Vertical factors, on the rows that the kernel reaches.
    down: Vec<f32>,
    /// The kernels that reach the rows at hand.
    active: Vec<Bump>,
    /// Rows of a group, or those below the image.
    rows: Vec<f32>,
    sums: Vec<f64>,
}

/// Writes the landscape of a checked trajectory whose weights sum to `total`, and its support.
pub(super) fn landscape(
    trajectory: &Trajectory<'_>,
    simd: Simd,
    shape: Shape,
    total: f64,
    buffers: &mut Buffers,
    support: &mut Support,
    out: &mut [f32],
) {
    simd.run(Product { trajectory, shape, total, buffers, support, out });
}

struct Product<'a> {
    trajectory: &'a Trajectory<'a>,
    shape: Shape,
    total: f64,
    buffers: &'a mut Buffers,
    support: &'a mut Support,
    out: &'a mut [f32],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { trajectory, shape, total, buffers, support, out } = self;
        let (width, points) = (shape.width(), trajectory.points.len());
        support.clear(shape);
        let group = (FACTORS / width).clamp(LEAST, GROUP);
        let mut spare = std::mem::take(&mut buffers.rows);
        spare.resize(TOGETHER * width, 0.0);
        if points <= group {
            buffers.factors(trajectory, 0..points, shape, total, support);
            for (k, rows) in out.chunks_mut(TOGETHER * width).enumerate() {
                let whole = rows.len() == spare.len();
                let target = if whole { &mut *rows } else { &mut spare[..] };
                target.fill(0.0);
                buffers.add((TOGETHER * k) as u32, target, width);
                if !whole {
                    rows.copy_from_slice(&spare[..rows.len()]);
                }
            }
            buffers.rows = spare;
            return;
        }
        let mut sums = std::mem::take(&mut buffers.sums);
        sums.clear();
        sums.resize(shape.pixels(), 0.0);
        for start in (0..points).step_by(group) {
            buffers.factors(trajectory, start..points.min(start + group), shape, total, support);
            for (k, sums) in sums.chunks_mut(TOGETHER * width).enumerate() {
                spare.fill(0.0);
                buffers.add((TOGETHER * k) as u32, &mut spare, width);
                for (sum, &x) in sums.iter_mut().zip(&spare) {
                    *sum += f64::from(x);
                }
            }
        }
        for (value, &sum) in out.iter_mut().zip(&sums) {
            *value = sum as f32;
        }
        (buffers.sums, buffers.rows) = (sums, spare);
    }
}

impl Buffers {
    /// The separable factors of some points, weights and norm folded in.
    #[inline(always)]
    fn factors(
        &mut self,
        trajectory: &Trajectory<'_>,
        points: std::ops::Range<usize>,
        shape: Shape,
        total: f64,
        support: &mut Support,
    ) {
        self.bumps.clear();
        let (width, height) = (points.len() * shape.width(), points.len() * shape.height());
        if self.across.len() < width {
            self.across.resize(width, 0.0);
        }
        if self.down.len() < height {
            self.down.resize(height, 0.0);
        }
        for n in points {
            let ([u, v], [wide, high]) = (trajectory.points[n], trajectory.widths.of(n));
            let weight = trajectory.weights.map_or(1.0, |w| w[n]);
            let (left, right) = pixels_between(u - REACH * wide, u + REACH * wide, shape.width());
            let (top, bottom) = pixels_between(v - REACH * high, v + REACH * high, shape.height());
            if left == right || top == bottom || weight == 0.0 {
                continue;
            }
            // Half of the norm goes to either factor, so that neither leaves float32's range.
            let height = (trajectory.kernel.peak() * (weight / total / (wide * high)).sqrt()) as f32;
            let k = self.bumps.len();
            let (across, down) = (k * shape.width(), k * shape.height());
            let factors = &mut self.across[across..][..shape.width()];
            factors[..left].fill(0.0);
            profile(left, u, wide, height, &mut factors[left..right]);
            factors[right..].fill(0.0);
            profile(top, v, high, height, &mut self.down[down..][..bottom - top]);
            let (rows, columns) = ([top as u32, bottom as u32], [left as u32, right as u32]);
            support.cover(rows, columns);
            self.bumps.push(Bump { columns, rows, across, down });
        }
    }

    /// Adds the kernels of the group to rows `v` and the ones below it.
    #[inline(always)]
    fn add(&mut self, v: u32, rows: &mut [f32], width: usize) {
        let below = v + TOGETHER as u32;
        self.active.clear();
        self.active.extend(self.bumps.iter().filter(|b| b.rows[0] < below && v < b.rows[1]));
        let (first, second) = rows.split_at_mut(2 * width);
        let ((r0, r1), (r2, r3)) = (first.split_at_mut(width), second.split_at_mut(width));
        for together in self.active.chunks(TOGETHER) {
            let left = together.iter().map(|b| b.columns[0]).min().unwrap_or(0) as usize;
            let right = together.iter().map(|b| b.columns[1]).max().unwrap_or(0) as usize;
            // Where fewer are left, the first stands in with a factor of 0.
            let bump = |k: usize| together.get(k).unwrap_or(&together[0]);
            let [a, b, c, d]: [&[f32]; TOGETHER] =
                std::array::from_fn(|k| &self.across[bump(k).across..][left..right]);
            let down = |v: u32| -> [f32; TOGETHER] {
                std::array::from_fn(|k| match together.get(k) {
                    Some(b) if b.rows[0] <= v && v < b.rows[1] => {
                        self.down[b.down + (v - b.rows[0]) as usize]
                    }
                    _ => 0.0,
                })
            };
            let [f0, f1, f2, f3] = [down(v), down(v + 1), down(v + 2), down(v + 3)];
            let sum =
                |f: [f32; 4], a: f32, b: f32, c: f32, d: f32| (f[0] * a + f[1] * b) + (f[2] * c + f[3] * d);
            let upper = r0[left..right].iter_mut().zip(&mut r1[left..right]);
            let lower = r2[left..right].iter_mut().zip(&mut r3[left..right]);
            for (((((upper, lower), &a), &b), &c), &d) in upper.zip(lower).zip(a).zip(b).zip(c).zip(d) {
                *upper.0 += sum(f0, a, b, c, d);
                *upper.1 += sum(f1, a, b, c, d);
                *lower.0 += sum(f2, a, b, c, d);
                *lower.1 += sum(f3, a, b, c, d);
            }
        }
    }
}

/// `height exp(-z^2 / 2)` with `z = (p - centre) / width` for the pixels `p` from `first`, all with `|z| <= 5`.
#[inline(always)]
fn profile(first: usize, centre: f64, width: f64, height: f32, out: &mut [f32]) {
    // Scaled by the root of log2(e) / 2, the square is the exponent of 2. The first offset is formed in
    // float64, where a narrow kernel may be far from the origin; from there steps are small. The bound is for
    // a lone pixel, which takes no step.
    // A subnormal width has no finite inverse until it is lifted.
    let lift = if width < f64::MIN_POSITIVE { (1_u64 << 60) as f64 } else { 1.0 };
    let scale = (0.5 * std::f64::consts::LOG2_E).sqrt() / (width * lift);
    let (start, step) = (((first as f64 - centre) * lift * scale) as f32, scale.min(1e30) as f32);
    for (i, value) in out.iter_mut().enumerate() {
        let z = start + i as i32 as f32 * step;
        *value = height * exp2_nonpositive(-(z * z));
    }
}
