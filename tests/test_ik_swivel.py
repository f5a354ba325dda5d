"""The elbow's swivel: what it is, how it is learned, and how a solver heeds it."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.control.arm import Arm
from motorprime.control.pose import PoseSolver
from motorprime.control.swivel import Swivel, SwivelPreference, learn_swivel, swivels
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.rotations import rotation_matrices
from small_robot import small_robot

UPPER, FORE = 0.25, 0.24
REACH = UPPER + FORE
RANGE = np.array([[0.0, 0.0, -1.0], [1.0, 1.0, 0.0]])


def arm_with(swivel, wrist, shoulder=(0.1, -0.2, 1.3)):
    """Elbow (3,) of an arm of these two lengths, hanging straight down and then turned about the line."""
    line = np.asarray(wrist, float)
    length = np.linalg.norm(line)
    n = line / length
    down = np.array([0.0, 0.0, -1.0])
    u = down - n * (n @ down)
    u /= np.linalg.norm(u)
    along = (length**2 + UPPER**2 - FORE**2) / (2 * length)
    off = np.sqrt(UPPER**2 - along**2)
    elbow = along * n + off * rotation_matrices(swivel * n) @ u
    return np.asarray(shoulder) + elbow, off


def reaches(function, count=6, samples=30, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        wrists = np.array([0.28, 0.05, -0.18]) + rng.uniform(-0.07, 0.07, size=(samples, 3))
        shoulder = rng.uniform(-1, 1, size=3)
        angles = function(wrists / REACH) + noise * rng.standard_normal(samples)
        elbows = np.array([arm_with(a, w, shoulder)[0] for a, w in zip(angles, wrists, strict=True)])
        found.append((np.tile(shoulder, (samples, 1)), elbows, shoulder + wrists))
    return found


def linear(x):
    return -0.4 + x @ np.array([-1.2, 0.5, 0.4])


# The angle.


@pytest.mark.parametrize("angle", [-2.0, -0.5, 0.0, 0.3, 3.0])
def test_the_swivel_is_the_turn_about_the_line_from_hanging_straight_down(angle):
    wrist = np.array([0.3, 0.1, -0.1])
    elbow, off = arm_with(angle, wrist, (0, 0, 0))
    found, away = swivels(np.zeros((1, 3)), elbow[None], wrist[None])
    assert found[0] == pytest.approx(angle) and away[0] == pytest.approx(off)


def test_a_right_elbow_lifted_outwards_has_a_negative_swivel():
    """Wrist ahead along x, left is y: outwards is -y."""
    found, _ = swivels(np.zeros((1, 3)), [[0.15, -0.15, -0.1]], [[0.3, 0.0, 0.0]])
    assert found[0] < 0


def test_where_the_body_stands_and_faces_makes_no_difference():
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.5, 0.5, size=(3, 20, 3))
    turn = rotation_matrices([0.0, 0.0, 1.1])
    moved = points @ turn.T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(swivels(*points)[0], swivels(*moved)[0], atol=1e-12)


# Learning.


def test_a_linear_swivel_is_learned_exactly_whatever_the_arm_s_size():
    learned = learn_swivel(reaches(linear), ridge=0.0)
    larger = learn_swivel([tuple(2.0 * part for part in reach) for reach in reaches(linear)], ridge=0.0)
    x = np.array([[0.6, 0.2, -0.4], [0.5, 0.1, -0.35]])
    np.testing.assert_allclose(learned.at(x), linear(x), atol=1e-9)
    np.testing.assert_allclose(larger.at(x), learned.at(x), atol=1e-9)
    assert learned.error < 1e-3 < learned.spread  # the left out wrists go beyond the others' range


def test_the_error_is_that_of_reaches_left_out_not_of_those_learned_from():
    """One reach of six lies: the others' fit misses it by what it lies, and it is 1/6 of the squares."""
    shown = reaches(lambda x: np.full(len(x), -0.4))
    shown[2] = reaches(lambda x: np.full(len(x), 0.2), count=1)[0]
    learned = learn_swivel(shown, ridge=1e6)
    within = 0.1  # every other fit's mean is off by a fifth of it, too
    expected = np.sqrt((0.6**2 + 5 * (0.6 / 5) ** 2) / 6)
    assert learned.error == pytest.approx(expected, rel=1e-6)
    assert learned.spread == pytest.approx(expected, rel=1e-6) and learned.error > within


def test_noise_shows_in_the_error():
    learned = learn_swivel(reaches(linear, samples=200, noise=0.05))
    assert learned.error == pytest.approx(0.05, rel=0.15)


def test_stretched_arms_teach_nothing():
    shown = reaches(linear)
    stretched = np.tile([[0.0, 0.0, 0.0]], (50, 1))
    wrists = np.tile([[0.3, 0.0, -0.3]], (50, 1)) * np.linspace(0.9, 1.0, 50)[:, None]
    elbows = 0.5 * wrists + [0.0, 0.019, 0.0]
    with_stretched = learn_swivel([*shown, (stretched, elbows, wrists)])
    assert with_stretched.error < 0.05


def test_one_reach_has_no_error_to_say():
    assert np.isnan(learn_swivel(reaches(linear, count=1)).error)


def test_a_swivel_comes_back_from_its_file(tmp_path):
    learned = learn_swivel(reaches(linear, noise=0.02))
    learned.save(tmp_path / "elbow.safetensors")
    back = Swivel.load(tmp_path / "elbow.safetensors")
    x = np.array([[0.6, 0.2, -0.4]])
    np.testing.assert_array_equal(back.at(x), learned.at(x))
    assert back.error == learned.error and back.spread == learned.spread
    one = learn_swivel(reaches(linear, count=1))
    one.save(tmp_path / "one.safetensors")
    assert np.isnan(Swivel.load(tmp_path / "one.safetensors").error)


def test_beyond_what_was_shown_the_swivel_is_that_of_the_range_s_border():
    swivel = Swivel(np.array([0.5, 0.5, -0.5]), -0.3, np.array([1.0, 2.0, 3.0]), RANGE)
    inside, border = swivel.at([[0.9, 0.2, -0.1]]), swivel.at([[1.0, 0.2, 0.0]])
    assert inside[0] == pytest.approx(-0.3 + 0.4 - 0.6 + 1.2)
    assert swivel.at([[7.0, 0.2, 0.4]])[0] == border[0]
    np.testing.assert_array_equal(swivel.slope_at(np.array([0.9, 0.2, -0.1])), [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(swivel.slope_at(np.array([7.0, 0.2, 0.4])), [0.0, 2.0, 0.0])


def test_the_range_is_that_of_the_wrists_that_were_shown():
    shown = reaches(linear)
    wrists = np.concatenate([wrist - shoulder for shoulder, _, wrist in shown]) / REACH
    learned = learn_swivel(shown)
    np.testing.assert_allclose(learned.shown, [wrists.min(axis=0), wrists.max(axis=0)])


# The preference.


@pytest.fixture(scope="module")
def wanted():
    shown = np.array([[-0.2, -1.0, -1.0], [1.0, 0.5, 0.3]])
    return Swivel(np.array([0.6, 0.2, -0.6]), -0.6, np.array([-1.3, 0.5, 0.5]), shown)


@pytest.mark.sim
def test_the_preference_s_error_is_the_swivel_of_the_robot_s_own_points_less_the_wanted_one(icub, wanted):
    """By the chains to elbow and wrist; the iCub's root has x backwards and y to the right."""
    preference, arm = SwivelPreference(icub, wanted), Arm(icub)
    rng = np.random.default_rng(1)
    limits = icub.limits(arm.names)
    reach = None
    for q in rng.uniform(*limits.T, size=(20, len(limits))):
        shoulder, elbow, wrist = (
            icub.tree.chain(icub.root, link).forward(q[:n])[:3, 3]
            for link, n in (("r_shoulder_3", 6), ("r_elbow_1", 7), ("r_wrist_1", 9))
        )
        flip = np.array([-1.0, -1.0, 1.0])
        zero = arm.at(np.zeros(len(limits))).frames[:, :3, 3]
        reach = reach or np.linalg.norm(zero[6] - zero[5]) + np.linalg.norm(zero[8] - zero[6])
        angle, _ = swivels(*(flip * p[None] for p in (shoulder, elbow, wrist)))
        expected = angle[0] - wanted.at([flip * (wrist - shoulder) / reach])[0]
        expected = (expected + np.pi) % (2 * np.pi) - np.pi
        assert preference.error(arm.at(q)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.sim
def test_the_preference_s_derivative_is_right(icub, wanted):
    preference, arm = SwivelPreference(icub, wanted, weight=0.7), Arm(icub)
    rng, h = np.random.default_rng(3), 1e-6
    limits = icub.limits(arm.names)
    for q in rng.uniform(*limits.T, size=(20, len(limits))):
        value, slope = preference(arm.at(q))
        if abs(value[0]) > 0.7 * 3.1:  # where a half turn wraps
            continue
        numeric = [
            (preference(arm.at(q + e))[0] - preference(arm.at(q - e))[0])[0] / (2 * h)
            for e in h * np.eye(len(q))
        ]
        np.testing.assert_allclose(slope[0], numeric, atol=1e-6)
        assert value[0] == pytest.approx(0.7 * preference.error(arm.at(q)))


@pytest.mark.sim
def test_a_solver_that_heeds_it_reaches_the_same_poses_with_the_elbow_nearer_to_it(icub, wanted):
    preference = SwivelPreference(icub, wanted, weight=1.0)
    free, heeding = PoseSolver(icub), PoseSolver(icub, preference=preference)
    rng, errors = np.random.default_rng(4), []
    for q in rng.uniform(*free.limits.T, size=(30, len(free.names))):
        pair = [solver.nearest(free.palm(q)) for solver in (free, heeding)]
        assert all(found.solved for found in pair)
        errors.append([abs(preference.error(free.arm.at(found.angles))) for found in pair])
    without, with_it = np.transpose(errors)
    assert np.median(with_it) < 0.7 * np.median(without)
    assert (with_it < without + 0.05).mean() > 0.9


@pytest.mark.sim
def test_a_stretched_arm_is_asked_nothing(icub, wanted):
    """By a posture whose elbow, wrist and shoulder are put on one line."""
    preference, arm = SwivelPreference(icub, wanted), Arm(icub)
    posture = arm.at(np.zeros(10))
    posture.frames = posture.frames.copy()
    for k in (5, 6, 8):
        posture.frames[k, :3, 3] = [-0.1 * k, 0.0, 0.0]
    value, slope = preference(posture)
    assert value.shape == (1,) and not value.any() and not slope.any()


# Errors.


@pytest.mark.parametrize(
    ("ask", "name"),
    [
        (lambda: learn_swivel([]), "reaches: expected at least one"),
        (lambda: learn_swivel([(np.zeros((3, 2)),) * 3]), "shoulders"),
        (lambda: learn_swivel([(np.full((3, 3), np.nan),) * 3]), "shoulders"),
        (
            lambda: learn_swivel(reaches(linear, count=1, samples=9)),
            "ten bent postures or more expected, got 9",
        ),
        (lambda: learn_swivel(reaches(linear), ridge=-1.0), "ridge"),
        (lambda: swivels(np.zeros((1, 3)), np.ones((2, 3)), np.ones((2, 3))), "wrists: as many"),
        (lambda: swivels(np.zeros((1, 3)), np.ones((1, 3)), np.zeros((1, 3))), "a wrist in the shoulder"),
        (lambda: Swivel(np.zeros(2), 0.0, np.zeros(3), RANGE), "middle"),
        (lambda: Swivel(np.zeros(3), np.nan, np.zeros(3), RANGE), "constant"),
        (lambda: Swivel(np.zeros(3), 0.0, np.zeros(3), RANGE[::-1]), "shown: expected the least and then"),
        (lambda: Swivel(np.zeros(3), 0.0, np.zeros(3), RANGE).at(np.zeros(3)), "wrists"),
        (lambda: Swivel.from_arrays({"middle": np.zeros(3), "slope": np.zeros(3)}, {}), "needs constant"),
        (lambda: Swivel.load("missing.safetensors"), "path"),
    ],
)
def test_what_cannot_be_learned_from_is_named(ask, name):
    with pytest.raises(ArgumentError, match=name):
        ask()


@pytest.mark.sim
@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"weight": -1.0}, "weight"),
        ({"forward": (0.0, 0.0, 0.0)}, "forward: expected a level unit vector"),
        ({"forward": (-0.6, 0.0, 0.8)}, "forward: expected a level unit vector"),
        ({"forward": (1.0, 0.0)}, "forward"),
    ],
)
def test_a_preference_that_is_wrong_is_named(icub, wanted, options, name):
    with pytest.raises(ArgumentError, match=name):
        SwivelPreference(icub, wanted, **options)


def test_a_robot_without_guarded_elbow_and_wrist_has_no_swivel(tmp_path, wanted):
    with pytest.raises(ArgumentError, match="'small' guards no elbow and wrist"):
        SwivelPreference(small_robot(tmp_path), wanted)


def test_words_are_no_places():
    with pytest.raises(ArgumentTypeError, match="wrists"):
        swivels(np.zeros((1, 3)), np.ones((1, 3)), [["a", "b", "c"]])
