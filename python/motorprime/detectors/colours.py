"""Hue and saturation, counted in bins: what the histogram detector sees of an image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

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


def bin_indices(hsv_image: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Bin (H, W) uint16 of each pixel in the raveled histogram; :data:`NO_BIN` or more without a hue."""
    index = cv2.LUT(hsv_image[..., 0], _HUE)
    for channel, table in ((1, _SATURATION), (2, _VALUE)):
        index = cv2.add(index, cv2.LUT(hsv_image[..., channel], table))
    found: NDArray[np.uint16] = index  # type: ignore[assignment]
    return found


_BYTES = np.arange(256)
_HUE = (np.minimum(_BYTES * BINS[0] // 180, BINS[0] - 1) * BINS[1]).astype(np.uint16)
_SATURATION = np.where(_BYTES < MIN_SATURATION, NO_BIN, _BYTES * BINS[1] // 256).astype(np.uint16)
_VALUE = np.where(_BYTES < MIN_VALUE, NO_BIN, 0).astype(np.uint16)
