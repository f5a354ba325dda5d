"""Forward kinematics against a second one, written from URDF's definition; hostile files."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import KinematicTree, apply, invert, rotation_from_rpy, transform
from small_robot import LIMITS, reference_pose, turn, urdf_text, write_urdf

ANGLE = st.floats(-3.1, 3.1)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    return KinematicTree(write_urdf(tmp_path_factory.mktemp("urdf")))


@given(roll=ANGLE, pitch=ANGLE, yaw=ANGLE)
@settings(max_examples=50, deadline=None)
def test_rpy_turns_about_the_fixed_x_then_y_then_z(roll, pitch, yaw):
    expected = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
    np.testing.assert_allclose(rotation_from_rpy((roll, pitch, yaw)), expected, atol=1e-9)


def test_a_positive_roll_lifts_y_and_a_positive_yaw_turns_x_to_y():
    """The signs of URDF's angles, by hand."""
    np.testing.assert_allclose(rotation_from_rpy((np.pi / 2, 0, 0)) @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(rotation_from_rpy((0, np.pi / 2, 0)) @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(rotation_from_rpy((0, 0, np.pi / 2)) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@given(waist=ANGLE, neck=ANGLE, pan=ANGLE)
@settings(max_examples=40, deadline=None)
def test_forward_is_the_product_of_origins_and_turns_fixed_joints_and_slanted_axes_included(
    tree, waist, neck, pan
):
    chain = tree.chain("base", "left_eye")
    assert chain.names == ("waist", "neck", "left_pan")
    expected = reference_pose("base", "left_eye", {"waist": waist, "neck": neck, "left_pan": pan})
    np.testing.assert_allclose(chain.forward([waist, neck, pan]), expected, atol=1e-9)


def test_a_chain_may_end_and_begin_with_fixed_joints_and_start_below_the_root(tree):
    chain = tree.chain("chest", "bar")
    assert chain.names == ("neck",)
    np.testing.assert_allclose(
        chain.forward([0.6]), reference_pose("chest", "bar", {"neck": 0.6}), atol=1e-12
    )


def test_a_batch_of_postures_gives_each_posture_s_own_pose(tree):
    chain = tree.chain("base", "hand")
    angles = np.random.default_rng(3).uniform(-2, 2, (4, 5, 3))
    poses = chain.forward(angles)
    assert poses.shape == (4, 5, 4, 4)
    for index in np.ndindex(4, 5):
        np.testing.assert_array_equal(poses[index], chain.forward(angles[index]))
    assert chain.forward(np.zeros((0, 3))).shape == (0, 4, 4)


@pytest.mark.parametrize("tip", ["right_eye", "hand", "bar"])
def test_the_jacobian_is_the_derivative_of_the_pose(tree, tip):
    """Linear rows against central differences of the place, angular ones of the rotation: dR = [w] R."""
    chain = tree.chain("base", tip)
    q = np.random.default_rng(7).uniform(-1.5, 1.5, len(chain.names))
    pose, jacobian = chain.jacobian(q)
    np.testing.assert_allclose(pose, chain.forward(q), atol=1e-12)
    assert jacobian.shape == (6, len(q))
    step = 1e-6
    for k in range(len(q)):
        delta = step * np.eye(len(q))[k]
        slope = (chain.forward(q + delta) - chain.forward(q - delta)) / (2 * step)
        spin = slope[:3, :3] @ pose[:3, :3].T
        np.testing.assert_allclose(jacobian[:3, k], slope[:3, 3], atol=1e-8)
        np.testing.assert_allclose(jacobian[3:, k], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)


def test_a_chain_without_moving_joints_has_a_pose_and_an_empty_jacobian(tree):
    chain = tree.chain("head", "bar")
    assert chain.names == () and chain.limits.shape == (0, 2)
    np.testing.assert_allclose(chain.forward([]), reference_pose("head", "bar", {}), atol=1e-12)
    assert chain.jacobian([])[1].shape == (6, 0)
    np.testing.assert_array_equal(tree.chain("head", "head").forward([]), np.eye(4))


def test_limits_come_in_the_order_of_the_chain_and_continuous_joints_turn_once_around(tree):
    limits = tree.chain("base", "left_eye").limits
    np.testing.assert_allclose(limits, [LIMITS["waist"], LIMITS["neck"], (-np.pi, np.pi)])


def test_apply_moves_from_the_frame_and_invert_moves_back():
    rng = np.random.default_rng(5)
    pose = transform(turn(rng.normal(size=3), 0.8), rng.normal(size=3))
    points = rng.normal(size=(6, 3))
    expected = np.column_stack([points, np.ones(6)]) @ pose.T
    np.testing.assert_allclose(apply(pose, points), expected[:, :3], atol=1e-12)
    np.testing.assert_allclose(invert(pose), np.linalg.inv(pose), atol=1e-12)
    np.testing.assert_allclose(apply(invert(pose), apply(pose, points)), points, atol=1e-12)


def test_an_axis_that_is_not_given_is_x(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='continuous'>"
        "<parent link='a'/><child link='b'/></joint></robot>"
    )
    np.testing.assert_allclose(
        KinematicTree(path).chain("a", "b").forward([0.3])[:3, :3], turn((1, 0, 0), 0.3), atol=1e-12
    )


JOINT = "<joint name='{}' type='{}'><parent link='{}'/><child link='{}'/>{}</joint>"


@pytest.mark.parametrize(
    ("inner", "names"),
    [
        ("<origin xyz='a b c'/>", ["'j'", "origin", "xyz", "a b c"]),
        ("<origin xyz='1 2'/>", ["'j'", "xyz"]),
        ("<origin xyz='1'/>", ["'j'", "xyz"]),
        ("<origin rpy='0 0 0 0'/>", ["'j'", "rpy"]),
        ("<origin xyz='nan 0 0'/>", ["'j'", "xyz"]),
        ("<axis xyz='0 0 0'/>", ["'j'", "axis", "length 0"]),
        ("<axis xyz='1 0'/>", ["'j'", "axis"]),
        ("<limit lower='low'/>", ["'j'", "limit", "lower"]),
        ("<limit upper='inf'/>", ["'j'", "limit", "upper"]),
    ],
)
def test_a_malformed_joint_is_named_with_what_is_wrong(tmp_path, inner, names):
    path = tmp_path / "robot.urdf"
    joint = JOINT.format("j", "revolute", "a", "b", inner)
    path.write_text(f"<robot name='r'><link name='a'/><link name='b'/>{joint}</robot>")
    with pytest.raises(ArgumentError, match="urdf") as caught:
        KinematicTree(path)
    for name in names:
        assert name in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["", "joints", "<robot>", "<html><joint/></html>", "<robot><joint name='j' type='fixed'/></robot>"],
)
def test_a_file_that_is_no_urdf_is_an_argument_error(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(ArgumentError, match="urdf"):
        KinematicTree(path)


def test_a_missing_file_a_folder_and_bytes_are_argument_errors(tmp_path):
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\x00\x81")
    for path in (tmp_path / "none.urdf", tmp_path, tmp_path / "bytes"):
        with pytest.raises(ArgumentError, match="urdf"):
            KinematicTree(path)


def test_a_joint_or_a_child_that_comes_twice_is_an_error(tmp_path):
    links = "".join(f"<link name='{name}'/>" for name in "abc")
    for second in (("j", "b", "c"), ("k", "c", "b")):
        path = tmp_path / "robot.urdf"
        name, parent, child = second
        joints = JOINT.format("j", "fixed", "a", "b", "") + JOINT.format(name, "fixed", parent, child, "")
        path.write_text(f"<robot name='r'>{links}{joints}</robot>")
        with pytest.raises(ArgumentError, match="twice"):
            KinematicTree(path)


def test_a_loop_is_an_error_and_no_endless_search(tmp_path):
    links = "".join(f"<link name='{name}'/>" for name in "abc")
    joints = JOINT.format("j", "fixed", "a", "b", "") + JOINT.format("k", "fixed", "b", "a", "")
    path = tmp_path / "robot.urdf"
    path.write_text(f"<robot name='r'>{links}{joints}</robot>")
    with pytest.raises(ArgumentError, match="loop"):
        KinematicTree(path).chain("c", "b")


def test_a_sliding_joint_matters_only_to_chains_that_run_over_it(tree):
    assert "prismatic" in urdf_text()
    tree.chain("base", "hand")
    with pytest.raises(ArgumentError, match=r"'slide'.*'prismatic'; known: revolute, continuous, fixed"):
        tree.chain("base", "finger")


def test_links_that_are_unknown_or_not_below_are_named(tree):
    with pytest.raises(ArgumentError, match=r"'tail' is not in small.urdf; it has \['bar', 'base'"):
        tree.chain("base", "tail")
    with pytest.raises(ArgumentError, match="'hand' does not hang below 'head'"):
        tree.chain("head", "hand")
    with pytest.raises(ArgumentError, match="'base' does not hang below 'hand'"):
        tree.chain("hand", "base")


@pytest.mark.parametrize(
    ("angles", "error"),
    [
        ([0.0, 0.0], ArgumentError),
        (0.0, ArgumentError),
        (np.zeros((3, 4)), ArgumentError),
        ([0.0, np.nan, 0.0], ArgumentError),
        ([0.0, 0.0, -np.inf], ArgumentError),
        ([[0.0], [0.0, 0.0]], ArgumentError),
        (["0", "0", "0"], ArgumentTypeError),
        ([True, False, True], ArgumentTypeError),
        (None, ArgumentTypeError),
    ],
)
def test_wrong_angles_are_errors_that_name_them(tree, angles, error):
    chain = tree.chain("base", "hand")
    for method in (chain.forward, chain.jacobian):
        with pytest.raises(error, match="angles"):
            method(angles)


def test_the_jacobian_takes_one_posture(tree):
    with pytest.raises(ArgumentError, match="one posture"):
        tree.chain("base", "hand").jacobian(np.zeros((2, 3)))
    with pytest.raises(ArgumentError, match="rpy"):
        rotation_from_rpy((0.0, 1.0))
