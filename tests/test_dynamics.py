"""The kernel of coupled dynamics against its twin, on random models and awkward input."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from motorprime._core import CoupledSystem
from motorprime.control.cds import CoupledDynamics, Goal, State, Tolerance
from motorprime.errors import ArgumentError, ArgumentTypeError
from small_dynamics import random_model, random_pose, simple

NEVER = np.zeros(4)
NEAR = Tolerance().array()
EARLY = (0.1, 0.02)


def parts(model):
    """What the kernel is made of."""
    systems = [(s.weights, s.means, s.covariances, s.matrices) for s in model.systems.values()]
    couplings = [(c.weights, c.means, c.covariances, c.near) for c in (model.eye_arm, model.arm_hand)]
    return [*systems, *couplings, model.alpha, model.beta, 0.001]


def kernel(model):
    return CoupledSystem(*parts(model))


def random_states(rng, count, reach=0.5):
    states = rng.uniform(-reach, reach, (count, 10))
    axes = rng.normal(size=(count, 3))
    angle = rng.uniform(0.0, np.pi, (count, 1))
    states[:, 6:9] = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    states[:, 9] = rng.uniform(0.2, 1.2, count)
    return states


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    components=st.integers(1, 7),
    reach=st.sampled_from([1e-12, 1e-3, 0.1, 0.5, 3.0, 1e3, 1e6]),
    amplitude=st.sampled_from([0.0, 0.5, 1.0, 2.0]),
)
def test_the_kernel_and_its_twin_walk_the_same_way(seed, components, reach, amplitude):
    rng = np.random.default_rng(seed)
    model = random_model(rng, components)
    state = random_states(rng, 1, reach)[0]
    dt = float(rng.uniform(0.1, 1.0)) * model.largest_step
    states, arrived = kernel(model).roll_out(state, amplitude, dt, 60, NEVER)
    assert states.shape == (61, 10) and not arrived
    twin = reference.coupled_roll_out(*parts(model), state, amplitude, dt, 60)
    # Errors grow with the number of steps, and where a weight changes hands.
    np.testing.assert_allclose(states, twin, rtol=1e-7, atol=1e-9 * max(1.0, reach))


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    components=st.integers(1, 7),
    reach=st.sampled_from([1e-3, 0.5, 1e3, 1e6]),
)
def test_at_the_largest_step_every_energy_still_falls_from_anywhere(seed, components, reach):
    """Eye, place and rotation, each in the metric of its certificate; the arm's is a block for each."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, components)
    state = random_states(rng, 1, reach)[0]
    states, _ = kernel(model).roll_out(state, 1.0, model.largest_step, 200, NEVER)
    arm = model.arm.lyapunov
    for part, metric in (
        (slice(0, 3), model.eye.lyapunov),
        (slice(3, 6), arm[:3, :3]),
        (slice(6, 9), arm[3:, 3:]),
    ):
        energy = ((states[:, part] @ metric) * states[:, part]).sum(axis=1)
        assert (energy[1:] <= energy[:-1] * (1.0 + 1e-12)).all()
    eye = ((states[:, :3] @ model.eye.lyapunov) * states[:, :3]).sum(axis=1)
    assert (eye[1:] < eye[:-1]).all()


def test_the_systems_in_the_kernel_are_those_that_the_certificates_are_about(rng):
    """One Euler step of each is what LpvDs.velocity says, with weights looked up at beta x."""
    model = random_model(rng)
    states = random_states(rng, 30)
    states[:, :3] *= 1e-9  # the eye is there, so the arm is free: rho is below 1e-7
    for state in states:
        (_, after), _ = kernel(model).roll_out(state, 0.0, 0.01, 1, NEVER)
        arm = state[3:9] + 0.01 * model.alpha[1] * model.arm.velocity(model.beta[1] * state[3:9])
        np.testing.assert_allclose(after[3:6], arm[:3], atol=1e-7)
        hand = state[9:] + 0.01 * model.alpha[2] * model.hand.velocity(model.beta[2] * state[9:])
        np.testing.assert_allclose(after[9:], hand, atol=1e-12)


@pytest.mark.parametrize(
    "state",
    [
        np.zeros(10),
        np.array([0.3, 0, 0, 0, 0, 0, 0, 0, 1.0, 0.5]),  # at its place, with the eye far
        np.array([0.3, 0, 0, 5e-324, 0, 0, 0, 0, 0, 0]),
        np.array([0, 0, 0, 0, 0, 0, 0, 0, np.pi, 0]),
        np.array([0, 0, 0, 0, 0, 0, 9.0, 0, 0, 0]),  # more than one turn
        np.full(10, 1e-300),
        np.full(10, 1e100),
        np.full(10, -1e100),
    ],
    ids=["zero", "in place", "denormal", "half a turn", "turns", "tiny", "huge", "huge negative"],
)
def test_awkward_states_stay_finite_and_follow_the_twin(state, rng):
    for components in (1, 5):
        model = random_model(rng, components)
        states, _ = kernel(model).roll_out(state, 1.0, 0.01, 50, NEVER)
        assert np.isfinite(states).all()
        if np.abs(state).max() < 1e99:
            twin = reference.coupled_roll_out(*parts(model), state, 1.0, 0.01, 50)
            np.testing.assert_allclose(states, twin, rtol=1e-8, atol=1e-10)


def test_a_palm_in_its_place_moves_once_the_eye_is_near_enough(rng):
    """g = 1 - rho / 1 mm there, and not 0 until the eye is exactly at its goal."""
    state = np.zeros(10)
    state[8] = 1.0
    state[0] = 0.0035  # rho = 0.8 * 0.0035 * (0.0035 / 0.02)
    (_, after), _ = kernel(simple()).roll_out(state, 1.0, 0.01, 1, NEVER)
    rho = 0.8 * 0.0035 * 0.0035 / 0.02
    assert 0.0 < rho < 0.001
    assert after[8] == pytest.approx(1.0 - 0.03 * (1.0 - rho / 0.001))


def test_one_component_needs_no_weights():
    model = simple()
    state = random_states(np.random.default_rng(3), 1)[0]
    states, _ = kernel(model).roll_out(state, 1.0, 0.01, 300, NEVER)
    np.testing.assert_allclose(states[:, :3], state[:3] * 0.94 ** np.arange(301)[:, None], rtol=1e-12)


def test_weights_that_differ_beyond_all_exponents_are_weighed():
    """ln w counts, however small w is; and a covariance's size counts as well as its shape."""
    model = simple()
    pieces = parts(model)
    for weights, variances in (
        ([1.0 - 1e-12, 1e-12], [0.01, 1.0]),
        ([1.0 - 1e-300, 1e-300], [1e-4, 1.0]),
        ([0.5, 0.5], [1e-12, 1e-12]),
        ([0.5, 0.5], [1e-6, 1e6]),
    ):
        pieces[2] = (
            np.array(weights),
            np.zeros((2, 1)),
            np.array(variances)[:, None, None],
            np.array([[[-1.0]], [[-4.0]]]),
        )
        for opening in (1e-3, 0.5, 1.0):
            state = np.zeros(10)
            state[9] = opening
            states, _ = CoupledSystem(*pieces).roll_out(state, 0.0, 0.01, 20, NEVER)
            twin = reference.coupled_roll_out(*pieces, state, 0.0, 0.01, 20)
            np.testing.assert_allclose(states, twin, rtol=1e-12)


def test_many_ends_are_those_of_each_movement_alone(rng):
    model = random_model(rng)
    states = random_states(rng, 150)
    steps = rng.integers(0, 9000, 150)
    last, arrived, early = kernel(model).ends(states, 1.0, 0.01, steps.tolist(), NEAR, (0.5, 0.2))
    assert (arrived >= 0).any() and (arrived < 0).any() and early.any() and not early.all()
    for n in range(150):
        path, there = kernel(model).roll_out(states[n], 1.0, 0.01, int(steps[n]), NEAR)
        np.testing.assert_array_equal(last[n], path[-1])
        assert arrived[n] == (len(path) - 1 if there else -1)
        assert early[n] == ((path[:, 9] < 0.5) & (np.linalg.norm(path[:, 3:6], axis=1) > 0.2)).any()


def test_ends_are_the_same_every_time(rng):
    model, states = random_model(rng), random_states(rng, 500)
    first = kernel(model).ends(states, 1.0, 0.01, [800] * 500, NEAR, EARLY)
    for _ in range(3):
        for a, b in zip(first, kernel(model).ends(states, 1.0, 0.01, [800] * 500, NEAR, EARLY), strict=True):
            np.testing.assert_array_equal(a, b)


def test_no_movements_have_no_ends():
    last, arrived, early = kernel(simple()).ends(np.zeros((0, 10)), 1.0, 0.01, [], NEAR, EARLY)
    assert last.shape == (0, 10) and arrived.shape == (0,) and early.shape == (0,)


def test_the_model_s_ends_are_in_seconds(rng):
    model = random_model(rng)
    goal = Goal(rng.normal(size=3), random_pose(rng))
    starts = [State(rng.normal(size=3), random_pose(rng), 0.5) for _ in range(5)]
    ends = model.ends([goal.relative(start) for start in starts], seconds=[0.0, 0.1, 80.0, 80.0, 80.0])
    assert len(ends) == 5
    assert np.isnan(ends.arrived[:2]).all()
    for k in (2, 3, 4):
        rolled = model.roll_out(starts[k], goal, seconds=80.0)
        assert rolled.arrived
        assert ends.arrived[k] == pytest.approx(rolled.times[-1])
        np.testing.assert_allclose(goal.absolute(ends.relative)[1][k], rolled.palms[-1], atol=1e-9)
    np.testing.assert_array_equal(ends.relative[0], goal.relative(starts[0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"relative": np.zeros((2, 9))}, r"relative: expected shape \(N, 10\)"),
        ({"relative": np.full((2, 10), np.nan)}, "relative: expected finite"),
        ({"seconds": [1.0]}, r"seconds: expected one number or shape \(2,\)"),
        ({"seconds": -1.0}, "seconds: expected 0 to"),
        ({"seconds": np.nan}, "seconds: expected finite"),
        ({"seconds": 1e5}, "seconds: expected 0 to"),
        ({"dt": 0.5}, "dt: expected at most"),
        ({"amplitude": -1.0}, "amplitude: expected"),
        ({"early": (-0.1, 0.02)}, "watch must be a number >= 0"),
    ],
)
def test_wrong_arguments_of_ends_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        simple().ends(**({"relative": np.zeros((2, 10))} | change))


def test_a_state_is_not_changed_and_may_have_any_layout(rng):
    model, states = kernel(random_model(rng)), np.asfortranarray(random_states(rng, 6))
    before = states.copy()
    path, _ = model.roll_out(states[2], 1.0, 0.01, 30, NEVER)
    last, _, _ = model.ends(states, 1.0, 0.01, [30] * 6, NEVER, EARLY)
    np.testing.assert_array_equal(states, before)
    np.testing.assert_array_equal(last[2], path[-1])
    np.testing.assert_array_equal(model.roll_out(list(before[2]), 1.0, 0.01, 30, NEVER)[0], path)


def test_a_model_can_be_copied_and_pickled(rng):
    model, state = random_model(rng), random_states(rng, 1)
    for again in (copy.deepcopy(model), pickle.loads(pickle.dumps(model)), copy.copy(model)):
        assert isinstance(again, CoupledDynamics)
        np.testing.assert_array_equal(again.ends(state).relative, model.ends(state).relative)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (
            {0: np.full(10, np.nan)},
            ArgumentError,
            r"state must be finite and at most 1e100, got NaN at state\[0\]",
        ),
        ({0: np.full(10, 1e101)}, ArgumentError, "state must be finite and at most 1e100"),
        ({0: np.zeros(9)}, ArgumentError, r"state must be \(10,\), got \(9,\)"),
        ({0: np.zeros((1, 10))}, ArgumentError, r"state must be \(10,\), got \(1, 10\)"),
        ({0: np.zeros(10, dtype=int)}, ArgumentTypeError, "state must be an array of float"),
        ({0: "no"}, ArgumentTypeError, "state must be"),
        ({1: np.nan}, ArgumentError, "amplitude must be from 0"),
        ({1: "wide"}, ArgumentTypeError, "amplitude must be a number"),
        ({2: 0.0}, ArgumentError, "dt must be positive"),
        ({2: np.inf}, ArgumentError, "dt must be positive"),
        ({2: 50.0}, ArgumentError, "dt makes a system grow beyond all numbers"),
        ({3: -1}, ArgumentError, "steps must be a whole number"),
        ({3: 1.5}, ArgumentTypeError, "steps must be a whole number"),
        ({3: True}, ArgumentTypeError, "steps must be a whole number"),
        ({3: 2**63}, ArgumentError, "steps must be at most 1000000"),
        ({4: np.zeros(3)}, ArgumentError, r"tolerance must be \(4,\)"),
        (
            {4: [0.1, -0.1, 0.1, 0.1]},
            ArgumentError,
            r"tolerance must be a number >= 0, got -0.1 at tolerance\[1\]",
        ),
        ({4: [0.1, 0.1, 0.1, np.nan]}, ArgumentError, "tolerance must be"),
    ],
)
def test_the_border_names_what_is_wrong_with_a_movement(change, error, message):
    arguments = [np.full(10, 0.1), 1.0, 0.01, 1000, NEVER]
    for at, value in change.items():
        arguments[at] = value
    with pytest.raises(error, match=message):
        kernel(simple()).roll_out(*arguments)


@pytest.mark.parametrize(
    ("at", "value", "error", "message"),
    [
        (0, np.zeros((2, 9)), ArgumentError, r"states must be \(N, 10\)"),
        (0, np.array([[0.0] * 10, [0.0] * 4 + [np.inf] + [0.0] * 5]), ArgumentError, r"states\[1, 4\]"),
        (3, [5], ArgumentError, "steps must be one number for each of 2 starts, got 1"),
        (3, [5, 2_000_000], ArgumentError, r"steps must be at most 1000000, got 2000000 at steps\[1\]"),
        (3, 5, ArgumentTypeError, "steps must be whole numbers"),
        (3, [5, 0.5], ArgumentTypeError, "steps must be a whole number"),
        (5, (0.1,), ArgumentError, r"watch must be \(2,\)"),
        (5, (0.1, np.nan), ArgumentError, "watch must be a number >= 0"),
    ],
)
def test_the_border_names_what_is_wrong_with_many(at, value, error, message):
    arguments = [np.zeros((2, 10)), 1.0, 0.01, [5, 5], NEVER, EARLY]
    arguments[at] = value
    with pytest.raises(error, match=message):
        kernel(simple()).ends(*arguments)


@pytest.mark.parametrize(
    ("at", "value", "error", "message"),
    [
        (0, None, ArgumentTypeError, r"eye must be \(weights, means, covariances, matrices\)"),
        (0, (1.0,), ArgumentTypeError, "eye must be"),
        (
            3,
            (np.ones(1), np.zeros((1, 2)), np.eye(2)[None], 0.0),
            ArgumentError,
            "eye_arm.near must be positive",
        ),
        (
            3,
            (np.ones(1), np.zeros((1, 2)), np.eye(2)[None], "x"),
            ArgumentTypeError,
            "eye_arm must be a number",
        ),
        (
            3,
            (np.ones(1), np.zeros((1, 3)), np.eye(3)[None], 0.1),
            ArgumentError,
            "eye_arm.means must be over 2",
        ),
        (5, np.ones(2), ArgumentError, r"alpha must be \(3,\)"),
        (5, [1.0, -1.0, 1.0], ArgumentError, r"alpha must be positive and finite, got -1.0 at alpha\[1\]"),
        (6, [1.0, 1.0, np.nan], ArgumentError, r"beta\[2\]"),
        (7, 0.0, ArgumentError, "close must be positive"),
    ],
)
def test_the_border_names_what_is_wrong_with_a_system(at, value, error, message):
    pieces = parts(simple())
    pieces[at] = value
    with pytest.raises(error, match=message):
        CoupledSystem(*pieces)


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (0, np.ones((1, 1)), r"hand.weights must be \(K,\), got \(1, 1\)"),
        (0, np.zeros(1), "hand.weights must be positive and finite"),
        (0, np.zeros(0), r"hand.means must be \(0, m\)"),
        (1, np.zeros((2, 1)), r"hand.means must be \(1, m\), got \(2, 1\)"),
        (1, np.zeros((1, 0)), "hand.covariances must be"),
        (1, np.full((1, 1), np.nan), "hand.means must be finite"),
        (2, np.zeros((1, 1)), r"hand.covariances must be \(1, 1, 1\)"),
        (2, np.zeros((1, 1, 1)), "hand.covariances has a matrix 0 that is not positive definite"),
        (2, np.full((1, 1, 1), np.inf), "hand.covariances must be finite"),
        (3, np.zeros((2, 1, 1)), r"hand.matrices must be \(1, d, d\), got \(2, 1, 1\)"),
        (3, np.zeros((1, 2, 2)), "hand.matrices must be of 1 elements, got 4"),
        (3, np.full((1, 1, 1), np.nan), "hand.matrices must be finite"),
    ],
)
def test_the_border_names_what_is_wrong_with_an_array_of_a_system(at, value, message):
    pieces = parts(simple())
    hand = list(pieces[2])
    hand[at] = value
    pieces[2] = tuple(hand)
    with pytest.raises(ArgumentError, match=message):
        CoupledSystem(*pieces)


def test_a_kernel_says_what_it_is(rng):
    assert repr(kernel(random_model(rng, 4))) == "CoupledSystem(4, 4 and 4 components of eye, arm and hand)"
