"""What stands out in an image by itself: two bottom-up saliency maps, as rivals and as weights.

They know nothing of the robot. A landscape tells where things matter, saliency where there is anything at
all; :func:`weighted` is the product that section V of the paper leaves to the future.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ._arrays import fixed
from .detectors.base import check_image
from .errors import ArgumentError

SIDE = 64
"""Width and height [px] at which the spectrum is taken: what stands out is large."""
BLUR, SPREAD = 5, 8.0  # of the residual's picture [px]: kernel and standard deviation
SURROUNDS = (12, 24, 28, 48, 56, 112)
"""Half the widths [px] of the squares that a pixel is held against."""


def spectral_residual(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Saliency (H, W) in [0, 1]: what the log spectrum has beyond its own local mean.

    With A and phi amplitude and phase of the Fourier transform of the grey image at 64 x 64, and h a 3 x 3
    mean, |F^-1(exp(log A - h * log A + i phi))|, smoothed and squared (Hou, Zhang, Saliency detection: a
    spectral residual approach, CVPR 2007). A picture of one grey value has no residual and gives zeros.

    Args:
        image: (H, W, 3) uint8 RGB.
    """
    grey = cv2.resize(cv2.cvtColor(check_image(image), _GREY), (SIDE, SIDE), interpolation=_LINEAR)
    if grey.min() == grey.max():
        return np.zeros(image.shape[:2], np.float32)
    spectrum = np.fft.fft2(grey.astype(np.float64))
    amplitude = np.abs(spectrum)
    logs = np.log(np.maximum(amplitude, 1e-9))
    residual = logs - cv2.blur(logs, (3, 3), borderType=cv2.BORDER_REFLECT_101)
    phase = spectrum / np.maximum(amplitude, 1e-9)
    smooth = cv2.GaussianBlur(np.abs(np.fft.ifft2(np.exp(residual) * phase)), (BLUR, BLUR), SPREAD) ** 2
    height, width = image.shape[:2]
    full = cv2.resize(smooth / smooth.max(), (width, height), interpolation=_LINEAR)
    return np.asarray(full, dtype=np.float32)


def fine_grained(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Saliency (H, W) in [0, 1]: how much each pixel differs from squares around it, brighter or darker.

    For squares of 24 to 224 px, the smoothed grey value less the mean of the square around it; the positive
    differences summed over the sizes, and so the negative ones, each scaled to 1, and both added (Montabone,
    Soto, Human detection using a mobile platform and novel features derived from a visual saliency mechanism,
    Image and Vision Computing 28, 2010).

    Args:
        image: (H, W, 3) uint8 RGB.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(check_image(image), _GREY), (5, 5), 0).astype(np.float64)
    sums = np.pad(grey.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    bright, dark = np.zeros_like(grey), np.zeros_like(grey)
    for half in SURROUNDS:
        difference = grey - _surround(sums, grey, half)
        bright += np.maximum(difference, 0.0)
        dark += np.maximum(-difference, 0.0)
    return np.asarray(_scaled(_scaled(bright) + _scaled(dark)), dtype=np.float32)


def weighted(landscape: npt.ArrayLike, saliency: npt.ArrayLike, *, share: float = 0.5) -> NDArray[np.float32]:
    """A landscape (H, W) times (1 - share + share * saliency): where it is relevant *and* stands out.

    Args:
        landscape: (H, W), >= 0.
        saliency: (H, W) in [0, 1].
        share: 0 leaves the landscape, 1 multiplies by the saliency alone.

    Raises:
        ArgumentError: shapes that differ, or a share outside [0, 1].
    """
    relevant, striking = np.asarray(landscape, np.float32), np.asarray(saliency, np.float32)
    if relevant.shape != striking.shape or relevant.ndim != 2:
        raise ArgumentError(
            f"saliency: shape (H, W) of the landscape expected, {relevant.shape}; got {striking.shape}"
        )
    part = float(fixed("share", share, ()))
    if not 0.0 <= part <= 1.0:
        raise ArgumentError(f"share: a number in [0, 1] expected, got {share}")
    product: NDArray[np.float32] = relevant * (np.float32(1.0 - part) + np.float32(part) * striking)
    return product


_GREY, _LINEAR = cv2.COLOR_RGB2GRAY, cv2.INTER_LINEAR_EXACT


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values >= 0 with a maximum of 1, or all 0."""
    highest = float(values.max())
    return values / highest if highest > 0.0 else values


def _surround(sums: NDArray[np.float64], grey: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Mean of a square 2 half wide around each pixel, which lacks the pixel and what is outside the image."""
    height, width = grey.shape
    rows, columns = np.arange(height), np.arange(width)
    top, bottom = np.maximum(rows - half + 1, 0)[:, None], np.minimum(rows + half + 1, height)[:, None]
    left, right = np.maximum(columns - half + 1, 0)[None], np.minimum(columns + half + 1, width)[None]
    total = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    mean: NDArray[np.float64] = (total - grey) / np.maximum((bottom - top) * (right - left) - 1, 1)
    return mean
