"""Levenberg-Marquardt training of small tanh networks, with early stopping (section III-A2).

With residuals r of the normalised outputs and their Jacobian J by the weights, a step solves::

    (J^T J / N + mu I) s = -J^T r / N

mu falls tenfold after a step that lowers the training error and rises tenfold after one that does not
(Hagan and Menhaj, 1994). The gradient is in double precision and so is the optimum; J^T J, which only shapes
the steps and costs nearly all the time, is summed over blocks in single precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator, integer
from ..errors import ArgumentError
from .network import Network, data

SHARES = (0.70, 0.15, 0.15)
"""Training, validation and test parts of the data."""
MU, MU_MIN, MU_MAX = 1e-2, 1e-12, 1e10
PATIENCE = 15
"""Iterations without a lower validation error before training stops."""
_BLOCK = 512  # samples whose Jacobian is held at a time


@dataclass(frozen=True, eq=False)
class Split:
    """Indices of the training, validation and test parts."""

    train: npt.NDArray[np.intp]
    validation: npt.NDArray[np.intp]
    test: npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Training:
    """A trained network and how it came about.

    Attributes:
        network: with the weights of the lowest validation error.
        split: of the data.
        history: (iterations + 1, 2) mean squared training and validation error of the normalised outputs.
        best: iteration of the lowest validation error.
        reason: why it stopped: 'iterations', 'validation' or 'converged'.
        restart: which of the random starts won.
    """

    network: Network
    split: Split
    history: Floats
    best: int
    reason: str
    restart: int = 0


def split(count: int, seed: int | np.random.Generator | None) -> Split:
    """A random partition of ``count`` samples by :data:`SHARES`.

    Raises:
        ArgumentError: a part would be empty.
    """
    count = integer("count", count, at_least=0)
    train, validation = round(SHARES[0] * count), round(SHARES[1] * count)
    if min(train, validation, count - train - validation) < 1:
        raise ArgumentError(f"samples: {count} are too few to train, validate and test; 7 or more are needed")
    order = generator(seed).permutation(count)
    return Split(order[:train], order[train : train + validation], order[train + validation :])


def train(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    hidden: tuple[int, ...] = (25, 25),
    *,
    seed: int | np.random.Generator | None = None,
    restarts: int = 1,
    iterations: int = 150,
    patience: int = PATIENCE,
    parts: Split | None = None,
    watch: Callable[[int, Floats], None] | None = None,
) -> Training:
    """Train a network from inputs (N, in) to outputs (N, out).

    Args:
        x: (N, in).
        y: (N, out).
        hidden: nodes of the hidden layers.
        seed: draws the partition, then the starts.
        restarts: random starts; the one with the lowest validation error wins.
        iterations: at most, for each start.
        patience: iterations without a lower validation error before it stops.
        parts: the partition, instead of drawing one.
        watch: called after each iteration with its number and the (2,) mean squared errors.

    Raises:
        ArgumentError: NaN, shapes that do not fit, inputs that never change, or fewer training samples than
            half the weights; the message says how many are needed.
    """
    x, y = (np.asarray(value) for value in (x, y))
    if x.ndim != 2 or y.ndim != 2:
        raise ArgumentError(f"x, y: (N, in) and (N, out) expected, got {x.shape} and {y.shape}")
    x, y = data(x, y, x.shape[1], y.shape[1])
    restarts = integer("restarts", restarts, at_least=1)
    rng = generator(seed)
    parts = split(len(x), rng) if parts is None else parts
    sizes = (x.shape[1], *hidden, y.shape[1])
    if not np.ptp(x, axis=0).any():
        raise ArgumentError("x: no input ever changes; there is nothing to learn from")
    check_enough(len(x), sizes)
    best: Training | None = None
    for restart in range(restarts):
        start = Network.random(sizes, rng, x[parts.train], y[parts.train])
        result = fit(start, x, y, parts, iterations=iterations, patience=patience, watch=watch)
        if best is None or result.history[result.best, 1] < best.history[best.best, 1]:
            best = Training(
                result.network, parts, result.history, result.best, result.reason, restart=restart
            )
    assert best is not None
    return best


def fit(
    start: Network,
    x: Floats,
    y: Floats,
    parts: Split,
    *,
    iterations: int = 150,
    patience: int = PATIENCE,
    watch: Callable[[int, Floats], None] | None = None,
) -> Training:
    """Train on from a network that is there; see :func:`train`."""
    z = (x - start.input_mean) / start.input_std
    t = (y - start.output_mean) / start.output_std
    z_train, t_train = z[parts.train], t[parts.train]
    z_held, t_held = z[parts.validation], t[parts.validation]

    def errors(network: Network) -> Floats:
        return np.array([mean_square(network, z_train, t_train), mean_square(network, z_held, t_held)])

    network, mu = start, MU
    history = [errors(network)]
    winner, best, reason = network, 0, "iterations"
    for iteration in range(1, iterations + 1):
        hessian, gradient = normal_equations(network, z_train, t_train)
        improved = False
        while mu <= MU_MAX:
            step = _solve(hessian, gradient, mu)
            if step is not None:
                trial = network.with_parameters(network.parameters - step)
                lower = mean_square(trial, z_train, t_train)
                if lower < history[-1][0]:
                    improved = True
                    break
            mu *= 10.0
        if not improved:
            reason = "converged"
            break
        network, mu = trial, max(mu / 10.0, MU_MIN)
        history.append(np.array([lower, mean_square(network, z_held, t_held)]))
        if watch is not None:
            watch(iteration, history[-1])
        if history[-1][1] < history[best][1]:
            winner, best = network, iteration
        elif iteration - best >= patience:
            reason = "validation"
            break
    return Training(winner, parts, np.array(history), best, reason)


def mean_square(network: Network, z: Floats, t: Floats) -> float:
    """Mean squared error of normalised outputs t (N, out) for normalised inputs z (N, in)."""
    return float(np.mean((network.activations(z)[-1] - t) ** 2))


def normal_equations(network: Network, z: Floats, t: Floats) -> tuple[Floats, Floats]:
    """J^T J / N (P, P) and J^T r / N (P,) of the residuals r = f(z) - t by the P parameters.

    Back-propagation: with d_last = e_o for output o, d_{k-1} = (W_k^T d_k) (1 - z_{k-1}^2); the derivative
    of output o by W_k is d_k z_{k-1}^T, and by b_k is d_k.
    """
    count, parameters = len(z), network.parameters.size
    hessian = np.zeros((parameters, parameters))
    gradient = np.zeros(parameters)
    outputs = t.shape[1]
    room = np.empty((outputs, min(_BLOCK, count), parameters), dtype=np.float32)
    for at in range(0, count, _BLOCK):
        layers = network.activations(z[at : at + _BLOCK])
        residual = layers[-1] - t[at : at + _BLOCK]
        rows = len(residual)
        jacobian = room[:, :rows]
        for output in range(outputs):
            delta = np.zeros((rows, outputs))
            delta[:, output] = 1.0
            _back_propagate(network, layers, delta, jacobian[output])
        flat = jacobian.reshape(-1, parameters)
        hessian += flat.T @ flat
        gradient += _gradient(network, layers, residual)
    return hessian / count, gradient / count


def _back_propagate(
    network: Network, layers: list[Floats], delta: Floats, jacobian: npt.NDArray[np.float32]
) -> None:
    """Fill the Jacobian (N, P) of one output, whose derivative by the last layer's sums is delta (N, out)."""
    end = jacobian.shape[1]
    for k in range(len(network.weights) - 1, -1, -1):
        below, (fan_out, fan_in) = layers[k], network.weights[k].shape
        jacobian[:, end - fan_out : end] = delta
        end -= fan_out
        block = jacobian[:, end - fan_out * fan_in : end]
        np.multiply(
            delta.astype(np.float32)[:, :, None],
            below.astype(np.float32)[:, None, :],
            out=block.reshape(len(delta), fan_out, fan_in),
        )
        end -= fan_out * fan_in
        if k:
            delta = (delta @ network.weights[k]) * (1.0 - below**2)


def _gradient(network: Network, layers: list[Floats], delta: Floats) -> Floats:
    """J^T delta (P,) in double precision."""
    parts: list[Floats] = []
    for k in range(len(network.weights) - 1, -1, -1):
        parts += [delta.sum(axis=0), (delta.T @ layers[k]).ravel()]
        if k:
            delta = (delta @ network.weights[k]) * (1.0 - layers[k] ** 2)
    return np.concatenate(parts[::-1])


def _solve(hessian: Floats, gradient: Floats, mu: float) -> Floats | None:
    """The step, or None where the damped matrix is singular in floating point."""
    try:
        step = np.asarray(np.linalg.solve(hessian + mu * np.eye(len(hessian)), gradient), np.float64)
    except np.linalg.LinAlgError:
        return None
    return step if np.isfinite(step).all() else None


def check_enough(count: int, sizes: tuple[int, ...]) -> None:
    """Raise an :class:`ArgumentError` where ``count`` samples are too few for a network's weights.

    The training part has to have half as many labels as the network has weights.
    """
    weights = sum((fan_in + 1) * fan_out for fan_in, fan_out in pairwise(sizes))
    if round(SHARES[0] * count) * sizes[-1] * 2 < weights:
        needed = int(np.ceil(weights / 2 / sizes[-1] / SHARES[0]))
        raise ArgumentError(
            f"samples: {count} are too few for the {weights} weights of {'-'.join(map(str, sizes))}; "
            f"at least {needed} are needed, or smaller hidden layers"
        )
