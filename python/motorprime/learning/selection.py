"""Grid search over architectures: which hidden layers, judged over several random runs (section III-A2).

Every run is kept in a file of its own as soon as it is done, so a search that was stopped goes on where it
was, and any number of processes or machines may share the work: a run depends on its architecture, its
number and the seed only.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Floats, integer
from ..errors import ArgumentError, StateError
from .levenberg_marquardt import check_enough, split, train
from .network import data
from .workers import run

ARCHITECTURES: tuple[tuple[int, ...], ...] = (
    (10,),
    (25,),
    (50,),
    (75,),
    (10, 10),
    (15, 15),
    (20, 20),
    (25, 25),
    (30, 30),
    (15, 15, 15),
)
"""Hidden layers to choose from: ten, the paper's 25-25 among them."""
RUNS = 10
_MANIFEST = "search.json"


@dataclass(frozen=True)
class Candidate:
    """One run of one architecture."""

    hidden: tuple[int, ...]
    number: int

    @property
    def name(self) -> str:
        """As in '25-25-run03'."""
        return f"{dashed(self.hidden)}-run{self.number:02d}"


@dataclass(frozen=True)
class Outcome:
    """What a run gave, judged on its test part.

    Attributes:
        hidden: hidden layers.
        number: of the run.
        weights: parameters of the network.
        mse: mean squared error per output, in squared units of the outputs.
        median: of the errors' lengths.
        p95: 95th percentile of them.
        iterations: of training.
        reason: why training stopped.
    """

    hidden: tuple[int, ...]
    number: int
    weights: int
    mse: float
    median: float
    p95: float
    iterations: int
    reason: str


@dataclass(frozen=True, eq=False)
class Grid:
    """A search: the data and what is tried on them.

    Args:
        x: (N, in).
        y: (N, out).
        seed: run k of every architecture shares the partition drawn from (seed, k).
        architectures: hidden layers to try.
        runs: of each.
        iterations: of training, at most.
    """

    x: Floats
    y: Floats
    seed: int = 0
    architectures: Sequence[tuple[int, ...]] = ARCHITECTURES
    runs: int = RUNS
    iterations: int = 150

    def __post_init__(self) -> None:
        integer("seed", self.seed, at_least=0)
        integer("runs", self.runs, at_least=1)
        integer("iterations", self.iterations, at_least=1)
        if not self.architectures:
            raise ArgumentError("architectures: expected at least one, got none")
        data(self.x, self.y, np.shape(self.x)[-1], np.shape(self.y)[-1])

    def candidates(self) -> list[Candidate]:
        """All runs, the largest networks first: the short ones fill the gaps of parallel work at the end."""
        ordered = sorted(self.architectures, key=lambda hidden: -_weights((1, *hidden, 1)))
        return [Candidate(tuple(hidden), k) for hidden in ordered for k in range(self.runs)]

    def __call__(self, candidate: Candidate) -> Outcome:
        """Train and judge one run."""
        parts = split(len(self.x), np.random.default_rng([self.seed, candidate.number]))
        start = np.random.default_rng([self.seed, candidate.number, *candidate.hidden])
        training = train(
            self.x, self.y, candidate.hidden, seed=start, iterations=self.iterations, parts=parts
        )
        error = training.network.forward(self.x[parts.test]) - self.y[parts.test]
        lengths = np.linalg.norm(error, axis=1)
        return Outcome(
            candidate.hidden,
            candidate.number,
            _weights(training.network.sizes),
            float(np.mean(error**2)),
            float(np.median(lengths)),
            float(np.percentile(lengths, 95)),
            len(training.history) - 1,
            training.reason,
        )

    def describe(self) -> dict[str, Any]:
        """What a search's folder is bound to."""
        digest = hashlib.sha256(np.ascontiguousarray(self.x).tobytes())
        digest.update(np.ascontiguousarray(self.y).tobytes())
        return {"data": digest.hexdigest(), "seed": self.seed, "iterations": self.iterations}


def search(
    grid: Grid, folder: str | Path, *, workers: int = 1, scheduler: str | None = None
) -> Iterator[Outcome]:
    """Yield the outcome of every run, those that the folder holds already first.

    Args:
        grid: what to try.
        folder: keeps the outcomes; made if it is missing.
        workers: processes on this machine.
        scheduler: address of a Dask scheduler instead, see :func:`motorprime.learning.workers.run`.

    Raises:
        ArgumentError: too few samples for one of the architectures, or the folder belongs to a search over
            other data or with another seed.
        StateError: an outcome cannot be written, or a file in the folder was cut off.
    """
    folder = Path(folder)
    for hidden in grid.architectures:
        check_enough(len(grid.x), (grid.x.shape[1], *hidden, grid.y.shape[1]))
    _claim(folder, grid.describe())
    open_runs = []
    for candidate in grid.candidates():
        path = folder / f"{candidate.name}.json"
        if path.exists():
            yield _read(path)
        else:
            open_runs.append(candidate)
    for candidate, outcome in run(grid, open_runs, workers=workers, scheduler=scheduler):
        _write(folder / f"{candidate.name}.json", asdict(outcome))
        yield outcome


def summary(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """One row per architecture, the lowest median test MSE first.

    Keys: hidden, weights, runs, mse (median over the runs), mse_best, median, p95.
    """
    rows = []
    for hidden in dict.fromkeys(outcome.hidden for outcome in outcomes):
        of = [outcome for outcome in outcomes if outcome.hidden == hidden]
        best = min(of, key=lambda outcome: outcome.mse)
        rows.append(
            {
                "hidden": list(hidden),
                "weights": best.weights,
                "runs": len(of),
                "mse": float(np.median([outcome.mse for outcome in of])),
                "mse_best": best.mse,
                "median": float(np.median([outcome.median for outcome in of])),
                "p95": float(np.median([outcome.p95 for outcome in of])),
            }
        )
    return sorted(rows, key=lambda row: float(row["mse"]))


def dashed(hidden: Sequence[int]) -> str:
    """As in '25-25'."""
    return "-".join(str(nodes) for nodes in hidden)


def _weights(sizes: Sequence[int]) -> int:
    return sum((fan_in + 1) * fan_out for fan_in, fan_out in pairwise(sizes))


def _claim(folder: Path, about: dict[str, Any]) -> None:
    """Bind a folder to a search, or make sure that it belongs to it."""
    path = folder / _MANIFEST
    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = path.read_text() if path.exists() else None
    except OSError as error:
        raise ArgumentError(f"folder: cannot use {folder}: {error.strerror}") from None
    if text is None:
        if any(folder.glob("*-run*.json")):
            raise ArgumentError(f"folder: {folder} holds runs, but no {_MANIFEST}; take another one")
        _write(path, about)
        return
    try:
        found = dict(json.loads(text))
    except (ValueError, TypeError):
        raise ArgumentError(f"folder: {path} is not readable; delete the folder or take another") from None
    other = [name for name in about if found.get(name) != about[name]]
    if other:
        raise ArgumentError(
            f"folder: {folder} belongs to a search with other {', '.join(other)}; take another one"
        )


def _read(path: Path) -> Outcome:
    try:
        found = json.loads(path.read_text())
        return Outcome(**{**found, "hidden": tuple(found["hidden"])})
    except (OSError, ValueError, KeyError, TypeError):
        raise StateError(f"folder: {path} was cut off or is no outcome; delete it to run it again") from None


def _write(path: Path, content: dict[str, Any]) -> None:
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(json.dumps(content) + "\n")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise StateError(f"folder: cannot write {path}: {error.strerror}; what is done is kept") from None
