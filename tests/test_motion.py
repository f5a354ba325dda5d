"""A movement of several legs: one after the other, in one simulation without seams."""

from dataclasses import replace

import numpy as np
import pytest

from motorprime.control.motion import TOO_LONG, Leg, Motion, simulate
from motorprime.control.movement import Goal, State
from motorprime.kinematics import transform
from motorprime.rotations import rotation_matrices
from small_dynamics import linear, random_model, random_pose, simple

START = State((0.0, 0.0, 0.0), transform(np.eye(3), (0.0, 0.0, 0.0)), 1.0)


def turned(angle):
    return rotation_matrices(np.array([0.0, 0.0, angle]))


def to(place, angle=0.0, **options):
    """A leg to a place, which the eyes look at, too."""
    return Leg(Goal(place, transform(turned(angle), place)), **options)


CORNER = to((0.3, 0.0, 0.0))
END = to((0.3, 0.3, 0.0), 0.8)


def brisk(rng):
    """A random model, none of its systems slower than 0.5/s."""
    model = random_model(rng)
    return model.with_speed(1.0 / (model.alpha * model.beta))


def at(place, angle=0.0):
    return transform(turned(angle), place)


# When a leg is done.


def test_a_leg_is_done_within_its_distance_and_not_at_it():
    leg = to((0.3, 0.0, 0.0), near=0.02)
    palms = np.array([at((x, 0.0, 0.0)) for x in (0.279, 0.281, 0.3, 0.319, 0.321)])
    np.testing.assert_array_equal(leg.done(palms), [False, True, True, True, False])


def test_distance_counts_in_every_direction():
    leg = to((0.3, 0.0, 0.0), near=0.02)
    palms = np.array(
        [at(np.array([0.3, 0.0, 0.0]) + 0.021 * axis) for axis in np.vstack([np.eye(3), -np.eye(3)])]
    )
    assert not leg.done(palms).any()


def test_a_leg_that_asks_for_a_turn_is_done_only_when_near_and_turned():
    leg = to((0.3, 0.0, 0.0), 1.0, near=0.02, turned=0.2)
    cases = [((0.3, 0.0, 0.0), 1.0), ((0.3, 0.0, 0.0), 0.81), ((0.3, 0.0, 0.0), 1.19)]
    assert leg.done(np.array([at(*case) for case in cases])).all()
    cases = [
        ((0.3, 0.0, 0.0), 0.79),
        ((0.3, 0.0, 0.0), 1.21),
        ((0.3, 0.0, 0.0), -1.0),
        ((0.2, 0.0, 0.0), 1.0),
    ]
    assert not leg.done(np.array([at(*case) for case in cases])).any()


def test_a_leg_that_asks_for_none_takes_any_turn():
    leg = to((0.3, 0.0, 0.0), near=0.02)
    assert leg.done(np.array([at((0.3, 0.0, 0.0), angle) for angle in (0.0, 1.5, 3.1)])).all()


# The simulation.


def test_one_leg_is_a_roll_out():
    motion = simulate(simple(), START, [END])
    alone = simple().roll_out(START, END.goal, seconds=TOO_LONG)
    np.testing.assert_array_equal(motion.simulated.palms, alone.palms)
    np.testing.assert_array_equal(motion.simulated.times, alone.times)
    assert motion.simulated.arrived
    assert motion.begins == (0,)
    assert motion.clearance == np.inf


def test_legs_are_followed_in_order_and_each_ends_at_the_first_instant_at_which_it_is_done():
    motion = simulate(simple(), START, [CORNER, END])
    path, turn = motion.simulated.path, motion.begins[1]
    assert motion.legs == (CORNER, END)
    assert motion.begins[0] == 0 < turn < len(path) - 1
    apart = np.linalg.norm(path - CORNER.goal.palm[:3, 3], axis=1)
    assert (apart[:turn] >= CORNER.near).all()
    assert apart[turn] < CORNER.near
    assert np.ptp(path[: turn + 1, 1]) == 0.0  # straight to the corner, and only then aside
    assert path[turn + 1, 1] > 0.0
    np.testing.assert_allclose(path[-1], END.goal.palm[:3, 3], atol=2e-3)
    assert motion.simulated.arrived


def test_a_leg_that_asks_for_a_turn_is_left_later():
    slowly = simple(arm=linear([4.0] * 3 + [1.0] * 3))
    corner = replace(CORNER, goal=Goal(CORNER.goal.fixation, at((0.3, 0.0, 0.0), 1.2)))
    anyhow, turning = (
        simulate(slowly, START, [replace(corner, turned=turned), END]) for turned in (np.inf, 0.1)
    )
    assert turning.begins[1] > anyhow.begins[1] + 10
    palm = turning.simulated.palms[turning.begins[1]]
    assert np.arccos((np.trace(palm[:3, :3].T @ at((0, 0, 0), 1.2)[:3, :3]) - 1.0) / 2.0) < 0.1


@pytest.mark.parametrize("legs", [1, 2, 3, 4])
def test_the_joined_simulation_is_continuous_in_everything(rng, legs):
    model = brisk(rng)
    places = [Leg(Goal(rng.normal(size=3), random_pose(rng), 0.1), near=0.2) for _ in range(legs)]
    start = State(rng.normal(size=3), random_pose(rng), 0.7)
    motion = simulate(model, start, places)
    rolled = motion.simulated
    assert len(rolled.times) == len(rolled.palms) == len(rolled.fixations) == len(rolled.openings)
    np.testing.assert_allclose(np.diff(rolled.times), 0.01, atol=1e-9)  # no instant twice, none left out
    assert rolled.times[0] == 0.0
    np.testing.assert_allclose(rolled.palms[0], start.palm, atol=1e-9)
    np.testing.assert_allclose(rolled.fixations[0], start.fixation, atol=1e-9)
    assert rolled.openings[0] == pytest.approx(start.opening)
    assert len(set(motion.begins)) == len(motion.begins) == legs  # all of them were done
    assert motion.begins == tuple(sorted(motion.begins))
    # Every instant follows from the one before by the dynamics of the leg that it lies on.
    for k in range(0, len(rolled) - 1, max(1, len(rolled) // 40)):
        leg = int(np.searchsorted(motion.begins, k, side="right")) - 1
        now = State(rolled.fixations[k], rolled.palms[k], float(rolled.openings[k]))
        then = model.step(now, places[leg].goal, 0.01)
        np.testing.assert_allclose(rolled.palms[k + 1], then.palm, atol=1e-9)
        np.testing.assert_allclose(rolled.fixations[k + 1], then.fixation, atol=1e-9)
        assert rolled.openings[k + 1] == pytest.approx(then.opening, abs=1e-9)


def test_where_one_leg_begins_the_one_before_is_done(rng):
    model = brisk(rng)
    legs = [Leg(Goal(rng.normal(size=3), random_pose(rng), 0.1), near=0.1) for _ in range(4)]
    motion = simulate(model, State(rng.normal(size=3), random_pose(rng), 0.7), legs)
    for before, begin in zip(legs[:-1], motion.begins[1:], strict=True):
        assert before.done(motion.simulated.palms[[begin]])[0]


def test_a_leg_that_is_done_from_the_start_costs_no_time():
    there = to((0.01, 0.0, 0.0), near=0.03)
    direct, over = simulate(simple(), START, [END]), simulate(simple(), START, [there, END])
    assert over.begins == (0, 0)
    np.testing.assert_allclose(over.simulated.palms, direct.simulated.palms, atol=1e-12)
    np.testing.assert_array_equal(over.simulated.times, direct.simulated.times)


def test_a_leg_that_is_never_done_ends_the_simulation_there_and_it_has_not_arrived():
    never = replace(CORNER, near=1e-9)
    motion = simulate(simple(), START, [never, END])
    assert not motion.simulated.arrived
    assert motion.legs == (never, END)
    assert len(motion.begins) == 2 and max(motion.begins) < len(motion.simulated)
    np.testing.assert_allclose(motion.simulated.path[-1], CORNER.goal.palm[:3, 3], atol=2e-3)
    assert np.abs(motion.simulated.path[:, 1]).max() == 0.0


def test_a_last_leg_that_takes_too_long_has_not_arrived():
    slow = simple().with_speed(0.01)
    motion = simulate(slow, START, [END])
    assert not motion.simulated.arrived
    assert motion.simulated.times[-1] == pytest.approx(TOO_LONG)


def test_the_step_is_the_one_that_is_asked_for():
    motion = simulate(simple(), START, [CORNER, END], dt=0.005)
    np.testing.assert_allclose(np.diff(motion.simulated.times), 0.005, atol=1e-9)


# What is left of a motion.


@pytest.fixture
def motion():
    return simulate(simple(), START, [CORNER, to((0.3, 0.15, 0.0)), END])


def test_its_goal_is_that_of_the_last_leg(motion):
    assert motion.goal is END.goal


def test_far_from_everything_nothing_is_dropped(motion):
    assert motion.advance(START.palm) is motion


def test_a_leg_that_is_done_is_dropped_with_its_beginning(motion):
    left = motion.advance(at((0.29, 0.0, 0.0)))
    assert left.legs == motion.legs[1:]
    assert left.begins == motion.begins[1:]
    assert left.simulated is motion.simulated
    assert len(motion.legs) == 3


def test_a_leg_is_not_dropped_before_the_one_before_it(motion):
    assert motion.advance(at((0.3, 0.15, 0.0))) is motion


def test_several_that_are_done_at_once_are_dropped_at_once():
    near = simulate(simple(), START, [to((0.3, 0.0, 0.0)), to((0.31, 0.0, 0.0)), END])
    assert near.advance(at((0.3, 0.0, 0.0))).legs == near.legs[2:]


def test_the_last_leg_stays():
    motion = simulate(simple(), START, [END])
    assert motion.advance(END.goal.palm) is motion


def test_a_leg_is_left_only_when_turned_enough():
    strict = replace(CORNER, turned=0.1)
    motion = simulate(simple(), START, [strict, END])
    assert motion.advance(at((0.3, 0.0, 0.0), 0.2)) is motion
    assert motion.advance(at((0.3, 0.0, 0.0), 0.05)).legs == (END,)


def test_shifted_replaces_the_goals_of_the_last_legs_and_nothing_else(motion):
    first, second = to((0.3, 0.16, 0.0)).goal, to((0.3, 0.31, 0.0)).goal
    moved = motion.shifted([first, second])
    assert [leg.goal for leg in moved.legs] == [CORNER.goal, first, second]
    assert moved.legs[0] is motion.legs[0]
    assert [(leg.near, leg.turned, leg.slim) for leg in moved.legs] == [
        (leg.near, leg.turned, leg.slim) for leg in motion.legs
    ]
    assert moved.simulated is motion.simulated and moved.begins == motion.begins
    assert motion.goal is END.goal  # the old one is as it was


def test_shifted_with_more_goals_than_legs_are_left_takes_the_last_of_them():
    left = simulate(simple(), START, [END])
    first, second = to((0.0, 0.0, 0.1)).goal, to((0.0, 0.0, 0.2)).goal
    moved = left.shifted([first, second])
    assert [leg.goal for leg in moved.legs] == [second]


def test_a_shifted_via_point_stays_slim():
    via = replace(CORNER, slim=True)
    moved = Motion((via, END), simulate(simple(), START, [via, END]).simulated, (0, 1)).shifted(
        [CORNER.goal] * 2
    )
    assert [leg.slim for leg in moved.legs] == [True, False]
