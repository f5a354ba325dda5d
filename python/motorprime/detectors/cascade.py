"""OpenCV's cascade classifiers on tiles."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..errors import ArgumentError, MissingExtraError
from ..where import Where
from .base import Detections
from .on_tiles import OnTiles


class Cascade:
    """A cascade classifier, not exact.

    It scans the image at scales a tenth apart, in steps of two pixels of the scaled image, and groups what it
    finds by its neighbours: a tile is scaled and scanned from another corner than the image. It finds nearly
    the same objects, in boxes a few pixels off.

    Args:
        cascade: the .xml file, or the name of one that comes with OpenCV.
        label: of every finding.
        scale: from one size of objects to the next, above 1.
        neighbours: findings that a group must have.
        smallest: least side of an object [px].
        halo: pixels read around what is attended: half the size of the largest object.

    Raises:
        ArgumentError: the file is no cascade, or a number is outside its domain.
        MissingExtraError: this OpenCV has no cascade classifiers.
    """

    exact = False

    def __init__(
        self,
        cascade: Path | str,
        *,
        label: str = "object",
        scale: float = 1.1,
        neighbours: int = 3,
        smallest: int = 24,
        halo: int = 64,
    ) -> None:
        classifier = getattr(cv2, "CascadeClassifier", None)
        if classifier is None:
            raise MissingExtraError(
                f"CascadeClassifier is not in OpenCV {cv2.__version__}, opencv-python-headless 4 has it: it",
                "opencv4",
            )
        path = Path(cascade)
        if not path.is_file():
            path = Path(cv2.__file__).parent / "data" / path
        self.label, self.smallest = label, integer("smallest", smallest, at_least=1)
        self.neighbours = integer("neighbours", neighbours, at_least=0)
        if not np.isfinite(scale) or scale <= 1.0:
            raise ArgumentError(f"scale: a number above 1 expected, got {scale}")
        self.scale = float(scale)
        try:
            self._classifier = classifier(str(path))
            empty = self._classifier.empty()
        except (cv2.error, SystemError):  # the latter from a file that is no XML
            empty = True
        if empty:
            raise ArgumentError(f"cascade: the .xml of a cascade classifier expected, {path} is none")
        self._tiles = OnTiles(self._on, halo=halo)

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect in ``image`` (H, W, 3) uint8 RGB; findings in its pixels, whose centres ``where`` asks for.

        The score is the weight of the last stage that a finding passed.

        Raises:
            ArgumentError: ``where`` does not fit the image.
            ArgumentTypeError: the image or ``where`` has the wrong type.
        """
        return self._tiles.detect(image, where)

    def _on(self, crop: NDArray[np.uint8]) -> Detections:
        boxes, _, weights = self._classifier.detectMultiScale3(
            cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY),
            scaleFactor=self.scale,
            minNeighbors=self.neighbours,
            minSize=(self.smallest, self.smallest),
            outputRejectLevels=True,
        )
        corners = np.array(boxes, dtype=np.float32).reshape(-1, 4)
        corners[:, 2:] += corners[:, :2]
        return Detections(corners, np.array(weights, np.float32).reshape(-1), (self.label,) * len(corners))
