"""A mixture of Gaussians: how much each component answers for a point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, numbers
from ..errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Mixture:
    """Weights, means and covariances of K Gaussians over m coordinates; copied, and read-only.

    Args:
        weights: (K,), > 0; they sum to 1.
        means: (K, m).
        covariances: (K, m, m), symmetric and positive definite.

    Raises:
        ArgumentError: a shape, a weight or a covariance is not so.
    """

    weights: Floats
    means: Floats
    covariances: Floats
    _offsets: Floats = field(init=False, repr=False)
    _whitening: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        weights = numbers("weights", self.weights)
        if weights.ndim != 1 or not len(weights):
            raise ArgumentError(f"weights: expected shape (K,) with K >= 1, got {weights.shape}")
        means = numbers("means", self.means)
        if means.ndim != 2 or means.shape[0] != len(weights) or not means.shape[1]:
            raise ArgumentError(f"means: expected shape ({len(weights)}, m) with m >= 1, got {means.shape}")
        count, m = means.shape
        fixed("weights", weights, (count,))
        if (weights <= 0.0).any() or abs(weights.sum() - 1.0) > 1e-6:
            raise ArgumentError(f"weights: expected numbers > 0 that sum to 1, got {weights.tolist()}")
        covariances = fixed("covariances", self.covariances, (count, m, m))
        for k, covariance in enumerate(covariances):
            positive_definite(f"covariances[{k}]", covariance)
        object.__setattr__(self, "weights", frozen(weights))
        object.__setattr__(self, "means", frozen(fixed("means", means, (count, m))))
        object.__setattr__(self, "covariances", frozen(covariances))
        # ln w - ln det(L) and L^-1 of each covariance L L^T: all that a density needs.
        factors = np.linalg.cholesky(covariances)
        log_det = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        object.__setattr__(self, "_offsets", np.log(weights) - log_det)
        object.__setattr__(self, "_whitening", np.linalg.inv(factors))

    def __len__(self) -> int:
        return len(self.weights)

    @property
    def dimensions(self) -> int:
        """How many coordinates m the mixture is over."""
        return int(self.means.shape[1])

    def posterior(self, points: Floats) -> Floats:
        """g_k(x) = w_k N(x; mu_k, S_k) / sum_j w_j N(x; mu_j, S_j): (N, m) -> (N, K), rows sum to 1.

        Normalised in logarithms: far from the data, where every density underflows, the component that is
        nearest by Mahalanobis distance takes over.
        """
        white = np.einsum("kij,nkj->nki", self._whitening, points[:, None, :] - self.means)
        logs = self._offsets - 0.5 * (white**2).sum(axis=2)
        likelihoods: Floats = np.exp(logs - logs.max(axis=1, keepdims=True))
        likelihoods /= likelihoods.sum(axis=1, keepdims=True)
        return likelihoods


def positive_definite(name: str, value: npt.ArrayLike) -> Floats:
    """Return a matrix, or raise an :class:`ArgumentError` where it is not symmetric and positive definite."""
    matrix = numbers(name, value)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * np.abs(matrix).max()):
        raise ArgumentError(f"{name}: expected a symmetric matrix, got {matrix.tolist()}")
    spread = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    lowest = float(np.linalg.eigvalsh(matrix / np.outer(spread, spread))[0])  # whatever the units
    if (np.diag(matrix) <= 0.0).any() or lowest <= 1e-13:  # singular but for rounding
        raise ArgumentError(f"{name}: expected a positive definite matrix, got {matrix.tolist()}")
    return matrix


def frozen(array: Floats) -> Floats:
    """A read-only copy."""
    copy = np.array(array, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy
