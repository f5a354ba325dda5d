"""Training: right derivatives, early stopping, the best weights kept, clear refusals."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.learning import levenberg_marquardt as lm
from motorprime.learning.network import Network


def wave(rng, n=400, noise=0.0):
    x = rng.uniform(-2.0, 2.0, (n, 2))
    y = np.column_stack([np.sin(x[:, 0]) + 0.5 * x[:, 1], np.cos(x[:, 0] * x[:, 1])])
    return x, y + rng.normal(0.0, noise, y.shape)


def residuals(network, z, t):
    return (network.activations(z)[-1] - t).ravel()


def test_the_normal_equations_are_those_of_a_jacobian_by_differences(rng):
    x, y = wave(rng, 1100)  # more than one block
    network = Network.random((2, 5, 4, 2), rng, x, y)
    z, t = (x - network.input_mean) / network.input_std, (y - network.output_mean) / network.output_std
    p, step = network.parameters, 1e-6
    columns = [
        (residuals(network.with_parameters(p + e), z, t) - residuals(network.with_parameters(p - e), z, t))
        / (2 * step)
        for e in step * np.eye(p.size)
    ]
    jacobian = np.column_stack(columns)
    hessian, gradient = lm.normal_equations(network, z, t)
    np.testing.assert_allclose(gradient, jacobian.T @ residuals(network, z, t) / len(z), atol=1e-8)
    np.testing.assert_allclose(hessian, jacobian.T @ jacobian / len(z), atol=1e-5)


def test_it_learns_a_smooth_function_that_a_linear_fit_cannot(rng):
    x, y = wave(rng)
    training = lm.train(x, y, (16,), seed=1, iterations=100)
    test = training.split.test
    error = np.sqrt(np.mean((training.network.forward(x[test]) - y[test]) ** 2))
    linear = np.column_stack([x, np.ones(len(x))])
    straight = np.sqrt(np.mean((linear @ np.linalg.lstsq(linear, y, rcond=None)[0] - y) ** 2))
    assert error < straight / 5


def test_the_training_error_never_rises(rng):
    x, y = wave(rng, noise=0.1)
    history = lm.train(x, y, (8,), seed=2, iterations=40).history
    assert (np.diff(history[:, 0]) < 0.0).all()


def test_training_stops_early_and_keeps_the_weights_that_validated_best(rng):
    x, y = wave(rng, 120, noise=0.5)
    training = lm.train(x, y, (20,), seed=3, iterations=200, patience=10)
    assert training.reason == "validation"
    assert training.best == int(np.argmin(training.history[:, 1]))
    assert len(training.history) == training.best + 11
    network = training.network
    z, t = (x - network.input_mean) / network.input_std, (y - network.output_mean) / network.output_std
    held = training.split.validation
    assert lm.mean_square(network, z[held], t[held]) == pytest.approx(training.history[training.best, 1])
    assert training.history[-1, 1] > training.history[training.best, 1]


def test_only_the_training_part_trains_and_only_it_is_normalised_by(rng):
    x, y = wave(rng)
    parts = lm.split(len(x), 0)
    spoilt = y.copy()
    spoilt[parts.test] = 1e3
    one = lm.train(x, y, (6,), seed=4, iterations=5, parts=parts)
    two = lm.train(x, spoilt, (6,), seed=4, iterations=5, parts=parts)
    np.testing.assert_array_equal(one.network.parameters, two.network.parameters)
    np.testing.assert_array_equal(one.network.output_mean, two.network.output_mean)


def test_the_split_is_a_partition_in_the_stated_shares():
    parts = lm.split(1000, 5)
    assert [len(part) for part in (parts.train, parts.validation, parts.test)] == [700, 150, 150]
    together = np.concatenate([parts.train, parts.validation, parts.test])
    np.testing.assert_array_equal(np.sort(together), np.arange(1000))
    assert not np.array_equal(np.sort(parts.train), np.arange(700))


def test_the_same_seed_trains_the_same_weights(rng):
    x, y = wave(rng)
    one, two = (lm.train(x, y, (6,), seed=7, iterations=10) for _ in range(2))
    np.testing.assert_array_equal(one.network.parameters, two.network.parameters)


def test_the_restart_with_the_lowest_validation_error_wins(rng):
    x, y = wave(rng, 200, noise=0.2)
    parts = lm.split(len(x), 1)
    seen = []
    training = lm.train(
        x, y, (6,), seed=8, restarts=4, iterations=6, parts=parts, watch=lambda k, e: seen.append((k, e[1]))
    )
    lowest = min(value for _, value in seen)
    assert training.history[training.best, 1] == lowest
    assert [k for k, _ in seen].count(1) == 4


def test_a_column_that_never_changes_is_held_and_one_that_does_is_enough(rng):
    x, y = wave(rng)
    x[:, 1] = 4.0
    assert lm.train(x, y, (6,), seed=1, iterations=3).network.constant == (1,)
    x[:, 0] = 2.0
    with pytest.raises(ArgumentError, match="no input ever changes"):
        lm.train(x, y, (6,), seed=1)


def test_too_few_samples_are_refused_with_the_number_that_is_needed(rng):
    x, y = wave(rng, 100)
    with pytest.raises(ArgumentError, match=r"at least [0-9]+ are") as caught:
        lm.train(x, y, (25, 25), seed=1)
    needed = int(str(caught.value).split("at least ")[1].split()[0])
    x, y = wave(rng, needed)
    lm.train(x, y, (25, 25), seed=1, iterations=1)
    x, y = wave(rng, needed - 2)
    with pytest.raises(ArgumentError, match="too few"):
        lm.train(x, y, (25, 25), seed=1, iterations=1)
    with pytest.raises(ArgumentError, match="too few"):
        lm.split(3, 0)


def test_bad_data_are_refused(rng):
    x, y = wave(rng)
    with pytest.raises(ArgumentError, match=r"\(N, in\) and \(N, out\)"):
        lm.train(x[:, 0], y)
    with pytest.raises(ArgumentError, match="same number"):
        lm.train(x[:-1], y)
    with pytest.raises(ArgumentError, match="restarts"):
        lm.train(x, y, restarts=0)
    y[2, 1] = np.inf
    with pytest.raises(ArgumentError, match="y: "):
        lm.train(x, y)


@pytest.mark.parametrize("constant", [0.0, 5.0])
def test_outputs_that_never_change_are_learned_too(rng, constant):
    x, _ = wave(rng)
    training = lm.train(x, np.full((len(x), 1), constant), (4,), seed=1, iterations=20)
    np.testing.assert_allclose(training.network.forward(x), constant, atol=0.1)
