"""Picking up on a body without a simulator: found, reached, held, or said that it is not."""

import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from motorprime import ArgumentError, Attention, KinematicProjection, shipped
from motorprime.control.motion import simulate
from motorprime.control.movement import State
from motorprime.control.obstacle import plan_motion
from motorprime.control.pose import PoseSolver
from motorprime.control.side_grasp import SIDE_GRASP
from motorprime.errors import UnreachableError
from motorprime.motorplan import default_width
from motorprime.tasks.cycle import Settings
from motorprime.tasks.pick import APART, ARRIVED, LOST, SIDES, STARTLED, SURVEYS, TURNED, WIDER, Pick
from motorprime.tasks.seeker import PERIOD
from painted_body import BENCH, BEYOND, CAN, GLASS, IN_REACH, PaintedBody, can, can_at, target

pytestmark = pytest.mark.sim

QUICK = Settings(compare=False)
PHASES = ["search", "fixate", "survey", "reach", "grasp", "lift"]


@pytest.fixture(scope="module")
def dynamics():
    return shipped.coupled_dynamics()


@pytest.fixture(scope="module")
def arm(icub):
    return PoseSolver(icub, BENCH)


@pytest.fixture(scope="module")
def painted(icub, cloud, dynamics):
    """Makes a task on a painted body."""

    def make(glass=IN_REACH, *, robot=icub, settings=QUICK, seed=1, body=None, **angles):
        body = body or PaintedBody(robot, glass, **angles)
        attention = Attention(KinematicProjection(robot), cloud=cloud)
        return Pick(
            body, target(), attention, BENCH, dynamics, obstacles=(can(),), settings=settings, seed=seed
        )

    return make


def run(task, each=lambda cycle: None, *, until=None):
    """All cycles, or those up to the first of a phase; ``each`` may do something after any of them."""
    cycles = []
    for cycle in task.run():
        cycles.append(cycle)
        each(cycle)
        if cycle.phase == until:
            break
    return cycles


def of(cycles, phase):
    return [cycle for cycle in cycles if cycle.phase == phase]


def moved(body, names):
    return any(name in move for move in body.moves for name in names)


def distances(places, thing, centre):
    """Of places (N, 3) outside a standing cylinder."""
    offset = np.asarray(places) - centre
    beside = np.maximum(np.linalg.norm(offset[:, :2], axis=1) - thing.radius, 0.0)
    return np.hypot(beside, np.maximum(np.abs(offset[:, 2]) - thing.height / 2, 0.0))


def commanded_palms(task):
    """Poses (N, 4, 4) of the palm at every command that moved the arm, on a body that obeys."""
    body, arm = task.body, task.controller.arm
    angles, palms = dict(zip(arm.names, arm.rest, strict=True)), []
    for move in body.moves:
        if arm.names[-1] in move:
            angles |= {name: move[name] for name in arm.names if name in move}
            palms.append(arm.palm(np.array([angles[name] for name in arm.names])))
    return np.array(palms)


# It picks up.


@pytest.fixture(scope="module")
def picked(painted):
    """A whole run with nothing in the way."""
    task = painted()
    at_grasp = {}

    def watch(cycle):
        if cycle.phase == "grasp" and not at_grasp:
            at_grasp.update(palm=task.controller.palm, grasp=task.grasp, moves=len(task.body.moves))

    return SimpleNamespace(task=task, cycles=run(task, watch), at_grasp=at_grasp)


def test_it_finds_grasps_and_lifts_on_any_body(picked):
    assert (picked.task.outcome, picked.task.reason) == ("lifted", "")
    np.testing.assert_allclose(picked.task.estimate, IN_REACH, atol=4e-3)


def test_the_phases_follow_one_another(picked):
    phases = [cycle.phase for cycle in picked.cycles]
    assert phases == sorted(phases, key=PHASES.index)
    assert set(phases) == set(PHASES)
    assert phases.count("survey") == SURVEYS


def test_the_arm_does_not_move_before_the_reach(picked, icub):
    start = picked.cycles[0].palm
    for cycle in picked.cycles:
        if PHASES.index(cycle.phase) < PHASES.index("reach"):
            np.testing.assert_array_equal(cycle.palm, start)
    assert np.linalg.norm(picked.cycles[-1].palm - start) > 0.05


def test_the_hand_closes_where_the_palm_grasps_the_glass(picked):
    """The palm's pose as the grasp's own formula gives it for the true glass."""
    palm, azimuth = picked.at_grasp["palm"], picked.at_grasp["grasp"].azimuth
    wanted = SIDE_GRASP.pose(IN_REACH, azimuth, GLASS.radius)
    assert np.linalg.norm(palm[:3, 3] - wanted[:3, 3]) < ARRIVED + 4e-3
    assert np.trace(palm[:3, :3].T @ wanted[:3, :3]) > 1.0 + 2.0 * np.cos(TURNED + 0.01)


def test_the_fingers_close_only_there_and_stay_closed_while_it_lifts(picked, icub):
    """The little fingers' motor bends most in a squeeze."""
    task, motor = picked.task, "r_pinky"
    moves = [move for move in task.body.moves if motor in move and "r_elbow" in move]
    names, goal = task.controller.arm.names, picked.at_grasp["palm"][:3, 3]
    places = [task.controller.arm.palm(np.array([move[n] for n in names]))[:3, 3] for move in moves]
    bent = np.array([move[motor] for move in moves])
    arrived = int(np.argmax(np.linalg.norm(places - goal, axis=1) < SIDE_GRASP.arrived + ARRIVED))
    roomy, squeeze = (icub.hand.targets(o)[motor] for o in (SIDE_GRASP.roomy, icub.hand.tightest))
    assert bent[:arrived].max() <= roomy + 1e-9
    assert bent.max() > roomy + 0.8 * (squeeze - roomy)
    assert task.body.read((motor,))[0] == pytest.approx(bent.max())


def test_it_lifts_straight_up(picked):
    palms = np.array([cycle.palm for cycle in of(picked.cycles, "lift")])
    assert palms[-1, 2] - palms[0, 2] == pytest.approx(SIDE_GRASP.lift, abs=3e-3)
    assert (np.diff(palms[:, 2]) > -1e-3).all()
    assert np.ptp(palms[:, :2], axis=0).max() < 3e-3
    assert palms[-1, 2] == pytest.approx(palms[-5, 2], abs=1e-3)  # and holds


def test_the_palm_comes_by_the_pregrasp_and_keeps_off_the_glass_before(picked):
    palms = commanded_palms(picked.task)[:, :3, 3]
    before = picked.task.grasp.palm_before[:3, 3]
    nearest = int(np.argmin(np.linalg.norm(palms - before, axis=1)))
    assert np.linalg.norm(palms[nearest] - before) < 0.015
    assert distances(palms[:nearest], GLASS, IN_REACH).min() > 0.02


def test_time_goes_on_by_the_period_of_vision(picked):
    for phase in ("reach", "grasp", "lift"):
        times = [cycle.time for cycle in of(picked.cycles, phase)]
        np.testing.assert_allclose(np.diff(times), PERIOD, atol=1e-9)
    assert (np.diff([cycle.time for cycle in picked.cycles]) >= 0.0).all()


def test_from_the_survey_on_it_looks_along_the_plan(picked):
    for cycle in picked.cycles:
        if cycle.phase in ("search", "fixate"):
            assert cycle.path is None and cycle.goal is None
            continue
        assert cycle.path.shape[1] == 3 and len(cycle.path) >= 10
        expected = picked.task.projection.project(cycle.path, cycle.joints)
        for camera, pixels in cycle.path_pixels.items():
            np.testing.assert_array_equal(pixels, expected[camera])
    for cycle in of(picked.cycles, "reach"):
        np.testing.assert_allclose(cycle.path[-1], cycle.estimate, atol=5e-3)
        assert np.linalg.norm(cycle.path[0] - cycle.palm) < 0.05 + 1e-6


def test_it_looks_at_little(picked):
    assert all(cycle.sight.attended < 0.6 for cycle in picked.cycles)


def test_that_body_never_loads_the_simulator(icub):
    script = f"""
import sys
sys.modules["pybullet"] = None
sys.path.insert(0, {str(sys.path[0])!r}); sys.path.insert(0, "tests")
from motorprime import ICUB, Attention, KinematicProjection, ReachCloud, shipped
from motorprime.tasks.cycle import Settings
from motorprime.tasks.pick import Pick
from painted_body import BENCH, PaintedBody, can, target
robot = ICUB.with_urdf({str(icub.urdf)!r})
attention = Attention(KinematicProjection(robot), cloud=ReachCloud(robot))
task = Pick(PaintedBody(robot), target(), attention, BENCH, shipped.coupled_dynamics(), obstacles=(can(),),
            settings=Settings(compare=False), seed=1)
for _ in task.run(): pass
assert not [name for name in sys.modules if name.startswith("motorprime.sim")]
print(task.outcome)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("lifted\n", "")


def test_the_same_seed_gives_the_same_run(painted, picked):
    task = painted()
    for ours, theirs in zip(task.run(), picked.cycles[:25], strict=False):
        np.testing.assert_array_equal(ours.palm, theirs.palm)
        np.testing.assert_array_equal(ours.joints, theirs.joints)
        assert (ours.estimate is None) == (theirs.estimate is None)
        if ours.estimate is not None:
            np.testing.assert_array_equal(ours.estimate, theirs.estimate)


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


def test_the_first_plan_leads_past_it(avoided, dynamics):
    plan = avoided.plans[0]
    assert len(plan.legs) == 3
    assert plan.legs[0].slim
    assert np.isfinite(plan.clearance)
    rolled = plan.simulated
    state = State(rolled.fixations[0], rolled.palms[0], float(rolled.openings[0]))
    straight = simulate(dynamics, state, plan.legs[1:]).simulated.path
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


# What is refused.


def test_out_of_reach_is_refused_before_the_arm_moves(painted):
    task = painted(BEYOND, settings=Settings(compare=False, postures=3))
    start = task.body.read(task.solver.names)
    cycles = run(task)
    assert task.outcome == "refused"
    assert task.reason.startswith("pose: no side of the object can be grasped")
    np.testing.assert_allclose(task.estimate, BEYOND, atol=0.03)  # it was seen all the same
    np.testing.assert_array_equal(task.body.read(task.solver.names), start)
    assert not moved(task.body, task.solver.names)
    assert "reach" not in {cycle.phase for cycle in cycles}
    assert task.motion is None and task.grasp is None


def test_without_a_glass_it_gives_up_and_never_reaches(painted, icub):
    task = painted(body=PaintedBody(icub, None), settings=Settings(patience=2, postures=2, compare=False))
    cycles = run(task)
    assert task.outcome == "not found"
    assert "2 postures of 2 cycles" in task.reason
    assert {cycle.phase for cycle in cycles} == {"search"}
    assert not moved(task.body, task.solver.names)


def test_a_robot_without_a_hand_is_refused_by_name(painted, icub):
    with pytest.raises(ArgumentError, match=r"body: a robot with a hand expected, 'iCub' has none"):
        painted(robot=replace(icub, hand=None))


def test_it_may_be_stopped_at_any_cycle(painted):
    task = painted()
    cycles = task.run()
    for cycle in cycles:
        if cycle.phase == "reach":
            break
    cycles.close()
    assert task.outcome == "running"


def test_where_no_way_leads_to_the_best_side_the_next_is_taken(painted, monkeypatch):
    def all_but_the_first(dynamics, state, legs, *rest, **options):
        sides.append(legs[-1].goal.palm[:3, 2])
        if len(sides) == 1:
            raise UnreachableError("obstacle: no way")
        return plan_motion(dynamics, state, legs, *rest, **options)

    sides = []
    monkeypatch.setattr("motorprime.tasks.pick.plan_motion", all_but_the_first)
    task = painted()
    run(task, until="reach")
    assert len(sides) == 2
    assert sides[0] @ sides[1] < np.cos(APART - np.deg2rad(8.0))
    np.testing.assert_allclose(task.grasp.palm[:3, 2], sides[1])


def test_a_plan_is_asked_for_with_all_that_is_known(painted, icub, monkeypatch):
    """And where none is found, nothing has moved but the hand."""
    asked = {}

    def none(dynamics, state, legs, obstacles=(), *, target=None, **options):
        asked.update(obstacles=obstacles, target=target)
        sides.append(legs[-1].goal.palm[:3, 2])
        raise UnreachableError("obstacle: no way")

    sides = []

    monkeypatch.setattr("motorprime.tasks.pick.plan_motion", none)
    task = painted(body=PaintedBody(icub, IN_REACH, can=can_at(-0.45, -0.05)))
    run(task)
    assert (task.outcome, task.reason) == ("refused", f"obstacle: no way (sides tried: {len(sides)})")
    assert 1 < len(sides) <= SIDES
    between = [np.arccos(np.clip(a @ b, -1.0, 1.0)) for a, b in combinations(sides, 2)]
    assert min(between) > APART - np.deg2rad(8.0)  # a side is refined by so much after it is chosen
    assert asked["target"].shape == GLASS
    np.testing.assert_allclose(asked["target"].centre, task.estimate)
    assert [obstacle.shape for obstacle in asked["obstacles"]] == [CAN]
    assert not moved(task.body, task.controller.arm.names)
