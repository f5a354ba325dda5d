"""``motorprime evaluate stand``: how often the hand lifts a glass, on a stand without eyes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from ..robot import Robot
from ..sim.glass import DIAMETERS, MASSES
from ..tasks.grasp_stand import GraspStand, GraspTrial, GraspVerdict, draw_grasp_trial, stand_solver
from .common import Progress

BINS = 3  # of masses and of diameters
GRAVITY = 9.81


def evaluate_stand(
    robot: Robot, *, trials: int = 100, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Grasp and lift ``trials`` drawn glasses with the palm a little off; trial i is drawn from [seed, i].

    Args:
        robot: with its URDF and a hand.
        trials: how many.
        seed: of the series.
        progress: shows how far it is.

    Returns:
        trials, lifted, by_mass and by_diameter ("lifted of trials" in thirds of the range), medians and
        worst of what the glass went through, and under ``details`` each trial's draw and verdict.
    """
    progress, solver = progress or Progress(), stand_solver(robot)
    done: list[tuple[GraspTrial, GraspVerdict]] = []
    for i in progress.over(range(trials), "grasping"):
        trial = draw_grasp_trial(np.random.default_rng([seed, i]))
        with GraspStand(robot, trial, solver=solver) as stand:
            done.append((trial, stand.run()))
    return {"seed": seed, "trials": trials, **summary(done)}


def summary(done: list[tuple[GraspTrial, GraspVerdict]]) -> dict[str, Any]:
    """Figures of trials and what became of them."""
    verdicts = [verdict for _, verdict in done]
    ran = [(trial, verdict) for trial, verdict in done if np.isfinite(verdict.lowest)]

    def figure(name: str, of: Callable[[Any], Any], scale: float = 1.0) -> float | None:
        return scale * float(of([getattr(verdict, name) for _, verdict in ran])) if ran else None

    return {
        "lifted": sum(verdict.lifted for verdict in verdicts),
        "unreachable": len(done) - len(ran),
        "by_mass_g": _thirds(done, MASSES, lambda trial: trial.glass.mass, 1e3),
        "by_diameter_mm": _thirds(done, DIAMETERS, lambda trial: 2 * trial.glass.radius, 1e3),
        "median_pushed_mm": figure("pushed", np.median, 1e3),
        "max_pushed_mm": figure("pushed", np.max, 1e3),
        "median_dragged_mm": figure("dragged", np.median, 1e3),
        "max_dragged_mm": figure("dragged", np.max, 1e3),
        "max_toppled_deg": figure("toppled", np.max, float(np.rad2deg(1.0))),
        "max_slipped_mm": figure("slipped", np.max, 1e3),
        "least_lowest_mm": figure("lowest", np.min, 1e3),
        "max_finger_torque_nm": figure("torque", np.max),
        "max_arm_torque_nm": figure("arm_torque", np.max),
        "max_torso_torque_nm": figure("torso_torque", np.max),
        "median_pressure_n": figure("pressure", np.median),
        "least_pressure_by_weight": min(
            (verdict.pressure / (GRAVITY * trial.glass.mass) for trial, verdict in ran), default=None
        ),
        "max_depth_mm": figure("deepest", np.max, 1e3),
        "touched_table": sum(verdict.table_touched for verdict in verdicts),
        "details": [
            {
                "mass_kg": trial.glass.mass,
                "diameter_m": 2 * trial.glass.radius,
                "height_m": trial.glass.height,
                "xy_m": list(trial.xy),
                "off_m": trial.off.tolist(),
                "turned_rad": trial.turned.tolist(),
                # JSON has no NaN: what was not measured is null
                **{key: None if value != value else value for key, value in asdict(verdict).items()},
            }
            for trial, verdict in done
        ],
    }


def _thirds(
    done: list[tuple[GraspTrial, GraspVerdict]],
    bounds: tuple[float, float],
    of: Callable[[GraspTrial], float],
    scale: float,
) -> dict[str, str]:
    """'lower-upper' -> 'lifted of trials' for equal parts of a range."""
    edges = np.linspace(*bounds, BINS + 1)
    part = [int(np.clip(np.searchsorted(edges, of(trial)) - 1, 0, BINS - 1)) for trial, _ in done]
    counts = {}
    for k in range(BINS):
        inside = [verdict.lifted for p, (_, verdict) in zip(part, done, strict=True) if p == k]
        counts[f"{edges[k] * scale:.0f}-{edges[k + 1] * scale:.0f}"] = f"{sum(inside)} of {len(inside)}"
    return counts
