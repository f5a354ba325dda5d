"""Least squares within a box, against brute force over which limits hold."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime.control.levenberg_marquardt import box_step, minimise


def linear(matrix, right):
    return lambda x: (matrix @ x - right, matrix)


def best_in_box(matrix, right, limits):
    """The lowest of all solutions with some variables at a limit and the others free, if within the box."""
    best, where = np.inf, None
    for choice in itertools.product(("low", "free", "high"), repeat=len(limits)):
        x = np.array(
            [{"low": lo, "high": hi, "free": 0.0}[c] for c, (lo, hi) in zip(choice, limits, strict=True)]
        )
        free = np.array([c == "free" for c in choice])
        if free.any():
            x[free] = np.linalg.lstsq(matrix[:, free], right - matrix[:, ~free] @ x[~free], rcond=None)[0]
        if (x >= limits[:, 0] - 1e-12).all() and (x <= limits[:, 1] + 1e-12).all():
            cost = 0.5 * np.sum((matrix @ x - right) ** 2)
            if cost < best:
                best, where = cost, x
    return best, where


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_linear_problem_ends_at_the_best_point_of_its_box(seed):
    rng = np.random.default_rng(seed)
    matrix, right = rng.normal(size=(6, 4)), 3.0 * rng.normal(size=6)
    limits = np.sort(rng.normal(size=(4, 2)), axis=1)
    found = minimise(linear(matrix, right), rng.normal(size=4), limits, iterations=400, slight=1e-14)
    best, where = best_in_box(matrix, right, limits)
    assert found.cost == pytest.approx(best, rel=1e-5, abs=1e-9)
    np.testing.assert_allclose(found.x, where, atol=2e-3)


def rosenbrock(x):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


def test_a_curved_valley_is_followed_to_its_end():
    found = minimise(rosenbrock, np.array([-1.2, 1.0]), np.array([[-2.0, 2.0]] * 2), slight=1e-15)
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-6)


def test_a_limit_in_the_valley_ends_it_there_with_the_other_variable_free():
    """At x = 0.5 the best y is x^2."""
    found = minimise(rosenbrock, np.array([-1.2, 1.0]), np.array([[-2.0, 0.5], [-2.0, 2.0]]), slight=1e-15)
    np.testing.assert_allclose(found.x, [0.5, 0.25], atol=1e-6)
    assert found.cost == pytest.approx(0.125)


def test_no_evaluation_is_outside_the_limits_and_each_counts():
    asked = []
    limits = np.array([[-1.3, 0.5], [0.9, 2.0]])

    def watched(x):
        asked.append(x)
        return rosenbrock(x)

    found = minimise(watched, np.array([-5.0, 5.0]), limits)
    assert (np.array(asked) >= limits[:, 0]).all() and (np.array(asked) <= limits[:, 1]).all()
    np.testing.assert_array_equal(asked[0], [-1.3, 2.0])
    assert found.evaluations == len(asked)


def test_equal_limits_hold_a_variable():
    found = minimise(rosenbrock, np.array([0.0, 0.3]), np.array([[-2.0, 2.0], [0.3, 0.3]]), slight=1e-15)
    assert found.x[1] == 0.3
    assert abs(rosenbrock(found.x)[1][:, 0] @ rosenbrock(found.x)[0]) < 1e-4


def test_the_cost_never_rises_and_iterations_are_a_bound():
    costs = []

    def watched(x):
        residuals, jacobian = rosenbrock(x)
        costs.append(0.5 * residuals @ residuals)
        return residuals, jacobian

    found = minimise(watched, np.array([-1.2, 1.0]), np.array([[-2.0, 2.0]] * 2), iterations=5)
    assert found.evaluations <= 6
    assert found.cost == min(costs)


def test_the_start_is_left_as_it_was():
    start = np.array([-1.2, 1.0])
    minimise(rosenbrock, start, np.array([[-2.0, 2.0]] * 2))
    np.testing.assert_array_equal(start, [-1.2, 1.0])


@given(seed=st.integers(0, 10_000), damping=st.sampled_from([1e-6, 1.0, 1e3]))
@settings(max_examples=60, deadline=None)
def test_a_step_is_the_lowest_point_of_its_model_within_the_box(seed, damping):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(5, 5))
    hessian, gradient = root.T @ root, rng.normal(size=5)
    lower, upper = -rng.uniform(0.0, 0.5, 5), rng.uniform(0.0, 0.5, 5)
    lower[rng.random(5) < 0.2] = 0.0
    step = box_step(hessian, gradient, damping, lower, upper)
    assert (step >= lower).all() and (step <= upper).all()
    free = (step > lower) & (step < upper) & (step != 0.0)
    slope = (hessian + damping * np.eye(5)) @ step + gradient
    np.testing.assert_allclose(slope[free], 0.0, atol=1e-8)
    assert (slope[(step == lower) & (lower < 0.0)] > -1e-8).all() and (slope[step == upper] < 1e-8).all()


def test_a_variable_at_its_limit_stays_when_pushed_out_and_leaves_when_pulled_in():
    hessian, room = np.eye(2), np.array([1.0, 1.0])
    np.testing.assert_allclose(
        box_step(hessian, np.array([1.0, -0.4]), 0.0, np.array([0.0, -1.0]), room), [0, 0.4]
    )
    np.testing.assert_allclose(
        box_step(hessian, np.array([-0.5, -0.4]), 0.0, np.array([0.0, -1.0]), room), [0.5, 0.4]
    )
