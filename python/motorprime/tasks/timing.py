"""Where the time of a cycle goes."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable

Clock = Callable[[], float]


class Stages:
    """Collects durations [s] by stage; ``clock`` returns seconds."""

    def __init__(self, clock: Clock = time.perf_counter) -> None:
        self._clock = clock
        self.seconds: dict[str, list[float]] = defaultdict(list)

    def time(self, stage: str) -> Timed:
        """Time the block as one more run of ``stage``."""
        return Timed(self._clock, self.seconds[stage])


class Timed:
    """A block whose duration is noted, however it ends; cheaper than a generator."""

    __slots__ = ("_clock", "_seconds", "_start")

    def __init__(self, clock: Clock, seconds: list[float]) -> None:
        self._clock, self._seconds = clock, seconds

    def __enter__(self) -> None:
        self._start = self._clock()

    def __exit__(self, *_: object) -> None:
        self._seconds.append(self._clock() - self._start)
