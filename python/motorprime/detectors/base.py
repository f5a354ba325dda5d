"""What a detector is, and what it returns; where it may look stands in ``motorprime.where``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..errors import ArgumentError, ArgumentTypeError
from ..where import Everywhere, Mask, Tiles, Where, Windows

__all__ = [
    "Detections",
    "Detector",
    "Everywhere",
    "Mask",
    "Tiles",
    "Where",
    "Windows",
    "check_image",
]


@dataclass(frozen=True, eq=False)
class Detections:
    """What was found, in pixels of the full image.

    Attributes:
        boxes: (N, 4) float32 (u0, v0, u1, v1), half-open.
        scores: (N,) float32.
        labels: (N,) strings.
        attended: pixels that the detector touched; an overlap counts once.
        failure: what went wrong in this frame, where :class:`Guarded` caught it; None when nothing did.
    """

    boxes: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    scores: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    labels: tuple[str, ...] = ()
    attended: int = 0
    failure: str | None = None

    def __len__(self) -> int:
        return len(self.boxes)


@runtime_checkable
class Detector(Protocol):
    """Anything with ``detect``: three lines wrap a detector of your own."""

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect in ``image`` (H, W, 3) uint8 RGB, looking only where ``where`` says."""
        ...


def check_image(image: npt.ArrayLike) -> NDArray[np.uint8]:
    """``image`` when it is (H, W, 3) uint8; else an error that says what it is."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise ArgumentTypeError(f"image: a uint8 array (H, W, 3) expected, got {kind}")
    if image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
        raise ArgumentError(f"image: shape (H, W, 3) expected, got {image.shape}")
    return image
