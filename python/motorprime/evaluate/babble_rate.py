"""Samples a second with one and with two workers, side by side."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import integer
from ..learning.babbling import babble
from ..learning.store import Store
from ..robot import Robot
from ..tasks.babble import GazeBabble
from ..tasks.studio import close_studio
from .common import Progress

ROUNDS = 5
CHUNK = 20  # small, so that no worker waits long for the other at the end


def two_worker_ratio(
    robot: Robot,
    seed: int = 0,
    samples: int = 300,
    *,
    rounds: int = ROUNDS,
    progress: Progress | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, Any]:
    """Babble ``samples`` samples into a new store, by one worker and by two in turns, ``rounds`` times each.

    Simulators and worker processes are warm before the first round. One worker is this process itself, two
    are two others, and this one writes their parts.

    Returns:
        samples, rounds, one_worker_per_s and two_workers_per_s (medians), ratio (median over the rounds) and
        ratios of all rounds.
    """
    integer("samples", samples, at_least=1), integer("rounds", rounds, at_least=1)
    source = GazeBabble(robot)
    manifest = replace(source.manifest(seed), chunk=CHUNK)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:

        def measure(name: str, count: int, workers: int) -> float:
            store = Store.create(Path(folder) / name, manifest)
            start = clock()
            babble(store, source, count, workers=workers)
            return clock() - start

        for workers in (1, 2):
            measure(f"warm-{workers}", max(samples, 4 * CHUNK), workers)  # enough for both to get some
        for k in (progress or Progress()).over(range(rounds), "babbling"):
            for workers in (1, 2) if k % 2 else (2, 1):
                seconds[workers].append(measure(f"{k}-{workers}", samples, workers))
    close_studio()
    ratios = np.divide(seconds[1], seconds[2])
    return {
        "seed": seed,
        "samples": samples,
        "rounds": rounds,
        "one_worker_per_s": float(samples / np.median(seconds[1])),
        "two_workers_per_s": float(samples / np.median(seconds[2])),
        "ratio": float(np.median(ratios)),
        "ratios": ratios.tolist(),
    }
