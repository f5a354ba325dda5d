//! The direction of a keypoint: the strongest sum of gradients in a sliding window of 60 degrees.

use std::f32::consts::{PI, TAU};

use super::Keypoint;
use super::integral::Plane;
use crate::math::atan2;
use crate::math64::exp_nonpositive;
use crate::shape::Shape;

/// Samples in a circle of this radius, in units of the scale.
const RADIUS: i32 = 6;
/// Standard deviation of their weights, in the same unit.
const SIGMA: f64 = 2.5;
/// Room for the 113 samples of the circle.
const ROOM: usize = 128;
/// Positions of the window, every 5 degrees.
const WINDOWS: usize = 72;
/// Windows that begin within 60 degrees.
const WIDTH: usize = 12;

/// Where gradients are sampled around a keypoint, and their weights.
pub(super) struct Disc {
    samples: Vec<([f32; 2], f32)>,
}

/// Side of the Haar wavelets of a keypoint [px], an even number.
#[inline(always)]
fn wavelet(scale: f32) -> usize {
    2 * rounded(2.0 * scale) as usize
}

/// The nearest whole number, and of two the even one.
#[inline(always)]
pub(super) fn rounded(x: f32) -> i32 {
    // Where the set has no instruction for it, rounding is a slow call of a function.
    const MAGIC: f32 = 12_582_912.0;
    ((x + MAGIC) - MAGIC) as i32
}

impl Disc {
    pub(super) fn new() -> Self {
        let weight = |at: i32| exp_nonpositive(-f64::from(at * at) / (2.0 * SIGMA * SIGMA));
        let side = -RADIUS..=RADIUS;
        let total: f64 = side.clone().map(weight).sum();
        let all = side.clone().flat_map(|x| side.clone().map(move |y| (x, y)));
        let inside = all.filter(|(x, y)| x * x + y * y <= RADIUS * RADIUS);
        let weighted = inside.map(|(x, y)| {
            ([x as f32, y as f32], ((weight(x) / total) as f32) * ((weight(y) / total) as f32))
        });
        Self { samples: weighted.collect() }
    }

    /// Whether the wavelets of a keypoint fit into the image.
    #[inline(always)]
    pub(super) fn fits(&self, shape: Shape, keypoint: &Keypoint) -> bool {
        wavelet(keypoint.scale()) <= shape.height().min(shape.width()) + 1
    }

    /// Cosine and sine of the direction, none if no wavelet is inside the image.
    #[inline(always)]
    pub(super) fn direction(&self, sums: &Plane, shape: Shape, keypoint: &Keypoint) -> Option<[f32; 2]> {
        if !self.fits(shape, keypoint) {
            return None;
        }
        let scale = keypoint.scale();
        let side = wavelet(scale);
        let (half, middle) = (side / 2, (side as f32 - 1.0) / 2.0);
        let (last_x, last_y) = (shape.width() as i32 - side as i32, shape.height() as i32 - side as i32);
        let (sums, stride) = sums.rows();
        let (mut x_slopes, mut y_slopes) = ([0.0_f32; ROOM], [0.0_f32; ROOM]);
        let mut count = 0;
        for &([across, down], weight) in &self.samples {
            let x = rounded(keypoint.u + across * scale - middle);
            let y = rounded(keypoint.v + down * scale - middle);
            if x < 0 || y < 0 || x > last_x || y > last_y {
                continue;
            }
            let top = y as usize * stride + x as usize;
            let above = &sums[top..][..side + 1];
            let middle = &sums[top + half * stride..][..side + 1];
            let below = &sums[top + side * stride..][..side + 1];
            let upto = |k: usize| below[k].wrapping_sub(above[k]);
            let right_less_left = upto(side).wrapping_add(upto(0)).wrapping_sub(upto(half).wrapping_mul(2));
            let left_of = |row: &[i32]| row[side].wrapping_sub(row[0]);
            let lower_less_upper =
                left_of(below).wrapping_add(left_of(above)).wrapping_sub(left_of(middle).wrapping_mul(2));
            x_slopes[count] = right_less_left as f32 * weight;
            y_slopes[count] = lower_less_upper as f32 * weight;
            count += 1;
        }
        (count > 0).then(|| strongest(&x_slopes, &y_slopes, count))
    }
}

/// The direction of the window with the longest sum.
#[inline(always)]
fn strongest(x: &[f32; ROOM], y: &[f32; ROOM], count: usize) -> [f32; 2] {
    const DEGREES: f32 = 180.0 / PI;
    let mut degrees = [0_i32; ROOM];
    for ((degrees, &y), &x) in degrees.iter_mut().zip(y).zip(x) {
        *degrees = rounded(atan2(y, x) * DEGREES);
    }
    // A window is open at both ends. What lies exactly on a multiple of 5 degrees is in one bin, what lies
    // between two of them in the other; both go once around and then on for the windows that wrap around.
    let mut on = [[0.0_f32; 2]; WINDOWS];
    let mut between = [[0.0_f32; 2]; WINDOWS];
    for k in 0..count {
        let degrees = (degrees[k] + 360) as usize;
        let bins = if degrees.is_multiple_of(5) { &mut on } else { &mut between };
        let bin = &mut bins[degrees / 5 % WINDOWS];
        *bin = [bin[0] + x[k], bin[1] + y[k]];
    }
    let (on, between) = (around(&on), around(&between));
    let [mut sum_x, mut sum_y] = [[0.0_f32; WINDOWS]; 2];
    for offset in 0..WIDTH {
        for (axis, sum) in [&mut sum_x, &mut sum_y].into_iter().enumerate() {
            let (on, between) = (&on[axis][offset..], &between[axis][offset..]);
            for ((sum, on), between) in sum.iter_mut().zip(on).zip(between) {
                // The window begins behind its first multiple of 5 degrees.
                let on = if offset > 0 { *on } else { 0.0 };
                *sum += on + between;
            }
        }
    }
    let mut best = (0.0, [0.0, 0.0]);
    // The first window is centred on 0 degrees.
    for k in (0..WINDOWS).map(|k| (k + WINDOWS - WIDTH / 2) % WINDOWS) {
        let length = sum_x[k] * sum_x[k] + sum_y[k] * sum_y[k];
        if length > best.0 {
            best = (length, [sum_x[k], sum_y[k]]);
        }
    }
    let (square, [x, y]) = best;
    let length = square.sqrt();
    if length > 0.0 && length.is_finite() { [x / length, y / length] } else { [1.0, 0.0] }
}

/// Bins by axis, those of the first windows once more at the end.
#[inline(always)]
fn around(bins: &[[f32; 2]; WINDOWS]) -> [[f32; WINDOWS + WIDTH]; 2] {
    let mut around = [[0.0; WINDOWS + WIDTH]; 2];
    for (axis, around) in around.iter_mut().enumerate() {
        for (k, value) in around.iter_mut().enumerate() {
            *value = bins[k % WINDOWS][axis];
        }
    }
    around
}

/// The angle of a direction, in `[0, 2 pi)`.
#[inline(always)]
pub(super) fn angle([cosine, sine]: [f32; 2]) -> f32 {
    let angle = atan2(sine, cosine);
    let angle = if angle < 0.0 { angle + TAU } else { angle };
    if angle < TAU { angle } else { 0.0 }
}

impl Keypoint {
    /// The standard deviation of the Gaussian that its filter approximates [px].
    #[inline(always)]
    pub(super) fn scale(&self) -> f32 {
        self.size * 1.2 / 9.0
    }
}
