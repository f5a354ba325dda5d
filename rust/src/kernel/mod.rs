//! The landscape of a planned trajectory: a product kernel on every projected point (Eq. 7-9).

mod gaussian;
mod triangular;

use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::Simd;
use crate::support::Support;

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

    /// `k(0)`.
    fn peak(self) -> f64 {
        match self {
            Self::Triangular => 1.0,
            Self::Gaussian => std::f64::consts::FRAC_2_SQRT_PI * std::f64::consts::FRAC_1_SQRT_2 / 2.0,
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

/// Densities that float32 holds with room to spare on both sides.
const PEAK: std::ops::RangeInclusive<f64> = 1e-30..=1e37;

/// Buffers that a landscape needs; a call with a warmed-up workspace allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    triangular: triangular::Buffers,
    gaussian: gaussian::Buffers,
}

impl Trajectory<'_> {
    /// Writes `sum_n w_n k(du / h_h) k(dv / h_v) / (h_h h_v) / sum_n w_n` into `out` (row-major) and the
    /// pixels where it may be positive into `support`.
    ///
    /// With equal weights and one width this is Eq. 7; N counts all points, also those outside the image.
    ///
    /// # Errors
    /// No point, anything that is not finite, a width or weight outside its domain, or so wide or narrow
    /// a kernel that float32 cannot hold the density.
    pub fn landscape(
        &self,
        shape: Shape,
        workspace: &mut Workspace,
        support: &mut Support,
        out: &mut [f32],
    ) -> Result<()> {
        self.landscape_on(Simd::best(), shape, workspace, support, out)
    }

    /// [`Trajectory::landscape`] on a given instruction set; all of them give the same bits.
    ///
    /// # Errors
    /// The same.
    pub fn landscape_on(
        &self,
        simd: Simd,
        shape: Shape,
        workspace: &mut Workspace,
        support: &mut Support,
        out: &mut [f32],
    ) -> Result<()> {
        let total = self.check()?;
        shape.check("out", out.len())?;
        match self.kernel {
            Kernel::Triangular => {
                triangular::landscape(self, simd, shape, total, &mut workspace.triangular, support, out);
            }
            Kernel::Gaussian => {
                gaussian::landscape(self, simd, shape, total, &mut workspace.gaussian, support, out);
            }
        }
        Ok(())
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
            let density = peak / (pair[0] * pair[1]);
            if !PEAK.contains(&density) || !PEAK.contains(&(density / self.points.len() as f64)) {
                let expected = "such that 1 / (N h_h h_v) is between 1e-30 and 1e37";
                return Err(Error::element("width", at, expected, pair));
            }
        }
        Ok(())
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
            let (mut workspace, mut support) = (Workspace::default(), Support::default());
            trajectory.landscape(shape, &mut workspace, &mut support, &mut out).unwrap();
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
        let shape = Shape::new(1, 201).unwrap();
        for width in 1..100 {
            let mut out = [f32::NAN; 201];
            let widths = Widths::Common([f64::from(width), 1.0]);
            let points = &[[100.0, 0.0]];
            let trajectory = Trajectory { points, widths, kernel: Kernel::Triangular, weights: None };
            let (mut workspace, mut support) = (Workspace::default(), Support::default());
            trajectory.landscape(shape, &mut workspace, &mut support, &mut out).unwrap();
            let positive = out.iter().filter(|&&k| k > 0.0).count();
            assert_eq!(positive, 2 * width as usize - 1, "width {width}");
        }
    }
}
