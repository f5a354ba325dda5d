"""Nonlinear least squares within a box, for a dozen variables and answers in a millisecond.

Levenberg-Marquardt (Madsen, Nielsen and Tingleff, *Methods for non-linear least squares problems*, 2004)
whose every step is solved within the box: a variable that would leave it stops at its limit, and the others
are solved with that known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._arrays import Floats

ITERATIONS = 60
DAMPING = 1e-3  # at the start, relative to the largest diagonal element of J^T J
LARGEST_DAMPING = 1e12
TURNS = 8  # of the slower method, for each variable
PASSES = 8  # of the search for the limits that hold a step
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
    """The step (n,) within lower <= 0 <= upper that minimises g s + s (H + damping I) s / 2.

    By the primal-dual active set method (Hintermueller, Ito and Kunisch, 2002): what crosses a limit is held
    there, what is held against its slope is let go. Where that does not settle, which is rare, a primal
    active set takes over, which always does.
    """
    damped = hessian.copy()
    damped.flat[:: len(gradient) + 1] += damping
    low, high = (lower >= 0.0) & (gradient > 0.0), (upper <= 0.0) & (gradient < 0.0)
    step: Floats = np.zeros_like(gradient)
    for _ in range(PASSES):
        held = low | high
        if held.any():  # their rows say that their steps are the limits
            known = np.where(low, lower, np.where(high, upper, 0.0))
            matrix = np.where(held[:, None] | held, 0.0, damped)
            matrix.flat[:: len(gradient) + 1] += held
            step[:] = np.linalg.solve(matrix, np.where(held, known, -gradient - damped @ known))
            slope = damped @ step + gradient
            new_low = np.where(low, slope > 0.0, step < lower)
            new_high = np.where(high, slope < 0.0, step > upper)
        else:
            step[:] = np.linalg.solve(damped, -gradient)
            new_low, new_high = step < lower, step > upper
        if not ((new_low != low) | (new_high != high)).any():
            return np.clip(step, lower, upper)
        low, high = new_low, new_high & ~new_low
    return _one_by_one(damped, gradient, lower, upper)


def _one_by_one(damped: Floats, gradient: Floats, lower: Floats, upper: Floats) -> Floats:
    """As :func:`box_step`, by holding and letting go one limit at a time: the model falls at every turn."""
    step: Floats = np.zeros_like(gradient)
    held = ((lower >= 0.0) & (gradient > 0.0)) | ((upper <= 0.0) & (gradient < 0.0))
    for _ in range(TURNS * len(gradient)):
        aim, free = step.copy(), ~held
        if free.any():
            aim[free] = np.linalg.solve(
                damped[np.ix_(free, free)], -(gradient + damped[:, held] @ step[held])[free]
            )
        way = aim - step
        room = np.where(way < 0.0, lower - step, upper - step)
        share = np.divide(room, way, out=np.full_like(way, np.inf), where=way != 0.0)
        first = int(np.argmin(share))
        if share[first] < 1.0:
            step += share[first] * way
            step[first] = lower[first] if way[first] < 0.0 else upper[first]
            held[first] = True
            continue
        step = aim
        slope = damped @ step + gradient
        pull = np.where(step <= lower, -slope, slope)  # inwards
        pull[~held | (lower >= upper)] = -np.inf
        worst = int(np.argmax(pull))
        if pull[worst] <= 0.0:
            break
        held[worst] = False
    return np.clip(step, lower, upper)


def _model(residuals: Floats, jacobian: Floats) -> tuple[float, Floats, Floats]:
    """Cost, gradient (n,) and the Gauss-Newton Hessian (n, n)."""
    return 0.5 * float(residuals @ residuals), residuals @ jacobian, jacobian.T @ jacobian
