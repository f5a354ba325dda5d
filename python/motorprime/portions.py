"""What there is to look at, cut into portions, the most relevant ones first."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .attention import Look
from .costs import CostModel
from .detectors.base import Mask, Tiles, Where, Windows
from .looking import Strategy, choose_windows

MOST = 4096  # windows of one portion


class Portions(Protocol):
    """A queue of places to look at."""

    whole: bool
    """Whether a second portion would cost as much again as the first: then one takes all the time."""

    def affordable(self, seconds: float, costs: CostModel) -> int:
        """How much of what is left fits into ``seconds``; 0 when nothing does or nothing is left."""

    def take(self, count: int) -> Where | None:
        """The next portion, at least one unit; None when nothing is left."""

    def rest(self, looked: NDArray[np.bool_]) -> tuple[Where, float]:
        """What was not looked at, and its share of all; ``looked`` (H, W) are the pixels that were."""


class DrawnWindows:
    """Windows drawn from a landscape as long as there is time, the first on its peak (section IV-B)."""

    whole = False

    def __init__(self, look: Look, size: int, strategy: Strategy, seed: np.random.Generator) -> None:
        self._look, self._size, self._strategy, self._seed = look, size, strategy, seed
        self._first = True

    def affordable(self, seconds: float, costs: CostModel) -> int:
        """See :class:`Portions`."""
        return min(_fitting(seconds - costs.call, costs.window), MOST)

    def take(self, count: int) -> Windows:
        """Some more windows; there are always more."""
        wanted = max(count, 1) - self._first
        drawn = choose_windows(self._look, wanted, size=self._size, strategy=self._strategy, seed=self._seed)
        if not self._first:
            return drawn
        self._first = False
        v, u = np.unravel_index(int(self._look.landscape.argmax()), self._look.landscape.shape)
        peak = np.array([[u, v]], dtype=np.int32)
        return Windows(np.concatenate([peak, drawn.centres]), self._size)

    def rest(self, looked: NDArray[np.bool_]) -> tuple[Where, float]:
        """See :class:`Portions`."""
        return _unseen(self._look, looked)


class TopPixels:
    """The most relevant pixels, in one go (section IV-A)."""

    whole = True

    def __init__(self, look: Look) -> None:
        self._look, self._left = look, True

    def affordable(self, seconds: float, costs: CostModel) -> int:
        """See :class:`Portions`."""
        if not self._left:
            return 0
        return min(_fitting(seconds - costs.call, costs.pixel), self._look.landscape.size)

    def take(self, count: int) -> Mask | None:
        """So many pixels, once."""
        if not self._left:
            return None
        self._left = False
        return self._look.mask(count=max(count, 1))

    def rest(self, looked: NDArray[np.bool_]) -> tuple[Where, float]:
        """See :class:`Portions`."""
        return _unseen(self._look, looked)


class Listed:
    """Windows or tiles in the order in which they were given."""

    whole = False

    def __init__(self, items: Windows | Tiles) -> None:
        self._items, self._done = items, 0
        self._all = len(items.centres) if isinstance(items, Windows) else len(items.boxes)

    def affordable(self, seconds: float, costs: CostModel) -> int:
        """See :class:`Portions`."""
        left = seconds - costs.call
        if isinstance(self._items, Windows):
            return min(_fitting(left, costs.window), self._all - self._done)
        boxes = np.asarray(self._items.boxes[self._done :], dtype=np.float64)
        pixels = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        return int(np.searchsorted(np.cumsum(costs.tile + costs.pixel * pixels), left, side="right"))

    def take(self, count: int) -> Windows | Tiles | None:
        """The next of the list."""
        if self._done == self._all:
            return None
        portion = slice(self._done, min(self._done + max(count, 1), self._all))
        self._done = portion.stop
        return _part(self._items, portion)

    def rest(self, looked: NDArray[np.bool_]) -> tuple[Where, float]:
        """See :class:`Portions`."""
        left = _part(self._items, slice(self._done, None))
        return left, (self._all - self._done) / self._all if self._all else 0.0


def most_relevant_first(tiles: Tiles, look: Look) -> Tiles:
    """Tiles ordered by the mean of the landscape inside what counts of them, the largest first.

    Raises:
        ArgumentError: a tile is empty or not inside the image.
    """
    height, width = look.landscape.shape
    boxes = tiles.within((height, width)).counted
    means = [look.landscape[v0:v1, u0:u1].mean(dtype=np.float64) for u0, v0, u1, v1 in boxes]
    return _tiles(tiles, np.argsort(-np.array(means), kind="stable"))


def paint(looks: tuple[Where, ...], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The pixels (H, W) of all these looks."""
    changes = np.zeros((shape[0] + 1, shape[1] + 1), dtype=np.int32)
    painted = np.zeros(shape, dtype=np.bool_)
    for where in looks:
        if isinstance(where, Windows):
            low = where.corners(shape)
            boxes = np.concatenate([low, low + where.size], axis=1)
        elif isinstance(where, Tiles):
            boxes = np.asarray(where.boxes)
        else:
            painted |= where.mask if isinstance(where, Mask) else np.True_
            continue
        for u, v, sign in ((0, 1, 1), (2, 1, -1), (0, 3, -1), (2, 3, 1)):
            np.add.at(changes, (boxes[:, v], boxes[:, u]), sign)
    counts = changes.cumsum(axis=0).cumsum(axis=1)[:-1, :-1]
    return painted | (counts > 0)


def _fitting(seconds: float, price: float) -> int:
    """Units of this price that fit; without a price any number does."""
    if seconds < 0.0:
        return 0
    return int(min(seconds / price, 2**31)) if price > 0.0 else 2**31


def _windows(items: Windows, index: slice) -> Windows:
    return Windows(items.centres[index], items.size)


def _tiles(items: Tiles, index: slice | NDArray[np.intp]) -> Tiles:
    # All that is known of a tile stays with it.
    return replace(items, **{name: rows[index] for name, rows in vars(items).items() if rows is not None})


def _part(items: Windows | Tiles, index: slice) -> Windows | Tiles:
    return _windows(items, index) if isinstance(items, Windows) else _tiles(items, index)


def _unseen(look: Look, looked: NDArray[np.bool_]) -> tuple[Mask, float]:
    """Positive pixels that were not looked at, and their share of the landscape's mass."""
    mass = look.landscape.sum(dtype=np.float64)
    seen = look.landscape.sum(dtype=np.float64, where=looked)
    share = min(max(1.0 - float(seen / mass), 0.0), 1.0)
    return Mask((look.landscape > 0.0) & ~looked), share
