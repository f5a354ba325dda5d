"""Triangulation: the points that appear at given pixels of several cameras."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from .._arrays import Floats
from ..camera import PosedCamera

MIN_ANGLE = 1e-3
"""Two rays that enclose a smaller angle [rad] are taken as parallel."""

_LEAST, _MOST = 1e-13, 1e3  # damping, in traces of the normal matrix


def nearest_to_rays(cameras: list[PosedCamera], targets: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the points (N, 3) nearest to the rays of targets (C, N, 2), and which rays (C, N) count."""
    count = targets.shape[1]
    visible: npt.NDArray[np.bool_] = np.asarray(~np.isnan(targets).any(axis=2))
    normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for camera, target, seen in zip(cameras, targets, visible, strict=True):
        origin, direction = camera.rays(np.where(seen[:, None], target, 0.0))
        seen &= ~np.isnan(direction[:, 0])
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
        across[~seen] = 0.0
        normal += across
        right += across @ origin
    # For two rays the smallest eigenvalue is 1 - cos(angle between them).
    determined = visible.sum(axis=0) >= 2
    determined &= np.linalg.eigvalsh(normal)[:, 0] >= 1.0 - math.cos(MIN_ANGLE)
    points = np.full((count, 3), np.nan)
    points[determined] = np.linalg.solve(normal[determined], right[determined, :, None])[:, :, 0]
    return points, visible


def refine(
    evaluate: Callable[[Floats], tuple[Floats, Floats]],
    points: Floats,
    *,
    iterations: int = 10,
    finest: float = 1e-9,
) -> tuple[Floats, Floats]:
    """Lower the squared reprojection error of all points at once by damped Gauss-Newton steps.

    Args:
        evaluate: points (N, 3) -> errors (C, N, 2) [px] and their derivatives (C, N, 2, 3) [px / m]; zeros
            for a camera that does not count, NaN for a point that a camera cannot have in view.
        points: (N, 3) [m] to start from.
        iterations: at most.
        finest: a step shorter than this [m] ends it.

    Returns:
        points (N, 3), never worse than the start, and their squared errors (N,) [px^2], NaN where a camera
        cannot have the point in view.
    """

    def measure(points: Floats) -> tuple[Floats, Floats, Floats]:
        errors, slopes = evaluate(points)
        return (
            (errors**2).sum(axis=(0, 2)),
            np.einsum("cnij,cni->nj", slopes, errors),
            np.einsum("cnij,cnik->njk", slopes, slopes),
        )

    cost, gradient, hessian = measure(points)
    damping = np.full(
        len(points), _LEAST
    )  # far below the steps' precision, it keeps a singular system solvable
    for _ in range(iterations):
        size = np.trace(hessian, axis1=1, axis2=2)
        damped = hessian + (damping * size)[:, None, None] * np.eye(3)
        solvable = np.isfinite(cost) & (size > 0.0) & (damping <= _MOST)
        step = np.zeros_like(points)
        step[solvable] = np.linalg.solve(damped[solvable], gradient[solvable, :, None])[:, :, 0]
        new = measure(points - step)
        with np.errstate(invalid="ignore"):
            better = new[0] < cost
        points = np.where(better[:, None], points - step, points)
        cost = np.where(better, new[0], cost)
        moving = solvable & (np.abs(step).max(axis=1) > finest)
        if not moving.any():
            break
        damping = np.where(better, np.maximum(damping / 100.0, _LEAST), np.maximum(damping, 1e-5) * 10.0)
        gradient = np.where(better[:, None], new[1], gradient)
        hessian = np.where(better[:, None, None], new[2], hessian)
    return points, cost
