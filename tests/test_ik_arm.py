"""Torso and arm at a posture, against the chains' own kinematics and differences; what the arm keeps off."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.control.arm import Arm, Points
from motorprime.control.clearance import (
    HAND_BAR,
    HAND_RADIUS,
    SPACING,
    THUMB_BAR,
    Clearance,
    Obstacle,
    hand_points,
)
from motorprime.control.reaching import Bench, ReachSolver
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, ArgumentTypeError
from small_robot import small_robot

BENCH = Bench(height=-0.06, edge=-0.15)
GLASS = Cylinder(0.03, 0.12)
STEP = 1e-6


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("small"))


def differences(function, q):
    return np.stack([(function(q + e) - function(q - e)) / (2 * STEP) for e in STEP * np.eye(len(q))], -1)


def postures(arm, count):
    limits = arm.robot.limits(arm.names)
    return np.random.default_rng(4).uniform(*limits.T, size=(count, len(arm.names)))


# The arm.


def test_the_palm_is_where_the_chain_says_and_its_jacobian_is_the_derivative(small):
    arm = Arm(small)
    for q in postures(arm, 5):
        posture = arm.at(q)
        np.testing.assert_allclose(posture.palm, small.reach_chain.forward(q) @ small.palm.frame, atol=1e-12)
        linear, angular = posture.palm_jacobian
        np.testing.assert_allclose(linear, differences(lambda x: arm.at(x).palm[:3, 3], q), atol=1e-8)
        turns = differences(lambda x: arm.at(x).palm[:3, :3], q)  # dR = w x R
        for k in range(len(q)):
            cross = turns[:, :, k] @ posture.palm[:3, :3].T
            np.testing.assert_allclose(angular[:, k], [cross[2, 1], cross[0, 2], cross[1, 0]], atol=1e-8)


def test_points_on_links_move_with_the_joints_before_them_only(small):
    arm = Arm(small)
    local = np.array([[0.1, 0.02, -0.03], [0.0, 0.0, 0.2]])
    points = arm.on_link("upper", local).joined(arm.on_palm(local))
    for q in postures(arm, 5):
        posture = arm.at(q)
        places = posture.places(points)
        upper = small.tree.chain("base", "upper").forward(q[:2])
        np.testing.assert_allclose(places[:2], local @ upper[:3, :3].T + upper[:3, 3], atol=1e-12)
        np.testing.assert_allclose(
            places[2:], local @ posture.palm[:3, :3].T + posture.palm[:3, 3], atol=1e-12
        )
        slopes = posture.velocities(points, places)
        assert (slopes[:2, :, 2] == 0.0).all() and (slopes[2:, :, 2] != 0.0).any()
        np.testing.assert_allclose(slopes, differences(lambda x: arm.at(x).places(points), q), atol=1e-8)


def test_some_of_the_points_are_taken_with_their_carriers(small):
    points = Points.carried(0, np.zeros((2, 3))).joined(Points.carried(1, np.ones((1, 3))))
    taken = points.take([2, 0])
    np.testing.assert_array_equal(taken.carriers, [1, 0])
    np.testing.assert_array_equal(taken.places[:, 0], [1, 0])


@pytest.mark.parametrize("link", ["head", "base"])
def test_a_link_off_the_way_to_the_palm_is_refused(small, link):
    with pytest.raises(ArgumentError, match=f"link '{link}' is not on the way to the palm"):
        Arm(small).on_link(link, np.zeros((1, 3)))


# Obstacles.


def surface(shape, count=400):
    """Points on an upright cylinder around 0, a millimetre apart or so."""
    turns, rims = np.linspace(0, 2 * np.pi, count), np.linspace(0, shape.radius, 30)
    heights = np.linspace(-shape.height / 2, shape.height / 2, 60)
    t, z = (grid.ravel() for grid in np.meshgrid(turns, heights))
    side = np.column_stack([shape.radius * np.cos(t), shape.radius * np.sin(t), z])
    t, r = (grid.ravel() for grid in np.meshgrid(turns, rims))
    flat = np.column_stack([r * np.cos(t), r * np.sin(t), np.full(len(r), shape.height / 2)])
    return np.vstack([side, flat, flat * (1, 1, -1)])


def test_the_gap_is_the_distance_to_the_surface_negative_inside():
    obstacle = Obstacle(GLASS, np.array([0.1, -0.2, 0.3]))
    rng = np.random.default_rng(3)
    points = obstacle.centre + rng.uniform(-0.1, 0.1, size=(300, 3))
    gaps, _ = obstacle.gap(points)
    offset = points - obstacle.centre
    inside = (np.hypot(offset[:, 0], offset[:, 1]) < 0.03) & (abs(offset[:, 2]) < 0.06)
    nearest = np.linalg.norm(offset[:, None] - surface(GLASS), axis=2).min(axis=1)
    assert inside.any()
    np.testing.assert_allclose(gaps, np.where(inside, -nearest, nearest), atol=1.5e-3)
    np.testing.assert_allclose(np.maximum(gaps, 0.0), GLASS.distance(offset), atol=1e-12)


def test_the_gap_s_gradient_is_its_derivative_and_a_unit_vector():
    obstacle = Obstacle(GLASS, np.array([0.1, -0.2, 0.3]))
    points = obstacle.centre + np.random.default_rng(3).uniform(-0.1, 0.1, size=(300, 3))
    _, gradients = obstacle.gap(points)
    np.testing.assert_allclose(np.linalg.norm(gradients, axis=1), 1.0, atol=1e-12)
    slopes = [
        (obstacle.gap(points + e)[0] - obstacle.gap(points - e)[0]) / (2 * STEP) for e in STEP * np.eye(3)
    ]
    np.testing.assert_allclose(gradients, np.transpose(slopes), atol=1e-6)


def test_on_the_axis_the_way_out_is_a_direction_all_the_same():
    gaps, gradients = Obstacle(GLASS, np.zeros(3)).gap(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]))
    np.testing.assert_allclose(gaps, [-0.03, 0.14])
    np.testing.assert_allclose(gradients, [[1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("make", "error", "name"),
    [
        (lambda: Obstacle(GLASS, np.zeros(2)), ArgumentError, "centre"),
        (lambda: Obstacle(GLASS, [0.0, np.nan, 0.0]), ArgumentError, "centre"),
        (lambda: Obstacle(GLASS, np.zeros(3), distance=-0.01), ArgumentError, "distance"),
        (lambda: Obstacle((0.03, 0.12), np.zeros(3)), ArgumentTypeError, "shape: expected a Cylinder"),
    ],
)
def test_an_obstacle_that_is_wrong_is_named(make, error, name):
    with pytest.raises(error, match=name):
        make()


def test_obstacles_have_to_be_obstacles(small):
    with pytest.raises(ArgumentTypeError, match="obstacles: expected Obstacle, got tuple"):
        Clearance(Arm(small), None, [(GLASS, np.zeros(3))])


def test_without_bench_and_obstacles_nothing_is_asked_of_the_arm(small):
    arm = Arm(small)
    clearance = Clearance(arm)
    depths, slopes = clearance.depths(arm.at(np.zeros(3)))
    assert clearance.idle and depths.shape == (0,) and slopes.shape == (0, 3)
    assert clearance.worst(arm.at(np.zeros(3))) == 0.0


@pytest.mark.sim
def test_depths_are_one_sided_and_their_derivative_is_right(icub):
    """Bench and two obstacles; where nothing is too near both are zero."""
    arm = Arm(icub)
    obstacles = [Obstacle(GLASS, (-0.30, 0.05, 0.0)), Obstacle(Cylinder(0.05, 0.3), (-0.2, 0.2, 0.1), 0.02)]
    clearance = Clearance(arm, BENCH, obstacles)
    touched = np.zeros(3, dtype=int)
    for q in postures(arm, 60):
        depths, slopes = clearance.depths(arm.at(q))
        assert (depths >= 0.0).all() and (slopes[depths == 0.0] == 0.0).all()
        deep = depths > 1e-5
        numeric = differences(lambda x: clearance.depths(arm.at(x))[0], q)
        np.testing.assert_allclose(slopes[deep], numeric[deep], atol=1e-6)
        assert clearance.worst(arm.at(q)) == depths.max()
        touched += [part.any() for part in np.split(deep, [10, 10 + (len(depths) - 10) // 2])]
    assert (touched > 3).all()


@pytest.mark.sim
def test_over_a_bench_the_same_points_dip_as_when_reaching(icub):
    arm, reach = Arm(icub), ReachSolver(icub, BENCH)
    clearance = Clearance(arm, BENCH)
    for q in postures(arm, 30):
        ours = np.sort(clearance.depths(arm.at(q))[0])
        np.testing.assert_allclose(ours, np.sort(np.maximum(reach._dips(q), 0.0)), atol=1e-12)


@pytest.mark.sim
@pytest.mark.parametrize("distance", [0.0, 0.02])
def test_the_depth_of_a_pole_at_the_fingertips_is_the_hand_s_radius_the_pole_s_and_the_distance(
    icub, distance
):
    arm = Arm(icub)
    posture = arm.at(np.zeros(len(arm.names)))
    tip = posture.palm[:3, :3] @ HAND_BAR[1] + posture.palm[:3, 3]
    clearance = Clearance(arm, None, [Obstacle(Cylinder(0.001, 0.2), tip, distance)])
    assert clearance.worst(posture) == pytest.approx(HAND_RADIUS + 0.001 + distance)


@pytest.mark.sim
def test_the_balls_cover_upper_arm_forearm_and_hand(icub):
    """A thin pole beside the line between the joints comes too near, one far from it does not.

    Halfway between two balls of radius r, s apart, the limb is sqrt(r^2 - s^2 / 4) thick.
    """
    arm = Arm(icub)
    pole = Cylinder(0.001, 0.002)
    beside = 0.95 * np.sqrt(HAND_RADIUS**2 - (SPACING / 2) ** 2)
    for q in postures(arm, 6):
        posture = arm.at(q)
        shoulder, elbow = posture.frames[5, :3, 3], posture.frames[6, :3, 3]
        forearm, wrist = posture.frames[7, :3, 3], posture.frames[8, :3, 3]
        finger = (posture.palm[:3, :3] @ HAND_BAR.T + posture.palm[:3, 3:]).T
        for begin, end in ((shoulder, elbow), (forearm, wrist), finger):
            across = np.cross(end - begin, [0.3, -0.5, 0.8])
            across *= beside / np.linalg.norm(across)
            for share in np.linspace(0.0, 1.0, 15):
                near = Clearance(arm, None, [Obstacle(pole, begin + share * (end - begin) + across, 0.0)])
                assert near.worst(posture) > 0.0
        for away in np.eye(3):
            far = Clearance(arm, None, [Obstacle(pole, shoulder + 0.6 * away), Obstacle(pole, (1, 1, 1))])
            assert far.worst(posture) == 0.0


def test_the_hand_s_points_reach_from_wrist_to_fingertips_and_along_the_thumb():
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = quarter, (0.1, 0.2, 0.3)
    places = hand_points(pose)
    for end in (*HAND_BAR, *THUMB_BAR):
        there = (0.1 - end[1], 0.2 + end[0], 0.3 + end[2])
        assert np.linalg.norm(places - there, axis=1).min() < 1e-12
    assert len(places) > 6
