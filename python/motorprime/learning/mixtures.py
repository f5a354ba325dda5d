"""Gaussian mixtures of data, with as many components as the data are worth."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from .._arrays import Floats, finite, generator, integer, numbers, positive
from ..control.mixture import Mixture
from ..errors import ArgumentError, MissingExtraError

COMPONENTS = range(1, 16)
SAMPLES = 5
"""Least samples for a component and coordinate: fewer make up a Gaussian, they do not measure it."""


def fit_mixture(
    points: Floats,
    *,
    components: Iterable[int] = COMPONENTS,
    regularisation: float = 0.02,
    n_init: int = 3,
    seed: int | np.random.Generator | None = None,
) -> Mixture:
    """The mixture of Gaussians with the least Bayesian information criterion, by expectation maximisation.

    Args:
        points: (N, m).
        components: numbers of components to try; those with too few points for them are left out.
        regularisation: added to each variance, as a share of the mean variance of the points' coordinates.
            More of it makes components overlap more.
        n_init: starts for each number.
        seed: draws the starts.

    Raises:
        ArgumentError: no points, points that are all the same, or no number of components to try.
        MissingExtraError: scikit-learn is not installed.
    """
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.mixture import GaussianMixture
    except ImportError:
        raise MissingExtraError("fitting mixtures (scikit-learn)", "learn") from None
    points = finite("points", numbers("points", points))
    if points.ndim != 2 or not points.size:
        raise ArgumentError(f"points: expected shape (N, m) with N >= 1, got {points.shape}")
    regularisation, n_init = positive("regularisation", regularisation), integer("n_init", n_init, at_least=1)
    tried = sorted({integer("components", count, at_least=1) for count in components})
    worth = [count for count in tried if count == 1 or count * SAMPLES * points.shape[1] <= len(points)]
    if not worth:
        raise ArgumentError(f"components: {len(points)} points are too few for any of {tried}")
    variance = float(points.var(axis=0).mean())
    if variance <= 0.0:
        raise ArgumentError(f"points: expected different points, all {len(points)} are the same")
    draws = generator(seed)
    best: Any = None
    least = np.inf
    for count in worth:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", ConvergenceWarning
            )  # a count that does not settle loses by its BIC
            fitted = GaussianMixture(
                count,
                reg_covar=regularisation * variance,
                n_init=n_init,
                max_iter=300,
                random_state=int(draws.integers(2**31)),
            ).fit(points)
        criterion = float(fitted.bic(points))
        if best is None or criterion < least:
            best, least = fitted, criterion
    covariances = (best.covariances_ + best.covariances_.transpose(0, 2, 1)) / 2
    return Mixture(best.weights_ / best.weights_.sum(), best.means_, covariances)
