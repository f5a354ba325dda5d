"""From a target to joint angles: timing, path, gaze and inverse kinematics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime import KinematicProjection
from motorprime.control import reaching
from motorprime.control.gaze import fixate
from motorprime.control.path import CLEARANCE, PalmPath, minimum_jerk, plan_path
from motorprime.control.reaching import HAND, STANDOFF, Bench, ReachSolver
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, ArgumentTypeError, UnreachableError

sim = pytest.mark.sim
START, GOAL = np.array([-0.10, 0.34, 0.06]), np.array([-0.30, 0.16, 0.02])
FACING = np.array([-np.sin(0.3), -np.cos(0.3), 0.0])
GLASS = Cylinder(0.0325, 0.11)
BENCH = Bench(height=-0.06, edge=-0.15)


def path(**changes) -> PalmPath:
    return PalmPath(**{"start": START, "goal": GOAL, "facing": FACING, "duration": 2.0, **changes})


# Timing and path.


def test_minimum_jerk_starts_and_ends_at_rest_without_acceleration():
    """10 t^3 - 15 t^4 + 6 t^5: 0 and 1 at the ends, first and second derivatives 0, symmetric."""
    t = np.linspace(0, 1, 101)
    np.testing.assert_allclose(minimum_jerk(t), 10 * t**3 - 15 * t**4 + 6 * t**5, atol=1e-14)
    np.testing.assert_allclose(minimum_jerk(t) + minimum_jerk(1 - t), 1.0, atol=1e-14)
    h = 1e-3
    assert minimum_jerk(h) < 1.1e-8 and 1 - minimum_jerk(1 - h) < 1.1e-8
    assert (np.diff(minimum_jerk(t)) > 0).all()
    assert minimum_jerk(0.5) == 0.5
    # The peak speed is 15/8 of the mean.
    assert np.gradient(minimum_jerk(t), t).max() == pytest.approx(1.875, abs=1e-3)
    np.testing.assert_array_equal(minimum_jerk(np.array([-3.0, 0.0, 1.0, 7.0])), [0, 0, 1, 1])


def test_a_path_runs_from_start_to_goal_and_rests_there():
    times = np.array([-1.0, 0.0, 2.0, 9.0])
    np.testing.assert_allclose(path().at(times), [START, START, GOAL, GOAL], atol=1e-12)
    assert path().at(1.0).shape == (3,) and path().at(np.zeros((2, 5))).shape == (2, 5, 3)


@given(
    start=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    azimuth=st.floats(-3.1, 3.1),
    detour=st.floats(0.0, 0.2),
)
@settings(max_examples=50, deadline=None)
def test_a_path_arrives_along_the_palm_s_facing(start, azimuth, detour):
    """The Bezier curve's last tangent is goal - arrive: facing * run_up - bulge / 2."""
    facing = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
    curve = path(start=np.array(start), facing=facing, bulge=(0.0, 0.0, 0.0))
    last = curve.at(2.0) - curve.at(1.97)
    assert last @ facing / np.linalg.norm(last) > 0.999
    lifted = path(
        start=np.array(start), facing=facing, bulge=(-detour * facing[0], -detour * facing[1], 0.06)
    )
    last = lifted.at(2.0) - lifted.at(1.97)
    assert last @ facing > 0
    level = last[:2] / np.linalg.norm(last[:2])
    assert level @ facing[:2] > 0.999 and last[2] < 0


def test_a_path_is_the_cubic_bezier_curve_of_its_four_points():
    """By de Casteljau's construction."""
    curve = path(bulge=(0.01, -0.02, 0.09), run_up=0.1)
    bulge = np.array([0.01, -0.02, 0.09])
    points = [START, START + 0.25 * (GOAL - START) + bulge, GOAL - 0.1 * FACING + bulge / 2, GOAL]
    for time in (0.3, 0.9, 1.6):
        s = float(minimum_jerk(time / 2.0))
        level = points
        while len(level) > 1:
            level = [(1 - s) * a + s * b for a, b in pairwise(level)]
        np.testing.assert_allclose(curve.at(time), level[0], atol=1e-12)


def test_the_way_ahead_is_what_is_left_of_it():
    curve = path()
    np.testing.assert_allclose(curve.ahead(0.5, 4), curve.at(np.array([0.5, 1.0, 1.5, 2.0])))
    assert curve.ahead(0.0).shape == (50, 3)
    np.testing.assert_allclose(curve.ahead(5.0, 3), [GOAL] * 3)
    assert curve.ahead(0.0, 0).shape == (0, 3)
    with pytest.raises(ArgumentError, match="count"):
        curve.ahead(0.0, -1)


@pytest.mark.parametrize(
    ("changes", "name", "error"),
    [
        ({"duration": 0.0}, "duration", ArgumentError),
        ({"duration": np.nan}, "duration", ArgumentError),
        ({"duration": "soon"}, "duration", ArgumentTypeError),
        ({"start": np.zeros(2)}, "start", ArgumentError),
        ({"goal": [0.0, np.nan, 0.0]}, "goal", ArgumentError),
        ({"facing": [0.0, 0.0, 0.0]}, "facing: expected a unit vector", ArgumentError),
        ({"facing": [0.0, -2.0, 0.0]}, "facing: expected a unit vector", ArgumentError),
        ({"bulge": (0.0, 0.0)}, "bulge", ArgumentError),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(changes, name, error):
    with pytest.raises(error, match=name):
        path(**changes)


def clearance(curve, centre):
    """Least distance to the cylinder before the last 3 cm, from points on its surface."""
    angles, heights = np.linspace(0, 2 * np.pi, 73), np.linspace(-0.055, 0.055, 23)
    a, z = (grid.ravel() for grid in np.meshgrid(angles, heights))
    surface = np.column_stack([0.0325 * np.cos(a), 0.0325 * np.sin(a), z]) + centre
    places = curve.at(np.linspace(0, curve.duration, 160))
    places = places[np.linalg.norm(places - curve.goal, axis=1) > 0.03]
    assert not ((np.hypot(*(places - centre)[:, :2].T) < 0.03) & (abs((places - centre)[:, 2]) < 0.055)).any()
    return np.linalg.norm(places[:, None] - surface, axis=2).min()


@pytest.mark.parametrize("azimuth", np.deg2rad([-20.0, 10.0, 40.0, 70.0, 100.0]))
def test_a_planned_path_keeps_half_a_hand_off_the_glass_until_it_faces_it(azimuth):
    centre = np.array([-0.32, 0.08, 0.0])
    facing = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
    goal = centre - STANDOFF * facing
    curve = plan_path(START, goal, facing, keep_off=GLASS, centre=centre, duration=2.0)
    np.testing.assert_allclose(curve.at(2.0), goal, atol=1e-12)
    # At the goal the palm is 4.75 cm off the surface, 3 cm before that at most 7.8 cm.
    assert clearance(curve, centre) > CLEARANCE - 0.004


def test_a_straight_start_through_the_glass_is_led_around_it():
    """The start lies behind the glass, as seen from the goal."""
    centre, facing = np.array([-0.32, 0.08, 0.0]), np.array([0.0, -1.0, 0.0])
    start, goal = np.add(centre, (0.0, -0.20, 0.0)), centre - STANDOFF * facing
    curve = plan_path(start, goal, facing, keep_off=GLASS, centre=centre, duration=2.0)
    straight = PalmPath(start, goal, facing, 2.0, bulge=(0.0, 0.0, 0.0))
    with pytest.raises(AssertionError):
        assert clearance(straight, centre) > 0.02
    assert clearance(curve, centre) > 0.02


# Gaze.


@sim
@pytest.mark.parametrize(
    "point", [(-0.30, 0.05, 0.0), (-0.45, -0.12, 0.05), (-0.28, 0.2, -0.05), (-0.6, 0, 0.4)]
)
def test_fixating_brings_the_point_to_the_middle_of_both_images(icub, point):
    """Within a pixel, with what turns at rest or near it; the torso keeps still."""
    joints = np.zeros(9)
    joints[:3] = 0.1, -0.05, 0.2
    kept = joints.copy()
    posture = fixate(icub, joints, point)
    for pixels in KinematicProjection(icub).project([point], posture).values():
        assert np.hypot(*(pixels[0] - (160, 120))) < 1.0
    np.testing.assert_array_equal(posture[:3], kept[:3])
    np.testing.assert_array_equal(joints, kept)
    limits = icub.limits(icub.gaze)
    assert (limits[:, 0] <= posture).all() and (posture <= limits[:, 1]).all()


@sim
def test_only_what_may_move_moves_and_what_the_limits_forbid_is_unreachable(icub):
    eyes = ("eyes_tilt", "eyes_version", "eyes_vergence")
    posture = fixate(icub, np.zeros(9), (-0.5, 0.05, 0.30), move=eyes)
    np.testing.assert_array_equal(posture[:6], 0.0)
    pixels = KinematicProjection(icub).project([(-0.5, 0.05, 0.30)], posture)
    assert all(np.hypot(*(uv[0] - (160, 120))) < 2.0 for uv in pixels.values())
    for away in ((0.5, 0.0, 0.3), (-0.2, 0.0, -0.9)):
        with pytest.raises(UnreachableError, match=r"gaze: the eyes cannot turn to .* deg are missing"):
            fixate(icub, np.zeros(9), away, move=eyes)


@sim
@pytest.mark.parametrize(
    ("joints", "point", "move", "name"),
    [
        (np.zeros(8), (-0.3, 0, 0), None, "joints"),
        (np.zeros(9), (-0.3, 0), None, "point"),
        (np.zeros(9), (-0.3, np.nan, 0), None, "point"),
        (np.zeros(9), (-0.3, 0, 0), ("tail",), "move"),
        (np.zeros(9), (-0.3, 0, 0), (), "move"),
    ],
)
def test_a_gaze_that_is_wrong_is_named(icub, joints, point, move, name):
    with pytest.raises(ArgumentError, match=name):
        fixate(icub, joints, point, move=move)


# Reaching.

TARGETS = [
    (-0.32, 0.09, 0.0),
    (-0.25, 0.12, 0.0),
    (-0.26, 0.05, 0.02),
    (-0.34, 0.06, -0.01),
    (-0.29, 0.18, 0.0),
]


@pytest.fixture(scope="module")
def solver(icub):
    return ReachSolver(icub, BENCH)


def guarded(icub, names, angles):
    """Heights [m] of elbow, wrist and the hand's points over the bench, by their own chains."""
    heights = []
    for link, clearance in icub.guarded.items():
        chain = icub.tree.chain(icub.root, link)
        x, _, z = chain.forward(angles[: len(chain.names)])[:3, 3]
        heights.append((x, z - clearance))
    palm = icub.tree.chain(icub.root, icub.palm.link).forward(angles) @ icub.palm.frame
    heights += [(x, z - 0.01) for x, _, z in HAND @ palm[:3, :3].T + palm[:3, 3]]
    return np.array([z - BENCH.height for x, z in heights if x < BENCH.edge])


@sim
@pytest.mark.parametrize("target", TARGETS)
def test_a_pregrasp_brings_the_palm_before_the_object_and_faces_its_axis(icub, solver, target):
    """The place by the URDF's chain; z of the palm towards the axis, level, fingers level."""
    centre = np.array(target)
    grasp = solver.pregrasp(centre, solver.rest)
    palm = icub.reach_chain.forward(grasp.angles) @ icub.palm.frame
    assert np.linalg.norm(palm[:3, 3] - (centre - 0.08 * grasp.facing)) < 0.004
    np.testing.assert_array_equal(grasp.point(centre), centre - STANDOFF * grasp.facing)
    to_axis = centre - palm[:3, 3]
    assert palm[:3, 2] @ (to_axis / np.linalg.norm(to_axis)) > np.cos(np.deg2rad(5))
    assert grasp.facing[2] == 0.0 and np.linalg.norm(grasp.facing) == pytest.approx(1.0)
    assert abs(palm[2, 0]) < np.sin(np.deg2rad(5))
    limits = icub.limits(icub.reach_chain.names)
    assert (limits[:, 0] < grasp.angles).all() and (grasp.angles < limits[:, 1]).all()
    assert guarded(icub, solver.names, grasp.angles).min() > -0.02


@sim
def test_over_a_bench_the_hand_stays_higher_than_without_one(icub, solver):
    """A place only 1 cm over the bench: the guards trade the place for height."""
    place, facing = np.array([-0.30, 0.14, -0.05]), np.array([0.0, -1.0, 0.0])
    free = ReachSolver(icub)
    lowest = [
        guarded(icub, free.names, s.solve(place, facing, s.rest, hold=s.rest)).min() for s in (free, solver)
    ]
    assert lowest[0] < -0.02 < -0.01 < lowest[1]


@sim
@pytest.mark.parametrize("target", [(-0.9, 0.1, 0.0), (0.8, 0.1, 0.0), (-0.3, 0.1, 1.2)])
def test_what_is_out_of_reach_is_refused_with_how_near_the_palm_comes(solver, target):
    with pytest.raises(UnreachableError, match=r"target: out of reach at .* within \d+\.\d cm"):
        solver.pregrasp(np.array(target), solver.rest)


@sim
def test_joints_to_keep_stay_and_the_others_still_bring_the_palm_there(solver):
    grasp = solver.pregrasp(np.array(TARGETS[0]), solver.rest)
    torso = ("torso_pitch", "torso_roll", "torso_yaw")
    place = np.add(grasp.point(np.array(TARGETS[0])), (0.0, 0.01, 0.0))
    angles = solver.solve(place, grasp.facing, grasp.angles, hold=grasp.angles, keep=torso)
    np.testing.assert_allclose(angles[:3], grasp.angles[:3], atol=2e-6)
    assert np.linalg.norm(solver.palm(angles)[:3, 3] - place) < 0.002


@sim
@pytest.mark.parametrize("weight", [1.0, 0.3])
def test_the_analytic_jacobian_is_the_derivative_of_the_residuals(solver, monkeypatch, weight):
    """Guards included: the start dips below the bench."""
    asked = {}

    def spy(residuals, start, limits, *, jacobian):
        asked.update(residuals=residuals, jacobian=jacobian)
        return start

    monkeypatch.setattr(reaching, "solve_bounded", spy)
    generator = np.random.default_rng(1)
    low, high = solver.limits.T
    dipping = 0
    for _ in range(12):
        q = generator.uniform(low, high)
        solver.solve(np.array([-0.3, 0.1, 0.0]), FACING, q, hold=solver.rest, facing_weight=weight)
        rows = asked["residuals"](q)
        dipping += int(np.count_nonzero(rows[-len(HAND) - 2 :]))
        slope = np.empty((len(rows), len(q)))
        for k, step in enumerate(1e-7 * np.eye(len(q))):
            slope[:, k] = (asked["residuals"](q + step) - asked["residuals"](q - step)) / 2e-7
        np.testing.assert_allclose(asked["jacobian"](q), slope, atol=2e-4)
    assert dipping > 0


@sim
@pytest.mark.parametrize(
    ("ask", "name"),
    [
        (lambda s: s.pregrasp(np.array([np.nan, 0, 0]), s.rest), "centre"),
        (lambda s: s.pregrasp(np.zeros(2), s.rest), "centre"),
        (lambda s: s.pregrasp(np.array(TARGETS[0]), s.rest[:4]), "start"),
        (lambda s: s.pregrasp(np.array(TARGETS[0]), s.rest, tolerance=0.0), "tolerance"),
        (lambda s: s.solve(np.zeros(2), FACING, s.rest, hold=s.rest), "place"),
        (lambda s: s.solve(START, FACING[:2], s.rest, hold=s.rest), "facing"),
        (lambda s: s.solve(START, FACING, s.rest, hold=s.rest * np.nan), "hold"),
        (lambda s: s.solve(START, FACING, s.rest, hold=s.rest, keep=("tail",)), "keep"),
        (lambda s: Bench(np.nan, 0.0), "height"),
    ],
)
def test_a_reach_that_is_wrong_is_named(solver, ask, name):
    with pytest.raises(ArgumentError, match=name):
        ask(solver)
