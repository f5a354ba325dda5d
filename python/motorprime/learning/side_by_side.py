"""Several small networks of the same inputs as one, so that one call gives all their outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._arrays import Floats
from ..errors import ArgumentError
from .network import Network


def of_raw_inputs(network: Network) -> Network:
    """The same network with the scaling of its inputs in the weights of its first layer."""
    inputs = network.sizes[0]
    weight = network.weights[0] / network.input_std
    bias = network.biases[0] - weight @ network.input_mean
    return replace(
        network,
        weights=(weight, *network.weights[1:]),
        biases=(bias, *network.biases[1:]),
        input_mean=np.zeros(inputs),
        input_std=np.ones(inputs),
    )


def side_by_side(networks: Sequence[Network]) -> Network:
    """One network whose outputs are those of all, one network's after the other's.

    Its layers hold the networks' in blocks, with zeros between them. A zero adds nothing, so the kernels give
    every output with the same bits as for its network alone.

    Args:
        networks: of the same inputs and depth, with unscaled inputs, see :func:`of_raw_inputs`.

    Raises:
        ArgumentError: no networks, or ones of different inputs or depths, or with scaled inputs.
    """
    shapes = {(network.sizes[0], len(network.weights)) for network in networks}
    if len(shapes) != 1:
        found = [network.sizes for network in networks]
        raise ArgumentError(f"networks: expected the same inputs and depth, got sizes {found}")
    if any(network.input_mean.any() or (network.input_std != 1.0).any() for network in networks):
        raise ArgumentError("networks: expected unscaled inputs")
    first, *others = zip(*(network.weights for network in networks), strict=True)
    return Network(
        (np.vstack(first), *map(_blocks, others)),
        tuple(np.concatenate(biases) for biases in zip(*(n.biases for n in networks), strict=True)),
        networks[0].input_mean,
        networks[0].input_std,
        np.concatenate([network.output_mean for network in networks]),
        np.concatenate([network.output_std for network in networks]),
    )


def _blocks(weights: Sequence[Floats]) -> Floats:
    """The matrices down the diagonal of a larger one."""
    whole = np.zeros(np.sum([weight.shape for weight in weights], axis=0))
    row, column = 0, 0
    for weight in weights:
        height, width = weight.shape
        whole[row : row + height, column : column + width] = weight
        row, column = row + height, column + width
    return whole
