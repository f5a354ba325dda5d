//! How much each of several Gaussians answers for a point.

use super::{checked, dimension};
use crate::error::{Error, Result};
use crate::math64::{exp_nonpositive, ln};

/// A mixture as it is given, all row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    /// K positive weights.
    pub weights: Vec<f64>,
    /// K x m.
    pub means: Vec<f64>,
    /// K x m x m, positive definite; what is above the diagonals is not read.
    pub covariances: Vec<f64>,
}

/// K Gaussians over m coordinates, ready to be evaluated.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mixture {
    coordinates: usize,
    /// `ln w - ln det L` of each covariance `L L^T`.
    offsets: Vec<f64>,
    means: Vec<f64>,
    /// `L^-1` of each, its lower triangle row by row.
    whitening: Vec<f64>,
}

impl Mixture {
    /// Checks and factorises; `name` is what the mixture belongs to.
    pub(super) fn new(name: &str, given: &Gaussians) -> Result<Self> {
        let count = given.weights.len();
        if count == 0 {
            return Err(Error::shape(format!("{name}.weights"), "of at least one component", "0"));
        }
        for (k, &weight) in given.weights.iter().enumerate() {
            if !(weight > 0.0 && weight.is_finite()) {
                let argument = format!("{name}.weights");
                return Err(Error::element(argument, &[k], "positive and finite", weight));
            }
        }
        let m = given.means.len() / count;
        if m == 0 || m * count != given.means.len() {
            let expected = format!("({count}, m)");
            return Err(Error::shape(format!("{name}.means"), expected, given.means.len().to_string()));
        }
        checked(name, "means", &given.means, count * m)?;
        checked(name, "covariances", &given.covariances, count * m * m)?;
        let (mut offsets, mut whitening) = (Vec::with_capacity(count), Vec::new());
        for (k, covariance) in given.covariances.chunks_exact(m * m).enumerate() {
            let factor = cholesky(covariance, m).ok_or_else(|| {
                let reason = format!("has a matrix {k} that is not positive definite");
                Error::conflict(format!("{name}.covariances"), reason)
            })?;
            let log_det: f64 = (0..m).map(|i| ln(factor[i * m + i])).sum();
            offsets.push(ln(given.weights[k]) - log_det);
            push_inverse(&factor, m, &mut whitening);
        }
        Ok(Self { coordinates: m, offsets, means: given.means.clone(), whitening })
    }

    /// Components.
    pub(super) fn len(&self) -> usize {
        self.offsets.len()
    }

    /// How many coordinates of a point matter.
    pub(super) fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// Weights of the components at `scale x`, normalised. Where every density underflows the component that is
    /// nearest by its own measure takes over; so far off that squares overflow, all are equal.
    #[inline]
    pub(super) fn posterior<'a>(&self, scale: f64, x: &[f64], weights: &'a mut [f64]) -> &'a [f64] {
        let m = self.coordinates;
        let weights = &mut weights[..self.offsets.len()];
        if let [weight] = weights {
            *weight = 1.0;
            return weights;
        }
        let mut largest = f64::NEG_INFINITY;
        let parts = self.means.chunks_exact(m).zip(self.whitening.chunks_exact(triangle(m)));
        for ((weight, offset), (mean, rows)) in weights.iter_mut().zip(&self.offsets).zip(parts) {
            let (mut square, mut first) = (0.0, 0);
            for i in 0..m {
                let row = &rows[first..=first + i];
                first += i + 1;
                let mut sum = 0.0;
                for ((w, x), mean) in row.iter().zip(x).zip(mean) {
                    sum += w * (scale * x - mean);
                }
                square += sum * sum;
            }
            *weight = offset - 0.5 * square;
            largest = largest.max(*weight);
        }
        if largest == f64::NEG_INFINITY {
            weights.fill(1.0 / weights.len() as f64);
            return weights;
        }
        let mut total = 0.0;
        for weight in weights.iter_mut() {
            *weight = exp_nonpositive(*weight - largest);
            total += *weight;
        }
        let share = 1.0 / total;
        for weight in weights.iter_mut() {
            *weight *= share;
        }
        weights
    }
}

/// Numbers in a lower triangle.
fn triangle(m: usize) -> usize {
    m * (m + 1) / 2
}

/// L, row-major with zeros above the diagonal, or nothing where the matrix is not positive definite.
fn cholesky(matrix: &[f64], m: usize) -> Option<Vec<f64>> {
    let mut factor = vec![0.0; m * m];
    for i in 0..m {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| factor[i * m + k] * factor[j * m + k]).sum();
            let rest = matrix[i * m + j] - dot;
            factor[i * m + j] = if i > j {
                rest / factor[j * m + j]
            } else if rest > 0.0 && rest.is_finite() {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(factor)
}

/// Appends the lower triangle of the inverse of a lower triangular matrix.
fn push_inverse(factor: &[f64], m: usize, out: &mut Vec<f64>) {
    let start = out.len();
    for i in 0..m {
        for j in 0..=i {
            let unit = if i == j { 1.0 } else { 0.0 };
            let dot: f64 = (j..i).map(|k| factor[i * m + k] * out[start + triangle(k) + j]).sum();
            out.push((unit - dot) / factor[i * m + i]);
        }
    }
}

/// K matrices d x d, to be mixed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrices<const D: usize>(Vec<[[f64; D]; D]>);

impl<const D: usize> Matrices<D> {
    /// The blocks that begin at `first` of K matrices `size` x `size`.
    pub(super) fn block(matrices: &[f64], size: usize, first: usize) -> Self {
        let cut = |matrix: &[f64]| {
            std::array::from_fn(|i| std::array::from_fn(|j| matrix[(first + i) * size + first + j]))
        };
        Self(matrices.chunks_exact(size * size).map(cut).collect())
    }

    /// `sum_k weights[k] A_k x`.
    #[inline(always)]
    pub(super) fn mixed(&self, weights: &[f64], x: [f64; D]) -> [f64; D] {
        let mut mean = [[0.0; D]; D];
        for (weight, matrix) in weights.iter().zip(&self.0) {
            for (mean, row) in mean.iter_mut().zip(matrix) {
                for (mean, a) in mean.iter_mut().zip(row) {
                    *mean += weight * a;
                }
            }
        }
        mean.map(|row| row.iter().zip(&x).map(|(a, x)| a * x).sum())
    }
}

/// What a scalar is expected to be, given another: regression on a mixture over both.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Regression {
    given: Mixture,
    /// `(intercept, slope)` of each component's line.
    lines: Vec<(f64, f64)>,
    near: f64,
}

impl Regression {
    /// From a mixture over (given, expected); below `near` the expectation is drawn to 0.
    pub(super) fn new(name: &str, joint: &Gaussians, near: f64) -> Result<Self> {
        let whole = Mixture::new(name, joint)?;
        dimension(name, "means", 2, whole.coordinates())?;
        if !(near > 0.0 && near.is_finite()) {
            return Err(Error::scalar(format!("{name}.near"), "positive and finite", near));
        }
        let (means, covariances) = (joint.means.as_chunks::<2>().0, joint.covariances.as_chunks::<4>().0);
        let marginal = Gaussians {
            weights: joint.weights.clone(),
            means: means.iter().map(|mean| mean[0]).collect(),
            covariances: covariances.iter().map(|covariance| covariance[0]).collect(),
        };
        let line = |(mean, covariance): (&[f64; 2], &[f64; 4])| {
            let slope = covariance[2] / covariance[0];
            (mean[1] - slope * mean[0], slope)
        };
        let lines = means.iter().zip(covariances).map(line).collect();
        Ok(Self { given: Mixture::new(name, &marginal)?, lines, near })
    }

    /// Components.
    pub(super) fn len(&self) -> usize {
        self.given.len()
    }

    /// The expectation at `psi` >= 0.
    #[inline]
    pub(super) fn expected(&self, psi: f64, weights: &mut [f64]) -> f64 {
        let weights = self.given.posterior(1.0, &[psi], weights);
        let lines = self.lines.iter().map(|(start, slope)| start + slope * psi);
        let mean: f64 = weights.iter().zip(lines).map(|(weight, y)| weight * y).sum();
        mean * (psi / self.near).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Gaussians {
        Gaussians {
            weights: vec![0.3, 0.7],
            means: vec![0.1, -0.2, 0.4, 0.5],
            covariances: vec![0.04, 0.01, 0.01, 0.09, 0.02, -0.01, -0.01, 0.05],
        }
    }

    /// The densities as they are written in textbooks.
    fn plain(given: &Gaussians, x: [f64; 2]) -> Vec<f64> {
        let densities = (0..2).map(|k| {
            let [a, b, _, d] = given.covariances.as_chunks::<4>().0[k];
            let z = [x[0] - given.means[2 * k], x[1] - given.means[2 * k + 1]];
            let det = a * d - b * b;
            let square = (d * z[0] * z[0] - 2.0 * b * z[0] * z[1] + a * z[1] * z[1]) / det;
            given.weights[k] * (-0.5 * square).exp() / det.sqrt()
        });
        let densities: Vec<f64> = densities.collect();
        let total: f64 = densities.iter().sum();
        densities.iter().map(|density| density / total).collect()
    }

    #[test]
    fn weights_are_the_shares_of_the_densities() {
        let (given, mut weights) = (two(), [0.0; 5]);
        let mixture = Mixture::new("eye", &given).unwrap();
        for x in [[0.0, 0.0], [0.1, -0.2], [0.3, 0.2], [-0.5, 0.8]] {
            let found = mixture.posterior(0.5, &x.map(|x| 2.0 * x), &mut weights);
            for (found, expected) in found.iter().zip(plain(&given, x)) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
    }

    #[test]
    fn far_away_the_nearest_component_takes_over_and_nothing_is_nan() {
        let (mixture, mut weights) = (Mixture::new("eye", &two()).unwrap(), [0.0; 2]);
        // Along the first axis the first component reaches farther, 0.04 - 0.01^2 / 0.09 against 0.02 - ...
        assert_eq!(mixture.posterior(1.0, &[1e6, 0.0], &mut weights), [1.0, 0.0]);
        assert_eq!(mixture.posterior(1.0, &[1e200, 0.0], &mut weights), [0.5, 0.5]);
    }

    #[test]
    fn regression_is_the_mean_of_lines_and_goes_to_zero_with_what_is_given() {
        let given = two();
        let regression = Regression::new("eye_arm", &given, 0.02).unwrap();
        let mut space = [0.0; 2];
        let psi = 0.3;
        let shares: Vec<f64> = (0..2)
            .map(|k| {
                let variance = given.covariances[4 * k];
                let z = psi - given.means[2 * k];
                given.weights[k] * (-0.5 * z * z / variance).exp() / variance.sqrt()
            })
            .collect();
        let lines = [-0.2 + 0.25 * (psi - 0.1), 0.5 - 0.5 * (psi - 0.4)];
        let expected = (shares[0] * lines[0] + shares[1] * lines[1]) / (shares[0] + shares[1]);
        assert!((regression.expected(psi, &mut space) - expected).abs() < 1e-12);
        assert_eq!(regression.expected(0.0, &mut space), 0.0);
        let (half, full) = (regression.expected(0.01, &mut space), regression.expected(0.02, &mut space));
        assert!((half / full - 0.5).abs() < 0.1, "{half} {full}");
    }

    #[test]
    fn what_is_wrong_with_a_mixture_is_named() {
        type Change = fn(&mut Gaussians);
        let cases: [(&str, Change); 6] = [
            ("eye.weights must be positive and finite, got 0.0 at eye.weights[1]", |g| g.weights[1] = 0.0),
            ("eye.means must be finite, got NaN at eye.means[2]", |g| g.means[2] = f64::NAN),
            ("eye.covariances must be of 8 elements, got 7", |g| {
                g.covariances.pop();
            }),
            ("eye.covariances has a matrix 1 that is not positive definite", |g| g.covariances[4] = -1.0),
            ("eye.means must be (2, m), got 3", |g| {
                g.means.pop();
            }),
            ("eye.weights must be of at least one component, got 0", |g| g.weights.clear()),
        ];
        for (message, change) in cases {
            let mut given = two();
            change(&mut given);
            assert_eq!(Mixture::new("eye", &given).unwrap_err().to_string(), message);
        }
    }
}
