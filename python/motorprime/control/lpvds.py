"""A dynamical system that provably comes to rest at its goal: linear ones, mixed by where the state is.

    x' = f(x) = sum_k g_k(x_m) A_k x

g_k is the posterior weight of component k of a Gaussian mixture over the first m coordinates of the state x,
which is relative to the goal. With one P = P^T > 0 for all k and B_k = P^1/2 A_k P^-1/2,

    continuous: max_k lambda_max((B_k + B_k^T) / 2) < 0    then V = x^T P x falls along every motion;
    discrete:   max_k ||I + step B_k||_2 < 1               then it falls at every Euler step up to ``step``.

Both bounds are convex in the matrix, so they hold for each mixture of the A_k, wherever the state is, and for
f(s x), 0 <= s <= 1. After Figueroa and Billard (CoRL 2018), whose proof is in continuous time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats, finite, fixed, numbers, positive
from ..errors import ArgumentError, StateError
from .mixture import Mixture, frozen, positive_definite

MARGIN = 1e-6
"""Least certified rate of decay [1/s]: far above what rounding can fake, far below what anybody waits for."""

_NAMES = ("weights", "means", "covariances", "matrices", "lyapunov", "step")


@dataclass(frozen=True)
class Certificate:
    """Why a system must converge.

    Attributes:
        continuous: max_k lambda_max((B_k + B_k^T) / 2) [1/s]; |x|_P falls at least as exp(continuous t).
        discrete: max_k ||I + step B_k||_2; |x|_P falls by this factor or more in an Euler step of ``step``.
        step: [s].
    """

    continuous: float
    discrete: float
    step: float

    @property
    def holds(self) -> bool:
        """Whether both falls are strict, by more than rounding."""
        return self.continuous <= -MARGIN and self.discrete <= 1.0 - MARGIN * self.step


@dataclass(frozen=True, eq=False)
class LpvDs:
    """A certified mixture of K linear systems of dimension d, weighted over the first m <= d coordinates.

    Arrays are copied and read-only: the certificate that was checked stays true.

    Args:
        weights: (K,) of the mixture.
        means: (K, m).
        covariances: (K, m, m).
        matrices: A_k (K, d, d) [1/s].
        lyapunov: P (d, d), symmetric and positive definite.
        step: the largest Euler step [s] that is certified.

    Raises:
        ArgumentError: a shape or value is wrong.
        StateError: the certificate does not hold.
    """

    weights: Floats
    means: Floats
    covariances: Floats
    matrices: Floats
    lyapunov: Floats
    step: float
    mixture: Mixture = field(init=False, repr=False)

    def __post_init__(self) -> None:
        mixture = Mixture(self.weights, self.means, self.covariances)
        matrices = numbers("matrices", self.matrices)
        count, m = mixture.means.shape
        if matrices.ndim != 3 or matrices.shape[0] != count or matrices.shape[1] != matrices.shape[2]:
            raise ArgumentError(f"matrices: expected shape ({count}, d, d), got {matrices.shape}")
        d = matrices.shape[1]
        if d < m:
            raise ArgumentError(
                f"matrices: expected d >= {m}, the mixture's coordinates, got {matrices.shape}"
            )
        step = positive("step", self.step)
        lyapunov = positive_definite("lyapunov", fixed("lyapunov", self.lyapunov, (d, d)))
        values = {
            "mixture": mixture,
            "weights": mixture.weights,
            "means": mixture.means,
            "covariances": mixture.covariances,
            "matrices": frozen(finite("matrices", matrices)),
            "lyapunov": frozen(lyapunov),
            "step": step,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        certificate = self.certificate()
        if not certificate.holds:
            raise StateError(
                f"matrices: not certified to converge: expected a rate < 0 and a factor < 1 at a step of "
                f"{step:.6g} s, got {certificate.continuous:.6g} 1/s and {certificate.discrete:.9g}"
            )

    @property
    def dimensions(self) -> int:
        """d, the length of a state."""
        return int(self.matrices.shape[1])

    def velocity(self, states: npt.ArrayLike) -> Floats:
        """f(x) at states (N, d), or at one (d,); the same shape, per second.

        Raises:
            ArgumentError: another shape, or a number that is not finite.
        """
        x = finite("states", numbers("states", states))
        if x.ndim not in (1, 2) or x.shape[-1] != self.dimensions:
            raise ArgumentError(
                f"states: expected shape (N, {self.dimensions}) or ({self.dimensions},), got {x.shape}"
            )
        points = np.atleast_2d(x)
        mixed = self.mixture.posterior(points[:, : self.mixture.dimensions])
        each = np.einsum("kij,nj->nki", self.matrices, points)
        velocities: Floats = np.einsum("nk,nki->ni", mixed, each)
        return velocities.reshape(x.shape)

    def certificate(self) -> Certificate:
        """The bounds by which the system converges, from its arrays."""
        return certify(self.matrices, self.lyapunov, self.step)

    def arrays(self, prefix: str = "") -> dict[str, Floats]:
        """What :meth:`from_arrays` needs, for a model file: {prefix + name: array}."""
        return {prefix + name: np.asarray(getattr(self, name), dtype=np.float64) for name in _NAMES}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> LpvDs:
        """The system that :meth:`arrays` wrote; its certificate is checked again.

        Raises:
            ArgumentError: an array is missing, or wrong.
            StateError: the certificate does not hold.
        """
        missing = [prefix + name for name in _NAMES if prefix + name not in arrays]
        if missing:
            raise ArgumentError(f"arrays: no '{missing[0]}' among {sorted(arrays)}")
        weights, means, covariances, matrices, lyapunov, step = (arrays[prefix + name] for name in _NAMES)
        return cls(weights, means, covariances, matrices, lyapunov, float(fixed(prefix + "step", step, ())))


def certify(matrices: Floats, lyapunov: Floats, step: float) -> Certificate:
    """The bounds of A_k (K, d, d) under P (d, d), whether they hold or not."""
    eigenvalues, vectors = np.linalg.eigh(lyapunov)
    root = (vectors * np.sqrt(eigenvalues)) @ vectors.T
    inverse = (vectors / np.sqrt(eigenvalues)) @ vectors.T
    turned = root @ matrices @ inverse
    rates = np.linalg.eigvalsh((turned + turned.transpose(0, 2, 1)) / 2)
    factors = np.linalg.norm(np.eye(len(lyapunov)) + step * turned, ord=2, axis=(1, 2))
    return Certificate(float(rates.max()), float(factors.max()), step)
