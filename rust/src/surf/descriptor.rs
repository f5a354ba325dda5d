//! The descriptor: gradients in a turned square of 20 scales around the keypoint, summed in 4 x 4 cells.

use super::integral::Plane;
use super::orientation::rounded;
use super::{Keypoint, LANES};
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

/// Samples along a side of the square up to which every pixel is looked at: the extended descriptor sorts slopes
/// by the sign of the other one, which is soon another.
const FINE: usize = 160;
const PLAIN: usize = 64;

type Patch = [[f32; POINTS]; POINTS];

/// Describes the keypoints of an image.
pub(super) struct Describe<'a> {
    gray: &'a [u8],
    shape: Shape,
    sums: &'a Plane,
    extended: bool,
    upright: bool,
    /// Weights of the gradients along a side.
    weights: [f32; SIDE],
}

impl<'a> Describe<'a> {
    pub(super) fn new(gray: &'a [u8], shape: Shape, sums: &'a Plane, extended: bool, upright: bool) -> Self {
        let weight = |k: usize| {
            let from_middle = k as f64 - (SIDE as f64 - 1.0) / 2.0;
            exp_nonpositive(-from_middle * from_middle / (2.0 * SIGMA * SIGMA))
        };
        let total: f64 = (0..SIDE).map(weight).sum();
        let weights = std::array::from_fn(|k| (weight(k) / total) as f32);
        Self { gray, shape, sums, extended, upright, weights }
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

    /// The brightness around a keypoint in squares of one scale, turned into its direction, in grey levels.
    #[inline(always)]
    fn patch(&self, keypoint: &Keypoint, direction: [f32; 2]) -> Patch {
        let samples = (POINTS as f32 * keypoint.scale()) as usize;
        let fine = if self.extended { FINE } else { PLAIN };
        let mut patch = if samples <= fine && self.shape.width().min(self.shape.height()) > 1 {
            let mut keypoint = *keypoint;
            if self.upright {
                // Upright samples are pixels.
                let start = (samples as f32 - 1.0) / 2.0;
                keypoint.u = rounded(keypoint.u - start) as f32 + start;
                keypoint.v = rounded(keypoint.v + start) as f32 - start;
            }
            self.every_pixel(&keypoint, direction, samples)
        } else {
            self.boxes(keypoint, direction, samples)
        };
        // Whole grey levels: a slope of nearly nothing has no sign then, and the extended descriptor asks for it.
        patch.iter_mut().flatten().for_each(|value| *value = rounded(*value) as f32);
        patch
    }

    /// Interpolated at distances of a pixel and shared among the squares by how far each sample lies in them.
    #[inline(always)]
    fn every_pixel(&self, keypoint: &Keypoint, [cosine, sine]: [f32; 2], samples: usize) -> Patch {
        let (width, height) = (self.shape.width(), self.shape.height());
        let (last_u, last_v) = ((width - 1) as f32, (height - 1) as f32);
        let start = -(samples as f32 - 1.0) / 2.0;
        let mut patch = [[0.0; POINTS]; POINTS];
        // The samples that belong to the present row of squares, and those of one line that belong to the next.
        let (mut line, mut next) = ([0.0_f32; FINE], [0.0_f32; FINE]);
        let (mut right, mut below, mut places) = ([0.0_f32; FINE], [0.0_f32; FINE], [0_u32; FINE]);
        let mut corners = [[0_u8; FINE]; 4];
        let whole = samples.next_multiple_of(LANES);
        let mut shares = [(0.0, false); FINE];
        for (k, share) in shares[..samples].iter_mut().enumerate() {
            *share = self::share(k, samples);
        }
        let lower = &self.gray[width..];
        let mut row = 0;
        for i in 0..samples {
            let down = start + i as f32;
            let (u0, v0) = (keypoint.u - down * sine, keypoint.v + down * cosine);
            let targets = places[..whole].iter_mut().zip(&mut right[..whole]).zip(&mut below[..whole]);
            for (j, ((place, right), below)) in targets.enumerate() {
                let across = start + j as i32 as f32;
                // Beyond the border it goes on as it is there.
                let u = (u0 + across * cosine).max(0.0).min(last_u);
                let v = (v0 + across * sine).max(0.0).min(last_v);
                let (x, y) = (u.min(last_u - 1.0) as i32, v.min(last_v - 1.0) as i32);
                (*right, *below) = (u - x as f32, v - y as f32);
                *place = (y * width as i32 + x) as u32;
            }
            let [a, b, c, d] = &mut corners;
            let targets = a.iter_mut().zip(b).zip(c).zip(d);
            for (&place, (((a, b), c), d)) in places[..samples].iter().zip(targets) {
                let place = place as usize;
                (*a, *b) = (self.gray[place], self.gray[place + 1]);
                (*c, *d) = (lower[place], lower[place + 1]);
            }
            let (mine, ends) = shares[i];
            let [a, b, c, d] = &corners;
            for j in 0..whole {
                let (a, b, c, d) = (f32::from(a[j]), f32::from(b[j]), f32::from(c[j]), f32::from(d[j]));
                let top = a + right[j] * (b - a);
                let bottom = c + right[j] * (d - c);
                let value = top + below[j] * (bottom - top);
                line[j] += value * mine;
                next[j] = value * (1.0 - mine);
            }
            if ends {
                gather(&line[..samples], &shares, &mut patch[row]);
                line = next;
                row += 1;
            }
        }
        patch
    }

    /// Means of upright boxes, two by two in every square.
    #[inline(always)]
    fn boxes(&self, keypoint: &Keypoint, [cosine, sine]: [f32; 2], samples: usize) -> Patch {
        const MESH: usize = 2;
        const COUNT: usize = POINTS * MESH;
        let spacing = samples as f32 / COUNT as f32;
        let (width, height) = (self.shape.width(), self.shape.height());
        let side = (rounded(spacing) as usize).clamp(1, width.min(height));
        let (sums, stride) = self.sums.rows();
        let (last_x, last_y) = ((width - side) as f32, (height - side) as f32);
        let middle = (COUNT as f32 - 1.0) / 2.0;
        let half = (side as f32 - 1.0) / 2.0;
        let below = &sums[side * stride..];
        let factor = 1.0 / (side * side * MESH * MESH) as f32;
        let mut patch = [[0.0; POINTS]; POINTS];
        for (i, row) in patch.iter_mut().enumerate() {
            let mut line = [0_i32; COUNT];
            for k in i * MESH..(i + 1) * MESH {
                let down = (k as f32 - middle) * spacing;
                let (u0, v0) = (keypoint.u - half - down * sine, keypoint.v - half + down * cosine);
                let mut places = [0_u32; COUNT];
                for (j, place) in places.iter_mut().enumerate() {
                    let across = (j as i32 as f32 - middle) * spacing;
                    let x = rounded((u0 + across * cosine).max(0.0).min(last_x));
                    let y = rounded((v0 + across * sine).max(0.0).min(last_y));
                    *place = (y * stride as i32 + x) as u32;
                }
                for (sum, &place) in line.iter_mut().zip(&places) {
                    let place = place as usize;
                    let upper = sums[place + side].wrapping_sub(sums[place]);
                    let lower = below[place + side].wrapping_sub(below[place]);
                    *sum += lower.wrapping_sub(upper);
                }
            }
            for (value, line) in row.iter_mut().zip(line.chunks_exact(MESH)) {
                *value = line.iter().sum::<i32>() as f32 * factor;
            }
        }
        patch
    }
}

/// Which part of sample `k` lies in the square that it begins in, and whether that square ends there.
#[inline(always)]
fn share(k: usize, samples: usize) -> (f32, bool) {
    // In units of one over the points, where everything is whole.
    let begin = k * POINTS;
    let end = (begin / samples + 1) * samples;
    (((end - begin).min(POINTS)) as f32 / POINTS as f32, end <= begin + POINTS)
}

/// The means of the samples in every square along a line.
#[inline(always)]
fn gather(line: &[f32], shares: &[(f32, bool); FINE], row: &mut [f32; POINTS]) {
    let samples = line.len();
    let per_point = POINTS as f32 / samples as f32;
    let (mut point, mut sum) = (0, 0.0);
    for (value, &(mine, ends)) in line.iter().zip(shares) {
        sum += value * mine;
        if ends {
            row[point] = sum * (per_point * per_point);
            sum = value * (1.0 - mine);
            point += 1;
        }
    }
}
