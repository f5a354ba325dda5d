"""``motorprime evaluate elbow``: a person's elbow from motion capture, and whether it suits the robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Floats, generator, integer
from ..control.pose import PoseSolution, PoseSolver
from ..control.swivel import Swivel, SwivelPreference, learn_swivel
from ..recordings.elbows import arms_in_reaches
from ..recordings.motion_capture import read_motion_capture
from ..robot import Robot
from .common import Progress

WEIGHTS = (0.0, 0.1, 0.3, 1.0, 3.0)
STOP = 0.03  # a joint nearer to its limit than this share of its range is at its stop
CENTRES = np.array([[-0.36, 0.03, 0.0], [-0.24, 0.19, 0.02]])
"""Box of the objects' centres [m] that are grasped from the side in the root frame, as tall as a glass."""
STANDOFF = 0.05  # [m] of the palm from their axes
SIDES = np.deg2rad([-17.0, 69.0])  # of the palm's facing: 0 to the left, 90 straight ahead


def evaluate_elbow(
    robot: Robot, path: Path, *, poses: int = 200, seed: int = 0, progress: Progress | None = None
) -> tuple[dict[str, Any], Swivel]:
    """Learn the swivel of a person's elbow, and solve poses of a robot with and without heeding it.

    Args:
        robot: with its URDF.
        path: motion capture table (.tsv).
        poses: of each kind: those of uniform joints, and level side grasps on a table.
        seed: draws them.
        progress: shows how far it is.

    Returns:
        The figures and what was learned: reaches, swivel_deg where the wrist was in the mean, error_deg on
        reaches that were left out and that of a constant swivel; under the kind of poses and the weight of
        the preference: solved, how far the robot's swivel is off the person's (median, 90 %), joints at
        their stops (mean of each posture), discomfort (median).
    """
    progress = progress or Progress()
    poses = integer("poses", poses, at_least=1)
    rng = generator(seed)
    reaches = arms_in_reaches(read_motion_capture(path))
    swivel = learn_swivel(reaches)
    free = PoseSolver(robot)
    uniform = rng.uniform(free.limits[:, 0], free.limits[:, 1], size=(poses, len(free.names)))
    kinds = {
        "uniform": [free.palm(angles) for angles in uniform],
        "side_grasps": [
            _side(centre, azimuth)
            for centre, azimuth in zip(
                rng.uniform(CENTRES[0], CENTRES[1], size=(poses, 3)),
                rng.uniform(SIDES[0], SIDES[1], size=poses),
                strict=True,
            )
        ],
    }
    figures: dict[str, Any] = {
        "seed": seed,
        "poses": poses,
        "reaches": len(reaches),
        "swivel_deg": float(np.rad2deg(swivel.constant)),
        "error_deg": float(np.rad2deg(swivel.error)),
        "error_of_a_constant_deg": float(np.rad2deg(swivel.spread)),
    }
    runs = [(kind, weight) for kind in kinds for weight in WEIGHTS]
    for kind, weight in progress.over(runs, "solving"):
        preference = SwivelPreference(robot, swivel, weight=weight)
        solver = PoseSolver(robot, preference=preference if weight else None)
        found = [solver.nearest(target) for target in kinds[kind]]
        figures.setdefault(kind, {})[f"weight {weight:g}"] = _judge(solver, preference, found)
    return figures, swivel


def _judge(solver: PoseSolver, preference: SwivelPreference, found: list[PoseSolution]) -> dict[str, Any]:
    solved = [solution.angles for solution in found if solution.solved]
    if not solved:
        return {"solved": 0}
    limits = solver.robot.limits(solver.names)
    off = np.rad2deg([abs(preference.error(solver.arm.at(angles))) for angles in solved])
    spare = np.minimum(solved - limits[:, 0], limits[:, 1] - solved) / (limits[:, 1] - limits[:, 0])
    return {
        "solved": len(solved),
        "off_deg": float(np.median(off)),
        "p90_off_deg": float(np.percentile(off, 90)),
        "joints_at_stops": float((spare < STOP).sum(axis=1).mean()),
        "discomfort": float(np.median([solver.discomfort(angles) for angles in solved])),
    }


def _side(centre: Floats, azimuth: float) -> Floats:
    """Pose (4, 4) of the palm beside an upright object: z level to its axis, y down, fingers level."""
    z = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
    y = np.array([0.0, 0.0, -1.0])
    palm = np.eye(4)
    palm[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    palm[:3, 3] = centre - STANDOFF * z
    return palm
