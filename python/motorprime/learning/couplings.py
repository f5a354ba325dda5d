"""Fit how one part of the body goes along with another."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from .._arrays import finite, numbers
from ..control.coupling import Coupling
from ..errors import ArgumentError
from .mixtures import fit_mixture


def fit_coupling(
    psi: npt.ArrayLike,
    slave: npt.ArrayLike,
    *,
    components: Iterable[int] = range(1, 9),
    near: float = 0.02,
    regularisation: float = 0.005,
    n_init: int = 3,
    seed: int | np.random.Generator | None = None,
) -> Coupling:
    """The coupling of a scalar on how far its master is from the goal.

    The mixture is fitted to both in units of their spread, else a share of a hand would weigh more than
    metres of an arm.

    Args:
        psi: (N,) >= 0, the master's distance.
        slave: (N,) at the same time.
        components: numbers of components to try.
        near: see :class:`Coupling`.
        regularisation: see :func:`fit_mixture`.
        n_init: starts of the mixture.
        seed: draws them.

    Raises:
        ArgumentError: lengths differ, a number is not finite, a distance is negative, or one of both never
            changes.
        MissingExtraError: scikit-learn is not installed.
    """
    pairs = [finite(name, numbers(name, value)) for name, value in (("psi", psi), ("slave", slave))]
    for name, values in zip(("psi", "slave"), pairs, strict=True):
        if values.ndim != 1 or values.shape != pairs[0].shape:
            raise ArgumentError(f"{name}: expected shape (N,) as psi, got {values.shape}")
        if not len(values) or np.ptp(values) <= 0.0:
            raise ArgumentError(f"{name}: expected different values, got {len(values)} that are the same")
    if (pairs[0] < 0.0).any():
        raise ArgumentError(f"psi: expected distances >= 0, got {pairs[0].min():.6g}")
    joint = np.column_stack(pairs)
    spread = joint.std(axis=0)
    mixture = fit_mixture(
        joint / spread, components=components, regularisation=regularisation, n_init=n_init, seed=seed
    )
    return Coupling(
        mixture.weights, mixture.means * spread, mixture.covariances * np.outer(spread, spread), near
    )
