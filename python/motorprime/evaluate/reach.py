"""``motorprime evaluate reach``: how often the palm ends before the glass, and how far off."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..peripersonal import ReachCloud
from ..projection import Projection
from ..robot import Robot
from ..sim.glass import Glass
from ..tasks.cycle import Settings
from ..tasks.staging import target_of
from ..tasks.trial import Trial, Verdict
from .common import Progress


def evaluate_reach(
    robot: Robot,
    *,
    trials: int = 20,
    seed: int = 0,
    projection: Projection | None = None,
    slack: float = 0.0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run ``trials`` reaches from random starts.

    Args:
        robot: with its URDF.
        trials: how many.
        seed: of the series.
        projection: by which the robot sees; its kinematics when not given.
        slack: how far [px] that projection may be off.
        progress: shows how far it is.

    Returns:
        trials, reached, refused, collisions (trials with any contact of the robot), median_error_m,
        max_error_m, not_found, and under ``details`` each trial's verdict.
    """
    progress = progress or Progress()
    cloud, target = ReachCloud(robot), target_of(Glass())
    verdicts: list[Verdict] = []
    for i in progress.over(range(trials), "reaching"):
        settings = Settings(slack=slack, compare=False)
        with Trial(
            robot, [seed, i], settings=settings, projection=projection, cloud=cloud, target=target
        ) as trial:
            for _ in trial.task.run():
                pass
            verdicts.append(trial.judge())
    errors = [v.palm_error_m for v in verdicts if v.palm_error_m is not None]
    return {
        "seed": seed,
        "trials": trials,
        "reached": sum(v.reached for v in verdicts),
        "refused": sum(v.outcome == "refused" for v in verdicts),
        "not_found": sum(v.outcome == "not found" for v in verdicts),
        "collisions": sum(bool(v.touched) for v in verdicts),
        "median_error_m": float(np.median(errors)) if errors else None,
        "max_error_m": float(np.max(errors)) if errors else None,
        "details": [
            {"outcome": v.outcome, "palm_error_m": v.palm_error_m, "touched": list(v.touched)}
            for v in verdicts
        ],
    }
