"""Times of several functions, taken in turn so that a slow phase of the machine hits all of them alike."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Call = Callable[[], Any]
Clock = Callable[[], int]


@dataclass(frozen=True)
class Effort:
    """How often everything is repeated.

    Args:
        rounds: Times that the turn comes to every function.
        batch_us: What one turn of a function should last [us].
        least: Fewest timed calls of a turn.
        most: Most timed calls of a turn.
    """

    rounds: int = 120
    batch_us: float = 1500.0
    least: int = 3
    most: int = 60


FULL = Effort()
LARGE = Effort(rounds=40, batch_us=6000.0, least=3, most=20)
QUICK = Effort(rounds=3, batch_us=100.0, least=2, most=4)


@dataclass(frozen=True)
class Times:
    """Times of single calls [us], a row for every round."""

    us: npt.NDArray[np.float64]

    @property
    def median(self) -> float:
        """Median of all calls [us]."""
        return float(np.median(self.us))

    @property
    def quartiles(self) -> tuple[float, float]:
        """First and third quartile of all calls [us]."""
        q1, q3 = np.percentile(self.us, (25, 75))
        return float(q1), float(q3)

    def over(self, other: Times) -> float:
        """How many times longer than ``other``: the median over the rounds of the ratio of their medians."""
        return float(np.median(np.median(self.us, axis=1) / np.median(other.us, axis=1)))


def interleave(
    calls: Mapping[str, Call], effort: Effort, clock: Clock = time.perf_counter_ns
) -> dict[str, Times]:
    """Time every function in every round, each round in another order.

    A turn begins with an untimed call, which brings the function's data back into the caches; then every call
    is timed by itself. Garbage is not collected meanwhile.
    """
    names = list(calls)
    counts = {name: _count(call, effort, clock) for name, call in calls.items()}
    rounds: dict[str, list[list[int]]] = {name: [] for name in names}
    with _no_garbage_collection():
        for number in range(effort.rounds):
            turn = number % len(names)
            for name in names[turn:] + names[:turn]:
                rounds[name].append(_turn(calls[name], counts[name], clock))
    return {name: Times(np.array(rounds[name], dtype=np.float64) / 1e3) for name in names}


def _turn(call: Call, count: int, clock: Clock) -> list[int]:
    call()
    times = []
    for _ in range(count):
        start = clock()
        call()
        times.append(clock() - start)
    return times


def _count(call: Call, effort: Effort, clock: Clock) -> int:
    """Calls that fill a turn, from the quickest of a few."""
    quickest = max(min(_turn(call, 3, clock)) / 1e3, 1e-3)
    return int(np.clip(effort.batch_us / quickest, effort.least, effort.most))


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
