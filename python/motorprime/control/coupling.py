"""How one part of the body goes along with another: Gaussian mixture regression of a scalar on a scalar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats, finite, fixed, numbers, positive
from ..errors import ArgumentError
from .mixture import Mixture

_NAMES = ("weights", "means", "covariances", "near")


@dataclass(frozen=True, eq=False)
class Coupling:
    """What the slave's state y is expected to be, given how far psi >= 0 the master is from its goal.

        expected(psi) = E(y | psi) min(1, psi / near)

    E is the conditional mean under a mixture of K Gaussians over (psi, y). The last factor brings the slave
    to its own goal, y = 0, together with the master; without it the cascade would have no attractor there.

    Args:
        weights: (K,), > 0; they sum to 1.
        means: (K, 2) of (psi, y).
        covariances: (K, 2, 2), positive definite.
        near: psi below which the slave is drawn to its goal, in the unit of psi.

    Raises:
        ArgumentError: a shape or value is wrong.
    """

    weights: Floats
    means: Floats
    covariances: Floats
    near: float = 0.02
    distance: Mixture = field(init=False, repr=False)

    def __post_init__(self) -> None:
        joint = Mixture(self.weights, self.means, self.covariances)
        if joint.dimensions != 2:
            raise ArgumentError(f"means: expected shape ({len(joint)}, 2), got {joint.means.shape}")
        values = {
            "weights": joint.weights,
            "means": joint.means,
            "covariances": joint.covariances,
            "near": positive("near", self.near),
            "distance": Mixture(joint.weights, joint.means[:, :1], joint.covariances[:, :1, :1]),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def expected(self, psi: npt.ArrayLike) -> Floats | float:
        """The slave's state at distances (N,) of the master; of one distance, a float.

        Raises:
            ArgumentError: another shape, or a distance that is negative or not finite.
        """
        given = finite("psi", numbers("psi", psi))
        if given.ndim > 1:
            raise ArgumentError(f"psi: expected shape (N,) or one number, got {given.shape}")
        if (given < 0.0).any():
            raise ArgumentError(f"psi: expected distances >= 0, got {given.min():.6g}")
        far = np.atleast_1d(given)
        slopes = self.covariances[:, 1, 0] / self.covariances[:, 0, 0]
        lines = self.means[:, 1] + slopes * (far[:, None] - self.means[:, 0])
        mean = (self.distance.posterior(far[:, None]) * lines).sum(axis=1)
        values: Floats = mean * np.minimum(1.0, far / self.near)
        return values if given.ndim else float(values[0])

    def arrays(self, prefix: str = "") -> dict[str, Floats]:
        """What :meth:`from_arrays` needs, for a model file: {prefix + name: array}."""
        return {prefix + name: np.asarray(getattr(self, name), dtype=np.float64) for name in _NAMES}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> Coupling:
        """The coupling that :meth:`arrays` wrote.

        Raises:
            ArgumentError: an array is missing, or wrong.
        """
        missing = [prefix + name for name in _NAMES if prefix + name not in arrays]
        if missing:
            raise ArgumentError(f"arrays: no '{missing[0]}' among {sorted(arrays)}")
        weights, means, covariances, near = (arrays[prefix + name] for name in _NAMES)
        return cls(weights, means, covariances, float(fixed(prefix + "near", near, ())))
