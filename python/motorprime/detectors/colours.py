"""Hue and saturation, counted in bins: what the histogram detector sees of an image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .. import _core

BINS = (30, 16)
RANGES = [0.0, 180.0, 0.0, 256.0]
MIN_SATURATION, MIN_VALUE = 70, 25  # below, a hue means nothing
NO_BIN = BINS[0] * BINS[1]


def hsv(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Hue (0-179), saturation and value of an image (H, W, 3) uint8 RGB."""
    converted: NDArray[np.uint8] = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)  # type: ignore[assignment]
    return converted


def coloured(hsv_image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The pixels (H, W) whose hue means something: 255, others 0."""
    found: NDArray[np.uint8] = cv2.inRange(hsv_image, (0, MIN_SATURATION, MIN_VALUE), (180, 255, 255))  # type: ignore[assignment]
    return found


def histogram(hsv_image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Counts (30, 16) of hue and saturation over the pixels that have a hue."""
    counts: NDArray[np.float32] = cv2.calcHist(  # type: ignore[assignment]
        [hsv_image], [0, 1], coloured(hsv_image), list(BINS), RANGES
    )
    return counts


def back_project(hsv_image: NDArray[np.uint8], values: NDArray[np.float32]) -> NDArray[np.uint8]:
    """``values`` (30, 16), 0 to 255, of each pixel's bin: (H, W) uint8, 0 where there is no hue."""
    projected = cv2.calcBackProject([hsv_image], [0, 1], values, RANGES, 1.0)
    found: NDArray[np.uint8] = cv2.bitwise_and(projected, coloured(hsv_image))  # type: ignore[assignment]
    return found


def bin_indices(rgb: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Bin (H, W) uint16 of each pixel of (H, W, 3) uint8 RGB; :data:`NO_BIN` without a hue.

    Hue and saturation are those of :func:`hsv` for every colour, in a third of the time.
    """
    return _core.hue_saturation_bins(rgb, BINS, MIN_SATURATION, MIN_VALUE, None)


def window_scores(
    rgb: NDArray[np.uint8], corners: NDArray[np.integer], size: int, target: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Intersection of the histograms of some windows with a target's; no other pixel is looked at.

    Args:
        rgb: (H, W, 3) uint8.
        corners: (N, 2) upper left pixels (u, v) of windows inside the image.
        size: of the windows [px].
        target: (480,) share of each bin.

    Returns:
        (N,) float32, the same bits as :func:`motorprime.intersections` gives for the whole image there.
    """
    places = np.ascontiguousarray(corners, dtype=np.int32)
    bins = BINS, MIN_SATURATION, MIN_VALUE
    return _core.window_intersections(rgb, places, target, (size, size), *bins)


def window_hits(
    rgb: NDArray[np.uint8],
    centres: NDArray[np.int32],
    size: int,
    target: NDArray[np.float32],
    hit: float,
    *,
    gap: int = 0,
) -> NDArray[np.int32]:
    """Boxes (M, 4) around groups of windows that share enough with a target and are near each other.

    In one call what ``Windows.corners``, :func:`window_scores` and
    :func:`motorprime.detectors.merging.merge_windows` give one after the other.

    Args:
        rgb: (H, W, 3) uint8.
        centres: (N, 2) int32 (u, v) of windows; those at the border are shifted to lie inside the image.
        size: of the windows [px].
        target: (480,) share of each bin.
        hit: the intersection from which a window hits.
        gap: windows so far apart [px] are of one group.

    Raises:
        ArgumentError: an image smaller than the window, a number outside its domain, an array of another
            shape.
        ArgumentTypeError: an argument has the wrong type or dtype.
    """
    return _core.window_hits(rgb, centres, target, size, hit, gap, BINS, MIN_SATURATION, MIN_VALUE)
