"""Small networks for what kinematics leave unexplained, learned from so few samples that they may not help.

A network has one hidden layer of random tanh units, and a ridge regression sets its output weights; how much
it looks at and how strongly it is held back is chosen on samples that it has not seen. Where no choice is
better than no network by more than chance, there is none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .._arrays import Floats
from ..learning.network import Network

HIDDEN = 30
RIDGES = (0.3, 3.0, 30.0)
FOLDS = 5
SURE = 3.0
"""A network is taken if it lowers the held-out error by this many standard errors of the mean."""

_SOFT = 2.5  # residuals count less from this many standard deviations on
_PASSES = 3  # of reweighting
_CLIP = 10.0  # held-out errors beyond this many medians count as this many


@dataclass(frozen=True)
class Form:
    """What a network looks at, the first ``inputs`` columns, and how strongly it is held back."""

    inputs: int
    ridge: float


def forms(columns: tuple[int, ...]) -> list[Form]:
    """All that are tried: the first so and so many columns, and each strength."""
    return [Form(inputs, ridge) for inputs in columns for ridge in RIDGES]


def fit_residual(x: Floats, y: Floats, form: Form, seed: int = 0) -> Network:
    """A network from x (N, in) to y (N, 2) [px] that ignores outliers and what its form does not look at.

    With H the hidden units' outputs and a column of ones, and weights W of Cauchy's loss, the output weights
    are (H^T W H + ridge I)^-1 H^T W y; the constant term is not held back.
    """
    small = Network.random((form.inputs, HIDDEN, 2), seed, x[:, : form.inputs], y)
    hidden = np.zeros((HIDDEN, x.shape[1]))
    hidden[:, : form.inputs] = small.weights[0]
    ignored = np.arange(x.shape[1]) >= form.inputs
    network = replace(
        small,
        weights=(hidden, small.weights[1]),
        input_mean=np.where(ignored, 0.0, np.resize(small.input_mean, x.shape[1])),
        input_std=np.where(ignored, 1.0, np.resize(small.input_std, x.shape[1])),
        output_mean=np.zeros(2),
        output_std=np.ones(2),
    )
    units = network.activations((x - network.input_mean) / network.input_std)[1]
    units = np.column_stack([units, np.ones(len(x))])
    held = form.ridge * np.diag([1.0] * HIDDEN + [1e-6])
    weight, solution = np.ones(len(x)), np.zeros((HIDDEN + 1, 2))
    for _ in range(_PASSES):
        weighted = units * weight[:, None]
        solution = np.linalg.solve(weighted.T @ units + held, weighted.T @ y)
        lengths = np.linalg.norm(units @ solution - y, axis=1)
        spread = max(float(np.median(lengths)), 1e-9)
        weight = 1.0 / (1.0 + (lengths / (_SOFT * spread)) ** 2)
    return replace(network, weights=(hidden, solution[:-1].T), biases=(small.biases[0], solution[-1]))


def folds(count: int, seed: int = 0) -> Iterator[npt.NDArray[np.bool_]]:
    """Masks (count,) of the samples held out, each sample once."""
    part = np.random.default_rng(seed).permutation(count) % FOLDS
    for k in range(min(FOLDS, count)):
        yield part == k


def better(without: Floats, with_it: Floats) -> float:
    """By how many standard errors the held-out errors (N,) [px] with a network are smaller than without."""
    if len(without) < FOLDS:
        return -np.inf
    cap = _CLIP * max(float(np.median(without)), 1e-9)
    gain = np.minimum(without, cap) - np.minimum(with_it, cap)
    spread = float(gain.std(ddof=1)) / np.sqrt(len(gain))
    return float(gain.mean()) / spread if spread > 0.0 else float(np.sign(gain.mean()))
