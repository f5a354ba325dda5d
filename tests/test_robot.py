"""A robot as data: limits, couplings, chains; and the iCub's own facts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import ICUB, KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from small_robot import CAMERA, LIMITS, reference_pose, small_robot

sim = pytest.mark.sim


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("robot"))


def test_limits_come_from_the_urdf_unless_the_robot_says_otherwise(robot):
    np.testing.assert_allclose(robot.limits(("neck", "squint")), [LIMITS["neck"], (0.0, 0.9)])
    np.testing.assert_allclose(robot.limits(robot.arm), [LIMITS["shoulder"], (0.2, 2.0)])
    assert robot.limits(()).shape == (0, 2)
    with pytest.raises(ArgumentError, match="'small' has no variable 'tail'"):
        robot.limits(("neck", "tail"))


def test_a_posture_at_rest_is_the_middle_of_the_range_unless_the_robot_prefers_another(robot):
    np.testing.assert_allclose(robot.resting(("waist", "neck", "elbow")), [0.25, 0.1, 1.1])
    assert robot.resting(()).shape == (0,)


def test_couplings_turn_variables_into_joints(robot):
    posture = np.array([0.3, -0.2, 0.1, 0.4])  # neck, waist, version, squint
    angles = robot.urdf_angles(("waist", "neck", "left_pan", "right_pan"), posture)
    np.testing.assert_allclose(angles, [-0.2, 0.3, 0.1 + 0.2, 0.1 - 0.2])


def test_a_joint_that_no_variable_moves_is_named(robot):
    lame = replace(robot, gaze=("neck", "waist", "version"))
    with pytest.raises(ArgumentError, match=r"'left_pan'.*'squint'"):
        KinematicProjection(lame).project(np.zeros((1, 3)), np.zeros(3))


def test_chains_run_from_root_or_chest_to_cameras_and_palm(robot):
    assert robot.camera_chains["right"].names == ("waist", "neck", "right_pan")
    assert robot.chest_chain.names == robot.torso
    assert robot.arm_chain.names == robot.arm
    assert robot.reach_chain.names == (*robot.torso, *robot.arm)


def test_the_kinematic_projection_puts_the_eyes_where_the_chain_says(robot):
    """Posed cameras and pixels against the second kinematics and plain pinhole formulas."""
    posture = [0.3, -0.2, 0.1, 0.4]
    angles = {"neck": 0.3, "waist": -0.2, "left_pan": 0.3, "right_pan": -0.1}
    projection = KinematicProjection(robot)
    for name, posed in projection.posed(posture).items():
        pose = reference_pose("base", f"{name}_eye", angles)
        np.testing.assert_allclose(posed.pose, pose, atol=1e-9)
        local = np.array([[0.03, -0.02, 0.4], [-0.1, 0.05, 0.7]])
        points = local @ pose[:3, :3].T + pose[:3, 3]
        expected = CAMERA.fx * local[:, :2] / local[:, 2:] + (CAMERA.cx, CAMERA.cy)
        np.testing.assert_allclose(projection.project(points, posture)[name], expected, atol=1e-6)
        np.testing.assert_allclose(projection.depths(points, posture)[name], local[:, 2], atol=1e-9)


@pytest.mark.parametrize(
    ("joints", "error"),
    [
        (None, ArgumentError),
        (np.zeros(3), ArgumentError),
        (np.zeros((1, 4)), ArgumentError),
        ([0, np.nan, 0, 0], ArgumentError),
        (["a"] * 4, ArgumentTypeError),
    ],
)
def test_wrong_joints_are_errors_that_name_them(robot, joints, error):
    with pytest.raises(error, match="joints"):
        KinematicProjection(robot).project(np.zeros((1, 3)), joints)


def test_a_robot_without_urdf_says_how_to_give_it_one():
    with pytest.raises(StateError, match=r"'small' has no URDF; give it one with with_urdf\(path\)"):
        _ = small_robot().tree


def test_another_image_size_keeps_what_the_camera_sees(robot):
    """A direction at the image's outer corner stays at the corner: pixel centres are integers."""
    doubled = robot.with_image_size(640, 480)
    camera = doubled.cameras["left"].camera
    assert camera.shape == (480, 640)
    corner = CAMERA.rays([[-0.5, -0.5], [319.5, 239.5]])
    np.testing.assert_allclose(camera.project(corner), [[-0.5, -0.5], [639.5, 479.5]], atol=1e-9)
    assert robot.cameras["left"].camera.shape == (240, 320)


# The iCub: numbers that were looked up or measured, independent of this code.


@sim
def test_the_icub_s_eyes_at_zero_are_where_they_were_measured(icub):
    """Baseline 68 mm; the camera frame has x right, y down, z forward, the root frame x backwards."""
    eyes = KinematicProjection(icub).posed(np.zeros(9))
    looking_ahead = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    for name, y in (("left", -0.034), ("right", 0.034)):
        np.testing.assert_allclose(eyes[name].origin, (-0.0564, y, 0.3469), atol=1e-4)
        turned = eyes[name].pose[:3, :3].T @ looking_ahead
        angle = np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1)))
        assert angle < 0.01


@sim
def test_the_icub_s_hand_at_zero_is_where_it_was_measured(icub):
    hand = icub.reach_chain.forward(np.zeros(len(icub.reach_chain.names)))
    np.testing.assert_allclose(hand[:3, 3], (-0.0106, 0.0899, -0.1266), atol=1e-4)


def test_left_pan_is_version_plus_half_vergence_and_right_pan_minus():
    posture = np.zeros(9)
    posture[ICUB.gaze.index("eyes_version")] = 0.2
    posture[ICUB.gaze.index("eyes_vergence")] = 0.5
    np.testing.assert_allclose(ICUB.urdf_angles(("l_eye_pan", "r_eye_pan"), posture), [0.45, -0.05])
    assert ICUB.gaze[3:] == (
        *("neck_pitch", "neck_roll", "neck_yaw"),
        *("eyes_tilt", "eyes_version", "eyes_vergence"),
    )


@sim
def test_positive_version_turns_both_eyes_right_and_vergence_turns_them_towards_each_other(icub):
    """To the right is +y of the root frame."""
    version, vergence = np.zeros(9), np.zeros(9)
    version[icub.gaze.index("eyes_version")] = 0.2
    vergence[icub.gaze.index("eyes_vergence")] = 0.4
    projection = KinematicProjection(icub)
    for camera in projection.posed(version).values():
        np.testing.assert_allclose(camera.pose[:3, 2], (-np.cos(0.2), np.sin(0.2), 0.0), atol=1e-4)
    converged = projection.posed(vergence)
    assert converged["left"].pose[1, 2] == pytest.approx(np.sin(0.2), abs=1e-4)
    assert converged["right"].pose[1, 2] == pytest.approx(-np.sin(0.2), abs=1e-4)
    # Turned by 0.2 rad each, the axes meet baseline / 2 / tan(0.2) in front of the eyes.
    meet = projection.triangulate({name: [[160.0, 120.0]] for name in ("left", "right")}, vergence)
    np.testing.assert_allclose(meet[0], (-0.0564 - 0.034 / np.tan(0.2), 0.0, 0.3469), atol=2e-4)


@sim
def test_a_point_ahead_and_to_the_right_and_above_lies_right_and_up_in_the_icub_s_images(icub):
    pixels = KinematicProjection(icub).project([[-0.45, 0.0, 0.3469], [-0.45, 0.1, 0.40]], np.zeros(9))
    for uv in pixels.values():
        assert uv[1, 0] > uv[0, 0] + 50 and uv[1, 1] < uv[0, 1] - 30
    assert pixels["left"][0, 0] > 160 > pixels["right"][0, 0]


@sim
def test_the_icub_s_palm_is_a_rotation_in_the_palm_s_middle(icub):
    frame = icub.palm.frame
    np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    assert 0.03 < np.linalg.norm(frame[:3, 3]) < 0.08


@sim
def test_every_variable_of_the_icub_has_sensible_limits_around_its_rest(icub):
    for variables in (icub.gaze, icub.arm, icub.reach_chain.names):
        limits, rest = icub.limits(variables), icub.resting(variables)
        assert (limits[:, 0] < limits[:, 1]).all() and np.abs(limits).max() < np.pi
        assert (limits[:, 0] <= rest).all() and (rest <= limits[:, 1]).all()
