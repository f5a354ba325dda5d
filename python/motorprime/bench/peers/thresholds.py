"""The threshold that leaves a given number of pixels, in NumPy."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from ..scene import Floats32


class Ranked:
    """The value of a rank among the pixels ``landscape[::stride, ::stride]``; buffers are kept.

    Right wherever at least the wanted share of the pixels is positive.
    """

    def __init__(self, shape: tuple[int, int], fraction: float, stride: int = 1) -> None:
        self.stride = stride
        self.copy = np.empty((-(-shape[0] // stride), -(-shape[1] // stride)), np.float32)
        self.flat = self.copy.reshape(-1)
        self.rank = self.flat.size - math.ceil(fraction * self.flat.size - 1e-9)

    def _copied(self, landscape: Floats32) -> Floats32:
        np.copyto(self.copy, landscape[:: self.stride, :: self.stride])
        return self.flat

    def partition(self, landscape: Floats32) -> float:
        """``ndarray.partition`` of a copy."""
        values = self._copied(landscape)
        values.partition(self.rank)
        return float(values[self.rank])

    def sort(self, landscape: Floats32, kind: Literal["quicksort", "stable"]) -> float:
        """``ndarray.sort`` of a copy."""
        values = self._copied(landscape)
        values.sort(kind=kind)
        return float(values[self.rank])

    def positive(self, landscape: Floats32) -> float:
        """``ndarray.partition`` of the positive pixels, which spares it the ties of the zeros."""
        values = landscape[:: self.stride, :: self.stride]
        values = values[values > 0]
        rank = max(values.size - (self.flat.size - self.rank), 0)
        values.partition(rank)
        return float(values[rank])

    def quantile(self, landscape: Floats32) -> float:
        """``np.quantile`` at the rank itself."""
        share = self.rank / (self.flat.size - 1)
        return float(np.quantile(landscape[:: self.stride, :: self.stride], share, method="nearest"))

    def histogram(self, landscape: Floats32) -> float:
        """Selection in two steps: count the upper 16 bits of the numbers, then partition within one bin.

        The bits of floats that are not negative order like the numbers.
        """
        values = self._copied(landscape) if self.stride > 1 else landscape.reshape(-1)
        upper = values.view(np.uint32) >> np.uint32(16)
        below = np.add.accumulate(np.bincount(upper))
        at = int(below.searchsorted(self.rank, "right"))
        rank = self.rank - (int(below[at - 1]) if at else 0)
        bin_values = values[upper == at]
        bin_values.partition(rank)
        return float(bin_values[rank])
