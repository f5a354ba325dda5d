"""``motorprime evaluate grasp``: how often the glass is lifted, by friction alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .. import shipped
from ..robot import Robot
from ..tasks.cycle import Settings
from ..tasks.pick_trial import PickTrial, PickVerdict
from .common import Progress
from .trials import cloud_of, each

ROUNDS = 12  # of replacing trials that were refused


@dataclass(frozen=True)
class _Asked:
    """One trial, as a worker is asked for it."""

    robot: Robot
    seed: int
    number: int
    obstacle: bool
    perturb: bool


def evaluate_grasp(
    robot: Robot,
    *,
    trials: int = 100,
    seed: int = 0,
    obstacle: bool = False,
    perturb: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Find, grasp and lift glasses from random starts in random scenes.

    What is refused before anything moves, and where a disturbance found no room to happen, is counted apart
    and replaced by further trials.

    Args:
        robot: with its URDF.
        trials: how many that were not refused.
        seed: of the series.
        obstacle: let something stand between hand and glass.
        perturb: let the glass jump 10 cm during the reach; with ``obstacle``, let that appear only then.
        workers: processes.
        progress: shows how far it is.

    Returns:
        trials, lifted, touched_obstacle, refused, and further: not_found, missed, dropped (the robot took it
        for lifted), undisturbed, median_glass_error_m, and under ``details`` each trial.
    """
    progress = progress or Progress()
    done: dict[int, PickVerdict] = {}
    counted: list[int] = []
    first = 0
    for _ in range(ROUNDS):
        missing = trials - len(counted)
        if not missing:
            break
        asked = [_Asked(robot, seed, first + k, obstacle, perturb) for k in range(missing)]
        first += missing
        for one, verdict in each(_run, asked, "picking up", progress, workers=workers):
            done[one.number] = verdict
        counted = [k for k, verdict in sorted(done.items()) if _counts(verdict, perturb)]
    verdicts = [done[k] for k in counted]
    errors = [v.glass_error_m for v in verdicts if v.glass_error_m is not None]
    return {
        "seed": seed,
        "trials": len(verdicts),
        "lifted": sum(v.lifted for v in verdicts),
        "touched_obstacle": sum(v.touched_obstacle for v in verdicts),
        "refused": sum(v.outcome == "refused" for v in done.values()),
        "not_found": sum(v.outcome == "not found" for v in verdicts),
        "missed": sum(v.outcome == "missed" for v in verdicts),
        "dropped": sum(v.outcome == "lifted" and not v.lifted for v in verdicts),
        "undisturbed": sum(perturb and v.outcome != "refused" and not v.disturbed for v in done.values()),
        "median_glass_error_m": float(np.median(errors)) if errors else None,
        "details": [{"trial": k, **asdict(done[k])} for k in sorted(done)],
    }


def _counts(verdict: PickVerdict, perturb: bool) -> bool:
    return verdict.outcome != "refused" and (verdict.disturbed or not perturb)


def _run(asked: _Asked) -> PickVerdict:
    with PickTrial(
        asked.robot,
        [asked.seed, asked.number],
        shipped.coupled_dynamics(),
        obstacle=asked.obstacle,
        perturb=asked.perturb,
        settings=Settings(compare=False),
        cloud=cloud_of(asked.robot),
    ) as trial:
        for _ in trial.run():
            pass
        return trial.judge()
