"""What evaluations that run whole trials in several processes share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from .. import shipped
from ..learning.workers import run
from ..peripersonal import ReachCloud
from ..robot import Robot
from ..tasks.cycle import Settings
from ..tasks.pick_trial import PickTrial
from .common import Progress

Asked = TypeVar("Asked")
Result = TypeVar("Result")


def each(
    work: Callable[[Asked], Result], asked: Sequence[Asked], what: str, progress: Progress, *, workers: int
) -> Iterator[tuple[Asked, Result]]:
    """What ``work`` makes of each that is asked for, as they come, with a bar."""
    return progress.over(_Sized(run(work, asked, workers=workers), len(asked)), what)


def cloud_of(robot: Robot) -> ReachCloud:
    """The reachable space, drawn once in each process."""
    if robot.urdf not in _CLOUDS:
        _CLOUDS[robot.urdf] = ReachCloud(robot)
    return _CLOUDS[robot.urdf]


def reach_of(robot: Robot, seed: int, number: int, *, obstacle: bool) -> PickTrial:
    """One scene of a series in which the robot sets out for the glass, by what its eyes see alone."""
    return PickTrial(
        robot,
        [seed, number],
        shipped.coupled_dynamics(),
        obstacle=obstacle,
        settings=Settings(compare=False),
        cloud=cloud_of(robot),
    )


_CLOUDS: dict[Any, ReachCloud] = {}


class _Sized:
    """An iterator whose length is known, for the progress bar."""

    def __init__(self, items: Iterator[Any], count: int) -> None:
        self._items, self._count = items, count

    def __iter__(self) -> Iterator[Any]:
        return self._items

    def __len__(self) -> int:
        return self._count
