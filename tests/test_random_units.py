"""Networks with random units: the ridge regression and the errors on what was left out."""

import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.learning import random_units
from motorprime.learning.random_units import fit_random_units


def curve(count, seed, noise=0.0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (count, 3))
    y = np.column_stack([200 * x[:, 0] * x[:, 1] + 50, 100 * np.sin(x[:, 2]) - 30 * x[:, 0]])
    return x, y + rng.normal(0.0, noise, y.shape)


def test_it_learns_a_smooth_map_from_fifty_samples():
    network, _ = fit_random_units(*curve(50, 0), seed=0)
    x, y = curve(300, 1)
    assert np.median(np.linalg.norm(network.forward(x) - y, axis=1)) < 1.0


def test_the_errors_are_those_of_networks_that_have_not_seen_the_sample(monkeypatch):
    """Held against leaving each sample out, with the same hidden layer, scaling and ridge."""
    monkeypatch.setattr(random_units, "GAINS", (0.4,))
    monkeypatch.setattr(random_units, "RIDGES", (0.1,))
    x, y = curve(25, 2, noise=5.0)
    network, errors = fit_random_units(x, y, seed=3, units=12)
    z, t = (x - network.input_mean) / network.input_std, (y - network.output_mean) / network.output_std
    units = np.column_stack([np.tanh(z @ network.weights[0].T + network.biases[0]), np.ones(25)])
    held = 0.1 * np.diag([1.0] * 12 + [0.0])
    for i in range(25):
        rest = np.arange(25) != i
        weights = np.linalg.solve(units[rest].T @ units[rest] + held, units[rest].T @ t[rest])
        off = np.linalg.norm((units[i] @ weights - t[i]) * network.output_std)
        assert errors[i] == pytest.approx(off, rel=1e-8)
    weights = np.linalg.solve(units.T @ units + held, units.T @ t)
    np.testing.assert_allclose(network.weights[1].T, weights[:-1], rtol=1e-8)
    np.testing.assert_allclose(network.biases[1], weights[-1], rtol=1e-8)


def test_noisy_samples_are_held_back_more():
    """What it promises is about what it makes, be the noise small or large."""
    x, y = curve(400, 5)
    for noise in (0.5, 20.0):
        network, errors = fit_random_units(*curve(60, 4, noise), seed=0)
        off = np.linalg.norm(network.forward(x) - y, axis=1)
        assert np.median(off) < np.median(errors) < 3.0 * np.median(off) + 3.0 * noise


def test_the_same_seed_gives_the_same_network_and_data_are_left_alone():
    x, y = curve(30, 0)
    before = x.copy(), y.copy()
    one, two, other = (fit_random_units(x, y, seed=seed)[0].parameters for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()
    np.testing.assert_array_equal(x, before[0])
    np.testing.assert_array_equal(y, before[1])


def test_an_input_that_never_changes_is_not_looked_at():
    x, y = curve(40, 0)
    x[:, 1] = 0.3
    network, _ = fit_random_units(x, y, seed=0)
    np.testing.assert_array_equal(network.forward(x), network.forward(x + np.array([0.0, 5.0, 0.0])))


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        (np.ones((5, 2)), np.ones((5, 1)), "no input ever changes"),
        (np.ones((1, 2)), np.ones((1, 1)), "at least two samples, got 1"),
        (np.ones(5), np.ones((5, 1)), r"\(N, in\)"),
        (np.eye(3), np.ones((2, 1)), "same number of samples"),
        (np.full((4, 2), np.nan), np.ones((4, 1)), "finite"),
    ],
)
def test_bad_data_are_errors(x, y, message):
    with pytest.raises(ArgumentError, match=message):
        fit_random_units(x, y)
