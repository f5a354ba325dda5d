"""Where the time of a cycle goes."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Clock = Callable[[], float]


class Stages:
    """Collects durations [s] by stage; ``clock`` returns seconds."""

    def __init__(self, clock: Clock = time.perf_counter) -> None:
        self._clock = clock
        self.seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Time the block as one more run of ``stage``."""
        start = self._clock()
        try:
            yield
        finally:
            self.seconds[stage].append(self._clock() - start)
