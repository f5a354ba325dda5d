"""Networks side by side give what each gives alone, to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.learning.network import Network
from motorprime.learning.side_by_side import of_raw_inputs, side_by_side


def network(sizes, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.normal(0.3, 2.0, (200, sizes[0]))
    return Network.random(sizes, rng, x, rng.normal(5.0, 20.0, (200, sizes[-1])))


X = np.random.default_rng(9).normal(0.0, 2.0, (50, 4))


def test_raw_inputs_change_nothing_but_where_the_scaling_is_done():
    scaled = network((4, 7, 6, 3))
    raw = of_raw_inputs(scaled)
    assert not raw.input_mean.any() and (raw.input_std == 1.0).all()
    np.testing.assert_allclose(raw.forward(X), scaled.forward(X), rtol=1e-12, atol=1e-10)
    assert scaled.input_mean.any()


@pytest.mark.parametrize("hidden", [(), (5,), (9, 16)])
def test_every_output_has_the_bits_of_its_network_alone(hidden):
    """One posture at a time and many; hidden layers of different widths beside each other."""
    parts = [
        of_raw_inputs(network((4, *(width + k for width in hidden), outputs), seed=k))
        for k, outputs in enumerate((2, 5, 1))
    ]
    together = side_by_side(parts).mlp()
    assert together.sizes == (4, *(3 * width + 3 for width in hidden), 8)
    for x in (X, X[:1], 1e6 * X[:3]):
        alone = np.hstack([part.mlp()(x) for part in parts])
        np.testing.assert_array_equal(together(x), alone)


def test_one_network_is_itself():
    one = of_raw_inputs(network((4, 6, 2)))
    np.testing.assert_array_equal(side_by_side([one]).forward(X), one.forward(X))


@pytest.mark.parametrize(
    ("networks", "words"),
    [
        ([], "same inputs and depth"),
        ([network((4, 6, 2)), network((3, 6, 2))], "same inputs and depth"),
        ([network((4, 6, 2)), network((4, 6, 6, 2))], "same inputs and depth"),
        ([of_raw_inputs(network((4, 6, 2))), network((4, 6, 2))], "unscaled"),
        ([replace(of_raw_inputs(network((4, 6, 2))), input_std=np.full(4, 2.0))], "unscaled"),
    ],
)
def test_networks_that_do_not_fit_beside_each_other_are_refused(networks, words):
    with pytest.raises(ArgumentError, match=words):
        side_by_side(networks)
