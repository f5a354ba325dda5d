"""Picking up on a body without a simulator: found, reached, held, or said that it is not."""

import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from motorprime import ArgumentError
from motorprime.control.obstacle import plan_motion
from motorprime.control.side_grasp import SIDE_GRASP
from motorprime.errors import UnreachableError
from motorprime.tasks.cycle import Settings
from motorprime.tasks.pick import APART, ARRIVED, SIDES, SURVEYS, TURNED
from motorprime.tasks.seeker import PERIOD
from painted_body import BEYOND, CAN, GLASS, IN_REACH, PaintedBody, can_at
from picking_up import PHASES, commanded_palms, distances, moved, of, run

pytestmark = pytest.mark.sim

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
