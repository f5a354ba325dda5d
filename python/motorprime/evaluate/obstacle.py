"""``motorprime evaluate obstacle``: is the planned path of the palm clear of what stands in its way?"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Floats
from ..control.cds import CoupledDynamics
from ..control.clearance import Obstacle
from ..control.motion import Leg, simulate
from ..control.movement import Goal, State
from ..control.obstacle import ALLOWANCE, plan_motion
from ..cylinder import Cylinder
from ..errors import UnreachableError
from ..kinematics import transform
from ..rotations import rotation_matrices
from .common import Progress

TABLE = -0.06  # [m]
SPARE = 0.03  # start and goal keep so much more [m] than they must off the cylinder


def evaluate_obstacle(
    dynamics: CoupledDynamics, *, scenes: int = 500, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Plan in random scenes in which the way straight ahead is blocked, and measure the paths.

    A scene is a goal over a table, a start 0.25 to 0.5 m from it, and an upright cylinder (radius 2 to 4.5
    cm, height 8 to 20 cm) that the palm's path without an obstacle would hit. Start and goal are 3 cm farther
    from it than the palm must keep, so that there is a detour.

    Args:
        dynamics: the controller.
        scenes: how many.
        seed: of all scenes.
        progress: shows how far it is.

    Returns:
        scenes, clear (paths whose palm keeps :data:`ALLOWANCE` off the thing's surface, so stays outside of
        the cylinder that encloses the thing and half a hand), refused, minimum_distance_m (of all paths to
        that enclosing cylinder's surface), median_detour (length of the path over that of the way without the
        obstacle), anterior, posterior, above (by which side).
    """
    progress = progress or Progress()
    generator = np.random.default_rng(seed)
    clear, refused, least, detours = 0, 0, np.inf, []
    sides = {"anterior": 0, "posterior": 0, "above": 0}
    for _ in progress.over(range(scenes), "planning"):
        state, goal, obstacle, direct = _draw(dynamics, generator)
        try:
            motion = plan_motion(dynamics, state, [Leg(goal)], [obstacle])
        except UnreachableError:
            refused += 1
            continue
        least = min(least, motion.clearance - ALLOWANCE)
        clear += motion.simulated.arrived and motion.clearance >= ALLOWANCE
        detours.append(_length(motion.simulated.path) / direct)
        sides[_side(motion.legs[0].goal, obstacle)] += 1
    return {
        "seed": seed,
        "scenes": scenes,
        "clear": clear,
        "refused": refused,
        "minimum_distance_m": float(least) if np.isfinite(least) else None,
        "median_detour": float(np.median(detours)) if detours else None,
        **sides,
    }


def _draw(dynamics: CoupledDynamics, generator: np.random.Generator) -> tuple[State, Goal, Obstacle, float]:
    """A scene whose direct path is blocked, and the length of that path [m]."""
    while True:
        goal, state = _goal(generator), None
        while state is None:
            state = _start(goal, generator)
        direct = simulate(dynamics, state, [Leg(goal)]).simulated
        if not direct.arrived:
            continue
        places = direct.path
        shape = Cylinder(generator.uniform(0.02, 0.045), generator.uniform(0.08, 0.20))
        spot = places[int(generator.integers(len(places)))] + [*generator.uniform(-0.05, 0.05, 2), 0.0]
        obstacle = Obstacle(shape, np.array([spot[0], spot[1], TABLE + shape.height / 2]))
        ends = obstacle.gap(np.array([state.palm[:3, 3], goal.palm[:3, 3]]))[0]
        if ends.min() > ALLOWANCE + SPARE and obstacle.gap(places)[0].min() < ALLOWANCE:
            return state, goal, obstacle, _length(places)


def _goal(generator: np.random.Generator) -> Goal:
    """A level palm over the table that faces between left and straight ahead, fingers level."""
    azimuth = generator.uniform(np.deg2rad(-20.0), np.deg2rad(100.0))
    facing = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
    along = np.array([-np.cos(azimuth), np.sin(azimuth), 0.0])
    axes = np.column_stack([along, np.cross(facing, along), facing])
    place = np.array([generator.uniform(-0.34, -0.22), generator.uniform(0.0, 0.2), TABLE + 0.06])
    return Goal(place, transform(axes, place))


def _start(goal: Goal, generator: np.random.Generator) -> State | None:
    away = generator.normal(size=3)
    place = goal.palm[:3, 3] + generator.uniform(0.25, 0.5) * away / np.linalg.norm(away)
    if not TABLE + 0.05 < place[2] < TABLE + 0.35:
        return None
    turn = goal.palm[:3, :3] @ rotation_matrices(generator.uniform(-0.6, 0.6, 3))
    return State(generator.uniform(-0.3, 0.3, 3) + goal.fixation, transform(turn, place), 0.8)


def _length(places: Floats) -> float:
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def _side(via: Goal, obstacle: Obstacle) -> str:
    if via.palm[2, 3] > obstacle.centre[2] + obstacle.shape.height / 2 + ALLOWANCE:
        return "above"
    return "anterior" if via.palm[0, 3] < obstacle.centre[0] else "posterior"
