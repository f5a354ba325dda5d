"""A bystander's view of the robot, for pictures and the video; the robot itself never sees it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..camera import Camera, PosedCamera
from ..kinematics import transform
from .cameras import Light, render
from .meshes import write_sphere
from .world import World, pybullet

_AWAY = (0.0, 0.0, -50.0)
_BALLS = ((0.0165, 0.021, (0.97, 0.97, 0.98)), (0.0085, 0.032, (0.05, 0.05, 0.07)))


def looking_at(eye: tuple[float, float, float], target: tuple[float, float, float]) -> Floats:
    """Camera pose (4, 4) at ``eye`` that looks at ``target`` with the horizon level."""
    forward = np.subtract(target, eye)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return transform(np.column_stack([right, np.cross(forward, right), forward]), eye)


class Bystander:
    """A camera in front of the robot, somewhat to its right: hand, obstacle and target side by side.

    The robot's eyeballs are drawn only here: they surround the cameras, and a picture taken from within them
    would cost the software renderer a third of its time for nothing.
    """

    def __init__(
        self, world: World, *, size: tuple[int, int] = (640, 480), light: Light | None = None
    ) -> None:
        self.world = world
        self.light = light or Light(shadow=True)
        width, height = size
        focal = 0.92 * width
        camera = Camera(width=width, height=height, fx=focal, fy=focal, cx=width / 2, cy=height / 2)
        self.view = PosedCamera(camera, looking_at((-1.0, 0.42, 0.7), (-0.2, 0.12, 0.09)))
        with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
            self._balls = [
                (mount.link, ahead, self._ball(Path(folder) / f"ball-{k}.obj", radius, rgb))
                for k, (radius, ahead, rgb) in enumerate(_BALLS)
                for mount in world.robot.cameras.values()
            ]

    def _ball(self, path: Path, radius: float, rgb: tuple[float, float, float]) -> int:
        bullet = self.world.bullet
        shape = bullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=str(write_sphere(path, radius, subdivisions=2)),
            rgbaColor=[*rgb, 1],
        )
        return int(bullet.createMultiBody(baseVisualShapeIndex=shape, basePosition=_AWAY))

    def capture(self) -> NDArray[np.uint8]:
        """The view now, (H, W, 3) uint8."""
        bullet = self.world.bullet
        for link, ahead, ball in self._balls:
            pose = self.world.link_pose(link)
            place = pose[:3, 3] + ahead * pose[:3, 2]
            bullet.resetBasePositionAndOrientation(ball, list(place), (0, 0, 0, 1))
        try:
            return render(bullet, self.view, light=self.light).rgb
        finally:
            for _, _, ball in self._balls:
                bullet.resetBasePositionAndOrientation(ball, _AWAY, (0, 0, 0, 1))
