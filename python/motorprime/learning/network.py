"""A small tanh network in double precision, for training; :meth:`Network.mlp` is its fast twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, generator, integer, rows
from .._core import Mlp
from ..errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Network:
    """Layers of tanh with a linear last one, between a normalised input and a normalised output.

    With z_0 = (x - input_mean) / input_std, z_k = tanh(W_k z_{k-1} + b_k), the last layer without tanh::

        f(x) = z_last output_std + output_mean

    Args:
        weights: of each layer (out, in).
        biases: of each layer (out,).
        input_mean, input_std: (in,).
        output_mean, output_std: (out,).
        constant: inputs that never changed in training; they are not looked at.
    """

    weights: tuple[Floats, ...]
    biases: tuple[Floats, ...]
    input_mean: Floats
    input_std: Floats
    output_mean: Floats
    output_std: Floats
    constant: tuple[int, ...] = ()

    @classmethod
    def random(
        cls,
        sizes: tuple[int, ...],
        seed: int | np.random.Generator | None,
        x: npt.ArrayLike,
        y: npt.ArrayLike,
    ) -> Network:
        """A network before training, normalised to zero mean and unit variance of the data it will see.

        The hidden weights are drawn as Nguyen and Widrow (1990) do: directions at random, lengths such that
        the units' slopes share the range of their inputs evenly.

        Args:
            sizes: nodes of every layer, inputs and outputs included, as (12, 25, 25, 2).
            seed: for the draw.
            x: (N, sizes[0]) inputs; a column that never changes is ignored by the network.
            y: (N, sizes[-1]) outputs.

        Raises:
            ArgumentError: fewer than two layers, data of another shape or with NaN, no rows.
        """
        sizes = tuple(integer("sizes", size, at_least=1) for size in sizes)
        if len(sizes) < 2:
            raise ArgumentError(f"sizes: at least inputs and outputs expected, got {sizes}")
        x, y = data(x, y, sizes[0], sizes[-1])
        if len(x) == 0:
            raise ArgumentError("x: expected at least one sample, got none")
        rng = generator(seed)
        weights: list[Floats] = []
        biases: list[Floats] = []
        for fan_in, fan_out in pairwise(sizes[:-1]):
            directions = rng.normal(size=(fan_out, fan_in))
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            # Inputs of unit variance reach about to +-sqrt(3), tanh's outputs to +-1.
            length = 0.7 * fan_out ** (1.0 / fan_in)
            reach = np.sqrt(3.0) if not weights else 1.0
            weights.append(directions * length / reach)
            biases.append(length * np.linspace(-1.0, 1.0, fan_out) * np.sign(rng.normal(size=fan_out)))
        weights.append(rng.normal(size=(sizes[-1], sizes[-2])) / np.sqrt(sizes[-2]))
        biases.append(np.zeros(sizes[-1]))
        input_std, spread = x.std(axis=0), np.ptp(x, axis=0)
        constant = tuple(int(k) for k in np.flatnonzero(spread == 0.0))
        input_std[list(constant)] = 1.0
        output_std = y.std(axis=0)
        output_std[np.ptp(y, axis=0) == 0.0] = 1.0
        weights[0][:, list(constant)] = 0.0
        return cls(
            tuple(weights), tuple(biases), x.mean(axis=0), input_std, y.mean(axis=0), output_std, constant
        )

    @property
    def sizes(self) -> tuple[int, ...]:
        """Nodes of every layer, inputs and outputs included."""
        return (self.weights[0].shape[1], *(len(bias) for bias in self.biases))

    @property
    def parameters(self) -> Floats:
        """All weights and biases in one vector: W_1 row by row, b_1, W_2, and so on."""
        return np.concatenate(
            [part.ravel() for layer in zip(self.weights, self.biases, strict=True) for part in layer]
        )

    def with_parameters(self, vector: Floats) -> Network:
        """The same network with other weights and biases, in the order of :attr:`parameters`."""
        weights, biases, at = [], [], 0
        for weight, bias in zip(self.weights, self.biases, strict=True):
            weights.append(vector[at : at + weight.size].reshape(weight.shape))
            biases.append(vector[at + weight.size : at + weight.size + bias.size])
            at += weight.size + bias.size
        return replace(self, weights=tuple(weights), biases=tuple(biases))

    def forward(self, x: npt.ArrayLike) -> Floats:
        """Outputs (N, out) of inputs (N, in)."""
        x = rows("x", x, self.sizes[0])
        return (
            self.activations((x - self.input_mean) / self.input_std)[-1] * self.output_std + self.output_mean
        )

    def activations(self, z: Floats) -> list[Floats]:
        """What every layer gives for normalised inputs (N, in): themselves first, the outputs last."""
        layers = [z]
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            z = z @ weight.T + bias
            if k < len(self.weights) - 1:
                z = np.tanh(z)
            layers.append(z)
        return layers

    def jacobian(self, x: npt.ArrayLike) -> Floats:
        """Derivatives (N, out, in) of :meth:`forward` by its inputs."""
        x = rows("x", x, self.sizes[0])
        layers = self.activations((x - self.input_mean) / self.input_std)
        slopes = np.broadcast_to(np.diag(self.output_std), (len(x), *2 * (len(self.output_std),)))
        for k in range(len(self.weights) - 1, -1, -1):
            slopes = slopes @ self.weights[k]
            if k:
                slopes = slopes * (1.0 - layers[k] ** 2)[:, None, :]
        return np.asarray(slopes / self.input_std)

    def mlp(self) -> Mlp:
        """The network as a kernel, in single precision."""
        return Mlp(
            [w.astype(np.float32) for w in self.weights],
            [b.astype(np.float32) for b in self.biases],
            self.input_mean.astype(np.float32),
            self.input_std.astype(np.float32),
            self.output_mean.astype(np.float32),
            self.output_std.astype(np.float32),
        )

    def arrays(self, prefix: str = "") -> dict[str, Floats]:
        """Everything as named arrays, for :func:`motorprime.model_files.write_model`."""
        named: dict[str, Floats] = {}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            named[f"{prefix}weight{k}"], named[f"{prefix}bias{k}"] = weight, bias
        for name in _NORMALISATION:
            named[prefix + name] = getattr(self, name)
        named[f"{prefix}constant"] = np.array(self.constant, dtype=np.float64)
        return named

    def composed(self, matrix: Floats, shift: Floats) -> Network:
        """The network of x -> f(M x + t): matrix (in, in), shift (in,); it is as fast as f."""
        weight, mean, std = self.weights[0], self.input_mean, self.input_std
        inner = matrix * std / std[:, None]
        bias = self.biases[0] + weight @ ((matrix @ mean + shift - mean) / std)
        return replace(self, weights=(weight @ inner, *self.weights[1:]), biases=(bias, *self.biases[1:]))

    def followed(self, matrix: Floats, shift: Floats) -> Network:
        """The network of x -> m + M (f(x) - m) + t, m the outputs' mean: matrix (out, out), shift (out,)."""
        std = self.output_std
        outer = matrix * std / std[:, None]
        return replace(
            self,
            weights=(*self.weights[:-1], outer @ self.weights[-1]),
            biases=(*self.biases[:-1], outer @ self.biases[-1]),
            output_mean=self.output_mean + shift,
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]], prefix: str = "") -> Network:
        """The network that :meth:`arrays` named so.

        Raises:
            ArgumentError: arrays are missing or do not fit together.
        """

        def take(name: str, dims: int) -> Floats:
            array = arrays.get(prefix + name)
            if array is None or array.ndim != dims or array.dtype != np.float64:
                raise ArgumentError(f"network: no array '{prefix}{name}' of {dims} dimensions in float64")
            return finite(prefix + name, array)

        count = sum(name.startswith(f"{prefix}weight") for name in arrays)
        weights = tuple(take(f"weight{k}", 2) for k in range(max(count, 1)))
        biases = tuple(take(f"bias{k}", 1) for k in range(max(count, 1)))
        normalisation = {name: take(name, 1) for name in _NORMALISATION}
        inside = [weight.shape[1] for weight in weights]
        outside = [len(weight) for weight in weights]
        ends = [len(part) for part in normalisation.values()]
        chained = outside == [*inside[1:], ends[2]] and outside == [len(bias) for bias in biases]
        if not chained or ends[:2] != inside[:1] * 2 or ends[2] != ends[3]:
            raise ArgumentError(f"network: layers of {list(zip(inside, outside, strict=True))} do not fit")
        constant = tuple(int(k) for k in take("constant", 1))
        return cls(weights, biases, **normalisation, constant=constant)


_NORMALISATION = ("input_mean", "input_std", "output_mean", "output_std")


def data(x: npt.ArrayLike, y: npt.ArrayLike, inputs: int, outputs: int) -> tuple[Floats, Floats]:
    """Training data checked: (N, inputs) and (N, outputs) float64, finite, of the same N."""
    x, y = rows("x", x, inputs), rows("y", y, outputs)
    if len(x) != len(y):
        raise ArgumentError(f"x, y: the same number of samples expected, got {len(x)} and {len(y)}")
    return x, y
