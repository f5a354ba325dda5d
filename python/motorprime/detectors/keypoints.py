"""Keypoints and their descriptors, in pixels of the full image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, ArgumentTypeError
from ..tiling import looked_at
from ..where import Tiles, Where
from .base import Detections

KEYPOINT = np.dtype(
    [
        ("u", np.float32),
        ("v", np.float32),
        ("size", np.float32),
        ("angle", np.float32),
        ("response", np.float32),
        ("octave", np.int32),
    ]
)
"""Place (u, v) and diameter ``size`` [px], angle [rad], strength, and the octave as the detector counts."""

Structured: TypeAlias = NDArray[Any]
"""A structured array (N,) with the fields of :data:`KEYPOINT` at least."""

NEAR = 1.0
"""Two tiles may see one keypoint on two sides of the border between their cores, so far [px] from it."""


@dataclass(frozen=True, eq=False)
class Keypoints(Detections):
    """Keypoints as detections: a box around each circle, its response as the score.

    Attributes:
        points: (N,) structured, with the fields of :data:`KEYPOINT` at least.
        descriptors: (N, D) float32, or uint8 for bits.
    """

    points: NDArray[Any] = field(default_factory=lambda: np.zeros(0, KEYPOINT))
    descriptors: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    @classmethod
    def of(cls, points: NDArray[Any], descriptors: NDArray[Any], attended: int = 0) -> Keypoints:
        """Keypoints from their structured array and descriptors.

        Raises:
            ArgumentTypeError: ``points`` lacks a field of :data:`KEYPOINT`.
            ArgumentError: not one descriptor for each point.
        """
        missing = [name for name in KEYPOINT.names or () if name not in (points.dtype.names or ())]
        if missing:
            raise ArgumentTypeError(
                f"points: fields {', '.join(KEYPOINT.names or ())} expected, {', '.join(missing)} missing"
            )
        if descriptors.ndim != 2 or len(descriptors) != len(points):
            raise ArgumentError(f"descriptors: shape ({len(points)}, D) expected, got {descriptors.shape}")
        centres = np.column_stack([points["u"], points["v"]]).astype(np.float32)
        half = points["size"][:, None].astype(np.float32) / 2
        # A pixel's centre is an integer and boxes are half-open: the edges lie half a pixel farther.
        boxes = np.hstack([centres - half, centres + half]) + np.float32(0.5)
        scores = points["response"].astype(np.float32)
        return cls(boxes, scores, ("keypoint",) * len(points), attended, None, points, descriptors)


def collect_keypoints(
    points: Sequence[NDArray[Any]],
    descriptors: Sequence[NDArray[Any]],
    tiles: Tiles,
    where: Where,
    shape: tuple[int, int],
) -> Keypoints:
    """Keypoints of each tile, in pixels of the tile, as keypoints of the image, each of them once.

    A keypoint counts in the first tile whose core has its rounded place, when ``where`` asks for that pixel.

    Args:
        points: for each tile, structured.
        descriptors: for each tile.
        tiles: what was read.
        where: what was asked for.
        shape: (height, width) of the image.
    """
    mask = looked_at(where, shape)
    kept_points, kept_descriptors, owners = [], [], []
    for k, (found, described) in enumerate(zip(points, descriptors, strict=True)):
        found = found.copy()
        found["u"] += tiles.boxes[k][0]
        found["v"] += tiles.boxes[k][1]
        u, v = np.rint(found["u"]).astype(np.intp), np.rint(found["v"]).astype(np.intp)
        kept = _inside(u, v, tiles.counted[k])
        for earlier in tiles.counted[:k]:
            kept &= ~_inside(u, v, earlier)
        if mask is not None:
            kept[kept] = mask[v[kept], u[kept]]
        kept_points.append(found[kept])
        kept_descriptors.append(described[kept])
        owners.append(np.full(np.count_nonzero(kept), k))
    all_points, owner = np.concatenate(kept_points), np.concatenate(owners)
    once = _once(all_points, owner, tiles)
    return Keypoints.of(all_points[once], np.concatenate(kept_descriptors)[once], tiles.attended(shape))


def _inside(u: NDArray[np.intp], v: NDArray[np.intp], box: NDArray[np.int32]) -> NDArray[np.bool_]:
    return np.asarray((u >= box[0]) & (v >= box[1]) & (u < box[2]) & (v < box[3]))


def _once(points: NDArray[Any], owner: NDArray[np.intp], tiles: Tiles) -> NDArray[np.bool_]:
    """Which points to keep when two tiles round one place to two sides of the border between them."""
    kept = np.ones(len(points), dtype=np.bool_)
    if len(tiles) < 2:
        return kept
    cores = np.asarray(tiles.counted, dtype=np.float32)[owner]
    u, v = points["u"], points["v"]
    margins = np.stack([u - cores[:, 0], cores[:, 2] - 1 - u, v - cores[:, 1], cores[:, 3] - 1 - v])
    at_border = np.flatnonzero(margins.min(axis=0) < NEAR)
    for place, k in enumerate(at_border):
        others = at_border[:place]
        others = others[kept[others] & (owner[others] != owner[k])]
        kept[k] = not _same(points[others], points[k]).any()
    return kept


def _same(points: NDArray[Any], one: Any) -> NDArray[np.bool_]:
    """Whether keypoints are one but for rounding: 0.5 px, 2 % in size, 2 degrees."""
    turn = np.abs(points["angle"] - one["angle"]) % (2 * np.pi)
    return np.asarray(
        (np.hypot(points["u"] - one["u"], points["v"] - one["v"]) < 0.5)
        & (np.abs(points["size"] - one["size"]) < 0.02 * one["size"])
        & (np.minimum(turn, 2 * np.pi - turn) < np.deg2rad(2.0))
    )
