"""Where the palm must be beside an upright glass."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import ArgumentError
from motorprime.control.side_grasp import SIDE_GRASP, SideGrasp
from motorprime.kinematics import apply, invert

CENTRE = np.array([-0.3, 0.1, -0.01])
AZIMUTHS = pytest.mark.parametrize("azimuth", [-0.3, 0.0, 0.4, np.pi / 2])


def seen(grasp, azimuth, radius, point=CENTRE):
    """A point in the grasping palm's own axes."""
    return apply(invert(grasp.pose(CENTRE, azimuth, radius)), point[None])[0]


@AZIMUTHS
def test_the_palm_faces_along_the_azimuth_fingers_level_and_thumb_up(azimuth):
    pose = SIDE_GRASP.pose(CENTRE, azimuth, 0.033)
    np.testing.assert_allclose(pose[:3, 2], [-np.sin(azimuth), -np.cos(azimuth), 0.0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, 1], [0.0, 0.0, -1.0], atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


def test_facing_left_the_fingers_point_away_from_the_robot():
    np.testing.assert_allclose(SIDE_GRASP.pose(CENTRE, 0.0, 0.033)[:3, 0], [-1.0, 0.0, 0.0], atol=1e-12)


@AZIMUTHS
def test_the_glass_stands_between_thumb_and_fingers_whatever_its_radius(azimuth):
    grasp = SideGrasp(along=-0.007, gap=0.012, above=0.009)
    for radius in (0.030, 0.0375):
        x, y, z = seen(grasp, azimuth, radius)
        assert x == pytest.approx(radius - 0.007)
        assert y == pytest.approx(0.009)  # the palm's y points down: the glass's middle is below
        assert z == pytest.approx(radius + 0.012)


def test_the_pregrasp_lies_back_along_the_facing_and_the_lift_straight_up():
    grasp = SideGrasp(retreat=0.1, lift=0.05)
    pose = grasp.pose(CENTRE, 0.4, 0.033)
    before, above = grasp.pregrasp(pose), grasp.lifted(pose, 0.5)
    np.testing.assert_allclose(apply(invert(pose), before[None, :3, 3])[0], [0.0, 0.0, -0.1], atol=1e-12)
    np.testing.assert_allclose(above[:3, 3] - pose[:3, 3], [0.0, 0.0, 0.025], atol=1e-12)
    for other in (before, above):
        np.testing.assert_array_equal(other[:3, :3], pose[:3, :3])
    np.testing.assert_array_equal(pose, grasp.pose(CENTRE, 0.4, 0.033))  # neither has changed it
    np.testing.assert_array_equal(grasp.pregrasp(pose, 0.0), pose)


@pytest.mark.parametrize(
    ("centre", "azimuth", "radius", "named"),
    [
        ([0.0, 0.0], 0.0, 0.03, "centre"),
        ([0.0, 0.0, np.nan], 0.0, 0.03, "centre"),
        (CENTRE, np.nan, 0.03, "azimuth"),
        (CENTRE, 0.0, 0.0, "radius"),
        (CENTRE, 0.0, np.inf, "radius"),
    ],
)
def test_wrong_arguments_are_named(centre, azimuth, radius, named):
    with pytest.raises(ArgumentError, match=named):
        SIDE_GRASP.pose(centre, azimuth, radius)


@pytest.mark.parametrize(
    "change", [{"retreat": 0.0}, {"along": np.nan}, {"azimuths": (0.0, np.nan)}, {"lift": np.inf}]
)
def test_a_geometry_that_is_none_is_named(change):
    with pytest.raises(ArgumentError, match=next(iter(change))):
        SideGrasp(**change)


def test_a_pose_that_is_no_rigid_motion_is_named():
    for move in (SIDE_GRASP.pregrasp, SIDE_GRASP.lifted):
        with pytest.raises(ArgumentError, match="pose"):
            move(np.zeros((4, 4)))


def test_the_hand_keeps_room_for_the_glass_until_the_palm_has_arrived():
    grasp = SideGrasp(roomy=0.6, arrived=0.005)
    assert [grasp.opening(wanted, 0.02) for wanted in (1.0, 0.7, 0.3, -0.5)] == [1.0, 0.7, 0.6, 0.6]
    assert [grasp.opening(wanted, 0.005) for wanted in (1.0, 0.3, -0.5)] == [1.0, 0.3, -0.5]


@pytest.mark.parametrize(
    ("wanted", "distance", "named"),
    [(np.nan, 0.0, "wanted"), (0.5, np.nan, "distance"), (0.5, -0.01, "distance")],
)
def test_an_opening_or_a_distance_that_is_none_is_named(wanted, distance, named):
    with pytest.raises(ArgumentError, match=named):
        SIDE_GRASP.opening(wanted, distance)
