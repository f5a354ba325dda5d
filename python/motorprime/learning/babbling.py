"""Motor babbling: fill a store with samples, each of which depends on the seed and its number only."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, integer
from ..errors import ArgumentError
from ..robot import Robot
from .manifest import INDEX, NUMBER, POINT, Manifest, robot_fingerprint
from .store import Columns, Piece, Store
from .workers import run

Sample: TypeAlias = Callable[[int, int], Mapping[str, Any]]
"""sample(seed, i) -> {column: number or word}, picklable."""


class Source(Protocol):
    """Something that can babble."""

    def manifest(self, seed: int) -> Manifest:
        """What its samples are."""
        ...

    def __call__(self, seed: int, i: int) -> Mapping[str, Any]:
        """Sample ``i``, drawn by ``default_rng([seed, i])``: {column: value}."""
        ...


def babble(
    store: Store,
    sample: Sample,
    count: int,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Compute those of the samples 0 .. count - 1 that the store does not hold yet, and write them.

    Args:
        store: of this sample's kind, see :meth:`Store.create`.
        sample: gives a sample; picklable if it runs in other processes.
        count: how many samples the store is to hold; fewer than it holds already changes nothing.
        workers: processes; see :func:`motorprime.learning.workers.run`.
        scheduler: address of a Dask scheduler.
        progress: called with the number of samples that are on disk, first before anything is computed.

    Returns:
        How many samples were computed.

    Raises:
        ArgumentError: a sample has other columns than the manifest says, or NaN where a number is due.
        StateError: another process is writing there, the disk is full, a part is damaged, or workers died.
            Whatever was written before is kept, and the same call goes on from there.
    """
    count = integer("count", count, at_least=1)
    with store.writing():
        pieces = store.missing(count)
        missing = sum(piece.stop - piece.start for piece in pieces)
        done = count - missing
        if progress is not None:
            progress(done)
        job = _Job(sample, store.manifest.seed)
        with closing(run(job, pieces, workers=workers, scheduler=scheduler)) as results:
            for piece, columns in results:
                store.write(piece.part, columns)
                done += piece.stop - piece.start
                if progress is not None:
                    progress(done)
    return missing


@dataclass(frozen=True)
class _Job:
    """Compute the samples of a piece."""

    sample: Sample
    seed: int

    def __call__(self, piece: Piece) -> Columns:
        index = range(piece.start, piece.stop)
        rows = [self.sample(self.seed, i) for i in index]
        names = list(rows[0])
        for i, row in zip(index, rows, strict=True):
            if list(row) != names:
                raise ArgumentError(f"sample: columns {names} as before expected, got {list(row)} in {i}")
        return {INDEX: np.array(index)} | {name: np.array([row[name] for row in rows]) for name in names}


@dataclass(frozen=True)
class ArmBabble:
    """Random arm postures and the palm's place in the chest's frame: the reachable space (section III-B1).

    Columns: the arm's joints [rad], and x, y, z [m] by the robot's own kinematics.
    """

    robot: Robot

    def manifest(self, seed: int) -> Manifest:
        """What its samples are."""
        robot = self.robot
        return Manifest(
            kind="arm",
            mode="uniform",
            robot=robot.name,
            fingerprint=robot_fingerprint(robot),
            seed=seed,
            joints=robot.arm,
            cameras=(),
            columns=dict.fromkeys((*robot.arm, *POINT), NUMBER),
        )

    def __call__(self, seed: int, i: int) -> dict[str, Any]:
        """One posture."""
        limits = self.robot.limits(self.robot.arm)
        joints = np.random.default_rng([seed, i]).uniform(limits[:, 0], limits[:, 1])
        palm = self.robot.arm_chain.forward(joints) @ self.robot.palm.frame
        return named(self.robot.arm, joints) | named(POINT, palm[:3, 3])


def named(names: tuple[str, ...], values: Floats | npt.NDArray[Any]) -> dict[str, float]:
    """{name: value} of a row of numbers."""
    return dict(zip(names, (float(value) for value in values), strict=True))
