"""Printed cards: flat pictures that stand in a scene or hang on its walls, to be seen and not touched."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..errors import StateError
from .meshes import write_plane
from .world import World, pybullet


def stand_card(
    world: World,
    path: Path,
    picture: NDArray[np.uint8],
    centre: npt.ArrayLike,
    size: tuple[float, float],
    *,
    turn: float = 0.0,
    lean: float = 0.0,
) -> int:
    """Put a card into the world, without mass and without resistance; returns its body.

    Args:
        world: to put it in.
        path: of files to write, without an ending.
        picture: (h, w, 3) uint8 RGB, on its front; it has no back.
        centre: (3,) [m].
        size: width and height [m].
        turn: of its front around z [rad]; 0 faces along +x.
        lean: how far its upper edge leans back [rad].

    Raises:
        StateError: the picture cannot be written.
    """
    width, height = size
    along = width * np.array([-np.sin(turn), np.cos(turn), 0.0])
    back = np.array([-np.cos(turn), -np.sin(turn), 0.0])
    up = height * (np.cos(lean) * np.array([0.0, 0.0, 1.0]) + np.sin(lean) * back)
    mesh = write_plane(path.with_suffix(".obj"), (-(along + up) / 2.0).tolist(), along.tolist(), up.tolist())
    texture = path.with_suffix(".png")
    if not cv2.imwrite(str(texture), picture[..., ::-1]):
        raise StateError(f"could not write the texture {texture}")
    bullet = world.bullet
    shape = bullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[1, 1, 1, 1])
    body = int(bullet.createMultiBody(baseVisualShapeIndex=shape, basePosition=np.asarray(centre).tolist()))
    bullet.changeVisualShape(body, -1, textureUniqueId=bullet.loadTexture(str(texture)))
    return body
