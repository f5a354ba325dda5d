"""Find a thing by what is printed on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..detectors import Detections, Detector, Where
from ..views import Views


@dataclass(frozen=True, eq=False)
class LabelFound:
    """A label that every eye reads.

    Attributes:
        place: (3,) [m] of its middle in the root frame, on the thing's surface.
        boxes: (4,) of it in each camera's image.
    """

    place: Floats
    boxes: dict[str, NDArray[np.float32]]


def find_label(
    word: str,
    images: Mapping[str, NDArray[np.uint8]],
    where: Mapping[str, Where],
    detector: Detector,
    views: Views,
    *,
    least: float = 0.7,
) -> LabelFound | None:
    """Where the thing is that has ``word`` printed on it.

    Args:
        word: what is printed.
        images: of each camera, (H, W, 3) uint8 RGB.
        where: to look in each.
        detector: finds text, and labels it with what it says.
        views: of the cameras at this moment.
        least: similarity, 0 to 1, of what is read to ``word``, from which it counts: letters are misread.

    Returns:
        The label, or None when not every eye reads it.
    """
    boxes = {}
    for camera, image in images.items():
        found = detector.detect(image, where[camera])
        best = _most_similar(word, found, least)
        if best is None:
            return None
        boxes[camera] = found.boxes[best]
    # The middle of a half-open box, in pixels whose centres are integers.
    middles = {camera: [(box[:2] + box[2:] - 1.0) / 2.0] for camera, box in boxes.items()}
    place = views.triangulate(middles)[0]
    return LabelFound(place, boxes) if np.isfinite(place).all() else None


def _most_similar(word: str, found: Detections, least: float) -> int | None:
    """Index of the finding that reads most like a word."""
    alike = [SequenceMatcher(None, word.upper(), label.upper()).ratio() for label in found.labels]
    return int(np.argmax(alike)) if alike and max(alike) >= least else None
