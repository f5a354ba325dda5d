"""Which windows a sliding detector scores where it is told to look."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, ArgumentTypeError
from .base import Everywhere, Mask, Tiles, Where

Bools = NDArray[np.bool_]


def positions(shape: tuple[int, int], where: Where, size: int, stride: int) -> Bools:
    """Windows of ``size`` pixels to score in an image of ``shape`` (height, width).

    Everywhere there is a grid, which reaches the far borders. A mask takes the windows of it whose centres
    it holds; a tile has a grid of its own inside it, or one window around its middle where it is smaller.

    Returns:
        (H - size + 1, W - size + 1), each window set at its upper left pixel.

    Raises:
        ArgumentError: a window does not fit into the image, the mask is of another size, or a tile is empty
            or not inside the image.
        ArgumentTypeError: ``where`` is none of the three.
    """
    height, width = shape
    if min(shape) < size:
        raise ArgumentError(f"image: {width} x {height} is smaller than the window of {size} px")
    if isinstance(where, Tiles):
        wanted = np.zeros((height - size + 1, width - size + 1), dtype=np.bool_)
        for box in np.asarray(where.within(shape).boxes).tolist():
            wanted[_inside(box, shape, size, stride)] = True
        return wanted
    if not isinstance(where, Everywhere | Mask):
        raise ArgumentTypeError(
            f"where: Everywhere, Mask, Windows or Tiles expected, got {type(where).__name__}"
        )
    wanted = _steps(height - size, stride)[:, None] & _steps(width - size, stride)
    if isinstance(where, Mask):
        half = size // 2
        wanted &= where.within(shape)[half : half + wanted.shape[0], half : half + wanted.shape[1]]
    return wanted


def pixels_of(wanted: Bools, size: int) -> Bools:
    """Pixels (H, W) of the windows that are set at their upper left pixels."""
    marked = cv2.copyMakeBorder(
        np.ascontiguousarray(wanted).view(np.uint8), 0, size - 1, 0, size - 1, cv2.BORDER_CONSTANT, value=0
    )
    spread = cv2.dilate(marked, np.ones((size, size), np.uint8), anchor=(size - 1, size - 1))
    return np.asarray(spread, dtype=np.uint8).view(np.bool_)


def _inside(box: list[int], shape: tuple[int, int], size: int, stride: int) -> tuple[NDArray[np.intp], ...]:
    """Rows and columns of the windows in one tile."""
    u0, v0, u1, v1 = box
    sides = []
    for low, high, length in ((v0, v1, shape[0]), (u0, u1, shape[1])):
        if high - low >= size:
            sides.append(low + np.flatnonzero(_steps(high - low - size, stride)))
        else:
            middle = (low + high) // 2 - size // 2
            sides.append(np.array([min(max(middle, 0), length - size)]))
    return np.ix_(*sides)


def _steps(last: int, stride: int) -> Bools:
    """(last + 1,): 0, stride, ... and ``last``, so that the far border is scanned too."""
    steps = np.zeros(last + 1, dtype=np.bool_)
    steps[::stride] = steps[last] = True
    return steps
