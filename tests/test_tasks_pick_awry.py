"""Picking up when something stands in the way, or the target moves: on a body without a simulator."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from motorprime.control.motion import simulate
from motorprime.control.movement import State
from motorprime.control.pose import PoseSolver
from motorprime.control.side_grasp import SIDE_GRASP
from motorprime.motorplan import default_width
from motorprime.tasks.cycle import Settings
from motorprime.tasks.pick import ARRIVED, LOST, STARTLED, WIDER
from motorprime.tasks.seeker import PERIOD
from painted_body import BENCH, CAN, GLASS, IN_REACH, PaintedBody, can_at
from picking_up import QUICK, commanded_palms, distances, of, run

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module")
def arm(icub):
    return PoseSolver(icub, BENCH)


# Something in the way.

BEHIND_A_CAN = np.array([-0.30, 0.02, -0.01])
THERE = can_at(-0.36, 0.19)


@pytest.fixture(scope="module")
def from_the_right(arm):
    """Angles with the palm to the right of that can, on the other side of the glass."""
    pose = SIDE_GRASP.pose(np.zeros(3), np.deg2rad(40.0), 0.03)
    pose[:3, 3] = (-0.38, 0.32, 0.04)
    return dict(zip(arm.names, map(float, arm.solve(pose).angles), strict=True))


@pytest.fixture(scope="module")
def avoided(painted, from_the_right):
    """A can that is put there after the glass was fixated: only a look along the way shows it."""
    task = painted(BEHIND_A_CAN, **from_the_right)
    plans = []

    def appear(cycle):
        if cycle.phase == "fixate":
            task.body.can = THERE
        if task.motion is not None and (not plans or task.motion.begins[0] == 0):
            plans.append(task.motion)

    return SimpleNamespace(task=task, cycles=run(task, appear), plans=plans)


def test_an_obstacle_is_found_by_looking_along_the_way(avoided):
    for cycle in avoided.cycles:
        if cycle.phase in ("search", "fixate"):
            assert cycle.obstacles == ()
    assert any(cycle.obstacles for cycle in of(avoided.cycles, "survey"))
    ((place, shape),) = avoided.task.known_obstacles
    np.testing.assert_allclose(place, THERE, atol=0.01)
    assert shape is avoided.task.obstacles[0].shape


def test_the_first_plan_leads_past_it(avoided):
    plan = avoided.plans[0]
    assert len(plan.legs) == 3
    assert plan.legs[0].slim
    assert np.isfinite(plan.clearance)
    rolled = plan.simulated
    state = State(rolled.fixations[0], rolled.palms[0], float(rolled.openings[0]))
    straight = simulate(avoided.task.controller.dynamics, state, plan.legs[1:]).simulated.path
    assert distances(straight, CAN, THERE).min() < 0.06 < distances(rolled.path, CAN, THERE).min() + 0.01


def test_the_palm_keeps_off_the_obstacle_and_the_glass_is_lifted(avoided):
    assert (avoided.task.outcome, avoided.task.reason) == ("lifted", "")
    assert distances(commanded_palms(avoided.task)[:, :3, 3], CAN, THERE).min() > 0.04


def test_no_ball_of_hand_or_forearm_comes_into_the_obstacle(avoided):
    """By the arm's own model of itself, at every command."""
    from motorprime.control.clearance import Obstacle

    arm = avoided.task.controller.arm
    strict = arm.over(None, [Obstacle(CAN, THERE, distance=0.0)])
    depths = [
        strict._clearance.worst(strict.arm.at(np.array([move[name] for name in arm.names])))
        for move in avoided.task.body.moves
        if all(name in move for name in arm.names)
    ]
    assert max(depths) < 5e-3


def test_an_obstacle_that_appears_during_the_reach_asks_for_a_new_plan(painted, arm):
    """Not where the hand is to be: the grasp stays, and the way to it is another."""
    pose = SIDE_GRASP.pose(np.zeros(3), np.deg2rad(40.0), 0.03)
    pose[:3, 3] = (-0.30, 0.36, 0.06)
    start = dict(zip(arm.names, map(float, arm.nearest(pose).angles), strict=True))
    task, plans, spot = painted(BEHIND_A_CAN, **start), [], can_at(-0.332, 0.278)

    def appear(cycle):
        if cycle.phase == "reach":
            plans.append((task.grasp, task.motion.clearance))
            if len(plans) == 2:
                task.body.can = spot

    cycles = run(task, appear, until="grasp")
    assert cycles[-1].phase == "grasp", task.reason
    known = next(k for k, cycle in enumerate(of(cycles, "reach")) if cycle.obstacles)
    assert 2 <= known < 2 + round(1.0 / PERIOD)  # seen within a second
    assert [np.isfinite(clearance) for _, clearance in plans] == [k > known for k in range(len(plans))]
    assert distances(commanded_palms(task)[:, :3, 3], CAN, spot).min() > 0.04


def test_an_obstacle_that_appears_where_the_hand_was_to_be_asks_for_another_side(painted):
    """It stands in the pre-grasp; from straight ahead the glass can be grasped as well."""
    task, plans = painted(), []

    def appear(cycle):
        if cycle.phase == "reach":
            plans.append(task.grasp.azimuth)
            if len(plans) == 1:
                task.body.can = can_at(-0.249, 0.277)

    cycles = run(task, appear, until="lift")
    assert cycles[-1].phase == "lift", task.reason
    assert plans[-1] > plans[0] + 0.5


def test_a_grasp_that_an_obstacle_leaves_no_room_for_is_refused_before_the_arm_moves(painted, icub):
    task = painted(body=PaintedBody(icub, IN_REACH, can=can_at(-0.25, 0.20)))
    start = task.body.read(task.solver.names)
    cycles = run(task)
    assert task.outcome == "refused"
    assert task.reason
    np.testing.assert_array_equal(task.body.read(task.solver.names), start)
    assert "reach" not in {cycle.phase for cycle in cycles}


# A target that moves, or goes.


@pytest.fixture(scope="module")
def jumped(painted):
    """The glass jumps 9 cm during the reach, and what width was looked with is noted."""
    task = painted()
    there = IN_REACH + np.array([0.03, 0.09, 0.0])
    widths, happened = [], []
    step = task.attention.step

    def noting(*args, width=None, **options):
        widths.append((task.body.time, width))
        return step(*args, width=width, **options)

    task.attention.step = noting

    def jump(cycle):
        if cycle.phase == "reach" and len(happened) < 8:
            happened.append(cycle.time)
            if len(happened) == 8:
                task.body.glass = there

    cycles = run(task, jump)
    return SimpleNamespace(task=task, cycles=cycles, there=there, when=happened[-1], widths=widths)


def test_a_glass_that_jumps_is_followed_and_lifted_at_its_new_place(jumped):
    task = jumped.task
    assert (task.outcome, task.reason) == ("lifted", "")
    np.testing.assert_allclose(task.estimate, jumped.there, atol=4e-3)
    wanted = SIDE_GRASP.pose(jumped.there, task.grasp.azimuth, GLASS.radius)
    np.testing.assert_allclose(task.grasp.palm[:3, 3], wanted[:3, 3], atol=6e-3)  # chosen anew
    bottom = of(jumped.cycles, "lift")[0].palm
    assert np.linalg.norm(bottom - wanted[:3, 3]) < ARRIVED + 4e-3


def test_the_jump_is_seen_within_cycles_and_the_plan_then_leads_there(jumped):
    after = [cycle for cycle in of(jumped.cycles, "reach") if cycle.time > jumped.when]
    seen = next(k for k, cycle in enumerate(after) if np.linalg.norm(cycle.estimate - jumped.there) < 0.01)
    assert seen < LOST
    for cycle in after[seen + 1 :]:
        assert np.linalg.norm(cycle.goal - jumped.there) < 0.08


def test_attention_is_twice_as_wide_for_a_second_after_the_jump_and_not_else(jumped, icub):
    shape = next(iter(icub.cameras.values())).camera.shape
    wide = [when for when, width in jumped.widths if width is not None]
    assert {width for _, width in jumped.widths} == {None, WIDER * default_width(shape)}
    assert WIDER == 2.0
    seen = next(
        cycle.time
        for cycle in of(jumped.cycles, "reach")
        if np.linalg.norm(cycle.estimate - jumped.there) < 0.01
    )
    assert min(wide) > jumped.when
    assert min(wide) == pytest.approx(seen + PERIOD, abs=PERIOD / 2)
    assert max(wide) - seen <= STARTLED + 1e-9
    assert max(wide) - seen > STARTLED - 1.5 * PERIOD


def test_a_width_of_the_settings_is_doubled_too(painted):
    task = painted(settings=replace(QUICK, width=24.0))
    for cycle in task.run():
        if cycle.phase == "reach":
            break
    assert task._width() is None
    task._startle()
    assert task._width() == 48.0


def test_a_glass_that_is_pushed_a_little_is_followed_without_a_new_grasp(painted):
    task, grasps = painted(), []

    def push(cycle):
        if cycle.phase == "reach":
            grasps.append(task.grasp)
            if len(grasps) == 6:
                task.body.glass = IN_REACH + np.array([0.0, 0.015, 0.0])

    cycles = run(task, push, until="lift")
    assert cycles[-1].phase == "lift"
    assert all(grasp is grasps[0] for grasp in grasps)
    wanted = SIDE_GRASP.pose(IN_REACH + np.array([0.0, 0.015, 0.0]), grasps[0].azimuth, GLASS.radius)
    assert np.linalg.norm(of(cycles, "grasp")[0].palm - wanted[:3, 3]) < ARRIVED + 5e-3


@pytest.fixture(scope="module")
def vanished(painted):
    """The glass is taken away during the reach."""
    task = painted(settings=Settings(compare=False, postures=4, patience=4))
    times, widths = [], []

    def vanish(cycle):
        if cycle.phase == "reach":
            times.append(cycle.time)
            widths.append(task._width())
            if len(times) == 8:
                task.body.glass = None

    return SimpleNamespace(task=task, cycles=run(task, vanish), when=times[7], widths=widths)


def test_a_glass_that_vanishes_is_searched_in_all_the_space_in_reach_and_missed(vanished):
    assert vanished.task.outcome == "missed"
    assert "lost on the way" in vanished.task.reason
    phases = [cycle.phase for cycle in vanished.cycles]
    again = vanished.cycles[len(phases) - phases[::-1].index("reach") :]
    assert {cycle.phase for cycle in again} == {"search"}
    assert 4 <= len(again) <= 16
    for cycle in again:  # with peripersonal windows, and no idea where
        assert cycle.path is None and cycle.estimate is None
        assert cycle.looks


def test_for_some_cycles_it_looks_on_along_the_way_and_then_wider(vanished):
    blind = [cycle for cycle in of(vanished.cycles, "reach") if cycle.time > vanished.when]
    assert len(blind) == LOST
    assert set(vanished.widths[:8]) == {None}
    wide = [width is not None for width in vanished.widths[8:]]
    assert wide == sorted(wide) and wide[-1] and not wide[0]


def test_a_glass_that_comes_back_is_found_again_and_lifted(painted):
    task, missing, reached = painted(), [], []
    there = IN_REACH + np.array([-0.02, -0.03, 0.0])

    def hide(cycle):
        if cycle.phase == "reach":
            reached.append(cycle.time)
            if len(reached) == 8:
                task.body.glass = None
        elif cycle.phase == "search" and reached:
            missing.append(cycle)
            if len(missing) == 3:
                task.body.glass = there

    cycles = run(task, hide, until="lift")
    assert (task.outcome, cycles[-1].phase) == ("running", "lift")
    np.testing.assert_allclose(task.estimate, there, atol=4e-3)
    assert of(cycles, "grasp")[0].time > missing[-1].time


def test_an_arm_that_does_not_follow_is_noticed_by_its_encoders(painted):
    """The elbow is stuck, and the palm never comes near the glass."""
    task = painted()
    body, move = task.body, task.body.move

    def stuck(targets, seconds):
        move({n: body.read((n,))[0] if n == "r_elbow" else t for n, t in targets.items()}, seconds)

    body.move = stuck
    cycles = run(task)
    assert np.linalg.norm(cycles[-1].palm - task.grasp.palm[:3, 3]) > 0.02
    assert task.outcome == "missed"
