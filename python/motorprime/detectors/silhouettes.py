"""Silhouettes: from a window that hit to the region that it hit, without a look at the rest of the image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError

GROW = 24  # pixels by which a segmentation's region grows where the silhouette touches its border

Segment = Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
"""From a patch (h, w, 3) of the image to the pixels (h, w) that are the target's: not 0."""


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A connected region of the target's colour.

    Attributes:
        mask: (h, w) bool, the region in its own box.
        corner: (u, v) of the box's upper left pixel in the full image.
        centroid: (2,) (u, v) of the region in the full image, float64.
        score: intersection of the best window that hit it, 0 to 1.
    """

    mask: NDArray[np.bool_]
    corner: tuple[int, int]
    centroid: NDArray[np.float64]
    score: float

    @property
    def area(self) -> int:
        """Pixels of the region."""
        return int(np.count_nonzero(self.mask))

    @property
    def box(self) -> tuple[int, int, int, int]:
        """(u0, v0, u1, v1), half-open."""
        (u, v), (height, width) = self.corner, self.mask.shape
        return (u, v, u + width, v + height)

    def paint(self, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """The region as a mask of the full image."""
        full = np.zeros(shape, dtype=np.bool_)
        u0, v0, u1, v1 = self.box
        full[v0:v1, u0:u1] = self.mask
        return full

    def touches(self, corners: NDArray[np.intp], size: int) -> NDArray[np.bool_]:
        """Which of the windows at these ``corners`` (N, 2), ``size`` pixels wide, hold some of it."""
        sums = cv2.integral(self.mask.view(np.uint8))
        (height, width), (u, v) = self.mask.shape, self.corner
        left, right = (np.clip(corners[:, 0] - u + side, 0, width) for side in (0, size))
        top, bottom = (np.clip(corners[:, 1] - v + side, 0, height) for side in (0, size))
        held: NDArray[np.bool_] = (
            sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left] > 0
        )
        return held


def merge(pieces: Sequence[Silhouette], *, gap: float = 0.5) -> Silhouette:
    """One silhouette of the largest piece and those near it: something in front may split an object.

    Args:
        pieces: at least one.
        gap: largest distance between the boxes of the largest and of another piece, in sizes of the former.

    Raises:
        ArgumentError: no pieces.
    """
    if not pieces:
        raise ArgumentError("pieces: at least one silhouette expected, got none")
    largest = max(pieces, key=lambda piece: piece.area)
    u0, v0, u1, v1 = largest.box
    reach = gap * max(u1 - u0, v1 - v0)
    near = [
        piece
        for piece in pieces
        if piece.box[0] < u1 + reach
        and piece.box[2] > u0 - reach
        and piece.box[1] < v1 + reach
        and piece.box[3] > v0 - reach
    ]
    if len(near) == 1:
        return largest
    boxes = np.array([piece.box for piece in near])
    (left, top), (right, bottom) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    mask = np.zeros((bottom - top, right - left), dtype=np.bool_)
    for piece in near:
        u, v, u1, v1 = piece.box
        mask[v - top : v1 - top, u - left : u1 - left] |= piece.mask
    areas = np.array([[piece.area] for piece in near], dtype=np.float64)
    centroid = (areas * np.array([piece.centroid for piece in near])).sum(axis=0) / areas.sum()
    return Silhouette(mask, (int(left), int(top)), centroid, largest.score)


def grow_all(
    image: NDArray[np.uint8],
    corners: NDArray[np.intp],
    scores: NDArray[np.floating],
    size: int,
    segment: Segment,
    attended: NDArray[np.bool_],
    *,
    min_area: int,
    apart: int,
) -> tuple[Silhouette, ...]:
    """Grow a silhouette from each hit that no earlier one explains, the best hits first.

    Args:
        image: (H, W, 3).
        corners: (K, 2) corners (u, v) of the windows that hit.
        scores: (K,) theirs.
        size: of the windows [px].
        segment: finds the target's pixels in a patch.
        attended: (H, W), in which the pixels that are looked at are set.
        min_area: smaller regions [px] are dropped.
        apart: a hit nearer [px] than this, along both axes, to one from which nothing grew is dropped.

    Returns:
        Disjoint silhouettes, the largest first.
    """
    order = np.argsort(-scores, kind="stable")
    corners, scores = corners[order], scores[order]
    found: list[Silhouette] = []
    while len(corners):
        u, v = (int(x) for x in corners[0])
        silhouette = _grow(image, (u, v), size, float(scores[0]), segment, attended)
        if silhouette is not None and silhouette.area >= min_area:
            found.append(silhouette)
            left = ~silhouette.touches(corners, size)
        else:
            left = (np.abs(corners - corners[0]) > apart).any(axis=1)
        corners, scores = corners[left], scores[left]
    return tuple(sorted(found, key=lambda s: -s.area))


def _grow(
    image: NDArray[np.uint8],
    corner: tuple[int, int],
    size: int,
    score: float,
    segment: Segment,
    attended: NDArray[np.bool_],
) -> Silhouette | None:
    height, width = image.shape[:2]
    u0, v0 = (max(c - GROW, 0) for c in corner)
    u1, v1 = min(corner[0] + size + GROW, width), min(corner[1] + size + GROW, height)
    while True:
        region = segment(image[v0:v1, u0:u1])
        _, labels, stats, centroids = cv2.connectedComponentsWithStats(region, connectivity=4)
        inside = labels[corner[1] - v0 : corner[1] - v0 + size, corner[0] - u0 : corner[0] - u0 + size]
        counts = np.bincount(inside.ravel(), minlength=len(stats))
        counts[0] = 0
        if not counts.any():
            attended[v0:v1, u0:u1] = True
            return None
        best = int(counts.argmax())
        left, top, w, h, _ = (int(x) for x in stats[best])
        grown = (
            u0 - GROW * (left == 0),
            v0 - GROW * (top == 0),
            u1 + GROW * (u0 + left + w == u1),
            v1 + GROW * (v0 + top + h == v1),
        )
        grown = (max(grown[0], 0), max(grown[1], 0), min(grown[2], width), min(grown[3], height))
        if grown == (u0, v0, u1, v1):
            break
        u0, v0, u1, v1 = grown
    attended[v0:v1, u0:u1] = True
    return Silhouette(
        mask=labels[top : top + h, left : left + w] == best,
        corner=(u0 + left, v0 + top),
        centroid=np.add(centroids[best], (u0, v0)),
        score=score,
    )
