"""Where to look next: windows that waste no looks.

Windows that are drawn independently of each other (section IV-B) fall on each other: 50 of 20 x 20 pixels in
each of ten cycles cover an image of 320 x 240 2.6 times over, and still leave parts of it out. Here they are
spread, kept apart, or kept off what was looked at in vain, and a share of them may look elsewhere, so that
the unexpected is seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ._arrays import fixed, generator, integer, rows
from .attention import Look
from .detectors.base import Mask, Windows
from .errors import ArgumentError, ArgumentTypeError
from .landscape import gibbs_sample, sample

__all__ = ["Memory", "Strategy", "choose_windows"]

Strategy: TypeAlias = Literal["gibbs", "independent", "apart", "stratified"]
"""How windows are drawn: by the paper's chain; independently of each other; at least half a window apart; or
one from each of as many parts of the landscape as there are windows, all of the same mass."""

_Field: TypeAlias = NDArray[np.float32]
_Draw: TypeAlias = Callable[[_Field, int], NDArray[np.int32]]


class Memory:
    """Which pixels of a camera were looked at without result, and how long ago.

    Args:
        shape: (height, width) of the images.
        keep: what is left of a memory after a cycle, in [0, 1): what was empty then may not be so any more.

    Attributes:
        seen: (H, W) float32: 1 where a window has just been, less where it has been longer ago.

    Raises:
        ArgumentError: a number outside its domain.
    """

    def __init__(self, shape: tuple[int, int], *, keep: float = 0.8) -> None:
        if not 0.0 <= float(fixed("keep", keep, ())) < 1.0:
            raise ArgumentError(f"keep: a share in [0, 1) expected, got {keep}")
        height, width = (integer("shape", side, at_least=1) for side in shape)
        self._keep = float(keep)
        self.seen: _Field = np.zeros((height, width), dtype=np.float32)

    def note(self, looked: Windows | Mask, *, margin: int = 0) -> None:
        """A cycle looked at these windows or pixels and found nothing there; all before is a cycle older.

        Args:
            looked: where.
            margin: pixels of a mask so near [px] to its border count as not looked at: what lies across it
                may have been missed.

        Raises:
            ArgumentError: a mask of another shape, a window that does not fit, or a negative margin.
        """
        shape = self.seen.shape[0], self.seen.shape[1]
        side = 2 * integer("margin", margin, at_least=0) + 1
        if isinstance(looked, Mask):
            inside = np.ascontiguousarray(looked.within(shape)).view(np.uint8)
            # What lies outside of the image cannot be looked at: its edge is no border.
            kernel = np.ones((side, side), np.uint8)
            core = cv2.erode(inside, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=[1.0])
            self.seen *= self._keep
            self.seen[core > 0] = 1.0
            return
        windows, corners = looked, looked.corners(shape)
        self.seen *= self._keep
        for u, v in corners.tolist():
            self.seen[v : v + windows.size, u : u + windows.size] = 1.0

    def move(self, before: npt.ArrayLike, after: npt.ArrayLike) -> None:
        """The camera has moved: move what is remembered along.

        The same points in space, before and after: the homography that fits them best moves the pixels. It is
        exact for a camera that turns, and for points of a plane. Any projection gives such pairs.

        Args:
            before: (N, 2) pixels (u, v) at the old posture; NaN where the camera did not see a point.
            after: (N, 2) at the new one. With fewer than four pairs, or none that spans a plane, all is
                forgotten.

        Raises:
            ArgumentError: other shapes, infinite pixels.
        """
        old, new = rows("before", before, 2, nan=True), rows("after", after, 2, nan=True)
        if len(old) != len(new):
            raise ArgumentError(f"after: as many points as before, {len(old)}, expected, got {len(new)}")
        known = ~(np.isnan(old) | np.isnan(new)).any(axis=1)
        fit = cv2.findHomography(old[known], new[known])[0] if known.sum() >= 4 else None
        if fit is None:
            self.forget()
            return
        height, width = self.seen.shape
        moved = cv2.warpPerspective(self.seen, fit, (width, height), flags=cv2.INTER_LINEAR)
        self.seen = np.clip(moved, 0.0, 1.0, dtype=np.float32)

    def forget(self) -> None:
        """Drop everything."""
        self.seen[:] = 0.0

    def weigh(self, landscape: _Field) -> _Field:
        """A landscape (H, W) less what is remembered; itself where nothing else would be left of it.

        Raises:
            ArgumentError: it is of another shape.
        """
        if landscape.shape != self.seen.shape:
            raise ArgumentError(
                f"landscape: the memory's shape {self.seen.shape} expected, got {landscape.shape}"
            )
        left: _Field = landscape * (1.0 - self.seen)
        return left if left.any() else landscape


def choose_windows(
    look: Look,
    count: int,
    *,
    size: int = 20,
    strategy: Strategy = "stratified",
    explore: float = 0.0,
    memory: Memory | None = None,
    seed: int | np.random.Generator | None = None,
) -> Windows:
    """Windows to look at next.

    Args:
        look: the landscape.
        count: number of windows.
        size: of the windows [px].
        strategy: how they are drawn, see :data:`Strategy`. Windows 'apart' are fewer where no more fit.
        explore: share of them that looks where the landscape is zero, spread over all of that; none where it
            is positive everywhere. As an expectation: 0.05 of 50 windows are two or three.
        memory: keeps all of them off what was looked at in vain.
        seed: draws them.

    Raises:
        ArgumentError: the landscape is zero everywhere, or a number outside its domain.
        ArgumentTypeError: an argument has the wrong type.
    """
    if not isinstance(look, Look):
        raise ArgumentTypeError(f"look: expected a Look, got {type(look).__name__}")
    if strategy not in get_args(Strategy):
        raise ArgumentError(f"strategy: one of {', '.join(get_args(Strategy))} expected, got {strategy!r}")
    count, size = integer("count", count, at_least=0), integer("size", size, at_least=1)
    if not 0.0 <= float(fixed("explore", explore, ())) <= 1.0:
        raise ArgumentError(f"explore: a share in [0, 1] expected, got {explore}")
    if look.is_empty:
        raise ArgumentError("look: the landscape is zero everywhere: there is nothing to look at")
    draw = generator(seed)
    weigh = (lambda field: field) if memory is None else memory.weigh
    others, elsewhere = 0, []
    if explore and not look.landscape.all():
        others = math.floor(count * explore + draw.random())
        outside = (look.landscape <= 0.0).astype(np.float32)
        elsewhere = [_stratified(weigh(outside), others, draw)]
    centres = _strategies(size, draw)[strategy](weigh(look.landscape), count - others)
    return Windows(np.concatenate([centres, *elsewhere]), size)


def choose_piece(look: Look, fraction: float, *, margin: int = 0, memory: Memory | None = None) -> Mask:
    """A rectangle of pixels to look at next, for detectors that must see a thing as a whole.

    The most relevant pixels of what was not yet looked at are a ring around what was, too narrow to hold
    anything. This is the rectangle of the image's own proportions that has most of the landscape in it.

    Args:
        look: the landscape.
        fraction: share of the image's pixels, in (0, 1]; sides are rounded to whole pixels.
        margin: half the extent of a thing [px]: what lies nearer to the rectangle's border, unless that is
            the image's own, does not count. As for :meth:`Memory.note`, so that pieces overlap by that much.
        memory: what was looked at in vain counts less.

    Raises:
        ArgumentError: the landscape is zero everywhere, a number outside its domain, a margin that leaves
            nothing of the rectangle, or a memory of another shape.
    """
    margin = integer("margin", margin, at_least=0)
    if not 0.0 < float(fixed("fraction", fraction, ())) <= 1.0:
        raise ArgumentError(f"fraction: a share in (0, 1] expected, got {fraction}")
    if look.is_empty:
        raise ArgumentError("look: the landscape is zero everywhere: there is nothing to look at")
    left = look.landscape if memory is None else memory.weigh(look.landscape)
    sides = [max(round(side * math.sqrt(fraction)), 1) for side in left.shape]
    cores = []
    for side, most in zip(sides, left.shape, strict=True):
        if 2 * margin >= side < most:
            raise ArgumentError(f"margin: less than half of {side} px expected, got {margin}")
        first = np.arange(most - side + 1)
        end = first + side
        cores.append((np.where(first > 0, first + margin, 0), np.where(end < most, end - margin, most)))
    (top, bottom), (start, end) = cores
    sums = cv2.integral(left.astype(np.float64))
    inside = sums[np.ix_(bottom, end)] - sums[np.ix_(top, end)] - sums[np.ix_(bottom, start)]
    inside += sums[np.ix_(top, start)]
    v, u = np.unravel_index(int(inside.argmax()), inside.shape)
    mask = np.zeros(left.shape, dtype=np.bool_)
    mask[v : v + sides[0], u : u + sides[1]] = True
    return Mask(mask)


def _strategies(size: int, draw: np.random.Generator) -> dict[Strategy, _Draw]:
    return {
        "gibbs": lambda field, count: gibbs_sample(field, count, seed=draw),
        "independent": lambda field, count: sample(field, count, seed=draw),
        "apart": lambda field, count: sample(field, count, seed=draw, min_distance=size / 2),
        "stratified": lambda field, count: _stratified(field, count, draw),
    }


def _stratified(field: _Field, count: int, draw: np.random.Generator) -> NDArray[np.int32]:
    """One pixel (u, v) from each of ``count`` parts of the same mass: together they follow the field exactly.

    The pixels are lined up so that neighbours in the line are neighbours in the image, and the line is cut.
    """
    line = _line(field.shape[0], field.shape[1])
    masses = np.cumsum(field.ravel()[line], dtype=np.float64)
    wanted = (np.arange(count) + draw.random(count)) / max(count, 1) * masses[-1]
    # To the right of equal sums: never a pixel of no mass. Rounding may reach the end, so it is held back.
    last = int(np.searchsorted(masses, masses[-1], side="left"))
    places = line[np.minimum(np.searchsorted(masses, wanted, side="right"), last)]
    v, u = np.divmod(places, field.shape[1])
    return np.stack([u, v], axis=1).astype(np.int32)


@lru_cache(maxsize=8)
def _line(height: int, width: int) -> NDArray[np.intp]:
    """All pixels in Morton's order: square blocks, and in each of them square blocks."""
    v, u = np.divmod(np.arange(height * width, dtype=np.uint64), np.uint64(width))
    code = np.zeros(height * width, dtype=np.uint64)
    for bit in range(max(height, width).bit_length()):
        one, at = np.uint64(1), np.uint64(bit)
        code |= ((u >> at & one) << (at + at)) | ((v >> at & one) << (at + at + one))
    line = np.argsort(code)
    line.setflags(write=False)
    return line
