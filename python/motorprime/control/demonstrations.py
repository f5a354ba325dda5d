"""Movements that somebody has shown: states over time, checked, and read from tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, fixed, integer, numbers, positive
from ..errors import ArgumentError
from ..recordings.table import read_columns
from .mixture import frozen

LONGEST = 3.0
"""No arm moves farther than this [m] in one go: beyond it the numbers are taken for another unit."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One movement: N >= 3 states of dimension d over time. Arrays are copied and read-only.

    Args:
        times: (N,) [s], strictly increasing.
        states: (N, d).
        velocities: (N, d) per second; when not given, central differences of the states.

    Raises:
        ArgumentError: a shape is wrong, a number is not finite, time stands still or runs backwards, or
            there are fewer than three samples.
    """

    times: Floats
    states: Floats
    velocities: Floats | None = None

    def __post_init__(self) -> None:
        states = numbers("states", self.states)
        if states.ndim != 2 or not states.shape[1]:
            raise ArgumentError(f"states: expected shape (N, d), got {states.shape}")
        if len(states) < 3:
            raise ArgumentError(f"states: expected at least 3 samples of a movement, got {len(states)}")
        finite("states", states)
        times = fixed("times", self.times, (len(states),))
        late = np.flatnonzero(np.diff(times) <= 0.0)
        if len(late):
            k = int(late[0])
            raise ArgumentError(
                f"times: expected to increase, got {times[k]:.6g} s at [{k}] and {times[k + 1]:.6g} s next"
            )
        if self.velocities is None:
            velocities = np.gradient(states, times, axis=0)
        else:
            velocities = fixed("velocities", self.velocities, states.shape)
        for name, value in (("times", times), ("states", states), ("velocities", velocities)):
            object.__setattr__(self, name, frozen(value))

    def __len__(self) -> int:
        return len(self.times)

    @property
    def speeds(self) -> Floats:
        """The velocities (N, d), never None."""
        assert self.velocities is not None  # set when it was made
        return self.velocities

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])

    def every(self, count: int) -> Demonstration:
        """Each ``count``-th sample, with the velocities they had."""
        count = integer("count", count, at_least=1)
        return Demonstration(self.times[::count], self.states[::count], self.speeds[::count])

    def relative_to(self, goal: npt.ArrayLike | None = None) -> Demonstration:
        """The same with the goal (d,) at zero; by default the last state is the goal."""
        end = self.states[-1] if goal is None else fixed("goal", goal, self.states.shape[1:])
        return Demonstration(self.times, self.states - end, self.speeds)


def read_demonstrations(path: str | Path, *, longest: float = LONGEST) -> list[Demonstration]:
    """Read movements of a point from a table.

    A CSV file (commas, semicolons or tabs) whose first row names the columns, or a NumPy file (.npy) of a
    structured array: ``time`` [s], one column for each coordinate [m], and ``demonstration``, a number that
    tells the movements apart, unless there is only one::

        demonstration,time,x,y,z
        1,0.00,0.312,-0.050,0.120

    Args:
        path: the file.
        longest: a movement that spans more than this [m] in a coordinate is taken for one in another unit.

    Raises:
        ArgumentError: no such file, a column or value is missing, time runs backwards, a movement has fewer
            than three samples, or spans more than ``longest``; the message names the movement.
    """
    path, longest = Path(path), positive("longest", longest)
    names, cells = read_columns(path)
    if "time" not in names:
        raise ArgumentError(f"path: {path} has no column 'time'; its columns are {', '.join(names)}")
    coordinates = [k for k, name in enumerate(names) if name not in ("time", "demonstration")]
    if not coordinates:
        raise ArgumentError(f"path: {path} has no coordinate beside {', '.join(names)}")
    empty = np.argwhere(np.isnan(cells))
    if len(empty):
        row, column = empty[0]
        raise ArgumentError(f"path: {path}, data row {row + 1}: '{names[column]}' has no value")
    labels = cells[:, names.index("demonstration")] if "demonstration" in names else np.zeros(len(cells))
    shown = []
    for label in dict.fromkeys(labels.tolist()):
        part = cells[labels == label]
        where = f"path: {path}, demonstration {label:g}" if "demonstration" in names else f"path: {path}"
        try:
            one = Demonstration(part[:, names.index("time")], part[:, coordinates])
            check_extent(one.states, longest)
        except ArgumentError as error:
            raise ArgumentError(f"{where}: {error}") from None
        shown.append(one)
    return shown


def check_extent(places: Floats, longest: float = LONGEST) -> None:
    """Refuse places (N, d) that lie farther apart than a movement can be [m]: they are in another unit.

    Raises:
        ArgumentError: they do.
    """
    extent = float(np.ptp(places, axis=0).max())
    if extent > longest:
        raise ArgumentError(
            f"states: a movement of {extent:.6g} m; at most {longest:g} m expected. Are these millimetres?"
        )


def stacked(demonstrations: Sequence[Demonstration]) -> tuple[Floats, Floats]:
    """States and velocities (N, d) of all movements.

    Raises:
        ArgumentError: there are none, or they differ in dimension.
    """
    if not len(demonstrations):
        raise ArgumentError("demonstrations: expected at least one, got none")
    sizes = sorted({one.states.shape[1] for one in demonstrations})
    if len(sizes) > 1:
        raise ArgumentError(f"demonstrations: expected one dimension, got {sizes}")
    states: Floats = np.concatenate([one.states for one in demonstrations])
    return states, np.concatenate([one.speeds for one in demonstrations])
