"""``motorprime evaluate demonstrations``: reaches learned from motion capture, on reaches left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Floats, generator, integer
from ..control.demonstrations import Demonstration, read_demonstrations
from ..control.lpvds import LpvDs
from ..errors import ArgumentError
from ..learning.movements import arm_places, fit_arm, palm_movement
from ..recordings.motion_capture import read_motion_capture
from ..recordings.reaches import find_reaches
from .common import Progress
from .warping import aligned_distance

FOLDS = 5
STEP, SECONDS = 0.01, 10.0  # of a roll-out
NEAR = 0.01
"""A movement's duration is the time until it is so near to its end [m] and stays so."""
SPACING = 0.002


def evaluate_demonstrations(
    path: str | Path, *, seed: int = 0, folds: int = FOLDS, progress: Progress | None = None
) -> dict[str, Any]:
    """Learn the palm's dynamics from all folds but one, and test them on that one, for each fold.

    Args:
        path: a motion capture (.tsv) of somebody who grasps again and again, or a table that
            :func:`read_demonstrations` reads.
        seed: draws the folds and the starts of the mixtures.
        folds: how many.
        progress: shows how far it is.

    Returns:
        Means over the movements that were left out of ``velocity_rmse_mm_s`` (mean over points of the root
        mean square over coordinates), ``path_error_mm`` (mean distance of the pairs in the best alignment of
        the roll-out and the demonstration, both sampled every 10 ms), ``path_error_even_mm`` (the same with
        both sampled every 2 mm of way, so that the slow end counts no more than the rest) and
        ``duration_error`` (time to within 10 mm of the end, roll-out to demonstration, minus 1);
        ``duration_error_abs``, the mean of its absolute value; ``not_arrived``, roll-outs that never came so
        near, which are left out of the duration; ``mean_speed_mm_s`` of the demonstrations, ``reaches``,
        ``dropped``, ``certified`` of ``fits``, and under ``details`` each fold's.

    Raises:
        ArgumentError: an unreadable file, or fewer movements than folds.
        MissingExtraError: scikit-learn or cvxpy is not installed.
    """
    progress, draws = progress or Progress(), generator(seed)
    movements, dropped = read_movements(path)
    folds = integer("folds", folds, at_least=2)
    if len(movements) < folds:
        raise ArgumentError(
            f"path: {path} has {len(movements)} movements; at least {folds} expected, one a fold"
        )
    order = draws.permutation(len(movements))
    figures: list[dict[str, float]] = []
    details = []
    for fold in progress.over(range(folds), "folds"):
        left_out = set(order[fold::folds].tolist())
        shown = [one for k, one in enumerate(movements) if k not in left_out]
        ds = fit_arm(shown, step=STEP, seed=draws)
        tested = [measure(ds, movements[k]) for k in sorted(left_out)]
        figures += tested
        details.append(
            {"reaches": sorted(left_out), "components": len(ds.weights), **summary(tested), **_rates(ds)}
        )
    speeds = np.concatenate([np.linalg.norm(one.speeds, axis=1) for one in movements])
    return {
        "seed": seed,
        "reaches": len(movements),
        "dropped": dropped,
        **summary(figures),
        "mean_speed_mm_s": float(1e3 * speeds.mean()),
        "certified": sum(one["certified"] for one in details),
        "fits": folds,
        "details": details,
    }


def read_movements(path: str | Path) -> tuple[list[Demonstration], int]:
    """Movements (N, 3) [m] relative to their ends, and how many were dropped.

    Raises:
        ArgumentError: the file cannot be read as a motion capture or as a table.
    """
    if Path(path).suffix == ".tsv":
        found = find_reaches(read_motion_capture(path))
        return arm_places([palm_movement(reach) for reach in found.reaches]), sum(found.dropped.values())
    return [one.relative_to() for one in read_demonstrations(path)], 0


def measure(ds: LpvDs, shown: Demonstration) -> dict[str, float]:
    """The figures of one movement that a system was not fitted to; NaN for the time of no arrival."""
    errors = np.sqrt(((ds.velocity(shown.states) - shown.speeds) ** 2).mean(axis=1))
    path = roll_out(ds, shown.states[0])
    # Demonstrations may have another rate than a roll-out has.
    times = np.arange(shown.times[0], shown.times[-1] + 1e-9, STEP)
    sampled = np.stack([np.interp(times, shown.times, column) for column in shown.states.T], axis=1)
    return {
        "points": float(len(errors)),
        "velocity": float(errors.mean()),
        "path": aligned_distance(path, sampled),
        "path_even": aligned_distance(_evenly(path), _evenly(sampled)),
        "duration": _duration(path) / _duration(sampled) - 1.0,
    }


def roll_out(ds: LpvDs, start: Floats) -> Floats:
    """Path (N, d) by Euler steps of 10 ms, until 1 mm from the goal or for ten seconds."""
    path = [start]
    while np.linalg.norm(path[-1]) > 0.001 and len(path) <= SECONDS / STEP:
        path.append(path[-1] + STEP * ds.velocity(path[-1]))
    return np.stack(path)


def summary(figures: Sequence[dict[str, float]]) -> dict[str, Any]:
    """The means of what :func:`measure` gave, in mm."""
    points = np.array([one["points"] for one in figures])
    durations = np.array([one["duration"] for one in figures])
    arrived = durations[~np.isnan(durations)]
    return {
        "velocity_rmse_mm_s": float(1e3 * np.average([one["velocity"] for one in figures], weights=points)),
        "path_error_mm": float(1e3 * np.mean([one["path"] for one in figures])),
        "path_error_even_mm": float(1e3 * np.mean([one["path_even"] for one in figures])),
        "duration_error": float(arrived.mean()) if len(arrived) else None,
        "duration_error_abs": float(np.abs(arrived).mean()) if len(arrived) else None,
        "not_arrived": int(np.isnan(durations).sum()),
    }


def _rates(ds: LpvDs) -> dict[str, Any]:
    certificate = ds.certificate()
    return {"certified": certificate.holds, "rate": certificate.continuous, "factor": certificate.discrete}


def _duration(path: Floats) -> float:
    """Time [s] after which a path, sampled every 10 ms, stays near its goal; NaN if it never does."""
    far = np.flatnonzero(np.linalg.norm(path, axis=1) > NEAR)
    if len(far) and far[-1] + 1 == len(path):
        return float("nan")
    return STEP * max(1, int(far[-1]) + 1 if len(far) else 1)


def _evenly(path: Floats) -> Floats:
    """The same path with a point every 2 mm of way."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], max(2, int(way[-1] / SPACING)))
    return np.stack([np.interp(at, way, column) for column in path.T], axis=1)
