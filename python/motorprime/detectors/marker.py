"""Find a ball of one colour and say whether the whole of it is in view.

A label is worth nothing when the ball is half hidden behind the hand: the centroid of what is left lies
elsewhere. Whether something hides a part of it is judged from the colour alone, by the shape. Seen in the
direction of a unit vector n with tangents e1, e2, a small sphere covers a circle of directions, and the lens
maps it to the ellipse of::

    J = d pixel / d (e1, e2)      (2, 2), distortion and unequal focal lengths included

so the pixels of a whole ball, multiplied by J^-1, fill a disc. A disc of area A has the covariance
A / (4 pi) I; a cap of 2 % cut off one side makes the eigenvalues differ by some 6 %, and a stripe across the
middle makes them larger than the area says.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays import Floats, integer, positive
from ..camera import Camera
from ..errors import ArgumentError
from .base import check_image

ABSENT, CUT, COVERED, SEEN = "absent", "cut", "covered", "seen"
"""Nothing of the colour, or too little; it touches the image's border; something hides a part of it; seen."""


@dataclass(frozen=True)
class Colour:
    """Pixels of one hue: ``hue`` (low, high) [degrees], at least ``saturation`` and ``value`` (0-255)."""

    hue: tuple[float, float]
    saturation: int = 110
    value: int = 40

    def __post_init__(self) -> None:
        low, high = self.hue
        if not 0.0 <= low < high <= 360.0:
            raise ArgumentError(f"hue: 0 <= low < high <= 360 degrees expected, got {self.hue}")
        for name in ("saturation", "value"):
            if integer(name, getattr(self, name), at_least=0) > 255:
                raise ArgumentError(f"{name}: at most 255 expected, got {getattr(self, name)}")

    def mask(self, image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Where ``image`` (H, W, 3) uint8 RGB has the colour: (H, W) uint8, 0 or 255."""
        low, high = (angle / 2.0 for angle in self.hue)  # OpenCV counts 180 steps
        hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
        found = cv2.inRange(hsv, (low, self.saturation, self.value), (high, 255, 255))
        return np.asarray(found, dtype=np.uint8)


GREEN = Colour((95.0, 155.0))


@dataclass(frozen=True, eq=False)
class Sighting:
    """What was found of a ball.

    Attributes:
        outcome: 'seen', 'absent', 'cut' (it touches the border) or 'covered' (a part is hidden).
        centre: (2,) centroid (u, v) [px] of its pixels; NaN unless the outcome is 'seen'.
        pixels: how many there are.
    """

    outcome: str
    centre: Floats = field(default_factory=lambda: np.full(2, np.nan))
    pixels: int = 0


def find_ball(
    image: npt.NDArray[np.uint8],
    camera: Camera,
    *,
    colour: Colour = GREEN,
    min_pixels: int = 30,
    tolerance: float = 0.03,
) -> Sighting:
    """Find the one ball of a colour in an image, the largest connected patch of it.

    Args:
        image: (H, W, 3) uint8 RGB, of the camera's shape.
        camera: intrinsics and distortion, for the shape that a whole ball has.
        colour: of the ball, and of nothing else in sight.
        min_pixels: a smaller patch counts as absent.
        tolerance: by how much the eigenvalues of the patch's covariance, in units of a disc's of the same
            area, may differ from 1 before the ball counts as covered. The border of small patches is coarse,
            which is allowed for with pi / pixels more. At the default, rendered balls that were kept had at
            least 94 % of their outline in sight and were labelled to half a pixel.

    Raises:
        ArgumentError: the image is not of the camera's shape, or an option makes no sense.
    """
    check_image(image)
    min_pixels, tolerance = integer("min_pixels", min_pixels, at_least=1), positive("tolerance", tolerance)
    if image.shape[:2] != camera.shape:
        raise ArgumentError(f"image: the camera's shape {camera.shape} expected, got {image.shape[:2]}")
    mask = colour.mask(image)
    left, top, width, height = cv2.boundingRect(mask)
    if width == 0:
        return Sighting(ABSENT)
    mask = mask[top : top + height, left : left + width]
    _, patches, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    count = int(stats[largest, cv2.CC_STAT_AREA])
    if count < min_pixels:
        return Sighting(ABSENT, pixels=count)
    v, u = np.nonzero(patches == largest)
    pixels = np.column_stack([u + left, v + top]).astype(np.float64)
    if (pixels == 0).any() or (pixels == (camera.width - 1, camera.height - 1)).any():
        return Sighting(CUT, pixels=count)
    centre = pixels.mean(axis=0)
    slack = tolerance + np.pi / count
    if np.abs(_roundness(pixels - centre, centre, camera) - 1.0).max() > slack:
        return Sighting(COVERED, pixels=count)
    return Sighting(SEEN, centre, count)


def _roundness(offsets: Floats, centre: Floats, camera: Camera) -> Floats:
    """Eigenvalues (2,) of a patch's covariance, in units of those of a whole ball of the same area."""
    direction = camera.rays(centre[None])
    direction /= np.linalg.norm(direction)
    if np.isnan(direction).any():  # the lens model reaches this pixel from nowhere
        return np.full(2, np.inf)
    tangents = np.linalg.svd(direction)[2][1:]
    shape = camera.jacobian(direction)[0] @ tangents.T
    shape /= np.sqrt(abs(np.linalg.det(shape)))
    round_ = np.linalg.solve(shape, offsets.T)
    covariance = round_ @ round_.T / len(offsets)
    unit: Floats = np.linalg.eigvalsh(covariance) * 4.0 * np.pi / len(offsets)
    return unit
