"""Is a peer exact? Whatever does not give the kernel's result is no peer, and ends the bench."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import StateError
from .scene import Floats, Floats32

CLOSE = 1e-4
"""Largest difference from the kernel's result, as a share of its largest number."""
SAME_CHAINS = 0.9
"""Least share of chains that are the same to the last sample; a rounding decides a draw now and then."""
SIGMAS = 5.0
BLOCKS = 12


class InexactPeerError(StateError):
    """A peer does not give the result of the kernel it is measured beside."""

    def __init__(self, kernel: str, peer: str, what: str) -> None:
        super().__init__(f"{kernel}: peer '{peer}' is not exact: {what}")


def close(truth: Floats32, found: Any) -> str:
    """What is wrong with an array of numbers; nothing if all are within 1e-4 of the largest."""
    found = np.asarray(found)
    if found.shape != truth.shape:
        return f"shape {found.shape} instead of {truth.shape}"
    scale = float(np.abs(truth).max())
    worst = float(np.abs(found.astype(np.float64) - truth).max()) / scale
    if worst <= CLOSE:  # false for NaN
        return ""
    return f"differs by {worst:.2g} of the largest number, {CLOSE:g} is allowed"


def same(truth: float, found: Any) -> str:
    """What is wrong with a number that must be the same to the last bit."""
    return "" if float(found) == truth else f"{float(found):.9g} instead of {truth:.9g}"


def same_chains(truth: Sequence[Any], found: Sequence[Any]) -> str:
    """What is wrong with chains that were given the kernel's own uniform numbers."""
    if len(truth) != len(found):
        return f"{len(found)} chains instead of {len(truth)}"
    alike = sum(np.array_equal(a, b) for a, b in zip(truth, found, strict=True))
    if alike >= SAME_CHAINS * len(truth):
        return ""
    return f"only {alike} of {len(truth)} chains are those of the kernel, given its uniform numbers"


def same_looks(truth: Any, found: Any) -> str:
    """What is wrong with (landscapes, chains) of a step."""
    for eye, (expected, landscape) in enumerate(zip(truth[0], found[0], strict=True)):
        if wrong := close(expected, landscape):
            return f"landscape of eye {eye} {wrong}"
    return same_chains(truth[1], found[1])


def distributed(landscape: Floats32, samples: Any) -> str:
    """What is wrong with independent samples: chi-square over blocks of the image against their mass."""
    samples = np.asarray(samples)
    height, width = landscape.shape
    if samples.ndim != 2 or samples.shape[1] != 2:
        return f"shape {samples.shape} instead of (n, 2)"
    u, v = samples.T
    if u.min() < 0 or v.min() < 0 or u.max() >= width or v.max() >= height:
        return "a sample lies outside the image"
    if not (landscape[v, u] > 0).all():
        return "a sample lies where the landscape is 0"
    rows, columns = np.arange(height) * BLOCKS // height, np.arange(width) * BLOCKS // width
    expected = _sums(landscape.astype(np.float64), rows, columns)
    expected *= len(samples) / expected.sum()
    seen = np.bincount(rows[v] * BLOCKS + columns[u], minlength=BLOCKS**2)
    often = expected >= 5.0
    if (~often).any():  # what is rare counts together
        expected = np.append(expected[often], expected[~often].sum())
        seen = np.append(seen[often], seen[~often].sum())
    square = float(((seen - expected) ** 2 / np.maximum(expected, 1e-9)).sum())
    degrees = len(expected) - 1
    spread = 2.0 / (9.0 * degrees)
    bound = degrees * (1.0 - spread + SIGMAS * spread**0.5) ** 3  # Wilson and Hilferty
    if square <= bound:
        return ""
    return f"samples do not follow the landscape: chi-square {square:.0f}, at most {bound:.0f} by chance"


def _sums(landscape: Floats, rows: Any, columns: Any) -> Floats:
    """Mass of every block, row by row."""
    sums = np.zeros((BLOCKS, BLOCKS))
    np.add.at(sums, (rows[:, None], columns[None, :]), landscape)
    return sums.reshape(-1)
