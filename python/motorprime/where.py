"""Where a detector may look: everywhere, at the pixels of a mask, at windows, or at tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ._arrays import integer, numbers
from .errors import ArgumentError, ArgumentTypeError


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

    def within(self, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """The mask itself, when it is of an image of ``shape`` (height, width).

        Raises:
            ArgumentError: it is of another size.
        """
        if self.mask.shape != tuple(shape):
            raise ArgumentError(f"mask: shape {tuple(shape)} expected, got {self.mask.shape}")
        return self.mask


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
        corners = np.subtract(self.centres, self.size // 2, dtype=np.intp)
        # As `np.clip`, in half the time.
        np.maximum(corners, 0, out=corners)
        return np.minimum(corners, (width - self.size, height - self.size), out=corners)


@dataclass(frozen=True, eq=False)
class Tiles:
    """Look at rectangles, half-open and in integers (u0, v0, u1, v1).

    Args:
        boxes: (N, 4) what is read.
        cores: (N, 4) the part of each box that its findings count in; the rest, its halo, is only there for
            the detector to see the core's surroundings. None: the boxes themselves.
    """

    boxes: NDArray[np.int32]
    cores: NDArray[np.int32] | None = None

    def __post_init__(self) -> None:
        boxes = _boxes("boxes", self.boxes)
        if self.cores is None:
            return
        cores = _boxes("cores", self.cores)
        if cores.shape != boxes.shape:
            raise ArgumentError(f"cores: a row for each of the {len(boxes)} boxes expected, got {len(cores)}")
        outside = (cores[:, :2] < boxes[:, :2]).any(axis=1) | (cores[:, 2:] > boxes[:, 2:]).any(axis=1)
        if outside.any():
            k = int(outside.argmax())
            raise ArgumentError(f"cores[{k}]: inside {boxes[k].tolist()} expected, got {cores[k].tolist()}")

    def __len__(self) -> int:
        return len(self.boxes)

    @property
    def counted(self) -> NDArray[np.int32]:
        """(N, 4) the parts whose findings count: the cores, or else the boxes."""
        return self.boxes if self.cores is None else self.cores

    def within(self, shape: tuple[int, int]) -> Tiles:
        """The tiles themselves, when each has pixels and lies in an image of ``shape`` (height, width).

        Raises:
            ArgumentError: the first one that has none, or does not, is named.
        """
        height, width = shape
        boxes = np.asarray(self.boxes)
        bad = (boxes[:, :2] < 0).any(axis=1) | (boxes[:, 2:] > (width, height)).any(axis=1)
        bad |= (boxes[:, 2:] <= boxes[:, :2]).any(axis=1) | (self.counted[:, 2:] <= self.counted[:, :2]).any(
            axis=1
        )
        if bad.any():
            k = int(bad.argmax())
            raise ArgumentError(
                f"boxes[{k}]: pixels u0 < u1, v0 < v1 of an image of {width} x {height} expected, "
                f"got {boxes[k].tolist()} with the core {self.counted[k].tolist()}"
            )
        return self

    def attended(self, shape: tuple[int, int]) -> int:
        """Pixels of an image of ``shape`` (height, width) that are read; an overlap counts once."""
        if len(self.boxes) == 1:
            ((u0, v0, u1, v1),) = self.boxes.tolist()
            return int((u1 - u0) * (v1 - v0))
        return int(np.count_nonzero(paint(self.boxes, shape)))


Where: TypeAlias = Everywhere | Mask | Windows | Tiles


def paint(boxes: npt.ArrayLike, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Mask (H, W) of the pixels in any of the ``boxes`` (N, 4), integer and half-open."""
    mask = np.zeros(shape, dtype=np.bool_)
    for u0, v0, u1, v1 in np.asarray(boxes).tolist():
        mask[v0:v1, u0:u1] = True
    return mask


def _boxes(name: str, value: npt.ArrayLike) -> NDArray[np.integer]:
    boxes = _pixels(name, value)
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise ArgumentError(f"{name}: shape (N, 4) expected, got {boxes.shape}")
    return boxes


def _pixels(name: str, value: npt.ArrayLike) -> NDArray[np.integer]:
    """``value`` as an array when it holds integers only."""
    numbers(name, value)
    array = np.asarray(value)
    if array.dtype.kind not in "iu":
        raise ArgumentTypeError(f"{name}: integer pixels expected, got {array.dtype}")
    return array
