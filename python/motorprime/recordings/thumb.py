"""Find the tip of a bright thumb, left of the rest of the arm, in the images of a camera that stands still.

Which point is called the tip matters more than how sharp it is: it must be the same point of the thumb from
wherever the camera sees it. The tip is round, so the circle through its outline has a centre that is such a
point; the outermost pixel is another point of the thumb in every image.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..errors import ArgumentError
from .yarp import Frames

BRIGHT, AREA = 120, 25
"""Smallest of R, G and B of a pixel of the thumb, and the fewest pixels [px] that make one."""
_OVER = 30  # a pixel of the thumb is so much brighter than what is behind it
_SHARE = 10.0  # [%] of the images in which a pixel shows what is behind the arm, at least
_MOST = 60  # images that the background is taken from


def thumb_tips(images: Frames) -> Floats:
    """Where the thumb's tip is in each image: (N, 2) of (u, v), a NaN row where there is no thumb.

    Args:
        images: (H, W, 3) uint8 RGB of one camera that stands still, the arm moving through them.

    Raises:
        ArgumentError: no images.
    """
    if not len(images):
        raise ArgumentError("images: expected at least one, got none")
    behind = background(images)
    tips = np.full((len(images), 2), np.nan)
    for k in range(len(images)):
        thumb = segment(images[k], behind)
        if thumb is not None:
            tips[k] = tip(*thumb)
    return tips


def background(images: Frames) -> Floats:
    """What is behind the arm, (H, W): how bright a pixel is in the darkest tenth of the images.

    Not the median: the arm may be at a place in more than half of them. Brightness is min(R, G, B).
    """
    step = -(-len(images) // _MOST)
    grey = np.stack([_whiteness(images[k]) for k in range(0, len(images), step)])
    return np.asarray(np.percentile(grey, _SHARE, axis=0), dtype=np.float64)


def segment(image: NDArray[np.uint8], behind: Floats) -> tuple[NDArray[np.bool_], Floats] | None:
    """The thumb in an image (H, W, 3), or None.

    Returns:
        The mask (H, W) of the leftmost bright part that is not background, and the direction (2,) from the
        rest of the arm to it, in which it points.
    """
    grey = _whiteness(image)
    arm = grey > behind + _OVER
    count, labels, stats, centroids = cv2.connectedComponentsWithStats(
        (arm & (grey > BRIGHT)).astype(np.uint8), connectivity=8
    )
    large = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= AREA]
    if not large:
        return None
    leftmost = min(large, key=lambda k: int(stats[k, cv2.CC_STAT_LEFT]))
    mask = np.asarray(labels == leftmost)
    v, u = np.nonzero(arm & ~mask)
    rest = np.array([u.mean(), v.mean()]) if len(u) else centroids[leftmost] + (1.0, 0.0)
    return mask, np.asarray(centroids[leftmost] - rest)


def tip(mask: NDArray[np.bool_], pointing: Floats) -> Floats:
    """Centre (2,) [px] of the circle through a mask's round end, the one of its two in a direction (2,).

    The end is what lies within r of the outermost point along the mask's axis, r being the largest distance
    of a pixel to the outline. The circle (u - a)^2 + (v - b)^2 = R^2 is linear in a, b and R^2 - a^2 - b^2.
    """
    depth = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    radius = float(depth.max())
    v, u = np.nonzero(mask)
    points = np.column_stack([u, v]).astype(np.float64)
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    axis *= 1.0 if axis @ pointing >= 0.0 else -1.0
    end = np.sort((points - middle) @ axis)[-5:].mean()
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=len)[:, 0].astype(np.float64)
    near = outline[(outline - middle) @ axis > end - radius]
    inscribed: Floats = middle + (end - radius) * axis
    if len(near) < 5:
        return inscribed
    local = near - inscribed
    system = np.column_stack([2.0 * local, np.ones(len(local))])
    solution, _, rank, _ = np.linalg.lstsq(system, (local**2).sum(axis=1), rcond=None)
    # A straight end has no circle.
    return inscribed + solution[:2] if rank == 3 and np.hypot(*solution[:2]) < radius else inscribed


def _whiteness(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """min(R, G, B), (H, W); NumPy takes ten times as long over an axis of three."""
    red, green, blue = cv2.split(image)
    return np.minimum(np.minimum(red, green), blue)
