"""How near ``regions`` and ``tiles`` come to the optimum, on cases so small that all covers can be tried."""

from __future__ import annotations

import functools
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tiling import grow, regions, tiles

CELL = 16
"""Pixels of a cell's side, in which the cases are drawn; also what tiles are aligned to."""


def evaluate_cover(cases: int, seed: int) -> dict[str, Any]:
    """Random masks of 5 x 6 cells of 16 px, with and without halo and overhead.

    Returns:
        For ``regions`` (price: pixels read and overheads) and ``tiles`` of 2 x 2 cells (their number): cases,
        optimal (share of cases that are the optimum's price), mean and worst (price over the optimum's).
    """
    rng = np.random.default_rng(seed)
    priced, counted = [], []
    for case in range(cases):
        cells = rng.random((5, 6)) < rng.uniform(0.1, 0.6)
        cells[rng.integers(5), rng.integers(6)] = True
        mask = np.kron(cells, np.ones((CELL, CELL), dtype=np.bool_))
        halo, overhead = CELL * (case % 2), 2 * CELL * CELL * (case // 2 % 2)
        found = regions(mask, halo=halo, align=CELL, overhead=overhead)
        priced.append(read(found.boxes, overhead) / least_price(cells, CELL, halo, overhead))
        counted.append(len(tiles(mask, 2 * CELL, align=CELL)) / fewest_tiles(cells, 2))
    return {"regions": _ratios(priced), "tiles": _ratios(counted)}


def read(boxes: NDArray[np.int32], overhead: int) -> int:
    """Pixels in boxes (N, 4), each as often as it is read, and overheads."""
    return int(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1).sum()) + overhead * len(boxes)


def least_price(cells: NDArray[np.bool_], cell: int, halo: int, overhead: int) -> int:
    """Least price of any rectangles of cells that cover the set ones; they may overlap."""
    height, width = cells.shape
    prices: dict[int, int] = {}
    for v0, v1 in combinations(range(height + 1), 2):
        for u0, u1 in combinations(range(width + 1), 2):
            box = grow(
                np.array([[u0, v0, u1, v1]]) * cell, (height * cell, width * cell), halo=halo, align=cell
            )
            _offer(prices, _covered(cells, u0, v0, u1, v1), read(box, overhead))
    return _least(prices, cells)


def fewest_tiles(cells: NDArray[np.bool_], size: int) -> int:
    """Fewest squares of ``size`` cells that cover the set ones."""
    height, width = cells.shape
    prices: dict[int, int] = {}
    for v in range(height - size + 1):
        for u in range(width - size + 1):
            _offer(prices, _covered(cells, u, v, u + size, v + size), 1)
    return _least(prices, cells)


def _covered(cells: NDArray[np.bool_], u0: int, v0: int, u1: int, v1: int) -> int:
    """The set cells in a rectangle, as bits of a number."""
    places = list(zip(*np.nonzero(cells), strict=True))
    return sum(1 << k for k, (v, u) in enumerate(places) if v0 <= v < v1 and u0 <= u < u1)


def _offer(prices: dict[int, int], covered: int, price: int) -> None:
    if covered:
        prices[covered] = min(price, prices.get(covered, price))


def _least(prices: dict[int, int], cells: NDArray[np.bool_]) -> int:
    """Price of the cheapest set cover: the first cell left is covered by one rectangle or another."""

    @functools.cache
    def least(left: int) -> int:
        if not left:
            return 0
        first = left & -left
        return min(price + least(left & ~covered) for covered, price in prices.items() if covered & first)

    return least((1 << int(np.count_nonzero(cells))) - 1)


def _ratios(ratios: list[float]) -> dict[str, Any]:
    return {
        "cases": len(ratios),
        "optimal": float(np.mean(np.array(ratios) == 1.0)),
        "mean": float(np.mean(ratios)),
        "worst": float(np.max(ratios)),
    }
