"""Robots that do not match their models."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime import Camera, KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import rotation_from_rpy, rpy_from_rotation
from motorprime.perturbed import build, draw_errors, perturb
from motorprime.projection import Calibration
from small_robot import turn
from watching_robot import watching_robot

sim = pytest.mark.sim
NUMBERS = {"offsets": 0.05, "links": 0.005, "focal": 0.03, "distortion": 0.1, "mounting": 0.02}


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return watching_robot(tmp_path_factory.mktemp("robot"))


def check_same(built, robot, calibration, seed=0):
    """The built robot's nominal projection is the calibrated projection of the model, hand included."""
    rng = np.random.default_rng(seed)
    real, model = KinematicProjection(built), KinematicProjection(robot, calibration)
    for _ in range(5):
        joints = rng.uniform(*robot.limits((*robot.gaze, *robot.arm)).T)
        gaze = joints[: len(robot.gaze)]
        for name, camera in real.posed(gaze).items():
            expected = model.posed(gaze)[name]
            np.testing.assert_allclose(camera.pose, expected.pose, atol=1e-12)
            assert camera.camera == expected.camera
        np.testing.assert_allclose(real.hand_points(joints), model.hand_points(joints), atol=1e-12)


@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_errors_built_into_the_urdf_are_the_calibration_of_the_same_numbers(robot, tmp_path, seed, arm):
    errors = draw_errors(robot, seed, **NUMBERS, arm=arm)
    built = perturb(robot, seed, tmp_path, **NUMBERS, arm=arm)
    check_same(built, robot, errors, seed)
    assert built.urdf == tmp_path / "small.urdf" and built.name == robot.name


def test_a_fixed_joint_s_translation_is_built_in_too(robot, tmp_path):
    calibration = Calibration(robot.name, {"squint": 0.1}, {"plate": [0.01, 0.0, -0.02]})
    check_same(build(robot, calibration, tmp_path), robot, calibration)


def test_nothing_wrong_leaves_the_robot_as_it_is(robot, tmp_path):
    built = perturb(robot, 0, tmp_path, offsets=0.0, links=0.0, focal=0.0, distortion=0.0)
    check_same(built, robot, Calibration(robot.name))
    assert built.cameras == robot.cameras


def test_errors_fill_their_bounds_and_stay_within(robot):
    drawn = [draw_errors(robot, seed, **NUMBERS) for seed in range(200)]
    for values, bound in [
        ([list(e.offsets.values()) for e in drawn], 0.05),
        ([np.ravel(list(e.links.values())) for e in drawn], 0.005),
        ([[c.fx / 257.34 - 1.0 for c in e.cameras.values()] for e in drawn], 0.03),
        ([[c.distortion[0] for c in e.cameras.values()] for e in drawn], 0.1),
        ([[c.distortion[1] for c in e.cameras.values()] for e in drawn], 0.05),
        ([[c.distortion[k] for c in e.cameras.values() for k in (2, 3)] for e in drawn], 0.002),
        ([np.ravel([m[:3] for m in e.mountings.values()]) for e in drawn], 0.02),
    ]:
        low, high = np.min(values, axis=0), np.max(values, axis=0)
        assert (low >= -bound).all() and (high <= bound).all()
        assert (low < -0.9 * bound).all() and (high > 0.9 * bound).all()
        np.testing.assert_allclose(np.mean(values), 0.0, atol=0.1 * bound)
    for errors in drawn:
        assert all(camera.fx == camera.fy for camera in errors.cameras.values())


def test_the_arm_is_exact_unless_asked_for_and_the_torso_belongs_to_both(robot):
    exact, wrong = draw_errors(robot, 3), draw_errors(robot, 3, arm=True)
    assert set(exact.offsets) == set(robot.gaze)
    assert set(exact.links) == {"waist", "neck", "left_pan", "right_pan"}
    assert set(wrong.offsets) - set(exact.offsets) == {"shoulder", "elbow"}
    assert set(wrong.links) - set(exact.links) == {"shoulder", "elbow"}
    assert exact.offsets.items() <= wrong.offsets.items() and exact.cameras == wrong.cameras


def test_a_seed_gives_the_same_robot_and_another_seed_another(robot):
    assert draw_errors(robot, 5).offsets == draw_errors(robot, 5).offsets
    assert draw_errors(robot, 5).offsets != draw_errors(robot, 6).offsets


def test_a_camera_s_own_distortion_is_changed_not_replaced(robot, tmp_path):
    rich = Camera(320, 240, 250.0, 255.0, 160.0, 120.0, (-0.3, 0.1, 0.0, 0.0, 0.02))
    mounts = {name: replace(mount, camera=rich) for name, mount in robot.cameras.items()}
    camera = perturb(replace(robot, cameras=mounts), 1, tmp_path).cameras["left"].camera
    assert camera.distortion[4] == 0.02 and 0.0 < abs(camera.distortion[0] + 0.3) <= 0.1
    assert camera.fx / 250.0 == pytest.approx(camera.fy / 255.0)


def test_meshes_are_found_from_the_new_folder(robot, tmp_path):
    old, new = tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        folder.mkdir()
    tree = ET.parse(robot.urdf)
    for name in ("arm.stl", "package://body/head.stl"):
        link = ET.SubElement(tree.getroot(), "link", name=f"shape of {name}")
        geometry = ET.SubElement(ET.SubElement(link, "visual"), "geometry")
        ET.SubElement(geometry, "mesh", filename=name)
    tree.write(old / "small.urdf")
    before = (old / "small.urdf").read_bytes()
    built = perturb(robot.with_urdf(old / "small.urdf"), 0, new)
    names = [mesh.get("filename") for mesh in ET.parse(built.urdf).getroot().iter("mesh")]
    assert names == [str(old / "arm.stl"), "package://body/head.stl"]
    assert (old / "small.urdf").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"offsets": -0.1}, ArgumentError, "offsets: expected a bound >= 0, got -0.1"),
        ({"links": np.nan}, ArgumentError, "links"),
        ({"focal": 1.0}, ArgumentError, "focal: expected a relative bound < 1"),
        ({"distortion": "much"}, ArgumentTypeError, "distortion"),
        ({"mounting": -1e-9}, ArgumentError, "mounting"),
        ({"seed": -1}, ArgumentError, "seed"),
    ],
)
def test_wrong_bounds_are_errors_that_name_them(robot, change, error, words):
    with pytest.raises(error, match=words):
        draw_errors(robot, **({"seed": 0} | change))


def test_the_model_s_own_file_is_never_overwritten(robot, tmp_path):
    with pytest.raises(ArgumentError, match="holds the URDF of robot 'small' itself"):
        perturb(robot, 0, robot.urdf.parent)
    with pytest.raises(ArgumentError, match="folder: cannot write"):
        perturb(robot, 0, tmp_path / "nowhere")
    with pytest.raises(ArgumentError, match="robot 'small', got one of 'iCub'"):
        build(robot, Calibration("iCub"), tmp_path)


ANGLE = st.floats(-3.1, 3.1)


@given(roll=ANGLE, pitch=ANGLE, yaw=ANGLE)
@settings(max_examples=60, deadline=None)
def test_roll_pitch_and_yaw_of_a_rotation_give_it_back(roll, pitch, yaw):
    rotation = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
    np.testing.assert_allclose(rotation_from_rpy(rpy_from_rotation(rotation)), rotation, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 1.570796])
@pytest.mark.parametrize("roll", [0.0, -2.356187, 3.0])
def test_roll_pitch_and_yaw_are_exact_where_two_axes_fall_together(pitch, roll):
    rotation = rotation_from_rpy((roll, pitch, 0.785406))
    np.testing.assert_allclose(rotation_from_rpy(rpy_from_rotation(rotation)), rotation, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_roll_pitch_and_yaw_bear_the_rounding_of_products_there(pitch):
    rotation = turn((0, 0, 1), 0.7) @ turn((0, 1, 0), pitch) @ turn((1, 2, 3), 0.4) @ turn((1, 2, 3), -0.4)
    np.testing.assert_allclose(rotation_from_rpy(rpy_from_rotation(rotation)), rotation, atol=1e-12)


def test_roll_pitch_and_yaw_need_a_matrix():
    with pytest.raises(ArgumentError, match=r"rotation: expected shape \(3, 3\)"):
        rpy_from_rotation(np.eye(4))


@sim
def test_the_perturbed_icub_is_its_calibration_and_the_simulator_loads_it(icub, tmp_path):
    from motorprime.sim.world import World

    built = perturb(icub, 4, tmp_path, mounting=0.02, arm=True)
    check_same(built, icub, draw_errors(icub, 4, mounting=0.02, arm=True))
    rng = np.random.default_rng(0)
    with World(built) as world:
        for _ in range(3):
            joints = rng.uniform(*icub.limits((*icub.gaze, *icub.arm)).T)
            world.place(dict(zip((*icub.gaze, *icub.arm), joints, strict=True)))
            projection = KinematicProjection(built)
            for name, view in projection.posed(world.gaze()).items():
                np.testing.assert_allclose(world.link_pose(built.cameras[name].link), view.pose, atol=1e-5)
            hand = projection.hand_points(joints)
            np.testing.assert_allclose(world.palm_pose()[None, :3, 3], hand, atol=1e-5)
