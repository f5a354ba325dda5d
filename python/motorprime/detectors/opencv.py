"""OpenCV's own keypoint detectors, run on tiles so that only what is attended is computed.

OpenCV's mask drops keypoints after everything was computed everywhere; only cropping saves time. But a crop's
keypoints are the full image's only where the detector looks at nothing but a keypoint's surroundings, and
where its pyramid samples the crop as it samples the image. Each class says how far that holds.
"""

from __future__ import annotations

from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..errors import ArgumentError, MissingExtraError
from ..tiling import reading
from ..where import Where
from .base import check_image
from .keypoints import KEYPOINT, Keypoints, collect_keypoints

SMALLEST = 8
"""No keypoint fits into fewer pixels a side; some of the detectors fail on them."""


class OpenCvKeypoints:
    """Base of OpenCV's keypoint detectors; the classes below say which, and how exact they are.

    Args:
        halo: pixels read around what is attended; None for what the class says.
        options: as of OpenCV's ``<name>_create``, by their names there.

    Attributes:
        align: what is read begins and ends at multiples of this, or at the image's border.

    Raises:
        ArgumentError: an option that OpenCV does not take, or a negative halo.
        MissingExtraError: this OpenCV has no such detector.
    """

    name: ClassVar[str]
    exact: ClassVar[bool] = False
    halo: int = 48
    align: int = 16

    def __init__(self, *, halo: int | None = None, **options: Any) -> None:
        self._detector = create(self.name, options)
        if halo is not None:
            self.halo = integer("halo", halo, at_least=0)

    def detect(self, image: NDArray[np.uint8], where: Where) -> Keypoints:
        """Keypoints and descriptors of ``image`` (H, W, 3) uint8 RGB, at the pixels that ``where`` asks for.

        A keypoint is at a pixel when its (u, v) round to it.

        Raises:
            ArgumentError: ``where`` does not fit the image.
            ArgumentTypeError: the image or ``where`` has the wrong type.
        """
        check_image(image)
        shape = image.shape[:2]
        tiles = reading(where, shape, halo=self.halo, align=self.align)
        found = [self._on(image[v0:v1, u0:u1]) for u0, v0, u1, v1 in tiles.boxes.tolist()]
        found.append(self._none())  # so that there is something to join without tiles
        points, descriptors = zip(*found[: max(len(tiles), 1)], strict=True)
        if not len(tiles):
            return Keypoints.of(points[0], descriptors[0])
        return collect_keypoints(points, descriptors, tiles, where, shape)

    def _on(self, crop: NDArray[np.uint8]) -> tuple[NDArray[Any], NDArray[Any]]:
        if min(crop.shape[:2]) < SMALLEST:
            return self._none()
        keypoints, descriptors = self._detector.detectAndCompute(cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY), None)
        return (structured(keypoints), descriptors) if keypoints else self._none()

    def _none(self) -> tuple[NDArray[Any], NDArray[Any]]:
        kind = np.uint8 if self._detector.descriptorType() == cv2.CV_8U else np.float32
        return np.zeros(0, KEYPOINT), np.zeros((0, self._detector.descriptorSize()), kind)


class Sift(OpenCvKeypoints):
    """SIFT, region-exact.

    A keypoint depends on its surroundings and on the phase of the pyramid only: with tiles at multiples of
    16 px and a halo of 48 px more than 99 % of the full image's keypoints in the region come out, to 0.1 px.
    The others, some 20 px and larger, see beyond the halo: in pictures of large plain shapes, with few small
    keypoints, they are 2 %; a halo of 64 px halves that. An origin at an odd pixel would lose up to 20 %.

    Exact without a limit to their number: ``nfeatures`` ranks the keypoints of each tile by themselves.
    """

    name = "SIFT"
    exact = True


class Akaze(OpenCvKeypoints):
    """AKAZE, not exact: its diffusion is steered by a contrast that is a percentile over the whole image."""

    name = "AKAZE"


class Kaze(OpenCvKeypoints):
    """KAZE, not exact: its diffusion is steered by a contrast that is a percentile over the whole image."""

    name = "KAZE"


class Orb(OpenCvKeypoints):
    """ORB, not exact.

    It keeps the ``nfeatures`` strongest of an image, here of each tile, and scales the image by 1.2 from
    level to level, so that a tile's levels sample other places than the image's. ``Orb(scaleFactor=2)`` with
    as many levels as tiles are aligned for removes the latter: then the full image's keypoints are found,
    and weaker ones besides, since the tile has no others to compete with.
    """

    name = "ORB"

    def __init__(self, *, halo: int | None = None, **options: Any) -> None:
        super().__init__(halo=halo, **options)
        coarsest = self._detector.getScaleFactor() ** (self._detector.getNLevels() - 1)
        if self._detector.getScaleFactor() == 2.0:
            self.align = max(self.align, int(coarsest))
        if halo is None:
            # At every level ORB drops what is so near to the border.
            self.halo = int(np.ceil(self._detector.getEdgeThreshold() * coarsest))


class Brisk(OpenCvKeypoints):
    """BRISK, not exact: its pyramid scales by 3/2 and by 2 in turn.

    Tiles at multiples of 48 px sample a tile as they sample the image, when its sides are multiples of 48
    too: crop the image to such a size, and all but some large keypoints are found. Otherwise few are.
    """

    name = "BRISK"
    halo, align = 96, 48


def create(name: str, options: dict[str, Any]) -> Any:
    """OpenCV's detector of this name.

    Raises:
        ArgumentError: an option that OpenCV does not take.
        MissingExtraError: this OpenCV lacks it.
    """
    factory = getattr(cv2, f"{name}_create", None)
    if factory is None:
        raise MissingExtraError(
            f"{name} is not in OpenCV {cv2.__version__}, opencv-python-headless 4 has it: it", "opencv4"
        )
    try:
        return factory(**options)
    except (TypeError, cv2.error) as error:
        raise ArgumentError(
            f"options: what cv2.{name}_create takes expected, got {options}: {error}"
        ) from None


def structured(keypoints: Any) -> NDArray[Any]:
    """OpenCV's keypoints as a structured array of :data:`KEYPOINT`; angles become radians."""
    points = np.zeros(len(keypoints), KEYPOINT)
    points["u"], points["v"] = np.reshape(cv2.KeyPoint.convert(keypoints), (-1, 2)).T
    for name in ("size", "angle", "response", "octave"):
        points[name] = [getattr(keypoint, name) for keypoint in keypoints]
    points["angle"] = np.deg2rad(points["angle"])
    return points
