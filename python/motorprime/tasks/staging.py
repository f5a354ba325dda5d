"""Stage a trial: a robot in a seeded scene, in a posture that suits the task.

This is the experimenter's side: it may read the truth to build a scene and to judge a result. The tasks
themselves never do.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from types import TracebackType

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..camera import PosedCamera
from ..cylinder import Cylinder, outline
from ..detectors import HistogramDetector
from ..errors import StateError
from ..projection import KinematicProjection
from ..robot import Robot
from ..sim.cameras import Eyes, Frame, Light
from ..sim.glass import Glass
from ..sim.scene import TABLE_HEIGHT, Layout, Scene
from ..sim.showing import show_glass
from ..sim.world import World
from .explore import Target

ATTEMPTS = 4000


class Stage:
    """A world with a robot and a scene in it; a context manager.

    Args:
        robot: with its URDF.
        layout: of the scene.
        noise: of the eyes' sensors [grey levels].
        seed: of the noise.
        light: of the scene.
        gui: open pybullet's window.
    """

    def __init__(
        self,
        robot: Robot,
        layout: Layout,
        *,
        noise: float = 2.0,
        seed: int | np.random.Generator | None = None,
        light: Light | None = None,
        gui: bool = False,
    ) -> None:
        self.robot, self.layout = robot, layout
        self.projection = KinematicProjection(robot)
        with ExitStack() as unwinding:  # closes what is open already when a later part fails
            self.world = unwinding.enter_context(World(robot, gui=gui))
            self.scene = Scene(self.world, layout)
            unwinding.callback(self.scene.close)
            self.eyes = Eyes(self.world, light=light, noise=noise, seed=seed)
            self._closing = unwinding.pop_all()

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    def strike(self, joints: Floats) -> None:
        """Put the gaze's joints at a posture (len(robot.gaze),) [rad]."""
        self.world.place(dict(zip(self.robot.gaze, joints, strict=True)))

    def truth(self, frames: Mapping[str, Frame]) -> dict[str, NDArray[np.bool_]]:
        """The glass's true silhouette (H, W) in each frame."""
        if self.scene.glass is None:
            return {camera: np.zeros(frame.body.shape, np.bool_) for camera, frame in frames.items()}
        return {camera: frame.body == self.scene.glass for camera, frame in frames.items()}

    def visible(self, frames: Mapping[str, Frame]) -> float:
        """Smallest fraction over the cameras of the glass's whole outline that is in the picture."""
        views, fractions = self.eyes.views(), []
        for camera, silhouette in self.truth(frames).items():
            whole = outline_area(views[camera], self.scene.glass_pose()[0], cylinder_of(self.layout.glass))
            fractions.append(float(silhouette.sum()) / whole if whole else 0.0)
        return min(fractions)


def cylinder_of(glass: Glass) -> Cylinder:
    """A glass's shape."""
    return Cylinder(glass.radius, glass.height)


def target_of(glass: Glass) -> Target:
    """What the robot is told of a glass: its shape, and how it looks on its own."""
    return Target(cylinder_of(glass), HistogramDetector(show_glass(glass), label="glass"))


def outline_area(view: PosedCamera, centre: Floats, cylinder: Cylinder) -> float:
    """Area [px] of a cylinder's whole outline, also of what lies outside the image; 0 behind the camera."""
    polygon = outline(view, centre, cylinder)
    return 0.0 if polygon is None else float(cv2.contourArea(polygon))


def random_posture(robot: Robot, generator: np.random.Generator) -> Floats:
    """A gaze posture (len(robot.gaze),) [rad]: neck and eyes anywhere, the torso near upright."""
    limits = robot.limits(robot.gaze)
    drawn = generator.uniform(limits[:, 0], limits[:, 1])
    torso = [robot.gaze.index(name) for name in robot.torso]
    drawn[torso] = np.clip(0.25 * drawn[torso], limits[torso, 0], limits[torso, 1])
    return drawn


def strike_seeing_posture(
    stage: Stage, generator: np.random.Generator, *, visible: float = 0.6
) -> Mapping[str, Frame]:
    """Put the robot in a random posture that has at least ``visible`` of the glass in both eyes.

    Returns:
        The frames that it sees there.

    Raises:
        StateError: none was found.
    """
    centre, glass = stage.scene.glass_pose()[0], cylinder_of(stage.layout.glass)
    for _ in range(ATTEMPTS):
        posture = random_posture(stage.robot, generator)
        views = stage.projection.posed(posture)
        if not all(_mostly_inside(view, centre, glass) for view in views.values()):
            continue
        stage.strike(posture)
        frames = stage.eyes.capture()
        if stage.visible(frames) >= visible:
            return frames
    raise StateError(f"posture: none of {ATTEMPTS} random ones has {visible:.0%} of the glass in both eyes")


def strike_start(
    stage: Stage, generator: np.random.Generator, *, clearance: float = 0.03, away: float = 0.0
) -> None:
    """Put the robot in a random start: gaze and arm drawn, the hand above the table and off everything.

    Args:
        stage: to put it on.
        generator: draws.
        clearance: of every link from every thing [m].
        away: least horizontal distance of the palm from the glass's axis [m].

    Raises:
        StateError: none was found.
    """
    robot, world = stage.robot, stage.world
    limits = robot.limits(robot.arm)
    others = [stage.scene.table, *stage.scene.clutter]
    others += [] if stage.scene.glass is None else [stage.scene.glass]
    for _ in range(ATTEMPTS):
        stage.strike(random_posture(robot, generator))
        world.place(dict(zip(robot.arm, generator.uniform(limits[:, 0], limits[:, 1]), strict=True)))
        x, y, z = world.palm_pose()[:3, 3]
        # Over the near half of the table at the hand's own side, not behind or inside the robot; farther off
        # where it must keep away.
        far, aside = (-0.42, 0.45) if away else (-0.32, 0.35)
        if not (far < x < -0.12 and 0.0 < y < aside and TABLE_HEIGHT + 0.06 < z < 0.22):
            continue
        if away and np.hypot(*(np.array([x, y]) - stage.scene.glass_pose()[0][:2])) < away:
            continue
        if world.clear_of(others, clearance):
            return
    raise StateError(f"start: none of {ATTEMPTS} random postures keeps {clearance} m off everything")


def _mostly_inside(view: PosedCamera, centre: Floats, glass: Cylinder) -> bool:
    polygon = outline(view, centre, glass)
    if polygon is None or np.abs(polygon).max() > 1e4:
        return False
    height, width = view.camera.shape
    middle = polygon.mean(axis=0)
    return bool(0 < middle[0] < width - 1 and 0 < middle[1] < height - 1)
