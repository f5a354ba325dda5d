"""Samplers in NumPy. They take the uniform numbers as an argument, so that a kernel's own can be given."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...landscape import sample
from ..scene import Floats, Floats32

Samples = npt.NDArray[np.int32]
MASK = 2**64 - 1


def uniforms(seed: int) -> Iterator[float]:
    """The numbers in [0, 1) that a kernel draws from a seed: xoshiro256++ filled by splitmix64."""
    s = []
    for _ in range(4):
        seed = (seed + 0x9E3779B97F4A7C15) & MASK
        z = ((seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        s.append(z ^ (z >> 31))
    while True:
        number = (_rotate((s[0] + s[3]) & MASK, 23) + s[0]) & MASK
        shifted = (s[1] << 17) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = _rotate(s[3], 45)
        yield (number >> 11) * 2.0**-53


def first_uniforms(seed: int, count: int) -> list[float]:
    """The first ``count`` of :func:`uniforms`."""
    return list(itertools.islice(uniforms(seed), count))


def chain_uniforms(landscape: Floats32, seed: int, n: int) -> list[float]:
    """The numbers with which :func:`gibbs` repeats the kernel's chain of ``n`` sweeps from a seed.

    The kernel starts at a pixel drawn by an order of its own and goes on from its row. The first number is
    therefore replaced by one that makes a draw by sums of rows begin in that row.
    """
    numbers = first_uniforms(seed, 2 * n + 1)
    v = int(sample(landscape, 1, seed=seed)[0, 1])
    ends = np.cumsum(_row_sums(landscape), dtype=np.float64)
    start = ends[v - 1] if v else 0.0
    numbers[0] = float((start + ends[v]) / 2 / ends[-1])
    return numbers


def _rotate(x: int, k: int) -> int:
    return ((x << k) | (x >> (64 - k))) & MASK


def gibbs(landscape: Floats32, n: int, x: Sequence[float]) -> Samples:
    """The kernel's chain from ``2 n + 1`` uniform numbers: tables only of the lines it comes by."""
    accumulate = np.add.accumulate
    rows: dict[int, npt.NDArray[Any]] = {}
    columns: dict[int, npt.NDArray[Any]] = {}
    masses = np.cumsum(_row_sums(landscape), dtype=np.float64)
    v = int(masses.searchsorted(x[0] * masses[-1], "right"))
    chain = []
    for k in range(1, 2 * n, 2):
        row = rows.get(v)
        if row is None:
            row = rows[v] = accumulate(landscape[v], dtype=np.float64)
        u = int(row.searchsorted(x[k] * row[-1], "right"))
        column = columns.get(u)
        if column is None:
            column = columns[u] = accumulate(landscape[:, u], dtype=np.float64)
        v = int(column.searchsorted(x[k + 1] * column[-1], "right"))
        chain.append((u, v))
    return np.array(chain, dtype=np.int32)


def gibbs_all_tables(landscape: Floats32, n: int, x: Sequence[float]) -> Samples:
    """The same chain with the tables of all lines made at once."""
    rows = np.cumsum(landscape, axis=1, dtype=np.float64)
    columns = np.cumsum(landscape, axis=0, dtype=np.float64)
    masses = np.cumsum(rows[:, -1], dtype=np.float64)
    v = int(masses.searchsorted(x[0] * masses[-1], "right"))
    chain = []
    for k in range(1, 2 * n, 2):
        row = rows[v]
        u = int(row.searchsorted(x[k] * row[-1], "right"))
        column = columns[:, u]
        v = int(column.searchsorted(x[k + 1] * column[-1], "right"))
        chain.append((u, v))
    return np.array(chain, dtype=np.int32)


def by_rows(landscape: Floats32, x: Floats) -> Samples:
    """Independent samples from (2, n) uniform numbers: rows by their sums, then a place in each row.

    The rows that were drawn are summed up in one go, one behind the other, and searched in one go.
    """
    masses = np.cumsum(_row_sums(landscape), dtype=np.float64)
    v = masses.searchsorted(x[0] * masses[-1], "right")
    width = landscape.shape[1]
    cumulative = np.add.accumulate(landscape.take(v, axis=0).reshape(-1), dtype=np.float64)
    ends = cumulative[width - 1 :: width]
    starts = np.concatenate(([0.0], ends[:-1]))
    places = cumulative.searchsorted(starts + x[1] * (ends - starts), "right")
    samples = np.empty((len(v), 2), np.int32)
    samples[:, 0], samples[:, 1] = places - np.arange(0, len(places) * width, width), v
    return samples


def by_rows_compared(landscape: Floats32, x: Floats) -> Samples:
    """The same, the place in each row found by comparing instead of searching."""
    masses = np.cumsum(_row_sums(landscape), dtype=np.float64)
    v = masses.searchsorted(x[0] * masses[-1], "right")
    cumulative = np.add.accumulate(landscape.take(v, axis=0), axis=1)
    wanted = (x[1] * cumulative[:, -1]).astype(np.float32)[:, None]
    samples = np.empty((len(v), 2), np.int32)
    samples[:, 0], samples[:, 1] = (cumulative > wanted).argmax(axis=1), v
    return samples


def flat(landscape: Floats32, x: Floats) -> Samples:
    """Independent samples from (n,) uniform numbers by one table of all pixels."""
    cumulative = np.add.accumulate(landscape.reshape(-1), dtype=np.float64)
    places = cumulative.searchsorted(x * cumulative[-1], "right")
    samples = np.empty((len(x), 2), np.int32)
    samples[:, 1], samples[:, 0] = np.divmod(places, landscape.shape[1])
    return samples


def choice(landscape: Floats32, n: int, generator: np.random.Generator) -> Samples:
    """Independent samples by ``Generator.choice``."""
    p = landscape.reshape(-1).astype(np.float64)
    p /= p.sum()
    places = generator.choice(p.size, n, p=p)
    samples = np.empty((n, 2), np.int32)
    samples[:, 1], samples[:, 0] = np.divmod(places, landscape.shape[1])
    return samples


_ONES: dict[int, Floats32] = {}


def _row_sums(landscape: Floats32) -> Floats32:
    """A product with ones is NumPy's fastest sum of rows."""
    width = landscape.shape[1]
    ones = _ONES.get(width)
    if ones is None:
        ones = _ONES[width] = np.ones(width, np.float32)
    sums: Floats32 = landscape @ ones
    return sums
