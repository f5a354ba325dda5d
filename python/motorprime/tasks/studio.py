"""One studio a process: opening one takes half a second, so it stays open for the next sample."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ..robot import Robot
from ..sim.ball import BallStudio

_OPEN: dict[tuple[str, float], BallStudio] = {}
_IN_USE = threading.RLock()


@contextmanager
def studio(fingerprint: str, robot: Robot, radius: float) -> Iterator[BallStudio]:
    """The process's studio with this robot and a ball of this radius [m], opened when it is not open yet.

    A cluster's worker may run several threads; the simulator serves one of them at a time.
    """
    with _IN_USE:
        key = fingerprint, radius
        if key not in _OPEN:
            close_studio()
            atexit.register(close_studio)
            _OPEN[key] = BallStudio(robot, radius)
        yield _OPEN[key]


def close_studio() -> None:
    """Close the simulator that this process keeps open between samples, if it does."""
    with _IN_USE:
        while _OPEN:
            _OPEN.popitem()[1].close()
