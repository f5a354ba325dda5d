"""Rectangles that cover what is attended, with few pixels read besides.

A detector of one's own reads rectangles. Each has its price, the pixels in it and a fixed overhead, and its
halo: a detector sees a pixel right only with what is around it. :func:`regions` finds the cheapest way to cut
the attended pixels into rectangles, :func:`tiles` covers them with rectangles of one size.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from . import _core
from ._arrays import integer
from .errors import ArgumentError, ArgumentTypeError
from .where import Everywhere, Mask, Tiles, Where, Windows, paint

__all__ = ["OVERHEAD", "Attendable", "grow", "reading", "regions", "tiles"]

OVERHEAD = 4096
"""What one more tile costs by default, in pixels."""

RESOLUTION = 8
"""Places at which :func:`regions` may cut along a side, about."""

Attendable: TypeAlias = npt.NDArray[np.floating[Any]] | npt.NDArray[np.bool_] | Mask
"""A landscape (H, W), a mask (H, W) bool, or a Mask."""

Pixels: TypeAlias = NDArray[np.int32]


def regions(
    landscape: Attendable,
    *,
    fraction: float | None = None,
    halo: int = 0,
    align: int = 1,
    overhead: int = OVERHEAD,
) -> Tiles:
    """Rectangles that cover the attended pixels and are cheap to read.

    The price of a rectangle is its area with halo, aligned and clipped, plus ``overhead``. Among all ways to
    cut the attended pixels' bounding box, and the parts again, along a grid of about 8 x 8, each part
    shrunk to the attended pixels in it, this is the cheapest: found by dynamic programming over the
    rectangles of the grid.

    Args:
        landscape: (H, W) landscape, or a mask.
        fraction: of a landscape, attend this share of the pixels as :func:`threshold` does; None attends
            all that are positive.
        halo: pixels read around each rectangle, where the image has them.
        align: what is read begins and ends at multiples of this, or at the image's border.
        overhead: price of one more rectangle [px].

    Returns:
        Tiles, none of whose cores overlap; no tiles where a mask is empty.

    Raises:
        ArgumentError: a landscape that is zero everywhere, negative or not finite, or a number outside its
            domain.
        ArgumentTypeError: an argument has the wrong type.
    """
    mask = _attended(landscape, fraction)
    halo, align = _frame(halo, align)
    overhead = integer("overhead", overhead, at_least=0)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return _no_tiles()
    whole = np.array([[columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]], dtype=np.int32)
    area = _areas(grow(whole, mask.shape, halo=halo, align=align))[0]
    if area <= np.count_nonzero(mask) + overhead:  # no two rectangles can be cheaper
        cores = whole
    else:
        extents = _extents(mask, whole[0], align)
        prices = _prices(extents, mask.shape, halo, align, overhead)
        cores = np.array([extents[part] for part in _cheapest(prices)], dtype=np.int32)
    return Tiles(grow(cores, mask.shape, halo=halo, align=align), cores)


def tiles(
    landscape: Attendable,
    size: int | tuple[int, int],
    *,
    fraction: float | None = None,
    halo: int = 0,
    align: int = 1,
) -> Tiles:
    """Rectangles of one size that cover the attended pixels, as few as can be found quickly.

    Of three covers that which reads least: strips of that height from the top, and tiles along each from the
    left; strips of columns likewise; and always the tile that covers most of what is left.

    Args:
        landscape: as for :func:`regions`.
        size: of a tile without its halo [px]: one number, or (height, width). At least ``align``.
        fraction: as for :func:`regions`.
        halo: pixels read around each tile, where the image has them.
        align: what is read begins and ends at multiples of this, or at the image's border. A halo is rounded
            up to a multiple of it, so all that is read has one shape too, but at the image's border.

    Returns:
        Tiles inside the image. Where the image is smaller than a tile, or the last tile begins at the last
        multiple of ``align``, it is cut at the image's border. Cores overlap only where a tile was moved back
        into the image.

    Raises:
        ArgumentError: as for :func:`regions`, or a size smaller than ``align``.
        ArgumentTypeError: an argument has the wrong type.
    """
    mask = _attended(landscape, fraction)
    halo, align = _frame(halo, align)
    height, width = _size(size, align)
    by_rows = _strips(mask, (height, width), align)
    by_columns = _strips(np.ascontiguousarray(mask.T), (width, height), align)[:, [1, 0, 3, 2]]
    covers = by_rows, by_columns, _greedy(mask, (height, width), align)
    found = [Tiles(grow(cores, mask.shape, halo=halo, align=align), cores) for cores in covers]
    return min(found, key=lambda few: int(_areas(few.boxes).sum()))


def reading(where: Where, shape: tuple[int, int], *, halo: int = 0, align: int = 1) -> Tiles:
    """What a detector that needs ``halo`` and ``align`` must read to answer for ``where``.

    The cores of Tiles stay; a Mask and the pixels of Windows are covered by :func:`regions`.

    Args:
        where: where to look.
        shape: (height, width) of the image.
        halo: as for :func:`regions`.
        align: as for :func:`regions`.

    Raises:
        ArgumentError: ``where`` does not fit the image.
        ArgumentTypeError: ``where`` is no place to look.
    """
    if isinstance(where, Everywhere):
        return Tiles(np.array([[0, 0, shape[1], shape[0]]], dtype=np.int32))
    if isinstance(where, Tiles):
        cores = np.asarray(where.within(shape).counted, dtype=np.int32)
        return Tiles(grow(cores, shape, halo=halo, align=align), cores)
    if isinstance(where, Mask):
        return regions(where.within(shape), halo=halo, align=align)
    if isinstance(where, Windows):
        return regions(_windows(where, shape), halo=halo, align=align)
    raise _no_place(where)


def _no_place(where: object) -> ArgumentTypeError:
    return ArgumentTypeError(
        f"where: Everywhere, Mask, Windows or Tiles expected, got {type(where).__name__}"
    )


def looked_at(where: Where, shape: tuple[int, int]) -> NDArray[np.bool_] | None:
    """Mask (H, W) of the pixels that ``where`` asks for; None for the whole image."""
    if isinstance(where, Everywhere):
        return None
    if isinstance(where, Mask):
        return where.within(shape)
    if isinstance(where, Tiles):
        return paint(where.within(shape).counted, shape)
    if isinstance(where, Windows):
        return _windows(where, shape)
    raise _no_place(where)


def grow(boxes: Pixels, shape: tuple[int, ...], *, halo: int, align: int) -> Pixels:
    """Boxes (N, 4) with a halo around, their edges moved out to multiples of ``align``, inside the image."""
    height, width = shape[:2]
    grown = np.empty_like(boxes)
    grown[..., :2] = np.maximum((boxes[..., :2] - halo) // align * align, 0)
    grown[..., 2:] = np.minimum(-((-boxes[..., 2:] - halo) // align) * align, (width, height))
    return grown


# What is attended, checked.


def _attended(landscape: Attendable, fraction: float | None) -> NDArray[np.bool_]:
    if isinstance(landscape, Mask):
        landscape = landscape.mask
    if not isinstance(landscape, np.ndarray) or landscape.ndim != 2 or landscape.dtype.kind not in "bf":
        kind = getattr(landscape, "dtype", type(landscape).__name__)
        raise ArgumentTypeError(
            f"landscape: a float or bool array (H, W) expected, got {kind} {np.shape(landscape)}"
        )
    if landscape.dtype == np.bool_:
        if fraction is not None:
            raise ArgumentError("fraction: a mask says itself what is attended; only a landscape has shares")
        return np.asarray(landscape)
    if not landscape.any():
        raise ArgumentError("landscape: at least one positive pixel expected, all are 0")
    values: NDArray[np.floating[Any]] = landscape  # type: ignore[assignment]  # its dtype says so
    level = _core.threshold(values, 1.0 if fraction is None else fraction, None, "select", 1)
    return np.asarray(values >= level)  # which is above 0


def _frame(halo: int, align: int) -> tuple[int, int]:
    return integer("halo", halo, at_least=0), integer("align", align, at_least=1)


def _size(size: int | tuple[int, int], align: int) -> tuple[int, int]:
    pair = size if isinstance(size, tuple) else (size, size)
    if len(pair) != 2:
        raise ArgumentError(f"size: one number or (height, width) expected, got {size}")
    # A smaller tile could end before a pixel that lies behind the multiple where it begins.
    height, width = (integer("size", length, at_least=align) for length in pair)
    return height, width


def _windows(where: Windows, shape: tuple[int, int]) -> NDArray[np.bool_]:
    corners = where.corners(shape)
    return paint(np.hstack([corners, corners + where.size]), shape)


def _no_tiles() -> Tiles:
    return Tiles(np.zeros((0, 4), dtype=np.int32), np.zeros((0, 4), dtype=np.int32))


# Cutting along a grid. Rectangles of the grid are indexed [x0, x1, y0, y1], the ends half-open.


def _areas(boxes: Pixels) -> NDArray[np.int64]:
    sides = (boxes[..., 2:] - boxes[..., :2]).astype(np.int64)
    areas: NDArray[np.int64] = sides[..., 0] * sides[..., 1]
    return areas


def _extents(mask: NDArray[np.bool_], whole: Pixels, align: int) -> Pixels:
    """Boxes (x, x, y, y, 4) of the attended pixels in each rectangle of the grid; u1 <= u0 where none is."""
    lines = [_lines(int(whole[k]), int(whole[k + 2]), align) for k in (0, 1)]
    us, vs = lines
    cells = np.full((4, len(us) - 1, len(vs) - 1), np.iinfo(np.int32).max // 2, dtype=np.int32)
    for y, (top, bottom) in enumerate(pairwise(vs)):
        strip = mask[top:bottom, us[0] : us[-1]]
        columns = np.flatnonzero(strip.any(axis=0)) + us[0]
        for x, (left, right) in enumerate(pairwise(us)):
            first, end = np.searchsorted(columns, (left, right))
            if first == end:
                continue
            rows = np.flatnonzero(strip[:, left - us[0] : right - us[0]].any(axis=1))
            # Ends negated: then every extent of a union is a minimum.
            cells[:, x, y] = columns[first], rows[0] + top, -columns[end - 1] - 1, -(rows[-1] + top) - 1
    unions = np.moveaxis(_minima(_minima(cells, 1), 3), 0, -1) * np.array([1, 1, -1, -1], dtype=np.int32)
    return np.ascontiguousarray(unions)


def _lines(start: int, end: int, align: int) -> list[int]:
    """Where the grid may cut: multiples of ``align``, and both ends."""
    step = align * -(-(end - start) // (RESOLUTION * align))
    return [start, *range((start // align + 1) * align, end, step), end]


def _minima(values: Pixels, axis: int) -> Pixels:
    """Minima over all ranges [start, end) along an axis, which becomes two; empty ranges stay huge."""
    values = np.moveaxis(values, axis, 0)
    length = len(values)
    ranges = np.full((length + 1, length + 1, *values.shape[1:]), np.iinfo(np.int32).max // 2, dtype=np.int32)
    for start in range(length):
        ranges[start, start + 1 :] = np.minimum.accumulate(values[start:], axis=0)
    return np.moveaxis(ranges, (0, 1), (axis, axis + 1))


def _prices(
    extents: Pixels, shape: tuple[int, ...], halo: int, align: int, overhead: int
) -> NDArray[np.int64]:
    """Price (x, x, y, y) of reading each rectangle of the grid in one piece; 0 where nothing is attended."""
    areas = _areas(grow(extents, shape, halo=halo, align=align))
    empty = extents[..., 2] <= extents[..., 0]
    return np.where(empty, 0, areas + overhead)


def _cheapest(prices: NDArray[np.int64]) -> list[tuple[int, int, int, int]]:
    """The rectangles that cover the grid at the least price, cutting and cutting again from side to side."""
    nx, ny = prices.shape[0] - 1, prices.shape[2] - 1
    best = prices.copy()
    for w in range(1, nx + 1):
        x = np.arange(nx - w + 1)
        for k in range(1, w):
            best[x, x + w] = np.minimum(best[x, x + w], best[x, x + k] + best[x + k, x + w])
        column = best[x, x + w]
        for h in range(2, ny + 1):
            y = np.arange(ny - h + 1)[:, None]
            cut = y + np.arange(1, h)
            both = (column[:, y, cut] + column[:, cut, y + h]).min(axis=-1)
            column[:, y[:, 0], y[:, 0] + h] = np.minimum(column[:, y[:, 0], y[:, 0] + h], both)
        best[x, x + w] = column
    return _parts(prices, best, (0, nx, 0, ny))


def _parts(
    prices: NDArray[np.int64], best: NDArray[np.int64], part: tuple[int, int, int, int]
) -> list[tuple[int, int, int, int]]:
    """The rectangles whose prices add up to the best of ``part``."""
    if prices[part] == 0:
        return []
    if best[part] == prices[part]:
        return [part]
    x0, x1, y0, y1 = part
    for x in range(x0 + 1, x1):
        halves = (x0, x, y0, y1), (x, x1, y0, y1)
        if best[halves[0]] + best[halves[1]] == best[part]:
            break
    else:
        for y in range(y0 + 1, y1):
            halves = (x0, x1, y0, y), (x0, x1, y, y1)
            if best[halves[0]] + best[halves[1]] == best[part]:
                break
    return [*_parts(prices, best, halves[0]), *_parts(prices, best, halves[1])]


# Tiles of one size.


def _strips(mask: NDArray[np.bool_], size: tuple[int, int], align: int) -> Pixels:
    """Tiles (N, 4) of (height, width) ``size`` that cover a mask, strip by strip."""
    (height, width), (tall, wide) = mask.shape, size
    rows = np.asarray(mask.any(axis=1))
    boxes = []
    v = 0
    while rows[v:].any():
        top = _begin(v + int(rows[v:].argmax()), tall, height, align)
        columns = np.asarray(mask[v : top + tall].any(axis=0))
        u = 0
        while columns[u:].any():
            left = _begin(u + int(columns[u:].argmax()), wide, width, align)
            u = left + wide
            boxes.append((left, top, min(u, width), min(top + tall, height)))
        v = top + tall
    return np.array(boxes, dtype=np.int32).reshape(-1, 4)


def _greedy(mask: NDArray[np.bool_], size: tuple[int, int], align: int) -> Pixels:
    """Tiles (N, 4) that each cover most of what the ones before left, on a grid of an eighth of a tile."""
    steps = [align * max(1, side // (8 * align)) for side in size]
    left = _any_in_cells(mask, steps)
    sides = [min(side // step, cells) for side, step, cells in zip(size, steps, left.shape, strict=True)]
    boxes = []
    while left.any():
        sums = np.pad(left, ((1, 0), (1, 0))).astype(np.int32).cumsum(axis=0).cumsum(axis=1)
        sums = sums[sides[0] :] - sums[: -sides[0]]
        sums = sums[:, sides[1] :] - sums[:, : -sides[1]]
        y, x = (int(k) for k in np.unravel_index(sums.argmax(), sums.shape))
        left[y : y + sides[0], x : x + sides[1]] = False
        v, u = (
            _begin(place * step, side, length, align)
            for place, step, side, length in zip((y, x), steps, size, mask.shape, strict=True)
        )
        boxes.append((u, v, min(u + size[1], mask.shape[1]), min(v + size[0], mask.shape[0])))
    return np.array(boxes, dtype=np.int32).reshape(-1, 4)


def _any_in_cells(mask: NDArray[np.bool_], steps: list[int]) -> NDArray[np.bool_]:
    """Whether anything is set in each cell of (height, width) ``steps``."""
    for axis, step in enumerate(steps):
        mask = np.logical_or.reduceat(mask, np.arange(0, mask.shape[axis], step), axis=axis)
    return mask


def _begin(pixel: int, size: int, length: int, align: int) -> int:
    """Where a tile begins that covers ``pixel`` and reaches beyond it, moved back to lie in the image."""
    last = -(-max(length - size, 0) // align) * align
    return min(pixel // align * align, last)
