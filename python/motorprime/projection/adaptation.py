"""Adapt learned projections by about 100 samples, without forgetting what they know elsewhere.

A robot that does not match its model differs from it in joint offsets, link lengths and lenses. To a network
f_i that learned the model this looks like slightly other inputs, the same for all cameras, and slightly
other outputs of each camera::

    p_i = m_i + (I + C_i) (f_i(x + b + A x~) - m_i) + d_i,   x~ = (x - mean) / std

so b, A, C_i and d_i are fitted (Gauss-Newton, Huber's loss) with Gaussian priors round zero, and the weights
stay as they are: with 100 samples a thousand weights would be bent to suit them and spoiled elsewhere. The
posterior's precision is kept, and the next samples go on from it. The corrections fold into the first and
the last layer, so an adapted network is as fast as before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, fixed
from ..errors import ArgumentError
from ..learning.network import Network

POINT_OFFSET, JOINT_OFFSET = 0.01, 0.03
"""Prior standard deviations of b: of the point's coordinates [m] and of the joints [rad]."""
MIXING = 0.001
"""Prior standard deviation of A: metres or radians for an input one standard deviation off its mean."""
SCALE, SHIFT = 0.03, 10.0
"""Prior standard deviations of C, and of d [px]."""
HUBER = 0.7
"""Errors beyond so many times the network's own count linearly."""
MIN_SAMPLES = 10
_ITERATIONS = 30
_ENOUGH = 1e-6  # relative fall of the cost below which it has converged


@dataclass(frozen=True, eq=False)
class Correction:
    """What adapting has learned: the corrections and how sure they are.

    Attributes:
        centre, scale: (n,) mean and standard deviation of the n inputs, for x~.
        cameras: in the order of their parameters.
        vector: (n + n^2 + 6 cameras,) b, A row by row, then C and d of each camera.
        precision: of their posterior, the prior of the next adaptation; None before the first.
        samples: pixels that it has learned from.
    """

    centre: Floats
    scale: Floats
    cameras: tuple[str, ...]
    vector: Floats
    precision: Floats | None = None
    samples: int = 0

    @classmethod
    def none(cls, network: Network, cameras: tuple[str, ...]) -> Correction:
        """No correction, of the inputs that a network was trained on."""
        n = network.sizes[0]
        vector = np.zeros(n + n * n + 6 * len(cameras))
        return cls(network.input_mean, network.input_std, cameras, vector)

    @property
    def offset(self) -> Floats:
        """b (n,): the correction of the inputs at their mean, [m] for the point and [rad] for the joints."""
        return self.vector[: len(self.centre)]

    @property
    def mixing(self) -> Floats:
        """A (n, n)."""
        n = len(self.centre)
        return self.vector[n : n + n * n].reshape(n, n)

    def output(self, camera: str) -> tuple[Floats, Floats]:
        """C (2, 2) and d (2,) [px] of a camera."""
        part = self.vector[self.columns(camera)]
        return part[:4].reshape(2, 2), part[4:]

    def columns(self, camera: str) -> slice:
        """Where a camera's C and d stand in :attr:`vector`."""
        n = len(self.centre)
        at = n + n * n + 6 * self.cameras.index(camera)
        return slice(at, at + 6)

    def inputs(self, x: Floats) -> Floats:
        """Corrected inputs (N, n)."""
        corrected: Floats = x + self.offset + (x - self.centre) / self.scale @ self.mixing.T
        return corrected

    def apply(self, network: Network) -> Network:
        """The network with corrected inputs."""
        matrix = np.eye(len(self.centre)) + self.mixing / self.scale
        return network.composed(matrix, self.offset - self.mixing @ (self.centre / self.scale))

    def apply_to_pixels(self, camera: str, network: Network) -> Network:
        """The network with corrected inputs and outputs."""
        scaling, shift = self.output(camera)
        return self.apply(network).followed(np.eye(2) + scaling, shift)

    def arrays(self) -> dict[str, Floats]:
        """Everything as named arrays."""
        named = {"centre": self.centre, "scale": self.scale, "vector": self.vector}
        if self.precision is not None:
            named["precision"] = self.precision
        named["samples"] = np.array([self.samples], dtype=np.float64)
        return {f"correction.{name}": array for name, array in named.items()}

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, NDArray[Any]], inputs: int, cameras: tuple[str, ...]
    ) -> Correction:
        """What :meth:`arrays` named.

        Raises:
            ArgumentError: arrays of another shape; KeyError where one is missing.
        """
        size = inputs + inputs**2 + 6 * len(cameras)
        shapes = {"centre": (inputs,), "scale": (inputs,), "vector": (size,), "samples": (1,)}
        parts = {
            name: fixed(f"correction.{name}", arrays[f"correction.{name}"], shape)
            for name, shape in shapes.items()
        }
        precision = arrays.get("correction.precision")
        return cls(
            parts["centre"],
            parts["scale"],
            cameras,
            parts["vector"],
            None if precision is None else fixed("correction.precision", precision, (size, size)),
            int(parts["samples"][0]),
        )


def adapt_networks(
    networks: Mapping[str, Network],
    errors: Mapping[str, float],
    correction: Correction,
    x: Floats,
    pixels: Mapping[str, Floats],
) -> Correction:
    """Correct networks by samples.

    Args:
        networks: {camera: network x -> (u, v)}, as trained.
        errors: {camera: median error [px] of its network where it was trained}: labels count against priors
            as much as the network can be trusted.
        correction: what is known already.
        x: (N, n) inputs.
        pixels: {camera: (N, 2)} labels, NaN rows where it did not see the point.

    Raises:
        ArgumentError: fewer than :data:`MIN_SAMPLES` labels.
    """
    seen = {camera: ~np.isnan(labels[:, 0]) for camera, labels in pixels.items()}
    count = sum(int(there.sum()) for there in seen.values())
    needed = 1 if correction.samples else MIN_SAMPLES
    if count < needed:
        raise ArgumentError(
            f"samples: {count} labels in {', '.join(networks)} are too few to adapt by; "
            f"at least {needed} are needed, about 100 are good"
        )
    prior = _precision(correction) if correction.precision is None else correction.precision
    mean = correction.vector

    def at(vector: Floats) -> Correction:
        return Correction(correction.centre, correction.scale, correction.cameras, vector)

    def evaluate(vector: Floats) -> tuple[float, Floats, Floats]:
        """Cost, gradient and normal matrix."""
        off = vector - mean
        cost, gradient, normal = float(off @ prior @ off), prior @ off, prior.copy()
        for camera, there in seen.items():
            error, jacobian = linearise(networks[camera], at(vector), camera, x[there])
            error -= pixels[camera][there]
            size = np.linalg.norm(error, axis=1) / errors[camera]
            weight = np.minimum(1.0, HUBER / np.maximum(size, 1e-12)) / errors[camera] ** 2
            cost += float(np.where(size <= HUBER, size**2, HUBER * (2.0 * size - HUBER)).sum())
            weighted = jacobian * weight[:, None, None]
            gradient += np.einsum("nij,ni->j", weighted, error)
            normal += np.einsum("nij,nik->jk", weighted, jacobian)
        return cost, gradient, normal

    vector = mean
    cost, gradient, normal = evaluate(vector)
    damping = 1e-3
    for _ in range(_ITERATIONS):
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        new = evaluate(vector - step)
        if new[0] < cost:
            fall = cost - new[0]
            vector = vector - step
            cost, gradient, normal = new
            damping /= 10.0
            if fall < _ENOUGH * cost:
                break
        elif damping > 1e6:
            break
        else:
            damping *= 10.0
    return Correction(
        correction.centre, correction.scale, correction.cameras, vector, normal, correction.samples + count
    )


def linearise(network: Network, correction: Correction, camera: str, x: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) and their derivatives (N, 2, P) by the correction's parameters."""
    n = len(correction.centre)
    moved = correction.inputs(x)
    centred = network.forward(moved) - network.output_mean
    scaling, shift = correction.output(camera)
    outer = np.eye(2) + scaling
    slopes = outer @ network.jacobian(moved)
    jacobian = np.zeros((len(x), 2, correction.vector.size))
    jacobian[:, :, :n] = slopes
    relative = (x - correction.centre) / correction.scale
    jacobian[:, :, n : n + n * n] = (slopes[:, :, :, None] * relative[:, None, None, :]).reshape(
        len(x), 2, -1
    )
    at = correction.columns(camera).start
    for row in range(2):
        jacobian[:, row, at + 2 * row : at + 2 * row + 2] = centred
        jacobian[:, row, at + 4 + row] = 1.0
    return network.output_mean + centred @ outer.T + shift, jacobian


def _precision(correction: Correction) -> Floats:
    """The prior before any sample: a diagonal matrix."""
    n = len(correction.centre)
    deviations = np.full(correction.vector.size, SCALE)
    deviations[:3], deviations[3:n] = POINT_OFFSET, JOINT_OFFSET
    deviations[n : n + n * n] = MIXING
    for camera in correction.cameras:
        part = correction.columns(camera)
        deviations[part.stop - 2 : part.stop] = SHIFT
    return np.diag(deviations**-2)
