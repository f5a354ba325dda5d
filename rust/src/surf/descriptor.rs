//! The descriptor: gradients in a turned square of 20 scales around the keypoint, summed in 4 x 4 cells.

use super::Keypoint;
use super::integral::Plane;
use super::orientation::rounded;
use crate::math64::exp_nonpositive;
use crate::shape::Shape;

/// Gradients along a side of the square.
const SIDE: usize = 20;
/// Points of which they are the differences.
const POINTS: usize = SIDE + 1;
/// Gradients along a side of a cell, and cells along a side of the square.
const CELL: usize = 5;
const CELLS: usize = SIDE / CELL;
/// Standard deviation of the gradients' weights, in units of the scale.
const SIGMA: f64 = 3.3;

/// Describes the keypoints of an image.
pub(super) struct Describe<'a> {
    gray: &'a [u8],
    shape: Shape,
    sums: &'a Plane,
    extended: bool,
    /// Weights of the gradients along a side.
    weights: [f32; SIDE],
}

impl<'a> Describe<'a> {
    pub(super) fn new(gray: &'a [u8], shape: Shape, sums: &'a Plane, extended: bool) -> Self {
        let weight = |k: usize| {
            let from_middle = k as f64 - (SIDE as f64 - 1.0) / 2.0;
            exp_nonpositive(-from_middle * from_middle / (2.0 * SIGMA * SIGMA))
        };
        let total: f64 = (0..SIDE).map(weight).sum();
        let weights = std::array::from_fn(|k| (weight(k) / total) as f32);
        Self { gray, shape, sums, extended, weights }
    }

    /// Writes the descriptor of a keypoint, whose direction has this cosine and sine.
    #[inline(always)]
    pub(super) fn write(&self, keypoint: &Keypoint, direction: [f32; 2], out: &mut [f32]) {
        let patch = self.patch(keypoint, direction);
        out.fill(0.0);
        for (i, rows) in patch.windows(2).enumerate() {
            for j in 0..SIDE {
                let [a, b, c, d] = [rows[0][j], rows[0][j + 1], rows[1][j], rows[1][j + 1]];
                let weight = self.weights[i] * self.weights[j];
                let (x, y) = ((b - a + d - c) * weight, (c - a + d - b) * weight);
                let cell = i / CELL * CELLS + j / CELL;
                if self.extended {
                    let cell = &mut out[8 * cell..][..8];
                    let (of_x, of_y) = (if y >= 0.0 { 0 } else { 2 }, if x >= 0.0 { 4 } else { 6 });
                    cell[of_x] += x;
                    cell[of_x + 1] += x.abs();
                    cell[of_y] += y;
                    cell[of_y + 1] += y.abs();
                } else {
                    let cell = &mut out[4 * cell..][..4];
                    for (sum, term) in cell.iter_mut().zip([x, y, x.abs(), y.abs()]) {
                        *sum += term;
                    }
                }
            }
        }
        let square: f64 = out.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
        let scale = (1.0 / (square.sqrt() + f64::from(f32::EPSILON))) as f32;
        out.iter_mut().for_each(|x| *x *= scale);
    }

    /// The brightness around a keypoint: means of squares of one scale, turned into its direction.
    #[inline(always)]
    fn patch(&self, keypoint: &Keypoint, [cosine, sine]: [f32; 2]) -> [[f32; POINTS]; POINTS] {
        let scale = keypoint.scale();
        // The square is sampled every pixel, and what falls to a point is summed by its share.
        let side = (POINTS as f32 * scale) as usize;
        let ratio = side as f32 / POINTS as f32;
        let start = -(side as f32 - 1.0) / 2.0;
        let mut patch = [[0.0_f32; POINTS]; POINTS];
        let share = |k: usize| {
            let point = ((k as f32 + 1e-4) / ratio) as usize;
            let end = (point + 1) as f32 * ratio;
            let first = (end - k as f32).clamp(0.0, 1.0);
            (point, first)
        };
        for i in 0..side {
            let (row, upper) = share(i);
            let down = start + i as f32;
            let mut line = [0.0_f32; POINTS + 1];
            for j in 0..side {
                let (column, left) = share(j);
                let across = start + j as f32;
                let u = keypoint.u + across * cosine - down * sine;
                let v = keypoint.v + across * sine + down * cosine;
                let value = self.between(u, v);
                line[column] += value * left;
                line[column + 1] += value * (1.0 - left);
            }
            for (j, value) in line[..POINTS].iter().enumerate() {
                patch[row][j] += value * upper;
                if row + 1 < POINTS {
                    patch[row + 1][j] += value * (1.0 - upper);
                }
            }
        }
        let _ = self.sums;
        let per_point = 1.0 / (ratio * ratio);
        for value in patch.iter_mut().flatten() {
            // Whole grey levels: a slope of nearly nothing has no sign then, and the signs choose the sums of the
            // extended descriptor.
            *value = rounded(*value * per_point) as f32;
        }
        patch
    }

    /// The brightness between pixels; beyond the border it goes on as it is there.
    #[inline(always)]
    fn between(&self, u: f32, v: f32) -> f32 {
        let (width, height) = (self.shape.width(), self.shape.height());
        let u = u.clamp(0.0, (width - 1) as f32);
        let v = v.clamp(0.0, (height - 1) as f32);
        let (x, y) = ((u as usize).min(width.saturating_sub(2)), (v as usize).min(height.saturating_sub(2)));
        let (a, b) = (u - x as f32, v - y as f32);
        let top = &self.gray[y * width + x..][..2];
        let bottom = &self.gray[(y + 1) * width + x..][..2];
        let mix = |p: &[u8]| f32::from(p[0]) + a * (f32::from(p[1]) - f32::from(p[0]));
        let (top, bottom) = (mix(top), mix(bottom));
        top + b * (bottom - top)
    }
}
