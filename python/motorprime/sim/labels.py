"""Bottles and boxes with printed labels, stood in a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import StateError
from .meshes import write_wrapped
from .scene import TABLE_HEIGHT
from .world import World, pybullet, rub

PICTURE = (384, 1024)
"""Height and width [px] of what is wrapped around a thing."""

PAPER, INK = (245, 244, 238), (25, 25, 30)


@dataclass(frozen=True)
class Labelled:
    """A thing with a word printed on its front.

    Args:
        name: what it is.
        word: what is printed.
        profile: (radius, height) points [m] that sweep around the axis.
        rgb: its colour, 0 to 1.
        sides: 4 for a box.
        level: height of the label's middle, as a share of the thing's.
        share: width of the label, as a share of the way around.
        mass: [kg]
    """

    name: str
    word: str
    profile: tuple[tuple[float, float], ...]
    rgb: tuple[float, float, float]
    sides: int = 48
    level: float = 0.4
    share: float = 0.2
    mass: float = 0.3

    @property
    def height(self) -> float:
        """[m]"""
        return self.profile[-1][1] - self.profile[0][1]

    @property
    def radius(self) -> float:
        """Largest radius [m]."""
        return max(radius for radius, _ in self.profile)

    def picture(self) -> NDArray[np.uint8]:
        """What is wrapped around it, (384, 1024, 3) RGB: its colour, and the label on it."""
        image = np.empty((*PICTURE, 3), dtype=np.uint8)
        image[:] = np.rint(np.multiply(self.rgb, 255.0))
        # In metres of the surface a pixel is not square: print upright letters of the right proportion.
        around = 2.0 * np.pi * self.radius if self.sides >= 8 else 4.0 * np.sqrt(2.0) * self.radius
        wide = round(self.share * PICTURE[1])
        label = print_word(self.word)
        square = (PICTURE[0] / self.height) / (PICTURE[1] / around)
        tall = round(wide * label.shape[0] / label.shape[1] * square)
        top = round((1.0 - self.level) * PICTURE[0] - tall / 2)
        left = (PICTURE[1] - wide) // 2
        image[top : top + tall, left : left + wide] = cv2.resize(
            label, (wide, tall), interpolation=cv2.INTER_AREA
        )
        return image


def print_word(word: str) -> NDArray[np.uint8]:
    """A word on paper, (H, W, 3) RGB: the label as it is printed."""
    (wide, tall), _ = cv2.getTextSize(word, cv2.FONT_HERSHEY_DUPLEX, 4.0, 9)
    image = np.full((tall + 70, wide + 60, 3), PAPER, dtype=np.uint8)
    cv2.putText(image, word, (30, tall + 35), cv2.FONT_HERSHEY_DUPLEX, 4.0, INK, 9, cv2.LINE_AA)
    return image


BOTTLE = Labelled(
    "bottle",
    "MILK",
    ((0.046, 0.0), (0.046, 0.11), (0.016, 0.14), (0.016, 0.17)),
    (0.20, 0.45, 0.62),
    sides=4,
    level=0.45,
)
"""A square bottle: around a round one letters bend, and half of the time one of them is misread."""

BOXES = (
    Labelled("box", "RICE", ((0.045, 0.0), (0.045, 0.12)), (0.70, 0.50, 0.25), sides=4, level=0.6),
    Labelled("box", "SALT", ((0.042, 0.0), (0.042, 0.10)), (0.45, 0.60, 0.40), sides=4, level=0.6),
    Labelled("box", "TEA", ((0.045, 0.0), (0.045, 0.09)), (0.62, 0.35, 0.35), sides=4, level=0.6),
)


def stand_labelled(world: World, folder: Path, thing: Labelled, at: Sequence[float]) -> int:
    """Stand a thing on the table at x, y [m], its label towards the robot; returns its body.

    Raises:
        StateError: the picture cannot be written.
    """
    name = f"{thing.name}-{thing.word}"
    mesh = write_wrapped(folder / f"{name}.obj", thing.profile, sides=thing.sides)
    picture = folder / f"{name}.png"
    if not cv2.imwrite(str(picture), thing.picture()[..., ::-1]):
        raise StateError(f"could not write the texture {picture}")
    bullet = world.bullet
    body = int(
        bullet.createMultiBody(
            baseMass=thing.mass,
            baseVisualShapeIndex=bullet.createVisualShape(
                pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[1, 1, 1, 1]
            ),
            baseCollisionShapeIndex=bullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(mesh)),
            basePosition=(*at, TABLE_HEIGHT + 0.0005),
        )
    )
    bullet.changeVisualShape(body, -1, textureUniqueId=bullet.loadTexture(str(picture)))
    rub(bullet, body)
    return body
