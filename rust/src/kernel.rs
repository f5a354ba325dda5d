//! The landscape of a planned trajectory: a product kernel on every projected point (Eq. 7-9).

use crate::error::{Error, Result};
use crate::math::exp_nonpositive;
use crate::shape::{Shape, pixels_between};

/// Profile k of the product kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// `1 - |z|` for `|z| <= 1` (Eq. 9).
    Triangular,
    /// `exp(-z^2 / 2) / sqrt(2 pi)` for `|z| <= 5`.
    Gaussian,
}

impl Kernel {
    /// The names that [`Kernel::named`] knows.
    pub const NAMES: &[&str] = &["triangular", "gaussian"];

    /// The kernel of that name.
    ///
    /// # Errors
    /// An unknown name; the error lists the known ones.
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "triangular" => Ok(Self::Triangular),
            "gaussian" => Ok(Self::Gaussian),
            _ => Err(Error::Unknown { argument: "kernel".into(), known: Self::NAMES, found: name.into() }),
        }
    }

    /// `|z|` from which the profile is 0.
    fn reach(self) -> f64 {
        match self {
            Self::Triangular => 1.0,
            Self::Gaussian => 5.0,
        }
    }

    /// `k(0)`.
    fn peak(self) -> f64 {
        match self {
            Self::Triangular => 1.0,
            Self::Gaussian => std::f64::consts::FRAC_2_SQRT_PI * std::f64::consts::FRAC_1_SQRT_2 / 2.0,
        }
    }

    /// `factor k((p - centre) / width)` for the pixels `p` from `first`.
    fn profile(self, first: usize, centre: f64, width: f64, factor: f64, out: &mut [f32]) {
        // Offsets are formed in float64: float32 is too coarse for a narrow kernel far from the origin.
        let offset = |i: usize| f64::from((first + i) as i32) - centre;
        let slope = factor / width;
        match self {
            // (width - |d|) is exactly 0 at the border; 1 - |d| / width would not always be.
            Self::Triangular => {
                for (i, value) in out.iter_mut().enumerate() {
                    *value = ((width - offset(i).abs()).max(0.0) * slope) as f32;
                }
            }
            Self::Gaussian => {
                let (inverse, limit) = (1.0 / width, self.reach() * width);
                let height = (factor * self.peak()) as f32;
                for (i, value) in out.iter_mut().enumerate() {
                    let d = offset(i);
                    let z = (d * inverse) as f32;
                    let k = height * exp_nonpositive(-0.5 * z * z);
                    *value = if d.abs() <= limit { k } else { 0.0 };
                }
            }
        }
    }
}

/// Kernel widths (horizontal, vertical) [px].
#[derive(Clone, Copy, Debug)]
pub enum Widths<'a> {
    /// One pair for all points, as in the paper.
    Common([f64; 2]),
    /// A pair for every point, for widths that are metres in space and so shrink with distance.
    PerPoint(&'a [[f64; 2]]),
}

impl Widths<'_> {
    fn of(&self, n: usize) -> [f64; 2] {
        match self {
            Self::Common(width) => *width,
            Self::PerPoint(widths) => widths[n],
        }
    }
}

/// A trajectory in the image and the kernels that it carries.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory<'a> {
    /// Points (u, v) [px], any number of them outside the image.
    pub points: &'a [[f64; 2]],
    /// Kernel widths.
    pub widths: Widths<'a>,
    /// Profile of the kernels.
    pub kernel: Kernel,
    /// Weights of the points, if they do not all count the same.
    pub weights: Option<&'a [f64]>,
}

/// Points whose sum is formed in float32 before it is added to the image.
const GROUP: usize = 64;

/// With more points than this the image itself is summed in float64.
const MANY: usize = 1024;

/// Densities that float32 holds with room to spare on both sides.
const PEAK: std::ops::RangeInclusive<f64> = 1e-30..=1e37;

impl Trajectory<'_> {
    /// Writes `sum_n w_n k(du / h_h) k(dv / h_v) / (h_h h_v) / sum_n w_n` into `out` (row-major).
    ///
    /// With equal weights and one width this is Eq. 7; N counts all points, also those outside the image.
    ///
    /// # Errors
    /// No point, anything that is not finite, a width or weight outside its domain, or so wide or narrow
    /// a kernel that float32 cannot hold the density.
    pub fn landscape(&self, shape: Shape, out: &mut [f32]) -> Result<()> {
        let total = self.check()?;
        shape.check("out", out.len())?;
        out.fill(0.0);
        let width = shape.width();
        let mut bumps = Bumps::default();

        if self.points.len() <= GROUP {
            self.bumps(0..self.points.len(), shape, total, &mut bumps);
            for (v, row) in bumps.rows().zip_rows(out, width) {
                bumps.add_row(v, row);
            }
        } else if self.points.len() <= MANY {
            self.add_groups(shape, total, &mut bumps, out, |sum, x| *sum += x);
        } else {
            let mut sums = vec![0.0_f64; out.len()];
            self.add_groups(shape, total, &mut bumps, &mut sums, |sum, x| {
                *sum += f64::from(x);
            });
            for (value, sum) in out.iter_mut().zip(sums) {
                *value = sum as f32;
            }
        }
        Ok(())
    }

    /// Sums the points group by group, so that rounding grows with the square root of their number.
    fn add_groups<T>(
        &self,
        shape: Shape,
        total: f64,
        bumps: &mut Bumps,
        image: &mut [T],
        add: impl Fn(&mut T, f32),
    ) {
        let mut buffer = vec![0.0_f32; shape.width()];
        for start in (0..self.points.len()).step_by(GROUP) {
            let end = (start + GROUP).min(self.points.len());
            self.bumps(start..end, shape, total, bumps);
            for (v, row) in bumps.rows().zip_rows(image, shape.width()) {
                buffer.fill(0.0);
                bumps.add_row(v, &mut buffer);
                for (sum, &x) in row.iter_mut().zip(&buffer) {
                    add(sum, x);
                }
            }
        }
    }

    /// The separable factors of some points, weights and norm folded into the vertical one.
    fn bumps(&self, range: std::ops::Range<usize>, shape: Shape, total: f64, bumps: &mut Bumps) {
        bumps.clear();
        for n in range {
            let ([u, v], [wide, high]) = (self.points[n], self.widths.of(n));
            let weight = self.weights.map_or(1.0, |w| w[n]);
            let (reach_u, reach_v) = (self.kernel.reach() * wide, self.kernel.reach() * high);
            let (left, right) = pixels_between(u - reach_u, u + reach_u, shape.width());
            let (top, bottom) = pixels_between(v - reach_v, v + reach_v, shape.height());
            if left == right || top == bottom || weight == 0.0 {
                continue;
            }
            // Half of the norm goes to either factor, so that neither leaves float32's range.
            let scale = (weight / total / wide / high).sqrt();
            let across = bumps.reserve(right - left);
            self.kernel.profile(left, u, wide, scale, &mut bumps.factors[across..]);
            let down = bumps.reserve(bottom - top);
            self.kernel.profile(top, v, high, scale, &mut bumps.factors[down..]);
            bumps.boxes.push(Bump { left, top, bottom, across, down });
        }
    }

    /// Checks everything and returns the sum of the weights.
    fn check(&self) -> Result<f64> {
        let count = self.points.len();
        if count == 0 {
            return Err(Error::shape("points", "(N, 2) with N >= 1", "(0, 2)"));
        }
        for (n, point) in self.points.iter().enumerate() {
            for (i, &x) in point.iter().enumerate() {
                if !x.is_finite() {
                    return Err(Error::element("points", &[n, i], "finite", x));
                }
            }
        }
        let total = self.check_weights()?;
        self.check_widths()?;
        Ok(total)
    }

    fn check_weights(&self) -> Result<f64> {
        let Some(weights) = self.weights else {
            return Ok(self.points.len() as f64);
        };
        if weights.len() != self.points.len() {
            let expected = format!("one per point, ({},)", self.points.len());
            return Err(Error::shape("weights", expected, format!("({},)", weights.len())));
        }
        for (n, &w) in weights.iter().enumerate() {
            if !(0.0..f64::INFINITY).contains(&w) {
                return Err(Error::element("weights", &[n], "finite and >= 0", w));
            }
        }
        let total: f64 = weights.iter().sum();
        if !(f64::MIN_POSITIVE..f64::INFINITY).contains(&total) {
            let expected = "of a positive and finite sum";
            return Err(Error::scalar("weights", expected, total));
        }
        Ok(total)
    }

    fn check_widths(&self) -> Result<()> {
        let pairs: &[[f64; 2]] = match &self.widths {
            Widths::Common(pair) => std::slice::from_ref(pair),
            Widths::PerPoint(pairs) if pairs.len() == self.points.len() => pairs,
            Widths::PerPoint(pairs) => {
                let expected = format!("one per point, {}", self.points.len());
                return Err(Error::shape("width", expected, pairs.len().to_string()));
            }
        };
        let common = matches!(self.widths, Widths::Common(_));
        let peak = self.kernel.peak() * self.kernel.peak();
        for (n, pair) in pairs.iter().enumerate() {
            // A common width may have been given as one number: it is named without an index.
            let at = if common { &[][..] } else { &[n][..] };
            for &h in pair {
                if !(h > 0.0 && h.is_finite()) {
                    return Err(Error::element("width", at, "positive and finite", h));
                }
            }
            let density = peak / pair[0] / pair[1];
            if !PEAK.contains(&density) || !PEAK.contains(&(density / self.points.len() as f64)) {
                let expected = "such that 1 / (N h_h h_v) is between 1e-30 and 1e37";
                return Err(Error::element("width", at, expected, pair));
            }
        }
        Ok(())
    }
}

/// Where one kernel stands in the image and where its factors stand in [`Bumps::factors`].
struct Bump {
    left: usize,
    top: usize,
    bottom: usize,
    across: usize,
    down: usize,
}

/// The kernels of a group of points.
#[derive(Default)]
struct Bumps {
    boxes: Vec<Bump>,
    factors: Vec<f32>,
}

impl Bumps {
    fn clear(&mut self) {
        self.boxes.clear();
        self.factors.clear();
    }

    fn reserve(&mut self, count: usize) -> usize {
        let start = self.factors.len();
        self.factors.resize(start + count, 0.0);
        start
    }

    /// The rows that some kernel of the group touches.
    fn rows(&self) -> Rows {
        Rows {
            first: self.boxes.iter().map(|b| b.top).min().unwrap_or(0),
            end: self.boxes.iter().map(|b| b.bottom).max().unwrap_or(0),
        }
    }

    /// Adds the kernels that cross row `v`.
    fn add_row(&self, v: usize, row: &mut [f32]) {
        for b in &self.boxes {
            if (b.top..b.bottom).contains(&v) {
                let factor = self.factors[b.down + v - b.top];
                let across = &self.factors[b.across..b.down];
                for (sum, k) in row[b.left..].iter_mut().zip(across) {
                    *sum += factor * k;
                }
            }
        }
    }
}

struct Rows {
    first: usize,
    end: usize,
}

impl Rows {
    /// These rows of an image with their indices.
    fn zip_rows<T>(self, image: &mut [T], width: usize) -> impl Iterator<Item = (usize, &mut [T])> {
        (self.first..self.end).zip(image[self.first * width..].chunks_exact_mut(width))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn profile(kernel: Kernel, z: f64) -> f64 {
        match kernel {
            Kernel::Triangular => (1.0 - z.abs()).max(0.0),
            Kernel::Gaussian if z.abs() > 5.0 => 0.0,
            Kernel::Gaussian => (-z * z / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt(),
        }
    }

    proptest! {
        #[test]
        fn every_pixel_is_the_weighted_mean_of_the_kernels(
            (height, width) in (1_usize..20, 1_usize..20),
            points in prop::collection::vec([-30.0..50.0, -30.0..50.0], 1..80),
            wide in 0.3..60.0, high in 0.3..60.0,
            kernel in prop::sample::select(vec![Kernel::Triangular, Kernel::Gaussian]),
        ) {
            let weights: Vec<f64> = (0..points.len()).map(|n| 0.5 + (n % 3) as f64).collect();
            let shape = Shape::new(height, width).unwrap();
            let mut out = vec![f32::NAN; shape.pixels()];
            let widths = Widths::Common([wide, high]);
            let trajectory = Trajectory { points: &points, widths, kernel, weights: Some(&weights) };
            trajectory.landscape(shape, &mut out).unwrap();
            let total: f64 = weights.iter().sum();
            for (i, &value) in out.iter().enumerate() {
                let at = [(i % width) as f64, (i / width) as f64];
                let sum: f64 = points.iter().zip(&weights).map(|(p, w)| {
                    w * profile(kernel, (at[0] - p[0]) / wide) * profile(kernel, (at[1] - p[1]) / high)
                }).sum();
                let error = (f64::from(value) * wide * high - sum / total).abs();
                prop_assert!(error < 1e-5, "{error}");
                prop_assert!(value >= 0.0);
            }
        }
    }

    #[test]
    fn a_kernel_ends_exactly_where_it_should() {
        for width in 1..100 {
            let mut out = [f32::NAN; 201];
            Kernel::Triangular.profile(0, 100.0, f64::from(width), 1.0, &mut out);
            let support = out.iter().filter(|&&k| k > 0.0).count();
            assert_eq!(support, 2 * width as usize - 1, "width {width}");
        }
    }
}
