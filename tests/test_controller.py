"""From dynamics to joints: within limits and speeds, without jumps, and the palm gets there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from motorprime import shipped
from motorprime.control.clearance import Obstacle
from motorprime.control.controller import (
    AWRY,
    CALM,
    CLOSE,
    DRAWN,
    FOLDED,
    GRAZE,
    JOINT_SPEED,
    LEAD,
    LEAP,
    THINNING,
    Controller,
)
from motorprime.control.gaze import fixate
from motorprime.control.motion import Leg, simulate
from motorprime.control.movement import Goal
from motorprime.control.obstacle import plan_motion
from motorprime.control.pose import PoseSolution, PoseSolver
from motorprime.control.reaching import Bench
from motorprime.control.side_grasp import SIDE_GRASP
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, Error, StateError
from small_dynamics import simple

pytestmark = pytest.mark.sim

BENCH = Bench(height=-0.06, edge=-0.15)
GLASS = np.array([-0.28, 0.10, -0.01])
PERIOD, STEPS = 0.1, 4


@pytest.fixture(scope="module")
def arm(icub):
    return PoseSolver(icub, BENCH)


@pytest.fixture(scope="module")
def learned():
    return shipped.coupled_dynamics()


@pytest.fixture(scope="module")
def postures(arm):
    """Angles at the pre-grasp and the grasp of a glass, whose poses are reached exactly."""
    palm = SIDE_GRASP.pose(GLASS, np.deg2rad(40.0), 0.0325)
    grasp = arm.solve(palm).angles
    return arm.solve(SIDE_GRASP.pregrasp(arm.palm(grasp)), grasp).angles, grasp


@pytest.fixture(scope="module")
def start(arm):
    """A posture with the palm to the right of the glass and above."""
    turned = SIDE_GRASP.pose(GLASS, np.deg2rad(20.0), 0.0325)
    turned[:3, 3] = (-0.20, 0.28, 0.08)
    return arm.solve(turned).angles


def begun(arm, start, dynamics, *, opening=1.0):
    controller = Controller(dynamics, arm)
    robot = arm.robot
    gaze = robot.resting(robot.gaze)
    gaze = np.array(
        [dict(zip(arm.names, start, strict=True)).get(n, g) for n, g in zip(robot.gaze, gaze, strict=True)]
    )
    controller.begin(start, fixate(robot, gaze, GLASS), GLASS, opening)
    return controller


def legs(arm, postures, **options):
    before, grasp = (arm.palm(angles) for angles in postures)
    return [Leg(Goal(GLASS, before, 1.0, 0.0), 0.01, 0.1, **options), Leg(Goal(GLASS, grasp))]


class Recording:
    """A solver that notes its name and the posture that it is to prefer each time it follows."""

    def __init__(self, name, solver, calls):
        self._name, self._solver, self._calls = name, solver, calls

    def __getattr__(self, attribute):
        return getattr(self._solver, attribute)

    def follow(self, target, angles, *, step, hold=None, drawn=1.0):
        self._calls.append((self._name, hold, drawn))
        return self._solver.follow(target, angles, step=step, hold=hold, drawn=drawn)


def drive(controller, motion, seconds, each=lambda motion: None):
    """Commands and palms of so many seconds."""
    commands = []
    for _ in range(round(seconds / PERIOD)):
        motion, more = controller.advance(motion, PERIOD, steps=STEPS)
        commands += more
        each(motion)
    return motion, commands


def column(commands, names):
    return np.array([[command[name] for name in names] for command in commands])


@pytest.fixture(scope="module")
def driven(arm, start, postures, learned):
    """A whole reach by the shipped dynamics: controller, commands, and the state after each period."""
    controller = begun(arm, start, learned)
    before = controller.angles.copy(), controller.gaze.copy()
    motion = simulate(learned, controller.state, legs(arm, postures))
    states, palms = [], []

    def watch(motion):
        states.append(controller.state)
        palms.append(controller.palm)

    left, commands = drive(controller, motion, 7.0, watch)
    return controller, left, commands, before, states, palms


def test_the_palm_arrives_and_is_turned_as_asked(driven, arm, postures):
    controller, left, commands, _, _, _ = driven
    goal = arm.palm(postures[1])
    assert np.linalg.norm(controller.palm[:3, 3] - goal[:3, 3]) < 0.004
    assert np.trace(controller.palm[:3, :3].T @ goal[:3, :3]) > 1.0 + 2.0 * np.cos(np.deg2rad(3.0))
    assert len(left.legs) == 1
    np.testing.assert_allclose(arm.palm(column(commands, arm.names)[-1]), controller.palm)


def test_it_goes_by_the_first_leg(driven, arm, postures):
    before = arm.palm(postures[0])[:3, 3]
    assert min(np.linalg.norm(palm[:3, 3] - before) for palm in driven[-1]) < 0.01 + 0.01


def test_every_variable_that_it_drives_is_commanded_at_every_step(driven, icub, arm):
    for command in driven[2]:
        assert set(command) == {*arm.names, *icub.gaze, *icub.hand.motors}
        assert all(isinstance(value, float) and np.isfinite(value) for value in command.values())


def test_commands_stay_within_the_limits(driven, icub, arm):
    names = tuple(driven[2][0])
    commanded, limits = column(driven[2], names), icub.limits(names)
    assert (commanded >= limits[:, 0] - 1e-9).all()
    assert (commanded <= limits[:, 1] + 1e-9).all()


def test_no_joint_of_the_arm_is_faster_than_it_may_be(driven, arm):
    (angles, _), commands = driven[3], driven[2]
    turns = np.abs(np.diff(np.vstack([angles, column(commands, arm.names)]), axis=0))
    assert turns.max() <= JOINT_SPEED * PERIOD / STEPS + 1e-9
    assert turns.max() > 0.005  # it does move


def test_eyes_and_neck_go_on_from_call_to_call_without_a_jump(driven, icub, arm):
    """Within a period evenly, and from one period to the next from where they were left."""
    names = [name for name in icub.gaze if name not in arm.names]
    (_, gaze), commands = driven[3], driven[2]
    begun = [gaze[icub.gaze.index(name)] for name in names]
    path = np.vstack([begun, column(commands, names)])
    steps = np.diff(path, axis=0).reshape(-1, STEPS, len(names))
    np.testing.assert_allclose(steps, np.repeat(steps[:, :1], STEPS, axis=1), atol=1e-9)
    assert np.abs(steps).max() < JOINT_SPEED * PERIOD / STEPS
    assert np.abs(steps).max() > 0.0


def test_the_eyes_look_at_the_fixation_point_from_where_the_torso_goes(driven, icub):
    controller, commands = driven[0], driven[2]
    np.testing.assert_array_equal(controller.gaze, column(commands, icub.gaze)[-1])
    again = fixate(icub, controller.gaze, GLASS)
    np.testing.assert_allclose(controller.gaze, again, atol=0.02)


def test_the_hand_stays_roomy_until_the_palm_has_arrived_and_then_closes(driven, icub, arm, postures):
    _, _, commands, _, states, _ = driven
    goal = arm.palm(postures[1])[:3, 3]
    roomy = icub.hand.targets(SIDE_GRASP.roomy)
    closing = "r_pinky"
    away = np.array([np.linalg.norm(arm.palm(row)[:3, 3] - goal) for row in column(commands, arm.names)])
    bent = column(commands, [closing])[:, 0]
    far = away > SIDE_GRASP.arrived
    assert far.any() and not far[-1]
    assert bent[far].max() <= roomy[closing] + 1e-9
    assert bent[-1] > roomy[closing] + 0.1
    assert states[-1].opening < 0.05


def test_the_same_start_gives_the_same_commands(arm, start, postures, learned, driven):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    _, commands = drive(controller, motion, 0.5)
    assert commands == driven[2][: len(commands)]


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_any_number_of_commands_in_a_period_keeps_the_speed(arm, start, postures, learned, steps):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    rows = [start]
    for _ in range(6):
        motion, commands = controller.advance(motion, 0.2, steps=steps)
        assert len(commands) == steps
        rows += list(column(commands, arm.names))
    assert np.abs(np.diff(rows, axis=0)).max() <= JOINT_SPEED * 0.2 / steps + 1e-9


def test_time_is_cut_into_steps_that_the_dynamics_certify(arm, start, postures):
    """However few commands are asked for, the plan goes as far as it does with many."""
    dynamics, ends = simple(), []
    for steps in (1, 20):
        controller = begun(arm, start, dynamics)
        motion = simulate(dynamics, controller.state, legs(arm, postures))
        for _ in range(2):
            motion, _ = controller.advance(motion, 0.2, steps=steps)
        ends.append(controller.state.palm[:3, 3])
    np.testing.assert_allclose(ends[0], ends[1], atol=0.005)


def test_a_hand_that_waits_at_the_pregrasp_is_not_the_one_that_has_arrived(icub, arm, start, postures):
    controller = begun(arm, postures[0] + 1e-3, simple(), opening=0.0)
    motion = simulate(simple(), controller.state, legs(arm, postures))
    motion = replace(motion, legs=(replace(motion.legs[0], near=1e-12), motion.legs[1]))
    _, commands = controller.advance(motion, PERIOD)
    assert np.linalg.norm(controller.palm[:3, 3] - motion.legs[0].goal.palm[:3, 3]) < SIDE_GRASP.arrived
    assert commands[-1]["r_pinky"] == pytest.approx(icub.hand.targets(SIDE_GRASP.roomy)["r_pinky"])


# What holds the arm back.


def test_the_plan_runs_ahead_of_a_blocked_arm_by_a_limit_and_the_arm_follows_when_it_is_free(
    arm, start, learned
):
    """The goal is under the bench: the arm keeps above it."""
    below = arm.palm(start).copy()
    below[:3, 3] = (-0.25, 0.15, -0.30)
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, [Leg(Goal(GLASS, below))])
    ahead, lowest = [], []

    def watch(motion):
        ahead.append(np.linalg.norm(controller.state.palm[:3, 3] - controller.palm[:3, 3]))
        lowest.append(controller.palm[2, 3])

    drive(controller, motion, 5.0, watch)
    assert max(ahead) <= LEAD + 1e-6
    assert ahead[-1] == pytest.approx(LEAD, abs=0.002)
    assert controller.state.palm[2, 3] < controller.palm[2, 3] - 0.8 * LEAD  # ahead, not behind
    assert min(lowest) > BENCH.height
    free = arm.palm(start)
    motion, _ = drive(controller, simulate(learned, controller.state, [Leg(Goal(GLASS, free))]), 6.0)
    np.testing.assert_allclose(controller.palm[:3, 3], free[:3, 3], atol=0.005)


def test_an_arm_that_is_too_slow_for_its_plan_is_waited_for(arm, start, postures):
    """Ten times the speed of demonstrations: the joints cannot, and are not asked to."""
    dynamics = simple().with_speed(10.0)
    controller = begun(arm, start, dynamics)
    motion = simulate(dynamics, controller.state, legs(arm, postures), dt=0.002)
    ahead, before = [], start
    for _ in range(60):
        motion, commands = controller.advance(motion, 0.02, steps=1)
        ahead.append(np.linalg.norm(controller.state.palm[:3, 3] - controller.palm[:3, 3]))
        now = column(commands, arm.names)[0]
        assert np.abs(now - before).max() <= JOINT_SPEED * 0.02 + 1e-9
        before = now
    assert max(ahead) <= LEAD + 1e-6
    assert ahead[-1] < 0.003


def test_wary_on_the_way_careful_before_the_grasp_and_then_neither(arm, start, postures):
    """The glass itself stands in the way of a first leg that leads through it, and not of the last."""
    dynamics, calls, before = simple(), [], arm.palm(postures[0])[:3, 3]
    controller, left = begun(arm, start, dynamics), []
    for name in ("arm", "careful", "wary"):
        setattr(controller, name, Recording(name, arm, calls))
    motion = simulate(dynamics, controller.state, legs(arm, postures))
    while len(motion.legs) == 2:
        left.append(np.linalg.norm(controller.palm[:3, 3] - before))
        motion, _ = controller.advance(motion, PERIOD / STEPS, steps=1)
    drive(controller, motion, 1.0)
    used = [name for name, _, _ in calls]
    assert list(dict.fromkeys(used)) == ["wary", "careful", "arm"]
    assert used == sorted(used, key=["wary", "careful", "arm"].index)  # and never again
    at = used.index("careful")
    assert left[at] < CALM <= left[at - 1]
    assert {drawn for _, _, drawn in calls} == {1.0}  # nothing was rehearsed


def test_a_rehearsed_posture_draws_the_wary_arm_and_no_other(arm, start, postures, learned):
    calls = []
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    assert controller.rehearse(motion, hold=postures[1])
    for name in ("arm", "careful", "wary"):
        setattr(controller, name, Recording(name, arm, calls))
    drive(controller, motion, 7.0)
    drawn = {
        name: {share for other, _, share in calls if other == name} for name in ("wary", "careful", "arm")
    }
    assert drawn == {"wary": {DRAWN}, "careful": {1.0}, "arm": {1.0}}


# The slim hand.


def test_the_hand_becomes_slim_on_a_slim_leg_and_unfolds_before_the_last(icub, arm, start, postures):
    dynamics = simple()
    controller = begun(arm, start, dynamics)
    motion = simulate(dynamics, controller.state, legs(arm, postures, slim=True, unfold=0.03))
    slims = []
    _, commands = drive(
        controller, motion, 5.0, lambda motion: slims.append((len(motion.legs), controller.slim))
    )
    assert max(slim for count, slim in slims if count == 2) == pytest.approx(1.0)
    assert max(slim for count, slim in slims if count == 1) < FOLDED
    assert slims[-1] == (1, 0.0)
    steps = np.abs(np.diff([0.0, *(slim for _, slim in slims)]))
    assert steps.max() <= PERIOD / THINNING + 1e-9
    most = max(range(len(slims)), key=lambda k: slims[k][1])
    command = commands[STEPS * (most + 1) - 1]
    for motor, angle in icub.hand.shape(icub.hand.slim).items():
        assert command[motor] == pytest.approx(angle, abs=1e-9)


def test_a_hand_may_begin_slim(icub, arm, start, postures):
    controller = begun(arm, start, simple())
    gaze = controller.gaze.copy()
    controller.begin(start, gaze, GLASS, 1.0, slim=1.0)
    assert controller.slim == 1.0
    motion = simulate(simple(), controller.state, legs(arm, postures, slim=True, unfold=0.0))
    _, commands = controller.advance(motion, PERIOD)
    for motor, angle in icub.hand.shape(icub.hand.slim).items():
        assert commands[0][motor] == pytest.approx(angle, abs=1e-9)


def test_the_way_past_an_obstacle_to_a_single_goal_is_followed_to_its_end(arm, start, postures):
    """plan_motion's own via-point is slim and names no place to unfold."""
    controller = begun(arm, start, simple())
    goal = legs(arm, postures)[0].goal
    middle = (arm.palm(start)[:3, 3] + goal.palm[:3, 3]) / 2.0
    obstacle = Obstacle(Cylinder(0.02, 0.10), middle + np.array([-0.05, 0.0, 0.0]))
    motion = plan_motion(simple(), controller.state, [Leg(goal)], [obstacle])
    assert len(motion.legs) == 2
    left, _ = drive(controller, motion, 6.0)
    assert len(left.legs) == 1


def test_slim_or_not_no_finger_jumps(icub, arm, start, postures):
    dynamics = simple()
    controller = begun(arm, start, dynamics)
    motion = simulate(dynamics, controller.state, legs(arm, postures, slim=True, unfold=0.08))
    _, commands = drive(controller, motion, 5.0)
    first = list(icub.hand.targets(1.0).values())
    path = np.vstack([first, column(commands, icub.hand.motors)])
    spans = np.ptp(list(icub.hand.shapes.values()), axis=0).max()
    assert np.abs(np.diff(path, axis=0)).max() < 0.25 * spans


def test_without_a_via_leg_the_hand_is_never_slim(driven):
    assert driven[0].slim == 0.0


# Straight lines.


def test_track_takes_the_palm_straight_to_a_pose_and_leaves_the_fingers(icub, arm, start, learned):
    controller = begun(arm, start, learned)
    begin = controller.palm
    goal = begin.copy()
    goal[:3, 3] += (0.0, 0.0, 0.02)
    commands = controller.track(goal, 0.4, steps=8)
    places = np.array([arm.palm(row)[:3, 3] for row in column(commands, arm.names)])
    np.testing.assert_allclose(places[-1], goal[:3, 3], atol=2e-3)
    np.testing.assert_allclose(places[:, :2], np.tile(begin[:2, 3], (8, 1)), atol=2e-3)
    np.testing.assert_allclose(places[:, 2], begin[2, 3] + 0.02 * np.arange(1, 9) / 8, atol=2e-3)
    assert all(set(command) == {*arm.names, *icub.gaze} for command in commands)
    turns = np.abs(np.diff(np.vstack([start, column(commands, arm.names)]), axis=0))
    assert turns.max() <= JOINT_SPEED * 0.05 + 1e-9


# The rehearsal.


def test_a_motion_that_the_arm_can_do_passes_its_rehearsal_and_nothing_has_moved(
    arm, start, postures, learned
):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    before = controller.angles.copy(), controller.state, controller.slim
    assert controller.rehearse(motion, hold=postures[1])
    np.testing.assert_array_equal(controller.angles, before[0])
    assert (controller.state, controller.slim) == before[1:]
    drive(controller, motion, 7.0)
    goal = arm.palm(postures[1])[:3, 3]
    assert np.linalg.norm(controller.palm[:3, 3] - goal) < 0.004


def test_what_was_rehearsed_is_preferred_on_the_way_until_a_new_beginning(arm, start, postures, learned):
    """Postures on the way are those of the rehearsal, one after the other, up to the one at the end."""
    calls = []
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    assert controller.rehearse(motion, hold=postures[1])
    controller.arm = controller.careful = controller.wary = Recording("arm", arm, calls)
    drive(controller, motion, 7.0)
    held = np.array([hold for _, hold, _ in calls])
    palms = np.array([arm.palm(hold) for hold in held])
    ends = [arm.palm(angles)[:3, 3] for angles in (start, postures[1])]
    assert np.linalg.norm(palms[0, :3, 3] - ends[0]) < 0.1
    assert np.linalg.norm(palms[-1, :3, 3] - ends[1]) < 0.005
    ahead = np.linalg.norm(np.diff(palms[:, :3, 3], axis=0), axis=1)
    assert ahead.max() < 0.05  # the next one each time, not one far ahead
    assert len(np.unique(held, axis=0)) > 5
    calls.clear()
    controller.begin(start, arm.robot.resting(arm.robot.gaze), GLASS, 1.0)
    drive(controller, motion, 0.1)
    assert {hold for _, hold, _ in calls} == {None}


@pytest.mark.parametrize("place", [(-0.7, 0.1, 0.0), (-0.28, 0.10, -0.25), (0.5, 0.0, 0.3)])
def test_one_that_leads_out_of_reach_or_through_the_bench_fails_it(arm, start, learned, place):
    goal = arm.palm(start).copy()
    goal[:3, 3] = place
    controller = begun(arm, start, learned)
    assert not controller.rehearse(simulate(learned, controller.state, [Leg(Goal(GLASS, goal))]))


def test_one_whose_end_stands_in_the_way_fails_it(arm, start, postures, learned):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    blocked = arm.over(BENCH, [Obstacle(Cylinder(0.05, 0.2), GLASS)])
    controller.arm = controller.careful = controller.wary = blocked
    assert not controller.rehearse(motion)


class Scripted:
    """A solver whose answers are given: its posture leaps so far, and is so far off and so deep inside."""

    def __init__(self, arm, *, off=0.0, last_off=0.0, depth=0.0, leap=0.0):
        self._arm, self._off, self._last_off, self._depth, self._leap = arm, off, last_off, depth, leap
        self._called = 0

    def __getattr__(self, attribute):
        return getattr(self._arm, attribute)

    def nearest(self, target, start, *, hold=None, restarts=0):
        self._called += 1
        at_goal = np.allclose(target[:3, 3], self._arm.goal, atol=2e-3)
        angles = np.array(start)
        angles[0] += self._leap * (-1.0) ** self._called
        return PoseSolution(angles, self._last_off if at_goal else self._off, 0.0, self._depth, 0, True)


@pytest.mark.parametrize(
    ("lack", "limit"), [("off", AWRY), ("last_off", CLOSE), ("depth", GRAZE), ("leap", LEAP)]
)
def test_a_rehearsal_forgives_so_much_and_no_more(arm, start, postures, learned, lack, limit):
    """Off the path, off its end, inside of what is kept off, and from posture to posture."""
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    for share, passed in ((0.99, True), (1.01, False)):
        scripted = Scripted(arm, **{lack: share * limit})
        scripted._arm = SimpleNamespace(goal=motion.simulated.path[-1], palm=arm.palm)
        controller.arm = controller.careful = controller.wary = scripted
        assert controller.rehearse(motion) is passed


def test_what_only_the_wary_arm_keeps_off_is_forgiven_on_the_way_alone(arm, start, postures, learned):
    controller = begun(arm, start, learned)
    controller.spare = 0.004
    motion = simulate(learned, controller.state, legs(arm, postures))
    for share, passed in ((0.99, True), (1.01, False)):
        deep, clear = Scripted(arm, depth=GRAZE + share * controller.spare), Scripted(arm)
        deep._arm = clear._arm = SimpleNamespace(goal=motion.simulated.path[-1], palm=arm.palm)
        controller.arm, controller.careful, controller.wary = clear, clear, deep
        assert controller.rehearse(motion) is passed
        for name in ("arm", "careful"):
            controller.arm, controller.careful, controller.wary = clear, clear, clear
            setattr(controller, name, deep)
            assert not controller.rehearse(motion)


def test_what_the_wary_arm_keeps_off_on_the_way_fails_it(arm, start, postures, learned):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    midway = motion.simulated.path[motion.begins[1] // 3]
    wary = arm.over(BENCH, [Obstacle(Cylinder(0.06, 0.3), midway)])
    assert controller.rehearse(motion, hold=postures[1])
    controller.wary = wary
    assert not controller.rehearse(motion, hold=postures[1])


def test_what_the_careful_arm_keeps_off_does_not_hinder_the_last_leg(arm, start, postures, learned):
    glass = Obstacle(Cylinder(0.0325, 0.10), GLASS)
    controller = begun(arm, start, learned)
    controller.careful = controller.wary = arm.over(BENCH, [glass])
    motion = simulate(learned, controller.state, legs(arm, postures))
    assert controller.rehearse(motion, hold=postures[1])
    controller.arm = controller.careful
    assert not controller.rehearse(motion, hold=postures[1])


# Bad calls.


def test_nothing_goes_before_it_has_begun(arm, start, postures, learned):
    controller = Controller(learned, arm)
    motion = simulate(learned, begun(arm, start, learned).state, legs(arm, postures))
    with pytest.raises(StateError, match=r"begin\(\)"):
        controller.advance(motion, PERIOD)
    with pytest.raises(StateError, match=r"begin\(\)"):
        controller.track(arm.palm(start), PERIOD)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"angles": np.full(10, np.nan)}, "angles"),
        ({"angles": np.zeros(9)}, "angles"),
        ({"gaze": np.full(9, np.inf)}, "joints|gaze"),
        ({"gaze": np.zeros(3)}, "joints|gaze"),
        ({"fixation": (0.0, np.nan, 0.0)}, "fixation"),
        ({"fixation": (0.0, 0.0)}, "fixation"),
        ({"opening": np.nan}, "opening"),
        ({"opening": 30.0}, "opening"),
    ],
)
def test_a_bad_beginning_is_named(arm, start, learned, change, name):
    gaze = arm.robot.resting(arm.robot.gaze)
    options = {"angles": start, "gaze": gaze, "fixation": GLASS, "opening": 1.0} | change
    with pytest.raises(ArgumentError, match=name):
        Controller(learned, arm).begin(**options)


@pytest.mark.parametrize(
    ("seconds", "steps", "name"),
    [
        (0.0, 4, "seconds"),
        (-1.0, 4, "seconds"),
        (np.nan, 4, "seconds"),
        (0.1, 0, "steps"),
        (0.1, 1.5, "steps"),
    ],
)
def test_bad_periods_are_named(arm, start, postures, learned, seconds, steps, name):
    controller = begun(arm, start, learned)
    motion = simulate(learned, controller.state, legs(arm, postures))
    with pytest.raises(Error, match=name):
        controller.advance(motion, seconds, steps=steps)
    with pytest.raises(Error, match=name):
        controller.track(arm.palm(start), seconds, steps=steps)


def test_what_it_begins_with_is_not_changed(arm, start, postures, learned):
    given = start.copy(), fixate(arm.robot, arm.robot.resting(arm.robot.gaze), GLASS), GLASS.copy()
    kept = [array.copy() for array in given]
    controller = Controller(learned, arm)
    controller.begin(*given, 1.0)
    drive(controller, simulate(learned, controller.state, legs(arm, postures)), 0.5)
    for array, before in zip(given, kept, strict=True):
        np.testing.assert_array_equal(array, before)


def test_a_new_beginning_starts_from_there(arm, start, postures, learned):
    controller = begun(arm, start, learned)
    drive(controller, simulate(learned, controller.state, legs(arm, postures)), 1.0)
    gaze = arm.robot.resting(arm.robot.gaze)
    controller.begin(postures[0], gaze, GLASS, 0.5)
    np.testing.assert_allclose(controller.palm, arm.palm(postures[0]))
    np.testing.assert_array_equal(controller.gaze, gaze)
    assert controller.state.opening == 0.5


def test_a_robot_without_a_hand_is_driven_without_one(icub, start, postures, learned):
    handless = PoseSolver(replace(icub, hand=None), BENCH)
    controller = begun(handless, start, learned)
    _, commands = controller.advance(simulate(learned, controller.state, legs(handless, postures)), PERIOD)
    assert set(commands[0]) == {*handless.names, *icub.gaze}
