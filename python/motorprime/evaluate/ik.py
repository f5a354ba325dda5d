"""``motorprime evaluate ik``: how many poses of the palm are solved, how exactly, and how fast."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

import numpy as np

from .._arrays import Floats, generator, integer
from ..control.pose import TOLERANCE, PoseSolution, PoseSolver
from ..robot import Robot
from .common import Progress

RATE, SPEED = 100.0, 1.0
"""The control loop of the followed palm: periods a second, and the fastest joint speed [rad/s]."""
FOLLOWED = 40  # ways that are followed, each from one solved pose to the next
AHEAD = 2.0  # [s] that the palm is given for such a way


def evaluate_ik(
    robot: Robot, *, poses: int = 1000, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Solve poses of the palm that uniform joints within the limits give, always from the resting posture.

    Args:
        robot: with its URDF.
        poses: how many.
        seed: draws the poses; the solver's further starts are drawn from another one.
        progress: shows how far it is.

    Returns:
        poses, solved (within 2 mm and 2 deg), solved_share, at_once (of those, without a further start),
        restarts (over all poses), median_us and p99_us on the wall and median_cpu_us and p99_cpu_us of the
        processor, which other programs do not lengthen, median and 99 % of position [mm] and rotation error
        [deg], and under ``with_margin`` the share that is solved where every joint keeps 2 % of its range
        off its limits, as a solver does by default; under ``follow`` how far behind the palm is when its
        goal glides from pose to pose and each period has four iterations.
    """
    poses = integer("poses", poses, at_least=1)
    progress = progress or Progress()
    rng = generator(seed)
    solver, careful = PoseSolver(robot, margin=0.0), PoseSolver(robot)
    low, high = robot.limits(solver.names).T
    postures = rng.uniform(low, high, size=(poses, len(low)))
    targets = [solver.palm(angles) for angles in postures]
    solver.nearest(targets[0])  # the first call loads what the others use
    took, worked, found, kept = [], [], [], 0
    for target in progress.over(targets, "solving"):
        begin, busy = time.perf_counter(), time.process_time()
        found.append(solver.nearest(target))
        took.append(1e6 * (time.perf_counter() - begin))
        worked.append(1e6 * (time.process_time() - busy))
        kept += careful.nearest(target).solved
    solved = [solution for solution in found if solution.solved]
    return {
        "seed": seed,
        "poses": poses,
        "solved": len(solved),
        "solved_share": len(solved) / poses,
        "at_once": sum(not solution.restarts for solution in solved),
        "restarts": sum(solution.restarts for solution in found),
        "median_us": float(np.median(took)),
        "p99_us": float(np.percentile(took, 99)),
        "median_cpu_us": float(np.median(worked)),
        "p99_cpu_us": float(np.percentile(worked, 99)),
        "tolerance_mm": 1e3 * TOLERANCE[0],
        "tolerance_deg": float(np.rad2deg(TOLERANCE[1])),
        **_errors(found),
        "with_margin": {"solved": kept, "solved_share": kept / poses},
        "follow": _follow(solver, solved, progress),
    }


def _errors(found: list[PoseSolution]) -> dict[str, float]:
    millimetres = [1e3 * solution.position_error for solution in found]
    degrees = [float(np.rad2deg(solution.rotation_error)) for solution in found]
    return {
        "median_mm": float(np.median(millimetres)),
        "p99_mm": float(np.percentile(millimetres, 99)),
        "median_deg": float(np.median(degrees)),
        "p99_deg": float(np.percentile(degrees, 99)),
    }


def _follow(solver: PoseSolver, solved: list[PoseSolution], progress: Progress) -> dict[str, float]:
    """The palm's lag behind a goal that moves as the joints' straight way between solved postures has it.

    That way is within the limits, but not always slow enough for the joints, and the posture that follows it
    may be another one and meet a limit: a loop knows only what is next.
    """
    off, turned, took, there = [], [], [], 0
    ways = list(pairwise(solved))[:FOLLOWED]
    for before, after in progress.over(ways, "following"):
        angles = before.angles
        for share in np.linspace(0.0, 1.0, round(AHEAD * RATE)):
            way: Floats = before.angles + (3.0 - 2.0 * share) * share**2 * (after.angles - before.angles)
            goal = solver.palm(way)
            begin = time.perf_counter()
            step = solver.follow(goal, angles, step=SPEED / RATE)
            took.append(1e6 * (time.perf_counter() - begin))
            off.append(1e3 * step.position_error)
            turned.append(float(np.rad2deg(step.rotation_error)))
            there += step.solved
            angles = step.angles
    if not off:
        return {}
    return {
        "steps": len(off),
        "within_tolerance": there / len(off),
        "median_mm": float(np.median(off)),
        "p99_mm": float(np.percentile(off, 99)),
        "p99_deg": float(np.percentile(turned, 99)),
        "median_us": float(np.median(took)),
        "p99_us": float(np.percentile(took, 99)),
    }
