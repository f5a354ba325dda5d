"""Bounded nonlinear least squares, by SciPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._arrays import Floats
from ..errors import MissingExtraError


def solve_bounded(
    residuals: Callable[[Floats], Floats],
    start: Floats,
    limits: Floats,
    *,
    jacobian: Callable[[Floats], Floats] | None = None,
    evaluations: int = 60,
) -> Floats:
    """Minimise the sum of squared residuals within limits (n, 2), from ``start`` (n,), clipped into them.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise MissingExtraError("inverse kinematics (SciPy)", "control") from None
    margin = 1e-6 * (limits[:, 1] - limits[:, 0])
    inside = np.clip(start, limits[:, 0] + margin, limits[:, 1] - margin)
    result = least_squares(
        residuals,
        inside,
        jac=jacobian or "2-point",
        bounds=(limits[:, 0], limits[:, 1]),
        max_nfev=evaluations,
        xtol=1e-6,
        ftol=1e-7,
        gtol=1e-9,
    )
    return np.asarray(result.x, dtype=np.float64)
