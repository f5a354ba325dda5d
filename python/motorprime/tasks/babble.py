"""Motor babbling with the simulated robot: random postures, a green ball, and its pixels in the pictures."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..camera import PosedCamera, sphere_outline_centre
from ..detectors.marker import Sighting, find_ball
from ..errors import ArgumentError, NotInViewError
from ..learning.babbling import named
from ..learning.manifest import COUNT, GAP, NUMBER, POINT, WORD, Manifest, robot_fingerprint
from ..learning.postures import Posture, Postures
from ..projection import KinematicProjection
from ..robot import Robot
from ..sim.ball import LIGHTS, BallStudio

MODES = ("near", "uniform")
OUTSIDE = "outside"
"""Outcome of a camera that was not asked for a picture: the ball is not, or not wholly, in its image."""


@dataclass(frozen=True, eq=False)
class View:
    """One camera's part of a sample: the picture (None where none was taken), what was found, and where the
    kinematics put the centre of the ball's outline (2,) [px], NaN behind the camera."""

    picture: NDArray[np.uint8] | None
    sighting: Sighting
    predicted: Floats


@dataclass(frozen=True)
class GazeBabble:
    """Random gaze postures and a ball somewhere within the hand's reach (section III-A of the paper).

    Args:
        robot: with its URDF.
        mode: 'uniform': gaze and ball are drawn independently, and the ball is seldom in view; 'near': the
            same distribution on the condition that an eye has it in view.
        radius: of the ball [m].
        noise: standard deviation of the eyes' sensors [grey levels].

    Columns: the gaze's encoders [rad]; x, y, z of the ball [m] in the root frame; and for every camera c
    c_outcome ('seen', 'absent', 'cut', 'covered', 'outside'), c_u and c_v [px] of the centroid where it was
    seen, c_pixels of the ball's colour, c_predicted_u and c_predicted_v [px] by the kinematics.
    """

    robot: Robot
    mode: str = "near"
    radius: float = 0.015
    noise: float = 0.0

    kind = "gaze"

    def __post_init__(self) -> None:
        _check(self.mode, self.noise)

    @cached_property
    def fingerprint(self) -> str:
        """Of the robot."""
        return robot_fingerprint(self.robot)

    def manifest(self, seed: int) -> Manifest:
        """What its samples are."""
        return _manifest(
            self, self.robot, self.robot.gaze, {"radius": self.radius, "noise": self.noise}, seed
        )

    def __call__(self, seed: int, i: int) -> dict[str, Any]:
        """Sample ``i``."""
        return self.look(seed, i)[0]

    def look(self, seed: int, i: int) -> tuple[dict[str, Any], dict[str, View]]:
        """Sample ``i`` and what the cameras saw."""
        generator = np.random.default_rng([seed, i])
        with _rig(self.fingerprint, self.robot, self.radius) as rig:
            posture = _draw(rig.postures, self.mode, generator)
            rig.studio.pose(dict(zip(self.robot.gaze, posture.gaze, strict=True)))
            rig.studio.put(posture.point)
            encoders = rig.studio.world.gaze()
            cameras = rig.projection.posed(encoders)
            wanted = rig.postures.in_view(posture)
            views = _look(rig, wanted, posture.point, cameras, self.noise, generator)
        return _sample(self.robot.gaze, encoders, posture.point, views), views


def _check(mode: str, noise: float) -> None:
    if mode not in MODES:
        raise ArgumentError(f"mode: one of {', '.join(MODES)} expected, got {mode!r}")
    if not 0.0 <= noise < np.inf:
        raise ArgumentError(f"noise: a finite number of grey levels, at least 0, expected, got {noise}")


def _draw(postures: Postures, mode: str, generator: np.random.Generator) -> Posture:
    return postures.draw_in_view(generator) if mode == "near" else postures.draw(generator)


def _look(
    rig: Rig,
    wanted: Mapping[str, bool],
    point: Floats,
    cameras: Mapping[str, PosedCamera],
    noise: float,
    generator: np.random.Generator,
) -> dict[str, View]:
    """Take and label the pictures that are wanted; the others cost a third of a sample's time for nothing."""
    light = LIGHTS[generator.integers(len(LIGHTS))]
    pictures = rig.studio.pictures([name for name, want in wanted.items() if want], light)
    views = {}
    for name, view in cameras.items():
        picture, sighting = pictures.get(name), Sighting(OUTSIDE)
        if picture is not None:
            if noise > 0.0:
                grain = generator.normal(0.0, noise, picture.shape)
                picture = np.clip(np.rint(picture + grain), 0, 255).astype(np.uint8)
            sighting = find_ball(picture, rig.studio.robot.cameras[name].camera)
        views[name] = View(picture, sighting, _outline_centre(view, point, rig.studio.radius))
    return views


def _outline_centre(view: PosedCamera, point: Floats, radius: float) -> Floats:
    if any(view.camera.distortion):  # the outline is no ellipse; its centre is near the centre's projection
        centre: Floats = view.project(point[None])[0]
        return centre
    try:
        return sphere_outline_centre(view.camera, view.to_camera(point[None])[0], radius)
    except NotInViewError:
        return np.full(2, np.nan)


def _sample(
    names: tuple[str, ...], joints: Floats, point: Floats, views: Mapping[str, View]
) -> dict[str, Any]:
    row: dict[str, Any] = {**named(names, joints), **named(POINT, point)}
    for name, view in views.items():
        row[f"{name}_outcome"] = view.sighting.outcome
        row |= named((f"{name}_u", f"{name}_v"), view.sighting.centre)
        row[f"{name}_pixels"] = view.sighting.pixels
        row |= named((f"{name}_predicted_u", f"{name}_predicted_v"), view.predicted)
    return row


def _manifest(
    source: Any, robot: Robot, joints: tuple[str, ...], settings: Mapping[str, Any], seed: int
) -> Manifest:
    columns = dict.fromkeys((*joints, *POINT), NUMBER)
    for name in robot.cameras:
        columns |= {f"{name}_outcome": WORD, f"{name}_u": GAP, f"{name}_v": GAP, f"{name}_pixels": COUNT}
        columns |= {f"{name}_predicted_u": GAP, f"{name}_predicted_v": GAP}
    return Manifest(
        kind=source.kind,
        mode=source.mode,
        robot=robot.name,
        fingerprint=source.fingerprint,
        seed=seed,
        joints=joints,
        cameras=tuple(robot.cameras),
        columns=columns,
        settings=settings,
    )


class Rig:
    """What a process needs to take samples of one robot; opening it takes half a second."""

    def __init__(self, robot: Robot, radius: float) -> None:
        self.studio = BallStudio(robot, radius)
        self.postures = Postures(robot, radius=radius)
        self.projection = KinematicProjection(robot)


_OPEN: dict[tuple[str, float], Rig] = {}
_IN_USE = threading.RLock()


@contextmanager
def _rig(fingerprint: str, robot: Robot, radius: float) -> Iterator[Rig]:
    """The process's rig for a robot, which stays open for the next sample.

    A cluster's worker may run several threads; the simulator serves one at a time.
    """
    with _IN_USE:
        key = fingerprint, radius
        if key not in _OPEN:
            close_rig()
            atexit.register(close_rig)
            _OPEN[key] = Rig(robot, radius)
        yield _OPEN[key]


def close_rig() -> None:
    """Close the simulator that this process keeps open between samples, if it does."""
    with _IN_USE:
        while _OPEN:
            _OPEN.popitem()[1].studio.close()
