"""A robot alone with one green ball: a world for babbling, quick to set up and to photograph."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..camera import Camera, PosedCamera
from ..errors import StateError
from ..robot import Robot
from .cameras import Light, projection_matrix, view_matrix
from .meshes import write_sphere
from .world import World, pybullet

RGB = (0.1, 0.8, 0.2)
LIGHTS = (
    Light(),
    Light(direction=(-0.6, 0.5, 1.2), ambient=0.5, diffuse=0.5),
    Light(direction=(0.2, -1.0, 0.8), ambient=0.65, diffuse=0.4),
)


_FINER = 2.0  # resolution of a picture that will be bent; at 1 the bending costs 0.06 px of a ball's place


class BallStudio:
    """A world with a robot and a ball in it, whose pictures have colours only; a context manager.

    No room, no table, no depth and no segmentation, which together cost the software renderer as long again
    as the colours do. The whole body stays visible but for the shell around the eyes.

    Args:
        robot: with its URDF; its cameras may have lens distortion.
        radius: of the ball [m].
    """

    def __init__(self, robot: Robot, radius: float) -> None:
        self.robot, self.radius = robot, radius
        with ExitStack() as unwinding:
            self.world = unwinding.enter_context(World(robot))
            unwinding.enter_context(self.world.hidden(robot.around_eyes))
            with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
                # At 1280 faces the outline is 0.2 % of the radius off a circle.
                mesh = write_sphere(Path(folder) / "ball.obj", radius, subdivisions=3)
                self.ball = self.world.add_marker(mesh, (*RGB, 1.0))
            self._lenses = {name: _Photograph(mount.camera) for name, mount in robot.cameras.items()}
            self._closing = unwinding.pop_all()

    def __enter__(self) -> BallStudio:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the simulator; a second call does nothing."""
        if self.world.bullet.isConnected():
            self._closing.close()

    def pose(self, variables: Mapping[str, float]) -> None:
        """Put joints at angles [rad]; as time stands still, no motors need to hold them there."""
        bullet, world = self.world.bullet, self.world
        for name, angle in world.variables_to_joints(variables).items():
            bullet.resetJointState(world.body, world.joint_index[name], angle, 0.0)

    def put(self, place: npt.ArrayLike) -> None:
        """Put the ball's centre at ``place`` (3,) [m] in the root frame."""
        self.world.put(self.ball, place)

    def pictures(self, cameras: Iterable[str], light: Light) -> Mapping[str, NDArray[np.uint8]]:
        """What some of the cameras see now, (H, W, 3) uint8 RGB each."""
        return {
            name: self._lenses[name].take(self.world, self.robot.cameras[name].link, light)
            for name in cameras
        }


class _Photograph:
    """A camera's picture; for one with distortion, a wider straight picture bent by the lens model."""

    def __init__(self, camera: Camera) -> None:
        self._straight, self._maps = camera, None
        if not any(camera.distortion):
            return
        height, width = camera.shape
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
        rays = camera.rays(grid.astype(np.float64))
        if np.isnan(rays).any():
            raise StateError("camera: its lens model does not reach every pixel of its image")
        lowest, highest = rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)
        focal = _FINER * np.array([camera.fx, camera.fy])
        size = np.ceil((highest - lowest) * focal).astype(int) + 3
        centre = 1.0 - lowest * focal
        self._straight = Camera(int(size[0]), int(size[1]), *focal.tolist(), *centre.tolist())
        maps = self._straight.project(rays).reshape(height, width, 2).astype(np.float32)
        self._maps = np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])

    def take(self, world: World, link: str, light: Light) -> NDArray[np.uint8]:
        view = PosedCamera(self._straight, world.link_pose(link))
        height, width = self._straight.shape
        _, _, rgba, _, _ = world.bullet.getCameraImage(
            width,
            height,
            view_matrix(view.pose),
            projection_matrix(self._straight),
            lightDirection=light.direction,
            lightAmbientCoeff=light.ambient,
            lightDiffuseCoeff=light.diffuse,
            lightSpecularCoeff=light.specular,
            shadow=int(light.shadow),
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
        )
        rgb = cv2.cvtColor(np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4), cv2.COLOR_RGBA2RGB)
        if self._maps is not None:
            rgb = cv2.remap(rgb, *self._maps, cv2.INTER_LINEAR)
        return np.asarray(rgb, dtype=np.uint8)
