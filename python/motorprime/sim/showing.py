"""Show the robot its target beforehand: the glass alone, from a few sides and under a few lights."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera, PosedCamera
from .bystander import looking_at
from .cameras import Light, render
from .glass import Glass
from .meshes import write_lathe
from .world import connect, pybullet

_LIGHTS = (
    Light(),
    Light(direction=(-0.6, 0.5, 1.2)),
    Light(direction=(0.2, -1.0, 0.8), ambient=0.35, diffuse=0.6),
)
_FROM = ((0.3, 0.0, 0.2), (0.25, 0.2, 0.3), (0.2, -0.2, 0.1))


def show_glass(glass: Glass) -> NDArray[np.uint8]:
    """Pixels (N, 3) uint8 RGB of a glass on its own: what the robot knows of its target's colour."""
    bullet = connect()
    try:
        with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
            half = glass.height / 2
            mesh = write_lathe(Path(folder) / "glass.obj", ((glass.radius, -half), (glass.radius, half)))
            shape = bullet.createVisualShape(
                pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[*glass.rgb, 1]
            )
            bullet.createMultiBody(baseVisualShapeIndex=shape)
        camera = Camera(width=160, height=120, fx=200.0, fy=200.0, cx=79.5, cy=59.5)
        frames = [
            render(bullet, PosedCamera(camera, looking_at(place, (0.0, 0.0, 0.0))), light=light)
            for place in _FROM
            for light in _LIGHTS
        ]
        return np.concatenate([frame.rgb[frame.body >= 0] for frame in frames])
    finally:
        bullet.disconnect()
