//! The peripersonal landscape: one Gaussian, evaluated only inside its ellipse (Eq. 2-5 and 10).

use crate::error::{Error, Result};
use crate::math::exp2_nonpositive;
use crate::shape::{Shape, pixels_between};
use crate::simd::{Kernel, Simd};
use crate::support::Support;

/// A pixel is inside the ellipse up to this relative excess of its squared radius: the border is inside,
/// and a border that falls on a pixel must not be lost to rounding.
const BORDER: f64 = 1.0 + 1e-12;

/// Pixels that go through the vector registers together.
const LANES: usize = 16;

/// Bounds that keep every intermediate product finite.
const SMALLEST: f64 = 1e-100;
const LARGEST: f64 = 1e100;

/// A bivariate Gaussian with covariance `L L^T`, `L = [[l1, 0], [l2, l3]]` (Eq. 3), cut at an ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean (u, v) [px]; it may lie outside the image.
    pub mean: [f64; 2],
    /// `l1, l2, l3` [px]; `l1` and `l3` are positive.
    pub chol: [f64; 3],
    /// Radius of the ellipse in standard deviations, sigma of Eq. 5.
    pub cutoff: f64,
    /// Share pi of the Gaussian in its mixture with a uniform of the same mass (Eq. 10).
    pub mixing: f64,
}

impl Gaussian {
    /// Writes the landscape into `out` (row-major, one element per pixel) and its ellipse into `support`;
    /// outside the ellipse it is 0.
    ///
    /// Inside, it is `pi exp(-|z|^2 / 2) + (1 - pi) m` with `z = L^-1 (p - mean)` and
    /// `m = 2 (1 - exp(-cutoff^2 / 2)) / cutoff^2`, the mean of the Gaussian over the ellipse.
    ///
    /// # Errors
    /// A mean, factor, cutoff or mixing outside its domain, or a buffer of the wrong size.
    pub fn landscape(&self, shape: Shape, support: &mut Support, out: &mut [f32]) -> Result<()> {
        self.landscape_on(Simd::best(), shape, support, out)
    }

    /// [`Gaussian::landscape`] on a given instruction set; all of them give the same bits.
    ///
    /// # Errors
    /// The same.
    pub fn landscape_on(
        &self,
        simd: Simd,
        shape: Shape,
        support: &mut Support,
        out: &mut [f32],
    ) -> Result<()> {
        self.check()?;
        shape.check("out", out.len())?;
        simd.run(Scan { gaussian: self, shape, support, out });
        Ok(())
    }

    /// Mean of the Gaussian over the whole ellipse, wherever the image ends.
    fn mean_inside(&self) -> f64 {
        let half = 0.5 * self.cutoff * self.cutoff;
        -(-half).exp_m1() / half
    }

    /// Evaluates the mixture on consecutive pixels of row `v` from column `u0`, all inside the ellipse.
    #[inline(always)]
    fn fill_row(&self, v: usize, u0: usize, pixels: &mut [f32], pi: f32, uniform: f32) {
        // z is formed in float64 at the first pixel, where the mean may be far away and the factor badly
        // conditioned. From there it takes equal steps; inside the ellipse it stays small, so they may be
        // float32. The bound is for a lone pixel of a needle-thin ellipse, which takes no step at all.
        // Scaled by the root of log2(e) / 2, the square is the exponent of 2.
        let scale = (0.5 * std::f64::consts::LOG2_E).sqrt();
        let [l1, l2, l3] = self.chol;
        // The first pixel is rounded as where it was found to be inside: a needle may be thinner than that.
        let (per_l1, per_l3) = (1.0 / l1, 1.0 / l3);
        let first = (u0 as f64 - self.mean[0]) * per_l1;
        let step = (scale * per_l1).min(1e30);
        let shear = (-l2 * per_l3 * step).clamp(-1e30, 1e30);
        let z2 = ((v as f64 - self.mean[1]) - l2 * first) * per_l3;
        let (z1, z2) = ((first * scale) as f32, (z2 * scale) as f32);
        let (step, shear) = (step as f32, shear as f32);
        let steps: [[f32; LANES]; 2] =
            [step, shear].map(|step| std::array::from_fn(|i| i as i32 as f32 * step));
        let chunk = |chunk: usize| -> [f32; LANES] {
            let done = (chunk * LANES) as i32 as f32;
            let (z1, z2) = (z1 + done * step, z2 + done * shear);
            std::array::from_fn(|i| {
                let (z1, z2) = (z1 + steps[0][i], z2 + steps[1][i]);
                // The bound is for pixels that only a rounding put into a needle, and for those thrown away.
                let square = z1 * z1 + z2 * z2;
                // Without a uniform part, pi is 1 and this changes no bit.
                pi * exp2_nonpositive(-if square < 126.0 { square } else { 126.0 }) + uniform
            })
        };
        // The odd end of a row is computed with full registers too, and thrown away beyond the last pixel.
        let (chunks, rest) = pixels.as_chunks_mut::<LANES>();
        let last = chunk(chunks.len());
        chunks.iter_mut().enumerate().for_each(|(k, pixels)| *pixels = chunk(k));
        rest.copy_from_slice(&last[..rest.len()]);
    }

    fn check(&self) -> Result<()> {
        for (i, &m) in self.mean.iter().enumerate() {
            if !m.is_finite() {
                return Err(Error::element("mean", &[i], "finite", m));
            }
        }
        for (i, &l) in self.chol.iter().enumerate() {
            if !l.is_finite() {
                return Err(Error::element("chol", &[i], "finite", l));
            }
            if i != 1 && !(SMALLEST..=LARGEST).contains(&l) {
                let expected = "(L1, L2, L3) with L1 and L3 between 1e-100 and 1e100";
                return Err(Error::element("chol", &[i], expected, l));
            }
            if l.abs() > LARGEST {
                return Err(Error::element("chol", &[i], "at most 1e100", l));
            }
        }
        if !(SMALLEST..=LARGEST).contains(&self.cutoff) {
            let expected = "positive, between 1e-100 and 1e100";
            return Err(Error::scalar("cutoff", expected, self.cutoff));
        }
        if !(0.0..=1.0).contains(&self.mixing) {
            return Err(Error::scalar("mixing", "in [0, 1]", self.mixing));
        }
        Ok(())
    }
}

/// Row after row through the ellipse.
struct Scan<'a> {
    gaussian: &'a Gaussian,
    shape: Shape,
    support: &'a mut Support,
    out: &'a mut [f32],
}

impl Kernel for Scan<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { gaussian, shape, support, out } = self;
        support.clear(shape);
        let uniform = ((1.0 - gaussian.mixing) * gaussian.mean_inside()) as f32;
        let square = gaussian.cutoff * gaussian.cutoff;
        // Where float32 has no Gaussian left, only the uniform part remains: exp(-87) is about 2^-125.5.
        let visible = square.min(2.0 * 87.0);
        let pi = gaussian.mixing as f32;

        let ellipse = Ellipse::new(gaussian);
        let (first, end) = ellipse.rows(square, shape.height());
        for (v, row) in out.chunks_exact_mut(shape.width()).enumerate() {
            if !(first..end).contains(&v) {
                row.fill(0.0);
                continue;
            }
            let (mut u0, mut u1) = ellipse.columns(v, square, shape.width());
            support.cover([v as u32, v as u32 + 1], [u0 as u32, u1 as u32]);
            row[..u0].fill(0.0);
            row[u1..].fill(0.0);
            if visible < square {
                row[u0..u1].fill(uniform);
                (u0, u1) = ellipse.columns(v, visible, shape.width());
            }
            gaussian.fill_row(v, u0, &mut row[u0..u1], pi, uniform);
        }
    }
}

/// The rows and columns of the ellipses `|z|^2 = square`.
struct Ellipse {
    mean: [f64; 2],
    chol: [f64; 3],
    /// Standard deviation along v, of which `lean` and `rest` are the shares of `l2` and `l3`.
    along_v: f64,
    lean: f64,
    rest: f64,
    per_l1: f64,
    per_l3: f64,
}

impl Ellipse {
    fn new(gaussian: &Gaussian) -> Self {
        let [l1, l2, l3] = gaussian.chol;
        // Not `hypot`, whose last bit depends on the C library; the bounds above keep the squares in range.
        let along_v = (l2 * l2 + l3 * l3).sqrt();
        Self {
            mean: gaussian.mean,
            chol: gaussian.chol,
            along_v,
            lean: l2 / along_v,
            rest: l3 / along_v,
            per_l1: 1.0 / l1,
            per_l3: 1.0 / l3,
        }
    }

    #[inline(always)]
    fn rows(&self, square: f64, height: usize) -> (usize, usize) {
        let reach = square.sqrt() * self.along_v * BORDER;
        pixels_between(self.mean[1] - reach, self.mean[1] + reach, height)
    }

    #[inline(always)]
    fn columns(&self, v: usize, square: f64, width: usize) -> (usize, usize) {
        // On a row |z|^2 is a parabola in z1 whose two roots are these.
        let dv = (v as f64 - self.mean[1]) / self.along_v;
        let middle = self.mean[0] + self.chol[0] * dv * self.lean;
        let half = self.chol[0] * self.rest * (square - dv * dv).max(0.0).sqrt();
        let (first, end) = pixels_between(middle - half, middle + half, width);
        // The roots are rounded, and the definition decides; it nearly always agrees.
        let agrees = first < end
            && self.inside(first, v, square)
            && self.inside(end - 1, v, square)
            && !(first > 0 && self.inside(first - 1, v, square))
            && !(end < width && self.inside(end, v, square));
        if agrees { (first, end) } else { self.trimmed(middle, half, v, square, width) }
    }

    /// The columns whose roots lie on pixels, or so nearly that rounding matters.
    #[cold]
    #[inline(never)]
    fn trimmed(&self, middle: f64, half: f64, v: usize, square: f64, width: usize) -> (usize, usize) {
        let (mut first, mut end) = pixels_between(middle - half - 1.0, middle + half + 1.0, width);
        while first < end && !self.inside(first, v, square) {
            first += 1;
        }
        while first < end && !self.inside(end - 1, v, square) {
            end -= 1;
        }
        (first, end)
    }

    #[inline(always)]
    fn inside(&self, u: usize, v: usize, square: f64) -> bool {
        let z1 = (u as f64 - self.mean[0]) * self.per_l1;
        let z2 = ((v as f64 - self.mean[1]) - self.chol[1] * z1) * self.per_l3;
        z1 * z1 + z2 * z2 <= square * BORDER
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn landscape(gaussian: &Gaussian, shape: Shape) -> Vec<f32> {
        let mut out = vec![f32::NAN; shape.pixels()];
        gaussian.landscape(shape, &mut Support::default(), &mut out).unwrap();
        out
    }

    proptest! {
        #[test]
        fn every_pixel_follows_the_definition(
            (height, width) in (1_usize..30, 1_usize..30),
            mean in [-20.0..50.0, -20.0..50.0],
            (l1, l2, l3) in (0.05..60.0, -40.0..40.0, 0.05..60.0),
            (cutoff, mixing) in (0.3..6.0, 0.0..=1.0),
        ) {
            let gaussian = Gaussian { mean, chol: [l1, l2, l3], cutoff, mixing };
            let shape = Shape::new(height, width).unwrap();
            let uniform = 2.0 * (1.0 - (-cutoff * cutoff / 2.0).exp()) / (cutoff * cutoff);
            for (i, &value) in landscape(&gaussian, shape).iter().enumerate() {
                let z1 = ((i % width) as f64 - mean[0]) / l1;
                let z2 = ((i / width) as f64 - mean[1] - l2 * z1) / l3;
                let square: f64 = z1 * z1 + z2 * z2;
                let inside = square <= cutoff * cutoff * (1.0 + 1e-12);
                let expected = mixing * (-square / 2.0).exp() + (1.0 - mixing) * uniform;
                let expected = if inside { expected } else { 0.0 };
                prop_assert!((f64::from(value) - expected).abs() < 1e-6);
                prop_assert!(value == 0.0 || inside);
            }
        }
    }

    #[test]
    fn a_needle_thinner_than_a_pixel_is_one_pixel() {
        let gaussian = Gaussian { mean: [2.0, 1.0], chol: [1e-100, 0.0, 1e-100], cutoff: 3.0, mixing: 1.0 };
        let out = landscape(&gaussian, Shape::new(3, 5).unwrap());
        assert_eq!(out[5 + 2], 1.0);
        assert_eq!(out.iter().sum::<f32>(), 1.0);
    }
}
