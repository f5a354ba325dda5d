"""Thousands of postures at once give what the direct fit gives for each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from head_eye_rig import ball_of_points
from motorprime import ICUB, KinematicProjection, fit_peripersonal
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from motorprime.learning.posture_ellipses import (
    PostureEllipses,
    fit_postures,
    head_eye_joints,
    random_head_eye,
)
from motorprime.projection import PosedProjection
from motorprime.robot import CameraMount
from small_robot import CAMERA, small_robot

sim = pytest.mark.sim


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def cloud(robot):
    return ball_of_points(robot)


class Other(PosedProjection):
    """The robot's kinematics behind another class, which cannot be looked into."""

    def __init__(self, robot, *, deep=True):
        self.inner, self.deep = KinematicProjection(robot), deep
        super().__init__({name: mount.camera for name, mount in robot.cameras.items()})

    def posed(self, joints=None):
        return self.inner.posed(joints)

    def depths(self, points, joints=None):
        if not self.deep:
            raise StateError("no depths here")
        return super().depths(points, joints)


def agree(cloud, projection, postures):
    """Whether fits of all postures at once are those of each; how many of them are in view."""
    fits = fit_postures(cloud, projection, postures)
    assert list(fits) == list(projection.cameras)
    seen = 0
    for k, joints in enumerate(postures):
        try:
            direct = fit_peripersonal(cloud, projection, joints)
        except NotInViewError:
            direct = {}
        assert set(direct) == {camera for camera, fit in fits.items() if fit.in_view[k]}
        for camera, fit in direct.items():
            np.testing.assert_allclose(fits[camera].mean[k], fit.mean, atol=1e-7)
            np.testing.assert_allclose(fits[camera].chol[k], fit.chol, atol=1e-7)
            assert fits[camera].inside[k] == fit.inside
            seen += 1
    return seen


def test_all_postures_at_once_are_the_direct_fit_of_each_whatever_the_torso(robot, cloud):
    """40 of them are no multiple of the block, and the torso stands differently in each."""
    limits = robot.limits(robot.gaze)
    postures = np.random.default_rng(3).uniform(limits[:, 0], limits[:, 1], (40, 4))
    kept = postures.copy()
    assert 20 < agree(cloud, KinematicProjection(robot), postures) < 80
    np.testing.assert_array_equal(postures, kept)


def test_other_projections_are_asked_posture_by_posture_to_the_same_end(robot, cloud):
    postures = random_head_eye(robot, 15, 1)
    assert agree(cloud, Other(robot), postures) > 5
    assert agree(cloud, Other(robot, deep=False), postures) > 5
    one, two = (fit_postures(cloud, p, postures) for p in (KinematicProjection(robot), Other(robot)))
    for camera in one:
        np.testing.assert_allclose(one[camera].mean, two[camera].mean, atol=1e-7)


def test_a_projection_of_another_robot_is_taken_as_it_is(robot, cloud):
    """Its focal length counts, and not that of the cloud's robot."""
    zoomed = replace(robot, cameras={"left": CameraMount("left_eye", replace(CAMERA, fx=400.0))})
    postures = random_head_eye(robot, 10, 2)
    assert agree(cloud, KinematicProjection(zoomed), postures) > 2


def test_lens_distortion_counts_as_in_the_direct_fit(robot):
    bent = replace(CAMERA, distortion=(-0.2, 0.05, 0.001, -0.002))
    lensed = replace(robot, cameras={"left": CameraMount("left_eye", bent)})
    assert agree(ball_of_points(lensed), KinematicProjection(lensed), random_head_eye(lensed, 10, 2)) > 2


def test_in_view_means_50_points_inside():
    fits = PostureEllipses(np.zeros((3, 2)), np.ones((3, 3)), np.array([49, 50, 51]))
    np.testing.assert_array_equal(fits.in_view, [False, True, True])


@pytest.mark.parametrize(
    ("postures", "error"),
    [
        (np.zeros(4), ArgumentError),
        (np.zeros((5, 3)), ArgumentError),
        (np.full((5, 4), np.nan), ArgumentError),
        ("postures", ArgumentTypeError),
    ],
)
def test_postures_of_another_shape_or_with_nan_are_named(robot, cloud, postures, error):
    with pytest.raises(error, match="postures"):
        fit_postures(cloud, KinematicProjection(robot), postures)


# Which joints, and how they are drawn.


def test_the_joints_are_those_that_move_a_camera_against_the_chest(robot):
    """Neck and the variables of the coupled eyes, in the order of the gaze; not the waist below the chest."""
    assert head_eye_joints(robot) == ("neck", "version", "squint")
    one_eye = replace(robot, couplings={"left_pan": {"version": 1.0}, "right_pan": {"version": 1.0}})
    assert head_eye_joints(one_eye) == ("neck", "version")


@sim
def test_the_icub_s_are_its_three_of_the_neck_and_three_of_the_eyes(icub):
    """q of g_i has six dimensions (section III-B2)."""
    assert head_eye_joints(icub) == (
        "neck_pitch", "neck_roll", "neck_yaw", "eyes_tilt", "eyes_version", "eyes_vergence",
    )  # fmt: skip


def test_a_camera_that_does_not_hang_below_the_chest_is_refused(robot):
    fixed = replace(robot, cameras={"table": CameraMount("base", CAMERA)})
    with pytest.raises(ArgumentError, match="'base' does not hang below 'chest'"):
        head_eye_joints(fixed)


def test_a_camera_that_nothing_moves_is_refused(robot):
    stiff = replace(robot, cameras={"breast": CameraMount("shelf", CAMERA)})
    with pytest.raises(ArgumentError, match="nothing moves a camera of 'small'"):
        head_eye_joints(stiff)


def test_without_a_urdf_the_message_says_how_to_get_one():
    with pytest.raises(StateError, match="with_urdf"):
        head_eye_joints(ICUB)


def test_head_and_eyes_are_uniform_within_their_limits_and_the_torso_rests(robot):
    postures = random_head_eye(replace(robot, rest={"waist": 0.3}), 4000, 5)
    assert postures.shape == (4000, 4)
    np.testing.assert_array_equal(postures[:, 1], 0.3)
    for column, (low, high) in ((0, (-0.7, 0.6)), (2, (-0.5, 0.5)), (3, (0.0, 0.9))):
        drawn = (postures[:, column] - low) / (high - low)
        assert drawn.min() >= 0.0 and drawn.max() <= 1.0
        # The share below each tenth, within four standard errors of a uniform draw.
        below = (drawn[:, None] < np.arange(1, 10) / 10).mean(axis=0)
        np.testing.assert_allclose(below, np.arange(1, 10) / 10, atol=4 * 0.5 / np.sqrt(4000))


def test_the_same_seed_draws_the_same_postures_and_a_generator_advances(robot):
    np.testing.assert_array_equal(random_head_eye(robot, 5, 3), random_head_eye(robot, 5, 3))
    generator = np.random.default_rng(3)
    first, second = random_head_eye(robot, 5, generator), random_head_eye(robot, 5, generator)
    np.testing.assert_array_equal(first, random_head_eye(robot, 5, 3))
    assert not np.array_equal(first, second)


@pytest.mark.parametrize(
    ("count", "seed", "name", "error"),
    [
        (0, 0, "count", ArgumentError),
        (2.0, 0, "count", ArgumentTypeError),
        (2, -1, "seed", ArgumentError),
        (2, "one", "seed", ArgumentTypeError),
    ],
)
def test_a_wrong_count_or_seed_is_named(robot, count, seed, name, error):
    with pytest.raises(error, match=name):
        random_head_eye(robot, count, seed)


@sim
def test_the_icub_s_postures_at_once_are_the_direct_fit_of_each(icub, cloud_of_icub):
    assert agree(cloud_of_icub, KinematicProjection(icub), random_head_eye(icub, 30, 0)) > 20


@pytest.fixture(scope="module")
def cloud_of_icub(icub):
    from motorprime import ReachCloud

    return ReachCloud(icub, size=1000)
