"""Moments of reaches: what the eyes see, which of its pixels the task needs, and maps of where to look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..attention import Look
from ..control.clearance import hand_points
from ..errors import NotInViewError
from ..motorplan import all_involved, pixel_landscapes
from ..robot import Robot
from ..saliency import fine_grained, spectral_residual, weighted
from ..tasks.cycle import Cycle
from ..tasks.pick_trial import PickTrial
from .trials import reach_of

METHODS = (
    "uniform",
    "center",
    "zoom_lens",
    "spectral_residual",
    "fine_grained",
    "peripersonal",
    "palm_path",
    "motorplan",
    "motorplan_saliency",
)
UNDER_WAY = (2, 30)
"""The moment is one of these vision cycles of the reach, or its last one where that comes sooner."""

Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Moment:
    """What one eye sees during a reach.

    Attributes:
        image: (H, W, 3) uint8 RGB.
        relevant: (H, W) bool, the pixels of target, obstacle, palm and fingers.
        maps: {method: (H, W) float32}, larger where the method would look first.
    """

    image: NDArray[np.uint8]
    relevant: NDArray[np.bool_]
    maps: Mapping[str, Map]


def moments(robot: Robot, seed: int, number: int) -> list[Moment] | None:
    """What both eyes see at a random moment of a reach past an obstacle, but for eyes that see nothing of it.

    The robot does what it always does up to then: it has found the glass, looked along its way, and planned
    by what it saw. Only which pixels are relevant is the simulator's truth.

    Args:
        robot: with its URDF.
        seed: of the series.
        number: of the scene.

    Returns:
        None where the robot did not set out.
    """
    with reach_of(robot, seed, number, obstacle=True) as trial:
        left = int(np.random.default_rng([seed, number, 1]).integers(*UNDER_WAY))
        found: list[Moment] = []
        for cycle in trial.run():
            if cycle.phase == "grasp":
                break
            if cycle.phase == "reach":
                left -= 1
                # The pictures are those of the cycle until the next one is asked for.
                if left <= 0:
                    return _moments(trial, cycle)
                found = _moments(trial, cycle)
        return found or None


def first_moment(robot: Robot, seed: int) -> Moment:
    """What an eye sees in the first scene of a series in which the robot set out, as an example."""
    return next(found[0] for number in count() if (found := moments(robot, seed, number)))


def _moments(trial: PickTrial, cycle: Cycle) -> list[Moment]:
    robot, frames = trial.stage.robot, trial.body.frames
    world, scene = trial.stage.world, trial.stage.scene
    own = [world.link_index[name] for name in _hand(robot) if name in world.link_index]
    try:
        peripersonal: Mapping[str, Look] = trial.attention.peripersonal(cycle.joints)
    except NotInViewError:
        peripersonal = {}
    plan, ends = _plan(trial, cycle), _ends(trial, cycle)
    found = []
    for camera, frame in frames.items():
        things = (frame.body == scene.glass) | (frame.body == scene.obstacle)
        relevant = things | ((frame.body == world.body) & np.isin(frame.link, own))
        if relevant.any():
            maps = maps_of(
                frame.rgb,
                plan.get(camera),
                cycle.looks.get(camera),
                peripersonal.get(camera),
                ends.get(camera),
            )
            found.append(Moment(frame.rgb, relevant, maps))
    return found


def maps_of(
    image: NDArray[np.uint8],
    plan: Map | None,
    path: Look | None,
    peripersonal: Look | None,
    ends: Floats | None,
) -> dict[str, Map]:
    """The map of every method.

    Args:
        image: (H, W, 3) uint8 RGB.
        plan: landscape of all that the plan involves: palm's path, own hand, target, known obstacles; None
            where it leaves no trace in the image.
        path: that of the palm's path alone, on to the target, as the task itself looks along it.
        peripersonal: that of the reachable space.
        ends: palm and target (2, 2) of (u, v) as the robot believes them to be seen. The zoom lens is a disc
            around the middle between them. Without them it is around the middle of the image.
    """
    shape = image.shape[:2]
    middle = (np.array([shape[1], shape[0]]) - 1.0) / 2.0
    nothing: Map = np.zeros(shape, np.float32)
    landscape = nothing if plan is None else plan
    residual, fine = spectral_residual(image), fine_grained(image)
    return {
        "uniform": nothing,
        "center": _nearness(shape, middle),
        "zoom_lens": _nearness(shape, middle if ends is None else ends.mean(axis=0)),
        "spectral_residual": residual,
        "fine_grained": fine,
        "peripersonal": nothing if peripersonal is None else peripersonal.landscape,
        "palm_path": nothing if path is None else path.landscape,
        "motorplan": landscape,
        "motorplan_saliency": weighted(landscape, fine),
    }


def _nearness(shape: tuple[int, ...], centre: Floats) -> Map:
    """Less the farther from a centre (u, v)."""
    v, u = np.ogrid[: shape[0], : shape[1]]
    return np.asarray(-np.hypot(u - centre[0], v - centre[1]), dtype=np.float32)


def _plan(trial: PickTrial, cycle: Cycle) -> dict[str, Map]:
    """Landscapes of all that the plan involves, as far as the robot knows it."""
    if cycle.path is None or cycle.estimate is None:
        return {}
    known = ((cycle.estimate, trial.task.target.shape), *cycle.obstacles)
    points, weights = all_involved(
        cycle.path,
        hand=hand_points(trial.task.controller.palm),
        things=[place + shape.axis for place, shape in known],
    )
    projection = trial.attention.projection
    pixels = projection.project(points, cycle.joints)
    try:
        return pixel_landscapes(pixels, projection.shapes, weights=weights)
    except NotInViewError:
        return {}


def _ends(trial: PickTrial, cycle: Cycle) -> dict[str, Floats]:
    """Palm and target in the images, in which both are in front of the camera."""
    if cycle.estimate is None:
        return {}
    pixels = trial.attention.projection.project(np.stack([cycle.palm, cycle.estimate]), cycle.joints)
    return {camera: places for camera, places in pixels.items() if np.isfinite(places).all()}


def _hand(robot: Robot) -> set[str]:
    """The palm's link and all that hang on it."""
    links, grown = {robot.palm.link}, {robot.palm.link}
    while grown:
        grown = {joint.child for joint in robot.tree.joints.values() if joint.parent in grown} - links
        links |= grown
    return links
