"""Networks for training: their twin in single precision, their normalisation, their files."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.learning.network import Network
from motorprime.model_files import read_model, write_model


def some_data(rng, n=60, inputs=4, outputs=2):
    return rng.normal(3.0, 2.0, (n, inputs)), rng.normal(100.0, 50.0, (n, outputs))


def some_network(rng, sizes=(4, 7, 5, 2)):
    network = Network.random(sizes, rng, *some_data(rng, inputs=sizes[0], outputs=sizes[-1]))
    return network.with_parameters(rng.normal(0.0, 0.5, network.parameters.size))


def test_the_kernel_gives_what_the_network_gives(rng):
    network = some_network(rng)
    x = rng.normal(3.0, 2.0, (30, 4))
    np.testing.assert_allclose(network.mlp()(x), network.forward(x), rtol=1e-5, atol=1e-3)


def test_forward_is_the_formula_written_out(rng):
    network = some_network(rng, (3, 6, 2))
    x = rng.normal(3.0, 2.0, (5, 3))
    hidden = np.tanh((x - network.input_mean) / network.input_std @ network.weights[0].T + network.biases[0])
    expected = (hidden @ network.weights[1].T + network.biases[1]) * network.output_std + network.output_mean
    np.testing.assert_allclose(network.forward(x), expected, rtol=1e-12)


def test_a_new_network_is_normalised_to_its_data(rng):
    x, y = some_data(rng, 500)
    network = Network.random((4, 10, 2), 1, x, y)
    z = (x - network.input_mean) / network.input_std
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(z.std(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(network.output_std, y.std(axis=0))
    # Its hidden units bend within the data: none is saturated or dead.
    hidden = network.activations(z)[1]
    assert hidden.std(axis=0).min() > 0.1


def test_a_column_that_never_changes_is_named_and_not_looked_at(rng):
    x, y = some_data(rng)
    x[:, 2] = 0.3
    network = Network.random((4, 10, 2), 1, x, y)
    assert network.constant == (2,)
    other = x.copy()
    other[:, 2] = 99.0
    np.testing.assert_array_equal(network.forward(x), network.forward(other))


def test_the_same_seed_gives_the_same_network_and_another_seed_another(rng):
    x, y = some_data(rng)
    one, two, other = (Network.random((4, 10, 2), seed, x, y).parameters for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 0.1


def test_parameters_go_out_and_in_again(rng):
    network = some_network(rng)
    again = network.with_parameters(network.parameters)
    for one, two in zip(network.weights + network.biases, again.weights + again.biases, strict=True):
        np.testing.assert_array_equal(one, two)
    assert network.parameters.size == 4 * 7 + 7 + 7 * 5 + 5 + 5 * 2 + 2
    assert network.sizes == (4, 7, 5, 2)


def test_a_network_survives_its_file(rng, tmp_path):
    network = some_network(rng)
    write_model(tmp_path / "net.safetensors", "test", network.arrays("a."), {})
    again = Network.from_arrays(read_model(tmp_path / "net.safetensors", "test")[0], "a.")
    x = rng.normal(3.0, 2.0, (30, 4))
    np.testing.assert_array_equal(network.forward(x), again.forward(x))
    assert again.constant == network.constant


@pytest.mark.parametrize(
    "damage",
    [
        lambda arrays: arrays.pop("weight1"),
        lambda arrays: arrays.pop("input_std"),
        lambda arrays: arrays.pop("constant"),
        lambda arrays: arrays.update(bias0=np.zeros(3)),
        lambda arrays: arrays.update(weight1=np.zeros((5, 6))),
        lambda arrays: arrays.update(output_mean=np.zeros(3)),
        lambda arrays: arrays.update(weight0=np.full((7, 4), np.nan)),
        lambda arrays: arrays.update(weight0=np.zeros((7, 4), np.float32)),
    ],
)
def test_arrays_that_make_no_network_are_refused(rng, damage):
    arrays = some_network(rng).arrays()
    damage(arrays)
    with pytest.raises(ArgumentError):
        Network.from_arrays(arrays)


def test_bad_data_are_refused(rng):
    x, y = some_data(rng)
    with pytest.raises(ArgumentError, match="sizes"):
        Network.random((4,), 0, x, y)
    with pytest.raises(ArgumentError, match="sizes"):
        Network.random((4, 0, 2), 0, x, y)
    with pytest.raises(ArgumentError, match=r"x: expected shape \(N, 5\)"):
        Network.random((5, 3, 2), 0, x, y)
    with pytest.raises(ArgumentError, match="got 60 and 59"):
        Network.random((4, 3, 2), 0, x, y[:-1])
    with pytest.raises(ArgumentError, match="at least one sample"):
        Network.random((4, 3, 2), 0, x[:0], y[:0])
    with pytest.raises(ArgumentTypeError):
        Network.random((4, 3, 2), 0, x.astype(str), y)
    x[3, 1] = np.nan
    with pytest.raises(ArgumentError, match=r"x: .*\[3, 1\]"):
        Network.random((4, 3, 2), 0, x, y)
