"""Motor babbling with the simulated robot: random postures, a green ball, and its pixels in the pictures.

Two kinds of it. For gaze babbling the ball floats somewhere within the hand's reach, and its place is known.
For marker babbling it is fixed to the hand, as on a real robot: where it is, only the robot's own kinematics
say, and those need not be those of the robot that moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, fixed, positive
from ..camera import PosedCamera, sphere_outline_centre
from ..detectors.marker import Sighting, find_ball
from ..errors import ArgumentError, NotInViewError
from ..learning.babbling import named
from ..learning.manifest import COUNT, GAP, NUMBER, POINT, WORD, Manifest, robot_fingerprint
from ..learning.postures import Posture, Postures
from ..projection import KinematicProjection
from ..robot import Robot
from ..sim.ball import LIGHTS, BallStudio
from .studio import studio

MODES = ("near", "uniform")
OUTSIDE = "outside"
"""Outcome of a camera that took no picture, because the ball is not, or not wholly, in its image."""


@dataclass(frozen=True, eq=False)
class View:
    """One camera's part of a sample.

    Attributes:
        picture: (H, W, 3) uint8 RGB; None where none was taken.
        sighting: what was found in it.
        predicted: (2,) [px] where the kinematics put the ball's outline; NaN behind the camera.
    """

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
        _check(self.mode, self.radius, self.noise)

    @cached_property
    def fingerprint(self) -> str:
        """Of the robot."""
        return robot_fingerprint(self.robot)

    @cached_property
    def _postures(self) -> Postures:
        return Postures(self.robot, radius=self.radius)

    @cached_property
    def _projection(self) -> KinematicProjection:
        return KinematicProjection(self.robot)

    def manifest(self, seed: int) -> Manifest:
        """What its samples are."""
        settings = {"radius": self.radius, "noise": self.noise}
        return _manifest(self, self.robot, self.robot.gaze, settings, seed)

    def __call__(self, seed: int, i: int) -> dict[str, Any]:
        """Sample ``i``."""
        return self.look(seed, i)[0]

    def look(self, seed: int, i: int) -> tuple[dict[str, Any], dict[str, View]]:
        """Sample ``i`` and what the cameras saw."""
        generator = np.random.default_rng([seed, i])
        drawn = _draw(self._postures, self.mode, generator)
        with studio(self.fingerprint, self.robot, self.radius) as here:
            here.pose(dict(zip(self.robot.gaze, drawn.gaze, strict=True)))
            here.put(drawn.point)
            encoders = here.world.gaze()
            wanted = self._postures.in_view(encoders, drawn.point)
            pictures = _pictures(here, wanted, self.noise, generator)
        views = _views(self.robot, pictures, self._projection.posed(encoders), drawn.point, self.radius)
        return _sample(self.robot.gaze, encoders, drawn.point, views), views


@dataclass(frozen=True)
class MarkerBabble:
    """Random postures of gaze and arm, and a marker on the hand (section III-A, on the robot itself).

    Args:
        robot: the one that moves and sees; its kinematics and cameras, lens distortion included, are the
            truth, of which the samples hold nothing but encoders and pixels.
        nominal: what is believed of it. It says where the marker is and what is in view.
        mode: as of :class:`GazeBabble`; gaze and arm are drawn together.
        radius: of the marker [m].
        offset: of its centre in the palm's frame (3,) [m]; by default it floats 2 cm over the palm.
        noise: standard deviation of the eyes' sensors [grey levels].

    Columns: as of :class:`GazeBabble`, and the arm's encoders; x, y, z and the predicted pixels are those of
    the nominal robot.

    Raises:
        ArgumentError: the two robots differ in more than numbers: joints, camera names or image sizes.
    """

    robot: Robot
    nominal: Robot
    mode: str = "near"
    radius: float = 0.01
    offset: tuple[float, float, float] = (0.0, 0.0, 0.03)
    noise: float = 0.0

    kind = "marker"

    def __post_init__(self) -> None:
        _check(self.mode, self.radius, self.noise)
        object.__setattr__(self, "offset", tuple(fixed("offset", self.offset, (3,)).tolist()))
        for name, expected in _form(self.robot).items():
            if (given := _form(self.nominal)[name]) != expected:
                raise ArgumentError(f"nominal: {name} {expected} of the moving robot expected, got {given}")

    @cached_property
    def fingerprint(self) -> str:
        """Of the nominal robot."""
        return robot_fingerprint(self.nominal)

    @cached_property
    def true_fingerprint(self) -> str:
        """Of the robot that moves."""
        return robot_fingerprint(self.robot)

    @cached_property
    def _postures(self) -> Postures:
        return Postures(self.nominal, radius=self.radius, offset=self.offset)

    @cached_property
    def _true_postures(self) -> Postures:
        return Postures(self.robot, radius=self.radius)

    @cached_property
    def _projection(self) -> KinematicProjection:
        return KinematicProjection(self.nominal)

    def manifest(self, seed: int) -> Manifest:
        """What its samples are."""
        settings = {
            "radius": self.radius,
            "noise": self.noise,
            "offset": list(self.offset),
            "moving_robot": self.true_fingerprint,
        }
        return _manifest(self, self.nominal, self.nominal.gaze + self.nominal.arm, settings, seed)

    def __call__(self, seed: int, i: int) -> dict[str, Any]:
        """Sample ``i``."""
        return self.look(seed, i)[0]

    def look(self, seed: int, i: int) -> tuple[dict[str, Any], dict[str, View]]:
        """Sample ``i`` and what the cameras saw."""
        generator = np.random.default_rng([seed, i])
        drawn = _draw(self._postures, self.mode, generator)
        names = self.nominal.gaze + self.nominal.arm
        with studio(self.true_fingerprint, self.robot, self.radius) as here:
            here.pose(dict(zip(names, (*drawn.gaze, *drawn.arm), strict=True)))
            marker = (here.world.palm_pose() @ (*self.offset, 1.0))[:3]
            here.put(marker)
            encoders = here.world.read(names)
            gaze, arm = encoders[: len(drawn.gaze)], encoders[len(drawn.gaze) :]
            # A shortcut of the simulation only: a picture without the whole marker shows nothing to label.
            wanted = self._true_postures.in_view(gaze, marker)
            pictures = _pictures(here, wanted, self.noise, generator)
        point = self._postures.place(gaze, arm)
        views = _views(self.robot, pictures, self._projection.posed(gaze), point, self.radius)
        return _sample(names, encoders, point, views), views


def _check(mode: str, radius: float, noise: float) -> None:
    if mode not in MODES:
        raise ArgumentError(f"mode: one of {', '.join(MODES)} expected, got {mode!r}")
    positive("radius", radius)
    if not 0.0 <= noise < np.inf:
        raise ArgumentError(f"noise: a finite number of grey levels, at least 0, expected, got {noise}")


def _form(robot: Robot) -> dict[str, Any]:
    """What two descriptions of one robot have in common, whatever their numbers."""
    return {
        "gaze": robot.gaze,
        "arm": robot.arm,
        "images": {name: mount.camera.shape for name, mount in robot.cameras.items()},
    }


def _draw(postures: Postures, mode: str, generator: np.random.Generator) -> Posture:
    return postures.draw_in_view(generator) if mode == "near" else postures.draw(generator)


def _pictures(
    here: BallStudio, wanted: Mapping[str, bool], noise: float, generator: np.random.Generator
) -> dict[str, NDArray[np.uint8]]:
    """Pictures (H, W, 3) uint8 RGB of the cameras that have the ball in view, under one of a few lights."""
    light = LIGHTS[generator.integers(len(LIGHTS))]
    pictures = dict(here.pictures([name for name, want in wanted.items() if want], light))
    if noise > 0.0:
        for name, picture in pictures.items():
            grain = noise * generator.standard_normal(picture.shape, dtype=np.float32)
            pictures[name] = np.clip(np.rint(picture + grain), 0, 255).astype(np.uint8)
    return pictures


def _views(
    robot: Robot,
    pictures: Mapping[str, NDArray[np.uint8]],
    cameras: Mapping[str, PosedCamera],
    point: Floats,
    radius: float,
) -> dict[str, View]:
    """Label the pictures that ``robot`` took; a camera without one saw nothing.

    The lens with which a picture was taken says how a whole ball looks in it; ``cameras`` only predict.
    """
    views = {}
    for name, camera in cameras.items():
        picture = pictures.get(name)
        sighting = Sighting(OUTSIDE) if picture is None else find_ball(picture, robot.cameras[name].camera)
        views[name] = View(picture, sighting, _outline_centre(camera, point, radius))
    return views


def _outline_centre(camera: PosedCamera, point: Floats, radius: float) -> Floats:
    if any(camera.camera.distortion):  # the outline is no ellipse; the centre's projection is near its middle
        centre: Floats = camera.project(point[None])[0]
        return centre
    try:
        return sphere_outline_centre(camera.camera, camera.to_camera(point[None])[0], radius)
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
    source: GazeBabble | MarkerBabble,
    robot: Robot,
    joints: tuple[str, ...],
    settings: Mapping[str, Any],
    seed: int,
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
