"""The unit of the ratios: a copy of a landscape between two warm buffers."""

from __future__ import annotations

import time

import numpy as np

from .scene import Floats32
from .timing import Clock

PLACES = 8
PAGE = 4096


class Copy:
    """Copies a landscape; always between the same buffers, as fast as this machine can do it.

    How fast a copy is hangs on where its buffers lie: on the distance of their addresses modulo a page,
    and on the physical pages that they happen to get. So several pairs are tried, half a page out of step,
    and the fastest is kept. That is the strict choice: a slow copy would flatter every kernel.
    """

    def __init__(self, landscape: Floats32, clock: Clock = time.perf_counter_ns) -> None:
        pairs = [_pair(landscape) for _ in range(PLACES)]
        self.target, self.source = min(pairs, key=lambda pair: _quick(pair[0], pair[1], clock))

    def __call__(self) -> None:
        """Copy once."""
        np.copyto(self.target, self.source)


def _pair(landscape: Floats32) -> tuple[Floats32, Floats32]:
    size = landscape.nbytes
    memory = np.zeros(2 * size + 3 * PAGE, np.uint8)
    first = -memory.ctypes.data % PAGE
    second = first + -(-size // PAGE) * PAGE + PAGE // 2
    target, source = (
        memory[start : start + size].view(np.float32).reshape(landscape.shape) for start in (first, second)
    )
    np.copyto(source, landscape)
    return target, source


def _quick(target: Floats32, source: Floats32, clock: Clock) -> float:
    """Median of some copies."""
    times = []
    for _ in range(25):
        start = clock()
        np.copyto(target, source)
        times.append(clock() - start)
    return float(np.median(times))
