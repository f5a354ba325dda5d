"""The robot's eyes in the simulator: colour, depth and segmentation from pybullet's software renderer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, generator
from ..camera import Camera, PosedCamera
from ..errors import ArgumentError
from ..kinematics import invert
from .world import World, pybullet

NEAR, FAR = 0.02, 8.0


@dataclass(frozen=True)
class Light:
    """A directional light; ``direction`` points from the scene to the light, in the root frame."""

    direction: tuple[float, float, float] = (0.6, 0.5, 1.5)
    ambient: float = 0.55
    diffuse: float = 0.45
    specular: float = 0.05
    shadow: bool = False


@dataclass(frozen=True)
class Frame:
    """One rendered view.

    Attributes:
        rgb: (H, W, 3) uint8.
        depth: (H, W) float32, planar depth z [m]; the far plane where nothing is hit.
        body: (H, W) int32, pybullet's body, -1 for none.
        link: (H, W) int32, the body's link, -1 for its base (and where there is no body).
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    body: NDArray[np.int32]
    link: NDArray[np.int32]


def view_matrix(pose: Floats) -> list[float]:
    """OpenGL's view matrix, column-major, of a camera pose (4, 4) with x right, y down, z forward."""
    opengl = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    return [float(value) for value in invert(opengl).T.ravel()]


def projection_matrix(camera: Camera) -> list[float]:
    """OpenGL's projection matrix, column-major, such that pixel centres fall on integers.

    The renderer rasterises a continuous v one row higher than u's convention would have it, hence the
    ``cy + 1``; with OpenGL's textbook matrix the picture is a pixel off.
    """
    if camera.distortion and any(camera.distortion):
        raise ArgumentError("camera: the renderer has no lens distortion; pass a camera without it")
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2.0 * camera.fx / camera.width
    matrix[1, 1] = 2.0 * camera.fy / camera.height
    matrix[0, 2] = 1.0 - 2.0 * camera.cx / camera.width
    matrix[1, 2] = 2.0 * (camera.cy + 1.0) / camera.height - 1.0
    matrix[2, 2] = -(FAR + NEAR) / (FAR - NEAR)
    matrix[2, 3] = -2.0 * FAR * NEAR / (FAR - NEAR)
    matrix[3, 2] = -1.0
    return [float(value) for value in matrix.T.ravel()]


def render(bullet: Any, view: PosedCamera, *, light: Light | None = None) -> Frame:
    """Render one view of a pybullet client's world."""
    light = light or Light()
    camera = view.camera
    _, _, rgba, buffer, segments = bullet.getCameraImage(
        camera.width,
        camera.height,
        view_matrix(view.pose),
        projection_matrix(camera),
        lightDirection=light.direction,
        lightAmbientCoeff=light.ambient,
        lightDiffuseCoeff=light.diffuse,
        lightSpecularCoeff=light.specular,
        shadow=int(light.shadow),
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
    )
    shape = camera.shape
    segment = np.asarray(segments, dtype=np.int32).reshape(shape)
    hit = segment >= 0
    planar = FAR * NEAR / (FAR - (FAR - NEAR) * np.asarray(buffer, dtype=np.float64).reshape(shape))
    return Frame(
        rgb=np.ascontiguousarray(np.asarray(rgba, dtype=np.uint8).reshape(*shape, 4)[..., :3]),
        depth=planar.astype(np.float32),
        body=np.where(hit, segment & 0xFFFFFF, -1).astype(np.int32),
        link=np.where(hit, (segment >> 24) - 1, -1).astype(np.int32),
    )


class Eyes:
    """The robot's cameras: what they see now.

    Args:
        world: the world that holds the robot.
        light: the scene's light.
        noise: standard deviation [grey levels] of the sensor's noise.
        seed: for the noise.

    Raises:
        ArgumentError: ``noise`` is negative or not finite.
    """

    def __init__(
        self,
        world: World,
        *,
        light: Light | None = None,
        noise: float = 0.0,
        seed: int | np.random.Generator | None = None,
    ) -> None:
        if not 0.0 <= noise < np.inf:
            raise ArgumentError(f"noise: a finite number of grey levels, at least 0, expected, got {noise}")
        self.world, self.light, self.noise = world, light or Light(), noise
        self._generator = generator(seed)

    def views(self) -> dict[str, PosedCamera]:
        """The cameras at their true poses."""
        return {
            name: PosedCamera(mount.camera, self.world.link_pose(mount.link))
            for name, mount in self.world.robot.cameras.items()
        }

    def capture(self) -> Mapping[str, Frame]:
        """One frame of every camera."""
        # The head is a shell around the eyes: at the near plane the renderer would tear splinters out of it.
        with self.world.hidden(self.world.robot.around_eyes):
            return {
                name: self._noisy(render(self.world.bullet, view, light=self.light))
                for name, view in self.views().items()
            }

    def _noisy(self, frame: Frame) -> Frame:
        if self.noise <= 0.0:
            return frame
        noise = self._generator.normal(0.0, self.noise, frame.rgb.shape)
        rgb = np.clip(np.rint(frame.rgb + noise), 0, 255).astype(np.uint8)
        return Frame(rgb, frame.depth, frame.body, frame.link)
