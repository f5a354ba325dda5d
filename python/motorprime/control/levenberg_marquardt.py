"""Nonlinear least squares within a box, for a dozen variables and answers in a millisecond.

Levenberg-Marquardt (Madsen, Nielsen and Tingleff, *Methods for non-linear least squares problems*, 2004)
whose every step is solved within the box: a variable that would leave it stops at its limit, and the others
are solved again with that known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._arrays import Floats

ITERATIONS = 60
DAMPING = 1e-3  # at the start, relative to the largest diagonal element of J^T J
LARGEST_DAMPING = 1e12
STILL = 1e-6  # a step shorter than this in every variable ends the search


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the search ended.

    Attributes:
        x: (n,) within the limits.
        cost: half the sum of squared residuals there.
        evaluations: of residuals and Jacobian, the first included.
    """

    x: Floats
    cost: float
    evaluations: int


def minimise(
    evaluate: Callable[[Floats], tuple[Floats, Floats]],
    start: Floats,
    limits: Floats,
    *,
    iterations: int = ITERATIONS,
    slight: float = 1e-7,
) -> Minimum:
    """Minimise half the sum of squared residuals within limits (n, 2), from ``start`` (n,) clipped into them.

    Args:
        evaluate: x (n,) -> residuals (m,) and their Jacobian (m, n).
        start: first guess.
        limits: lower and upper; equal ones hold a variable.
        iterations: largest number of steps that are tried.
        slight: a step that promises to lower the cost by no more than this share ends the search.
    """
    lower, upper = limits[:, 0], limits[:, 1]
    x = np.clip(start, lower, upper)
    residuals, jacobian = evaluate(x)
    cost, gradient, hessian = _model(residuals, jacobian)
    damping, growth = DAMPING * max(float(hessian.diagonal().max()), 1e-12), 2.0
    evaluations = 1
    for _ in range(iterations):
        step = box_step(hessian, gradient, damping, lower - x, upper - x)
        promised = -float(step @ gradient + 0.5 * step @ hessian @ step)
        if np.abs(step).max() < STILL or 0.0 <= promised <= slight * cost:
            break
        lowered = 0.0  # a step cut by the limits may promise nothing; a shorter one will
        if promised > 0.0:
            ahead = np.clip(x + step, lower, upper)
            residuals, jacobian = evaluate(ahead)
            evaluations += 1
            lowered = cost - 0.5 * float(residuals @ residuals)
        if lowered > 0.0:
            x = ahead
            cost, gradient, hessian = _model(residuals, jacobian)
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * lowered / promised - 1.0) ** 3)
            growth = 2.0
        else:
            damping *= growth
            growth *= 2.0
            if damping > LARGEST_DAMPING:
                break
    return Minimum(x, cost, evaluations)


def box_step(hessian: Floats, gradient: Floats, damping: float, lower: Floats, upper: Floats) -> Floats:
    """The step (n,) of lower <= 0 <= upper that solves (H + damping I) s = -g for the variables that can move.

    A variable at its limit that the gradient pushes outwards stays; one whose step crosses a limit ends
    there, and the rest is solved anew.
    """
    damped = hessian + damping * np.eye(len(gradient))
    stays = ((lower >= 0.0) & (gradient > 0.0)) | ((upper <= 0.0) & (gradient < 0.0))
    step = np.zeros_like(gradient)
    while not stays.all():
        if stays.any():  # their rows say that their steps are what they are
            known = np.where(stays, step, 0.0)
            matrix = np.where(stays[:, None] | stays, 0.0, damped) + np.diag(stays.astype(np.float64))
            step = np.linalg.solve(matrix, np.where(stays, step, -gradient - damped @ known))
        else:
            step = np.linalg.solve(damped, -gradient)
        crossing = ~stays & ((step < lower) | (step > upper))
        if not crossing.any():
            break
        step = np.clip(step, lower, upper)
        stays |= crossing
    return step


def _model(residuals: Floats, jacobian: Floats) -> tuple[float, Floats, Floats]:
    """Cost, gradient (n,) and the Gauss-Newton Hessian (n, n)."""
    return 0.5 * float(residuals @ residuals), residuals @ jacobian, jacobian.T @ jacobian
