"""What tiles found, as findings of the image: shifted into it, cut objects joined, duplicates dropped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .. import _core
from .._arrays import not_negative, numbers
from ..errors import ArgumentError, ArgumentTypeError
from ..tiling import looked_at
from ..where import Tiles, Where
from .base import Detections

TOUCH = 2.0
"""A box that ends so near to its tile's border [px] is cut by it."""


def collect(
    found: Sequence[Detections],
    tiles: Tiles,
    where: Where,
    shape: tuple[int, int],
    *,
    overlap: float = 0.5,
) -> Detections:
    """Findings in each tile, in pixels of the tile, as findings in the image.

    1. Boxes of one label that are cut by a border of their tile and go on in another tile are joined.
    2. Of boxes of one label and of different tiles that overlap by an intersection over union of
       ``overlap`` or more, the one with the highest score stays.
    3. Those stay whose centre lies in a pixel that ``where`` asks for.

    Args:
        found: for each tile, in its own pixels.
        tiles: what was read.
        where: what was asked for.
        shape: (height, width) of the image.
        overlap: from which two boxes are one object, in (0, 1].

    Returns:
        The findings, highest score first.

    Raises:
        ArgumentError, ArgumentTypeError: a tile's findings are no boxes, scores and labels.
    """
    checked = [check_found(one) for one in found]
    corners = np.asarray(tiles.boxes, dtype=np.float32)
    boxes = np.concatenate(
        [np.zeros((0, 4), np.float32)]
        + [one.boxes + np.tile(corner[:2], 2) for one, corner in zip(checked, corners, strict=True)]
    ).astype(np.float32)
    scores = np.concatenate([np.zeros(0, np.float32), *(one.scores for one in checked)])
    labels = np.array([label for one in checked for label in one.labels], dtype=object)
    tile = np.repeat(np.arange(len(checked)), [len(one) for one in checked])
    if len(checked) > 1:
        boxes, scores, labels, tile = _join(boxes, scores, labels, tile, corners, shape)
        kept = _distinct(boxes, scores, labels, tile, overlap)
        boxes, scores, labels = boxes[kept], scores[kept], labels[kept]
    asked = _asked(boxes, where, shape)
    order = asked[np.argsort(-scores[asked], kind="stable")]
    return Detections(
        boxes[order],
        scores[order].astype(np.float32),
        tuple(str(label) for label in labels[order]),
        tiles.attended(shape),
    )


def check_found(found: object) -> Detections:
    """``found`` when it is Detections with finite boxes, a score and a label for each; else an error."""
    if not isinstance(found, Detections):
        raise ArgumentTypeError(f"detections: Detections expected, got {type(found).__name__}")
    boxes, scores = numbers("boxes", found.boxes), numbers("scores", found.scores)
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise ArgumentError(f"boxes: shape (N, 4) expected, got {boxes.shape}")
    if scores.shape != (len(boxes),) or len(found.labels) != len(boxes):
        raise ArgumentError(
            f"scores and labels: {len(boxes)} of each expected, got {scores.shape} and {len(found.labels)}"
        )
    bad = ~(np.isfinite(boxes).all(axis=1) & np.isfinite(scores))
    if bad.any():
        k = int(bad.argmax())
        raise ArgumentError(f"boxes[{k}]: finite numbers expected, got {boxes[k]} with score {scores[k]}")
    return found


def check_overlap(overlap: npt.ArrayLike) -> float:
    """An intersection over union from which boxes are one object: in (0, 1]."""
    share = not_negative("overlap", overlap)
    if not 0.0 < share <= 1.0:
        raise ArgumentError(f"overlap: a share in (0, 1] expected, got {share}")
    return share


def merge_windows(corners: NDArray[np.integer], size: int, *, gap: int = 0) -> NDArray[np.int32]:
    """Windows that hit as detections: those that overlap or touch, be it by way of others, are one.

    Args:
        corners: (K, 2) upper left pixels (u, v) of windows that hit.
        size: of the windows [px].
        gap: so far apart [px] they are one, too: windows that were drawn leave gaps on one thing.

    Returns:
        Boxes (N, 4), half-open, around the windows of each group, in no special order.
    """
    return _core.merge_windows(np.ascontiguousarray(corners, dtype=np.int32), size, gap)


def merge_hits(scores: NDArray[np.float32], hit: float, size: int, *, gap: int = 0) -> NDArray[np.int32]:
    """As :func:`merge_windows`, for windows that were all scored.

    Args:
        scores: (H - size + 1, W - size + 1), of the windows with these upper left pixels.
        hit: score from which a window hits.
        size: of the windows [px].
        gap: see there.
    """
    return _core.merge_hits(scores, hit, size, gap)


def suppress(boxes: NDArray[np.float32], scores: NDArray[np.float32], overlap: float) -> NDArray[np.intp]:
    """Indices of the boxes that no better one covers by ``overlap``, best first: non-maximum suppression."""
    order = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while len(order):
        best, rest = order[0], order[1:]
        kept.append(int(best))
        order = rest[intersection_over_union(boxes[best], boxes[rest]) < overlap]
    return np.array(kept, dtype=np.intp)


def intersection_over_union(box: NDArray[np.float32], boxes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of a box (4,) with each of ``boxes`` (N, 4)."""
    sides = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    common = np.prod(np.maximum(sides, 0.0), axis=1)
    union = np.prod(box[2:] - box[:2]) + np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) - common
    return np.asarray(common / np.maximum(union, 1e-9), dtype=np.float32)


def _join(
    boxes: NDArray[np.float32],
    scores: NDArray[np.float32],
    labels: NDArray[np.object_],
    tile: NDArray[np.intp],
    corners: NDArray[np.float32],
    shape: tuple[int, int],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.object_], NDArray[np.intp]]:
    """Join the pieces of what borders of tiles cut: their hull, and the best score."""
    group = np.arange(len(boxes))
    cut = _cut(boxes, corners[tile], shape)
    for a in np.flatnonzero(cut.any(axis=1)):
        for b in np.flatnonzero((tile != tile[a]) & (labels == labels[a])):
            if any(_goes_on(boxes[a], boxes[b], int(side)) for side in np.flatnonzero(cut[a])):
                group[group == group[b]] = group[a]
    joined = [np.flatnonzero(group == k) for k in np.unique(group)]
    return (
        np.array(
            [[*boxes[k, :2].min(axis=0), *boxes[k, 2:].max(axis=0)] for k in joined], dtype=np.float32
        ).reshape(-1, 4),
        np.array([scores[k].max() for k in joined], dtype=np.float32),
        labels[[int(k[0]) for k in joined]],
        # A joined one belongs to no tile: it may be a duplicate of any other.
        np.array([tile[k[0]] if len(k) == 1 else -1 - k[0] for k in joined], dtype=np.intp),
    )


def _cut(boxes: NDArray[np.float32], tiles: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Whether each side (N, 4) of a box lies on its tile's border, other than the image's own."""
    ends = (tiles > 0) & (tiles < np.array([np.inf, np.inf, shape[1], shape[0]]))
    beyond = np.hstack([boxes[:, :2] - tiles[:, :2], tiles[:, 2:] - boxes[:, 2:]])
    return np.asarray(ends & (beyond < TOUCH))


def _goes_on(piece: NDArray[np.float32], other: NDArray[np.float32], side: int) -> bool:
    """Whether ``other`` lies across the side at which ``piece`` was cut, and has about its extent there."""
    along, across = side % 2, 1 - side % 2
    if not other[along] - TOUCH <= piece[side] <= other[along + 2] + TOUCH:
        return False
    common = min(piece[across + 2], other[across + 2]) - max(piece[across], other[across])
    smaller = min(piece[across + 2] - piece[across], other[across + 2] - other[across])
    return bool(common >= 0.5 * smaller)


def _distinct(
    boxes: NDArray[np.float32],
    scores: NDArray[np.float32],
    labels: NDArray[np.object_],
    tile: NDArray[np.intp],
    overlap: float,
) -> NDArray[np.intp]:
    """Indices of the boxes left when of those that two tiles found only the better stays."""
    alive = np.ones(len(boxes), dtype=np.bool_)
    for best in np.argsort(-scores, kind="stable"):
        if alive[best]:
            twin = (tile != tile[best]) & (labels == labels[best])
            alive &= ~twin | (intersection_over_union(boxes[best], boxes) < overlap)
    return np.flatnonzero(alive)


def _asked(boxes: NDArray[np.float32], where: Where, shape: tuple[int, int]) -> NDArray[np.intp]:
    """Indices of the boxes whose centre was asked for."""
    mask = looked_at(where, shape)
    if mask is None:
        return np.arange(len(boxes))
    # Half-open boxes: a box of one pixel has its centre in the middle of that pixel.
    u, v = np.floor((boxes[:, :2] + boxes[:, 2:]) / 2.0).astype(np.intp).T
    inside = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    inside[inside] = mask[v[inside], u[inside]]
    return np.flatnonzero(inside)
