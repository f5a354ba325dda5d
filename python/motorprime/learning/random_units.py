"""A network from few samples: random hidden units, of which only the output weights are learned.

Training all weights by fifty samples ends wherever the start leads it. With the hidden layer drawn and kept,
the output weights are a ridge regression, and the error on a sample that was left out follows without
leaving it out, so what cannot be known beforehand is chosen by all samples. With units H (N, K), centred,
outputs y, centred, and the singular values H = U S V^T::

    W = V (S / (S^2 + r)) U^T y,   h_i = 1 / N + sum_k U_ik^2 s_k^2 / (s_k^2 + r)

and the error on sample i by a network that has not seen it is (y_i - H_i W) / (1 - h_i) (Allen, 1974).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator
from ..errors import ArgumentError
from .network import Network, data

UNITS = 200
GAINS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Lengths of the units' weights: the smaller, the nearer the network is to a polynomial of low degree."""
RIDGES = tuple(float(10.0**k) for k in range(-8, 1))


def fit_random_units(
    x: npt.ArrayLike, y: npt.ArrayLike, seed: int | np.random.Generator | None = None, *, units: int = UNITS
) -> tuple[Network, Floats]:
    """Fit a network with one hidden layer of random units.

    Args:
        x: (N, in).
        y: (N, out).
        seed: draws the hidden layer.
        units: in it.

    Returns:
        The network, and for each sample (N,) the length of the error of one that has not seen it.

    Raises:
        ArgumentError: NaN, shapes that do not fit, fewer than two samples, inputs that never change.
    """
    x, y = np.asarray(x), np.asarray(y)
    if x.ndim != 2 or y.ndim != 2:
        raise ArgumentError(f"x, y: (N, in) and (N, out) expected, got {x.shape} and {y.shape}")
    x, y = data(x, y, x.shape[1], y.shape[1])
    if len(x) < 2:
        raise ArgumentError(f"x: expected at least two samples, got {len(x)}")
    if not np.ptp(x, axis=0).any():
        raise ArgumentError("x: no input ever changes; there is nothing to learn from")
    rng = generator(seed)
    start = Network.random((x.shape[1], units, y.shape[1]), rng, x, y)
    directions = start.weights[0] / np.linalg.norm(start.weights[0], axis=1, keepdims=True)
    start = replace(start, biases=(rng.uniform(-1.0, 1.0, units), start.biases[1]))
    z, t = (x - start.input_mean) / start.input_std, (y - start.output_mean) / start.output_std
    best: tuple[float, Network, Floats] | None = None
    for gain in GAINS:
        hidden = np.tanh(z @ (gain * directions).T + start.biases[0])
        middle = hidden.mean(axis=0)
        u, s, v = np.linalg.svd(hidden - middle, full_matrices=False)
        for ridge in RIDGES:
            weights = v.T @ ((s / (s * s + ridge))[:, None] * (u.T @ t))
            leverage = 1.0 / len(x) + (u * u) @ (s * s / (s * s + ridge))
            # One sample more than the units can tell apart has a leverage of 1 but for rounding.
            left_out = (t - (hidden - middle) @ weights) / np.maximum(1.0 - leverage, 1e-9)[:, None]
            error = float(np.mean(left_out**2))
            if best is None or error < best[0]:
                fitted = replace(
                    start,
                    weights=(gain * directions, weights.T),
                    biases=(start.biases[0], -middle @ weights),
                )
                best = error, fitted, np.linalg.norm(left_out * start.output_std, axis=1)
    assert best is not None
    return best[1], best[2]
