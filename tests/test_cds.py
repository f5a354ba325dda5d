"""Eye, arm and hand move together, come to rest at the goal, and wait for each other."""

import math

import numpy as np
import pytest

from motorprime.control.cds import CoupledDynamics, Goal, State, Tolerance
from motorprime.control.lpvds import LpvDs
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.kinematics import rotation_from_rpy, transform
from motorprime.model_files import read_model, write_model
from motorprime.rotations import rotation_matrices, rotation_vectors
from small_dynamics import STEP, line, linear, open_until, random_model, random_pose, simple

PALM = transform(rotation_from_rpy((0.3, -0.5, 1.2)), (-0.3, 0.1, 0.05))
GOAL = Goal(np.array([-0.35, 0.1, 0.1]), PALM)


def at(place, *, fixation=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), opening=0.3, goal=GOAL):
    """A state that far from the goal, in the goal palm's axes."""
    palm = goal.palm @ transform(rotation_matrices(turn), place)
    return State(goal.fixation + goal.palm[:3, :3] @ np.asarray(fixation), palm, goal.opening + opening)


# The frame of the goal.


def test_a_state_is_relative_to_the_goal_in_the_goal_palm_s_axes():
    state = at([0.1, -0.2, 0.3], fixation=[0.01, 0.02, 0.03], turn=[0.3, 0.2, -0.1], opening=0.4)
    expected = [0.01, 0.02, 0.03, 0.1, -0.2, 0.3, 0.3, 0.2, -0.1, 0.4]
    np.testing.assert_allclose(GOAL.relative(state), expected, atol=1e-12)


def test_relative_and_absolute_undo_each_other(rng):
    for _ in range(20):
        goal = Goal(rng.normal(size=3), random_pose(rng), 0.1)
        state = State(rng.normal(size=3), random_pose(rng), 0.7)
        fixations, palms, openings = goal.absolute(goal.relative(state)[None])
        np.testing.assert_allclose(fixations[0], state.fixation, atol=1e-12)
        np.testing.assert_allclose(palms[0], state.palm, atol=1e-12)
        assert openings[0] == pytest.approx(0.7)


def test_a_movement_turns_and_shifts_with_its_goal(rng):
    model = random_model(rng)
    rotation = transform(rotation_from_rpy((0.7, 0.1, -0.4)), (0.2, -0.3, 0.4))
    start = at([0.2, 0.1, -0.1], fixation=[0.3, 0.0, 0.1], turn=[0.5, -0.4, 0.2])
    goal = Goal(rotation[:3, :3] @ GOAL.fixation + rotation[:3, 3], rotation @ GOAL.palm)
    turned = State(rotation[:3, :3] @ start.fixation + rotation[:3, 3], rotation @ start.palm, start.opening)
    plain, moved = model.roll_out(start, GOAL), model.roll_out(turned, goal)
    np.testing.assert_allclose(moved.palms, rotation @ plain.palms, atol=1e-9)
    np.testing.assert_allclose(moved.openings, plain.openings, atol=1e-9)


# One step.


def test_every_system_steps_along_its_own_velocity_towards_the_goal():
    """Eye 6/s, place 2/s, turn 3/s; the eye is at its goal, so the arm is free."""
    step = simple().step(at([0.2, 0.0, 0.0], turn=[0.0, 0.3, 0.0], opening=0.9), GOAL, 0.01)
    relative = GOAL.relative(step)
    np.testing.assert_allclose(relative[3:6], [0.2 * 0.98, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(relative[6:9], [0.0, 0.3 * 0.97, 0.0], atol=1e-12)
    eye = simple().step(at([0.2, 0.0, 0.0], fixation=[0.0, 0.1, 0.0]), GOAL, 0.01)
    np.testing.assert_allclose(GOAL.relative(eye)[:3], [0.0, 0.1 * 0.94, 0.0], atol=1e-12)


def test_the_arm_waits_by_how_far_the_eye_says_it_should_be():
    """Eye at 0.2: the arm is expected at 0.16, and stands at 0.2: g = 1 - 0.8."""
    step = simple().step(at([0.0, 0.2, 0.0], fixation=[0.2, 0.0, 0.0]), GOAL, 0.01)
    np.testing.assert_allclose(GOAL.relative(step)[3:6], [0.0, 0.2 * (1 - 0.02 * 0.2), 0.0], atol=1e-12)


def test_the_arm_stands_still_where_it_is_closer_than_the_eye_expects():
    for place in ([0.1, 0.0, 0.0], [0.0, -0.15, 0.0]):
        start = at(place, fixation=[0.0, 0.0, 0.2], turn=[0.2, 0.0, 0.0])
        step = simple().step(start, GOAL, 0.01)
        np.testing.assert_allclose(step.palm, start.palm, atol=1e-12)


def test_the_hand_goes_to_what_the_arm_s_distance_asks_for():
    """5/s towards 0.9 from either side, scaled by the goal's amplitude; towards 0 with amplitude 0."""
    for opening, amplitude, wanted in ((0.3, 1.0, 0.9), (1.2, 1.0, 0.9), (0.3, 0.5, 0.45), (0.3, 0.0, 0.0)):
        goal = Goal(GOAL.fixation, GOAL.palm, 0.0, amplitude)
        step = simple().step(at([0.3, 0.0, 0.0], opening=opening, goal=goal), goal, 0.01)
        assert step.opening == pytest.approx(opening - 0.05 * (opening - wanted))


def test_the_hand_s_goal_is_where_the_arm_is_at_its_own():
    goal = Goal(GOAL.fixation, GOAL.palm, 0.4)
    step = simple().step(at([0.0, 0.0, 0.0], opening=0.2, goal=goal), goal, 0.01)
    assert step.opening == pytest.approx(0.4 + 0.2 * 0.95)


def test_what_is_expected_of_arm_and_hand_stays_within_what_makes_sense():
    """Far outside the demonstrations regression may say anything: below 0, or above fully open."""
    far = at([0.9, 0.0, 0.0], opening=0.5)
    above = simple(arm_hand=line(20.0, 0.02)).step(far, GOAL, 0.01)
    assert above.opening == pytest.approx(0.5 + 0.05 * 0.5)
    below = simple(arm_hand=line(-1.0)).step(far, GOAL, 0.01)
    assert below.opening == pytest.approx(0.5 * 0.95)
    start = at([0.1, 0.0, 0.0], fixation=[0.5, 0.0, 0.0])
    free = simple(eye_arm=line(-1.0)).step(start, GOAL, 0.01)
    np.testing.assert_allclose(GOAL.relative(free)[3:6], [0.1 * 0.98, 0.0, 0.0], atol=1e-12)


def test_alpha_scales_the_velocity_and_beta_the_state_that_is_seen(rng):
    """Of a mixture, so that beta is more than another alpha: it looks the weights up elsewhere."""
    model = random_model(rng)
    start = at([0.2, 0.1, -0.1], fixation=[0.1, 0.1, 0.0])
    e, h = GOAL.relative(start)[:3], GOAL.relative(start)[9]
    scaled = CoupledDynamics(
        *model.systems.values(), model.eye_arm, model.arm_hand, alpha=[0.5, 1.0, 0.25], beta=[0.7, 1.0, 2.0]
    )
    step = GOAL.relative(scaled.step(start, GOAL, 0.01))
    np.testing.assert_allclose(step[:3], e + 0.005 * model.eye.velocity(0.7 * e), atol=1e-12)
    wanted = min(1.0, max(0.0, model.arm_hand.expected(float(np.linalg.norm([0.2, 0.1, -0.1])))))
    expected = h + 0.0025 * model.hand.velocity(np.array([2.0 * (h - wanted)]))[0]
    assert step[9] == pytest.approx(expected)


def test_a_palm_that_only_has_to_turn_does_not_wait_for_ever():
    """Its place is exactly right, and the eye comes from afar."""
    start = at([0.0, 0.0, 0.0], fixation=[0.4, 0.0, 0.0], turn=[1.5, 0.0, 0.0])
    waiting = simple().step(start, GOAL, 0.01)
    np.testing.assert_allclose(waiting.palm, start.palm, atol=1e-12)
    rolled = simple().roll_out(start, GOAL, seconds=4.0)
    assert rolled.arrived and np.isfinite(rolled.palms).all()


def test_a_turn_beyond_half_a_turn_goes_on_the_short_way(rng):
    """In a slanted metric the vector may grow past pi on its way; steps and roll-outs agree on what then."""
    swirl = np.array([[-1.0, 6.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = -np.eye(3), swirl
    metric = np.diag([1.0, 1.0, 1.0, 1.0, 36.0, 1.0])
    arm = LpvDs(np.ones(1), np.zeros((1, 3)), np.eye(3)[None], matrix[None], metric, STEP)
    model = simple(arm=arm)
    state = at([0.05, 0.0, 0.0], turn=[3.0, 0.9, 0.0])
    rolled = model.roll_out(state, GOAL, seconds=20.0)
    assert rolled.arrived
    vectors = rotation_vectors(GOAL.palm[:3, :3].T @ rolled.palms[:, :3, :3])
    assert np.linalg.norm(np.diff(vectors, axis=0), axis=1).max() > 3.0  # it did flip to the other side
    energy = (vectors**2) @ [1.0, 36.0, 1.0]
    assert (np.diff(energy) < 1e-9).all()
    for palm in rolled.palms[1:60]:
        state = model.step(state, GOAL)
        np.testing.assert_allclose(state.palm, palm, atol=1e-9)


# Movements.


def test_a_roll_out_is_the_steps_one_after_the_other(rng):
    model, goal = random_model(rng), Goal(rng.normal(size=3), random_pose(rng), 0.2, 0.8)
    state = State(rng.normal(size=3), random_pose(rng), 0.9)
    rolled = model.roll_out(state, goal, dt=0.01, seconds=1.0, tolerance=Tolerance(0, 0, 0, 0))
    assert len(rolled) == 101 and not rolled.arrived
    np.testing.assert_allclose(rolled.times, 0.01 * np.arange(101))
    for k in range(101):
        np.testing.assert_allclose(rolled.fixations[k], state.fixation, atol=1e-9)
        np.testing.assert_allclose(rolled.palms[k], state.palm, atol=1e-9)
        assert rolled.openings[k] == pytest.approx(state.opening, abs=1e-9)
        state = model.step(state, goal, 0.01)


def test_random_models_come_to_rest_at_the_goal_from_anywhere(rng):
    for _ in range(5):
        model = random_model(rng)
        for _ in range(3):
            goal = Goal(rng.normal(size=3), random_pose(rng), 0.1)
            start = State(rng.normal(size=3), random_pose(rng, 1.0), rng.uniform(0.2, 1.2))
            rolled = model.roll_out(start, goal, seconds=60.0)
            assert rolled.arrived
            np.testing.assert_allclose(rolled.fixations[-1], goal.fixation, atol=0.001)
            np.testing.assert_allclose(rolled.path[-1], goal.palm[:3, 3], atol=0.001)
            turned = rotation_vectors(goal.palm[:3, :3].T @ rolled.palms[-1, :3, :3])
            assert np.linalg.norm(turned) < math.radians(1.0)
            assert rolled.openings[-1] == pytest.approx(0.1, abs=0.01)


def test_the_energy_of_eye_and_place_falls_at_every_step(rng):
    model = random_model(rng)
    rolled = model.roll_out(at([0.3, -0.2, 0.1], fixation=[0.2, 0.2, 0.1], turn=[1, 1, 1]), GOAL)
    relative = np.array([GOAL.relative(State(*row)) for row in _rows(rolled)])
    for part, metric in ((slice(0, 3), model.eye.lyapunov), (slice(3, 9), model.arm.lyapunov)):
        energy = np.einsum("ni,ij,nj->n", relative[:, part], metric, relative[:, part])
        assert (np.diff(energy) < 1e-12).all()


def _rows(rolled):
    return zip(rolled.fixations, rolled.palms, rolled.openings, strict=True)


def test_the_eye_lands_before_the_arm_and_the_hand_closes_after_it():
    rolled = simple().roll_out(at([0.3, 0.0, 0.0], fixation=[0.3, 0.0, 0.0], opening=0.9), GOAL)
    assert rolled.arrived
    gaze = np.linalg.norm(rolled.fixations - GOAL.fixation, axis=1)
    reach = np.linalg.norm(rolled.path - GOAL.palm[:3, 3], axis=1)
    landed, there = np.argmax(gaze < 0.02), np.argmax(reach < 0.02)
    assert landed < there
    assert (rolled.openings[:there] > 0.1).all() and rolled.openings[-1] < 0.02


def test_a_hand_that_is_not_coupled_closes_while_the_arm_is_far():
    goal = Goal(GOAL.fixation, GOAL.palm, amplitude=0.0)
    rolled = simple().roll_out(at([0.3, 0.0, 0.0], opening=0.9), goal)
    reach = np.linalg.norm(rolled.path - GOAL.palm[:3, 3], axis=1)
    assert (rolled.openings[reach > 0.02] < 0.1).any()


def test_a_goal_that_moves_on_the_way_is_reached_as_well(rng):
    model = random_model(rng)
    half = model.roll_out(at([0.3, 0.0, 0.0], fixation=[0.2, 0.0, 0.0]), GOAL, seconds=0.5)
    now = State(half.fixations[-1], half.palms[-1], half.openings[-1])
    goal = Goal(rng.normal(size=3), random_pose(rng))
    assert model.roll_out(now, goal, seconds=60.0).arrived


def test_a_movement_that_is_over_is_its_start():
    rolled = simple().roll_out(at([0.0, 0.0, 0.0], opening=0.0), GOAL)
    assert rolled.arrived and len(rolled) == 1
    np.testing.assert_allclose(rolled.palms[0], GOAL.palm, atol=1e-12)


@pytest.mark.parametrize(
    ("start", "tolerance"),
    [
        ({"place": [0.0, 0.0, 0.0], "fixation": [0.0, 0.0020, 0.0]}, Tolerance(fixation=0.003)),
        ({"place": [0.002, 0.0, 0.0]}, Tolerance(place=0.003)),
        ({"place": [0.0, 0.0, 0.0], "turn": [0.1, 0.0, 0.0]}, Tolerance(turn=0.11)),
        ({"place": [0.0, 0.0, 0.0], "opening": -0.2}, Tolerance(opening=0.21)),
    ],
    ids=["fixation", "place", "turn", "opening"],
)
def test_each_system_has_to_be_within_its_own_tolerance(start, tolerance):
    state = at(**({"opening": 0.0} | start))
    assert len(simple().roll_out(state, GOAL, tolerance=tolerance)) == 1
    assert len(simple().roll_out(state, GOAL)) > 1


def test_from_very_far_where_every_density_underflows_nothing_is_nan(rng):
    model = random_model(rng)
    for far in (1e3, 1e6):
        rolled = model.roll_out(at([far, -far, far], fixation=[-far, far, far]), GOAL, seconds=2.0)
        for values in (rolled.fixations, rolled.palms, rolled.openings):
            assert np.isfinite(values).all()


def test_a_faster_model_does_the_same_in_less_time():
    start = at([0.3, 0.0, 0.0], fixation=[0.3, 0.0, 0.0])
    slow = simple(about={"source": "drawn by hand"})
    fast = slow.with_speed(2.0)
    assert fast.about == slow.about
    plain, quick = slow.roll_out(start, GOAL, dt=0.01), fast.roll_out(start, GOAL, dt=0.005)
    np.testing.assert_allclose(quick.palms, plain.palms, atol=1e-12)
    assert fast.largest_step == pytest.approx(slow.largest_step / 2.0)
    eyes = slow.with_speed([2.0, 1.0, 1.0])
    np.testing.assert_array_equal(eyes.alpha, [2.0, 1.0, 1.0])
    np.testing.assert_array_equal(slow.alpha, [1.0, 1.0, 1.0])


# Bad input.


def test_a_step_beyond_the_certificate_is_refused_and_the_largest_is_named():
    model = simple(hand=linear([5.0], step=0.008))
    assert model.largest_step == 0.008
    start = at([0.1, 0.0, 0.0])
    model.step(start, GOAL, 0.008)
    for call in (model.step, lambda s, g, dt: model.roll_out(s, g, dt=dt)):
        with pytest.raises(ArgumentError, match=r"dt: expected at most 0\.008 s"):
            call(start, GOAL, 0.009)
    with pytest.raises(ArgumentError, match=r"at most 0\.001 s"):
        CoupledDynamics(
            *model.systems.values(), model.eye_arm, model.arm_hand, alpha=[1, 1, 2], beta=[1, 1, 4]
        ).step(start, GOAL, 0.002)


@pytest.mark.parametrize("dt", [0.0, -0.01, math.nan, math.inf])
def test_a_time_step_is_a_positive_number(dt):
    with pytest.raises(ArgumentError, match="dt: "):
        simple().step(at([0.1, 0, 0]), GOAL, dt)
    with pytest.raises(ArgumentError, match="seconds: "):
        simple().roll_out(at([0.1, 0, 0]), GOAL, seconds=dt)


def test_a_movement_of_too_many_steps_is_refused():
    with pytest.raises(ArgumentError, match="seconds: expected at most 1000000 steps"):
        simple().roll_out(at([0.1, 0, 0]), GOAL, dt=1e-5, seconds=11.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fixation": [0.0, math.nan, 0.0]}, "fixation: expected finite"),
        ({"fixation": [0.0, 0.0]}, r"fixation: expected shape \(3,\)"),
        ({"palm": 2.0 * np.eye(4)}, "palm: expected"),
        ({"palm": np.diag([1.0, 1.0, -1.0, 1.0])}, "palm: expected a rotation"),
        ({"palm": np.eye(3)}, r"palm: expected shape \(4, 4\)"),
        ({"opening": math.nan}, "opening: expected finite"),
        ({"opening": 2.1}, "opening: expected -0.5 to 2.0"),
        ({"opening": -0.6}, "opening: expected -0.5 to 2.0"),
        ({"opening": [0.5]}, "opening: expected shape"),
    ],
)
def test_a_state_and_a_goal_that_make_no_sense_are_refused(change, message):
    good = {"fixation": [0.0, 0.0, 0.0], "palm": np.eye(4), "opening": 0.5}
    for kind in (State, Goal):
        with pytest.raises(ArgumentError, match=message):
            kind(**(good | change))


def test_an_amplitude_that_would_open_the_hand_beyond_all_is_refused():
    Goal([0, 0, 0], np.eye(4), 0.5, 1.5)
    for amplitude in (1.6, -0.1, math.nan):
        with pytest.raises(ArgumentError, match="amplitude: "):
            Goal([0, 0, 0], np.eye(4), 0.5, amplitude)


@pytest.mark.parametrize("name", ["fixation", "place", "turn", "opening"])
def test_tolerances_are_not_negative(name):
    for value in (-1e-3, math.nan):
        with pytest.raises(ArgumentError, match=f"{name}: "):
            Tolerance(**{name: value})


def test_states_and_goals_do_not_change_with_the_arrays_they_came_from():
    palm, fixation = np.eye(4), np.zeros(3)
    state, goal = State(fixation, palm, 0.5), Goal(fixation, palm)
    palm[0, 3], fixation[0] = 5.0, 5.0
    for one in (state, goal):
        assert one.palm[0, 3] == 0.0 and one.fixation[0] == 0.0
        with pytest.raises(ValueError, match="read-only"):
            one.palm[0, 3] = 1.0


def test_what_is_no_state_or_goal_is_a_type_error():
    start = at([0.1, 0, 0])
    with pytest.raises(ArgumentTypeError, match="state: expected a State"):
        simple().step(start.palm, GOAL)
    with pytest.raises(ArgumentTypeError, match="goal: expected a Goal"):
        simple().roll_out(start, GOAL.palm)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"eye": linear([1.0] * 2)}, ArgumentError, "eye: expected a system in 3 dimensions, got 2"),
        ({"arm": linear([1.0] * 3)}, ArgumentError, "arm: expected a system in 6 dimensions, got 3"),
        ({"hand": linear([1.0] * 2)}, ArgumentError, "hand: expected a system in 1 dimensions, got 2"),
        ({"hand": None}, ArgumentTypeError, "hand: expected an LpvDs"),
        ({"eye_arm": linear([1.0])}, ArgumentTypeError, "eye_arm: expected a Coupling"),
        ({"alpha": [1.0, 0.0, 1.0]}, ArgumentError, "alpha: expected three numbers > 0"),
        ({"alpha": 1.0}, ArgumentError, r"alpha: expected shape \(3,\)"),
        ({"beta": [1.0, 1.0, math.nan]}, ArgumentError, "beta: expected finite"),
    ],
)
def test_parts_that_do_not_fit_are_named(change, error, message):
    with pytest.raises(error, match=message):
        simple(**change)


def test_an_arm_that_mixes_place_and_rotation_is_refused():
    matrix = -2.0 * np.eye(6)
    matrix[4, 1] = 0.1
    mixed = LpvDs(np.ones(1), np.zeros((1, 3)), np.eye(3)[None], matrix[None], np.eye(6), STEP)
    with pytest.raises(ArgumentError, match="arm: expected matrices without terms between"):
        simple(arm=mixed)


def test_a_speed_is_positive():
    for factor in (0.0, -1.0, math.nan, [1.0, 2.0]):
        with pytest.raises(ArgumentError, match="factor: "):
            simple().with_speed(factor)


# Files.


def test_a_model_comes_back_from_its_file(tmp_path, rng):
    model = random_model(rng)
    model.about["source"] = "drawn by hand"
    model.save(tmp_path / "cds.safetensors")
    again = CoupledDynamics.load(tmp_path / "cds.safetensors")
    assert again.about == {"source": "drawn by hand"}
    start = at([0.3, 0.1, 0.0], fixation=[0.2, 0.0, 0.0], turn=[0.5, 0.0, 0.0])
    np.testing.assert_array_equal(again.roll_out(start, GOAL).palms, model.roll_out(start, GOAL).palms)


def test_a_file_whose_system_was_changed_loses_its_certificate(tmp_path, rng):
    path = tmp_path / "cds.safetensors"
    random_model(rng).save(path)
    arrays, about = read_model(path, "coupled dynamics")
    arrays["arm.matrices"] = -arrays["arm.matrices"]
    write_model(path, "coupled dynamics", arrays, about)
    with pytest.raises(StateError, match="not certified to converge"):
        CoupledDynamics.load(path)


def test_a_file_without_one_of_its_arrays_is_refused(tmp_path):
    path = tmp_path / "cds.safetensors"
    simple().save(path)
    arrays, about = read_model(path, "coupled dynamics")
    for name in ("alpha", "hand.step", "eye_arm.means"):
        write_model(path, "coupled dynamics", {k: v for k, v in arrays.items() if k != name}, about)
        with pytest.raises(ArgumentError, match=name):
            CoupledDynamics.load(path)


def test_the_hand_stays_within_the_openings_that_a_state_may_have():
    """A system may overshoot by almost as much as it was off: 80/s at a step of 0.02 s."""
    hand = linear([80.0])
    model = simple(hand=hand, arm_hand=open_until(0.001))
    state = State(GOAL.fixation, at([0.5, 0.0, 0.0]).palm, -0.5)
    goal = Goal(GOAL.fixation, GOAL.palm, 1.0)
    state = model.step(state, goal, 0.02)
    assert state.opening == 2.0  # and not 1.9 + 0.6 * 2.4
    for _ in range(20):
        state = model.step(state, goal, 0.02)
    assert state.opening == pytest.approx(1.9, abs=0.01)
