"""Fill a store with plain numbers, slowly: a process to kill. Arguments: folder, count, workers."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motorprime.learning.babbling import babble
from motorprime.learning.manifest import GAP, NUMBER, Manifest
from motorprime.learning.store import Store

MANIFEST = Manifest(
    kind="numbers",
    mode="uniform",
    robot="none",
    fingerprint="0" * 64,
    seed=5,
    joints=("a", "b"),
    cameras=("left",),
    columns={"a": NUMBER, "b": NUMBER, "x": NUMBER, "y": NUMBER, "z": NUMBER, "left_u": GAP, "left_v": GAP},
    settings={"noise": 0.0},
    chunk=7,
)


@dataclass(frozen=True)
class Numbers:
    """Seen by the left camera where the first number is positive."""

    pause: float = 0.0

    def __call__(self, seed, i):
        time.sleep(self.pause)
        values = np.random.default_rng([seed, i]).normal(size=7)
        if values[0] < 0.0:
            values[5:] = np.nan
        return dict(zip(MANIFEST.columns, values.tolist(), strict=True))


def filled(folder, count=20, **options):
    store = Store.create(folder, MANIFEST)
    babble(store, Numbers(), count, **options)
    return store


def contents(folder):
    """Every part's bytes, by name."""
    return {path.name: path.read_bytes() for path in sorted(Path(folder).glob("part-*"))}


def columns(start, stop):
    rows = [Numbers()(5, i) for i in range(start, stop)]
    return {"i": np.arange(start, stop)} | {name: np.array([r[name] for r in rows]) for name in rows[0]}


if __name__ == "__main__":
    folder, count, workers = sys.argv[1:]
    babble(Store.create(folder, MANIFEST), Numbers(0.002), int(count), workers=int(workers))
