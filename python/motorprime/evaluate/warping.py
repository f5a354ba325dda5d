"""Dynamic time warping: how far apart two paths are when each may run at its own pace."""

from __future__ import annotations

import numpy as np

from .._arrays import Floats
from ..errors import ArgumentError


def warped_distance(first: Floats, second: Floats) -> float:
    """Least sum of distances over all monotone alignments of paths (N, d) and (M, d), without a window."""
    if not len(first) or not len(second):
        raise ArgumentError(f"paths: expected points, got {len(first)} and {len(second)}")
    return float(_diagonals(first, second)[-1][-1])


def aligned_distance(first: Floats, second: Floats) -> float:
    """Mean distance of the pairs that the best alignment of :func:`warped_distance` makes."""
    totals = _table(first, second)
    i, j = len(first) - 1, len(second) - 1
    pairs = 1
    while i or j:
        steps = [(i - 1, j - 1), (i - 1, j), (i, j - 1)]
        i, j = min((s for s in steps if min(s) >= 0), key=lambda s: float(totals[s]))
        pairs += 1
    return float(totals[-1, -1]) / pairs


def _table(first: Floats, second: Floats) -> Floats:
    """Least cost (N, M) of aligning the paths up to each pair."""
    totals = np.full((len(first), len(second)), np.inf)
    for s, diagonal in enumerate(_diagonals(first, second)):
        rows = np.arange(max(0, s - len(second) + 1), min(len(first), s + 1))
        totals[rows, s - rows] = diagonal
    return totals


def _diagonals(first: Floats, second: Floats) -> list[Floats]:
    """The cost table along its anti-diagonals i + j = s, on which no entry depends on another."""
    n, m = len(first), len(second)
    costs = np.linalg.norm(first[:, None] - second[None], axis=2)
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)  # entry i + 1 is row i
    before[0] = 0.0
    found = []
    for s in range(n + m - 1):
        low, high = max(0, s - m + 1), min(n, s + 1)
        rows = np.arange(low, high)
        now = np.full(n + 1, np.inf)
        cheapest = np.minimum(np.minimum(last[low + 1 : high + 1], last[low:high]), before[low:high])
        now[low + 1 : high + 1] = costs[rows, s - rows] + cheapest
        found.append(now[low + 1 : high + 1])
        before, last = last, now
    return found
