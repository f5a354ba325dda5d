"""What a detector is, where it may look, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import integer, numbers
from ..errors import ArgumentError, ArgumentTypeError


@dataclass(frozen=True)
class Everywhere:
    """Look at the whole image."""


@dataclass(frozen=True, eq=False)
class Mask:
    """Look at the pixels that are set: ``mask`` (H, W) bool."""

    mask: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if not isinstance(self.mask, np.ndarray) or self.mask.dtype != np.bool_ or self.mask.ndim != 2:
            kind = getattr(self.mask, "dtype", type(self.mask).__name__)
            raise ArgumentTypeError(f"mask: a bool array (H, W) expected, got {kind} {np.shape(self.mask)}")


@dataclass(frozen=True, eq=False)
class Windows:
    """Look at square windows: ``centres`` (N, 2) integer (u, v), ``size`` pixels wide and high.

    An even window of 20 covers columns u-10..u+9 and rows v-10..v+9, shifted to lie inside the image.
    """

    centres: NDArray[np.int32]
    size: int = 20

    def __post_init__(self) -> None:
        centres = _pixels("centres", self.centres)
        if centres.ndim != 2 or centres.shape[1] != 2:
            raise ArgumentError(f"centres: shape (N, 2) expected, got {centres.shape}")
        integer("size", self.size, at_least=1)

    def corners(self, shape: tuple[int, int]) -> NDArray[np.intp]:
        """Upper left corners (N, 2) of (u, v) in an image of ``shape`` (height, width).

        Raises:
            ArgumentError: the image is smaller than a window.
        """
        height, width = shape
        if min(shape) < self.size:
            raise ArgumentError(
                f"size: a window of {self.size} px does not fit into an image of {width} x {height}"
            )
        corners = np.asarray(self.centres, dtype=np.intp) - self.size // 2
        return np.clip(corners, 0, (width - self.size, height - self.size))


@dataclass(frozen=True, eq=False)
class Tiles:
    """Look at rectangles: ``boxes`` (N, 4) integer (u0, v0, u1, v1), half-open."""

    boxes: NDArray[np.int32]

    def __post_init__(self) -> None:
        boxes = _pixels("boxes", self.boxes)
        if boxes.ndim != 2 or boxes.shape[1] != 4:
            raise ArgumentError(f"boxes: shape (N, 4) expected, got {boxes.shape}")


def _pixels(name: str, value: npt.ArrayLike) -> NDArray[np.integer]:
    """``value`` as an array when it holds integers only."""
    numbers(name, value)
    array = np.asarray(value)
    if array.dtype.kind not in "iu":
        raise ArgumentTypeError(f"{name}: integer pixels expected, got {array.dtype}")
    return array


Where: TypeAlias = Everywhere | Mask | Windows | Tiles


@dataclass(frozen=True, eq=False)
class Detections:
    """What was found, in pixels of the full image.

    Attributes:
        boxes: (N, 4) float32 (u0, v0, u1, v1), half-open.
        scores: (N,) float32.
        labels: (N,) strings.
        attended: pixels that the detector touched; an overlap counts once.
    """

    boxes: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    scores: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    labels: tuple[str, ...] = ()
    attended: int = 0

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
