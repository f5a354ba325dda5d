"""Corrections of a robot's model: what they are, and projecting with them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from motorprime import Camera, KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import transform
from motorprime.projection import Calibration, parameter_names
from motorprime.projection.parameters import Parameters, Priors
from motorprime.robot import Palm
from small_robot import CAMERA, JOINTS, PALM_FRAME, reference_pose, turn
from watching_robot import watching_robot

WARPED = Camera(320, 240, 250.0, 262.0, 157.0, 123.0, (-0.1, 0.04, 0.002, -0.001))
Q = np.array([0.3, -0.2, 0.1, 0.4])  # neck, waist, version, squint
ARM = np.array([0.7, 1.1])


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return watching_robot(tmp_path_factory.mktemp("robot"))


def full(robot) -> Calibration:
    """A correction of every kind."""
    return Calibration(
        robot.name,
        offsets={"neck": 0.02, "waist": -0.03, "version": 0.01, "squint": 0.04, "elbow": 0.05},
        links={"neck": [0.004, -0.001, 0.002], "plate": [0.0, 0.003, 0.0], "elbow": [-0.002, 0.0, 0.005]},
        mountings={"right": [0.02, -0.01, 0.03, 0.001, 0.002, -0.003]},
        cameras={"left": WARPED},
        hand=[[0.01, 0.02, 0.03], [0.0, 0.0, 0.0]],
    )


def test_a_projection_without_calibration_is_that_of_a_calibration_of_nothing(robot):
    plain, same = KinematicProjection(robot), KinematicProjection(robot, Calibration(robot.name))
    for name, camera in plain.posed(Q).items():
        np.testing.assert_array_equal(camera.pose, same.posed(Q)[name].pose)
        np.testing.assert_allclose(
            camera.pose,
            reference_pose(
                "base", f"{name}_eye", {"neck": 0.3, "waist": -0.2, "left_pan": 0.3, "right_pan": -0.1}
            ),
            atol=1e-12,
        )


def test_offsets_are_added_to_the_encoders_through_the_couplings(robot):
    offsets = {"neck": 0.02, "waist": -0.03, "version": 0.01, "squint": 0.04}
    moved = KinematicProjection(robot, Calibration(robot.name, offsets)).posed(Q)
    expected = KinematicProjection(robot).posed(Q + np.array([0.02, -0.03, 0.01, 0.04]))
    for name in robot.cameras:
        np.testing.assert_allclose(moved[name].pose, expected[name].pose, atol=1e-12)


def shifted_pose(monkeypatch, tip, angles, shifts):
    """The second kinematics, with origins moved."""
    joints = [
        (name, kind, parent, child, tuple(np.add(xyz, shifts.get(name, 0.0))), rpy, axis)
        for name, kind, parent, child, xyz, rpy, axis in JOINTS
    ]
    with monkeypatch.context() as patch:
        patch.setattr("small_robot.JOINTS", joints)
        return reference_pose("base", tip, angles)


def test_links_move_the_origins_in_the_frames_of_their_parents(robot, monkeypatch):
    shifts = {"neck": (0.004, -0.001, 0.002), "plate": (0.0, 0.003, 0.0), "left_pan": (0.001, 0.0, 0.002)}
    posed = KinematicProjection(robot, Calibration(robot.name, links=shifts)).posed(Q)
    angles = {"neck": 0.3, "waist": -0.2, "left_pan": 0.3, "right_pan": -0.1}
    for name in robot.cameras:
        expected = shifted_pose(monkeypatch, f"{name}_eye", angles, shifts)
        np.testing.assert_allclose(posed[name].pose, expected, atol=1e-12)


def test_a_mounting_is_the_camera_s_pose_on_its_link(robot):
    calibration = Calibration(robot.name, mountings={"right": [0.0, 0.0, 0.5, 0.001, 0.002, -0.003]})
    plain, mounted = KinematicProjection(robot).posed(Q), KinematicProjection(robot, calibration).posed(Q)
    mounting = transform(turn((0, 0, 1), 0.5), (0.001, 0.002, -0.003))
    np.testing.assert_allclose(mounted["right"].pose, plain["right"].pose @ mounting, atol=1e-12)
    np.testing.assert_array_equal(mounted["left"].pose, plain["left"].pose)


def test_cameras_are_replaced(robot):
    projection = KinematicProjection(robot, Calibration(robot.name, cameras={"left": WARPED}))
    posed = projection.posed(Q)
    assert posed["left"].camera == WARPED == projection.camera("left") and posed["right"].camera == CAMERA


def test_the_hand_s_pixels_are_those_of_its_points_torso_and_arm_moved(robot, monkeypatch):
    calibration = full(robot)
    projection = KinematicProjection(robot, calibration)
    angles = {"waist": -0.2 - 0.03, "shoulder": 0.7, "elbow": 1.1 + 0.05}
    palm = shifted_pose(monkeypatch, "hand", angles, calibration.links) @ PALM_FRAME
    points = calibration.hand @ palm[:3, :3].T + palm[:3, 3]
    joints = np.append(Q, ARM)
    np.testing.assert_allclose(projection.hand_points(joints), points, atol=1e-12)
    expected = projection.project(points, Q)
    for name, pixels in projection.hand_pixels(joints).items():
        np.testing.assert_allclose(pixels, expected[name], atol=1e-9)


def test_the_hand_is_the_palm_s_origin_unless_points_are_given(robot):
    palm = reference_pose("base", "hand", {"waist": -0.2, "shoulder": 0.7, "elbow": 1.1}) @ PALM_FRAME
    points = KinematicProjection(robot).hand_points(np.append(Q, ARM))
    np.testing.assert_allclose(points, palm[None, :3, 3], atol=1e-12)


def test_the_hand_in_many_postures_is_the_hand_in_each(robot):
    projection = KinematicProjection(robot, full(robot))
    joints = np.random.default_rng(0).uniform(-0.5, 0.5, (7, 6))
    many = projection.hand_pixels(joints)
    for name, pixels in many.items():
        assert pixels.shape == (7, 2, 2)
        for row, q in zip(pixels, joints, strict=True):
            np.testing.assert_allclose(row, projection.hand_pixels(q)[name], atol=1e-9)
    assert projection.hand_pixels(joints[:0])["left"].shape == (0, 2, 2)


def test_a_hand_behind_a_camera_has_no_pixels_there(robot):
    """Eyes that turn once around have the hand before them and behind them."""
    projection, blind = KinematicProjection(robot), []
    for version in np.linspace(-3.0, 3.0, 13):
        joints = np.array([0.3, -0.2, version, 0.0, *ARM])
        depths = projection.depths(projection.hand_points(joints), joints[:4])
        for name, pixels in projection.hand_pixels(joints).items():
            assert np.isnan(pixels).all() == (depths[name][0] < 0.01)
            blind.append(np.isnan(pixels).all())
    assert 3 < sum(blind) < len(blind) - 3


@pytest.mark.parametrize(
    ("joints", "error"),
    [
        (np.zeros(4), ArgumentError),
        (np.zeros((1, 1, 6)), ArgumentError),
        (np.full(6, np.nan), ArgumentError),
        (["a"] * 6, ArgumentTypeError),
    ],
)
def test_wrong_joints_of_the_hand_are_errors_that_name_them(robot, joints, error):
    with pytest.raises(error, match="joints"):
        KinematicProjection(robot).hand_pixels(joints)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"robot": "iCub"}, "robot 'small', got one of 'iCub'"),
        ({"offsets": {"tail": 0.1}}, "no variable 'tail'; there are neck, waist"),
        ({"links": {"slide": [0, 0, 0]}}, "no joint 'slide'; there are waist"),
        ({"mountings": {"top": np.zeros(6)}}, "no camera 'top'; there are left, right"),
        ({"cameras": {"top": CAMERA}}, "no camera 'top'"),
        ({"cameras": {"left": CAMERA.scale(2.0)}}, "camera 'left' has 320 x 240 px, .* 640 x 480"),
    ],
)
def test_a_calibration_of_another_robot_is_refused(robot, change, words):
    calibration = Calibration(**({"robot": robot.name} | change))
    with pytest.raises(ArgumentError, match=words):
        KinematicProjection(robot, calibration)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"offsets": {"neck": np.nan}}, ArgumentError, r"offsets\['neck'\]: .*finite"),
        ({"offsets": {"neck": [0.1]}}, ArgumentError, r"offsets\['neck'\]: expected shape \(\)"),
        ({"offsets": [0.1]}, ArgumentTypeError, "offsets: expected a mapping, got list"),
        ({"links": {"neck": [0, 0]}}, ArgumentError, r"links\['neck'\]: expected shape \(3,\)"),
        ({"mountings": {"left": [0, 0, 0]}}, ArgumentError, r"mountings\['left'\]: expected shape \(6,\)"),
        ({"cameras": {"left": 3}}, ArgumentTypeError, r"cameras\['left'\]: expected a Camera, got int"),
        ({"hand": [0, 0, 0]}, ArgumentError, "hand: expected shape"),
        ({"hand": np.zeros((0, 3))}, ArgumentError, "hand: expected at least one point"),
        ({"hand": [[0, np.inf, 0]]}, ArgumentError, "hand: "),
        ({"covariance": np.zeros((3, 4))}, ArgumentError, "covariance: expected shape"),
        ({"covariance": np.full((3, 3), np.nan)}, ArgumentError, "covariance: .*finite"),
    ],
)
def test_wrong_corrections_are_errors_that_name_them(change, error, words):
    with pytest.raises(error, match=words):
        Calibration("small", **change)


def test_a_calibration_keeps_copies_that_cannot_be_written(robot):
    hand, shift = np.zeros((1, 3)), np.zeros(3)
    calibration = Calibration(robot.name, links={"neck": shift}, hand=hand)
    hand[:], shift[:] = 1.0, 1.0
    assert not calibration.hand.any() and not calibration.links["neck"].any()
    with pytest.raises(ValueError, match="read-only"):
        calibration.hand[0, 0] = 1.0


def test_a_file_brings_back_every_number(robot, tmp_path):
    calibration = replace(full(robot), covariance=np.diag(np.arange(len(parameter_names(robot))) / 7.0))
    KinematicProjection(robot, calibration).save(tmp_path / "small.model")
    loaded = KinematicProjection.load(tmp_path / "small.model", robot).calibration
    assert loaded.offsets == calibration.offsets and loaded.cameras == calibration.cameras
    for key in ("links", "mountings"):
        found, expected = getattr(loaded, key), getattr(calibration, key)
        assert list(found) == list(expected)
        for name, value in expected.items():
            np.testing.assert_array_equal(found[name], value)
    np.testing.assert_array_equal(loaded.hand, calibration.hand)
    np.testing.assert_array_equal(loaded.covariance, calibration.covariance)
    KinematicProjection(robot).save(tmp_path / "nominal.model")
    nominal = KinematicProjection.load(tmp_path / "nominal.model", robot).calibration
    assert nominal.offsets == {} and nominal.covariance is None


def test_a_file_of_another_robot_or_kind_is_refused(robot, tmp_path):
    path = tmp_path / "small.model"
    KinematicProjection(robot, full(robot)).save(path)
    with pytest.raises(ArgumentError, match=r"small.model: .*robot 'tall', got one of 'small'"):
        KinematicProjection.load(path, replace(robot, name="tall"))
    with pytest.raises(ArgumentError, match="cannot read"):
        KinematicProjection.load(tmp_path / "none.model", robot)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(ArgumentError, match="cut off"):
        KinematicProjection.load(path, robot)
    with pytest.raises(ArgumentError, match="cannot write"):
        KinematicProjection(robot).save(tmp_path / "nowhere" / "small.model")


@pytest.mark.parametrize(
    "garble",
    [
        lambda arrays, about: arrays.pop("hand"),
        lambda arrays, about: about.pop("cameras"),
        lambda arrays, about: about["offsets"].pop(),
        lambda arrays, about: about["cameras"]["left"].update(fx=-1.0),
        lambda arrays, about: about["cameras"]["left"].update(colour=1.0),
        lambda arrays, about: about.update(cameras=[]),
        lambda arrays, about: arrays.update(links=np.full((3, 3), np.nan)),
    ],
)
def test_a_description_that_lacks_something_is_an_error(robot, garble):
    calibration = full(robot)
    arrays, about = calibration.arrays(), json.loads(json.dumps(calibration.about()))
    assert Calibration.from_arrays(arrays, about).offsets == calibration.offsets
    garble(arrays, about)
    with pytest.raises(ArgumentError):
        Calibration.from_arrays(arrays, about)


def test_the_vector_of_all_parameters_and_the_calibration_are_each_other_s_inverse(robot):
    parameters = Parameters(robot)
    vector = parameters.sigmas(Priors()) * np.random.default_rng(1).normal(size=parameters.size)
    calibration = parameters.unpack(vector, Calibration(robot.name))
    np.testing.assert_allclose(parameters.pack(calibration), vector, atol=1e-12)
    calibration.check(robot)
    names = parameters.names
    assert len(names) == len(set(names)) == parameters.size
    assert calibration.offsets["neck"] == vector[names.index("neck offset")]
    assert calibration.links["neck"][1] == vector[names.index("neck y")]
    assert calibration.mountings["right"][5] == vector[names.index("right shift z")]
    assert calibration.cameras["left"].cx - CAMERA.cx == pytest.approx(vector[names.index("left cx")])
    assert calibration.cameras["right"].distortion[3] == vector[names.index("right p2")]
    assert calibration.cameras["right"].fy == pytest.approx(
        CAMERA.fy * np.exp(vector[names.index("right fy")])
    )


def test_zero_parameters_are_the_model_as_it_is(robot):
    calibration = Parameters(robot).unpack(np.zeros(Parameters(robot).size), Calibration(robot.name))
    assert calibration.cameras["left"] == CAMERA
    nominal, same = KinematicProjection(robot), KinematicProjection(robot, calibration)
    np.testing.assert_array_equal(nominal.posed(Q)["left"].pose, same.posed(Q)["left"].pose)


def test_further_distortion_stays_as_it_was(robot):
    rich = replace(CAMERA, distortion=(-0.1, 0.02, 0.0, 0.0, 0.003))
    mounts = {name: replace(mount, camera=rich) for name, mount in robot.cameras.items()}
    parameters = Parameters(replace(robot, cameras=mounts))
    vector = np.zeros(parameters.size)
    vector[parameters.names.index("left k1")] = 0.03
    camera = parameters.unpack(vector, Calibration(robot.name)).cameras["left"]
    np.testing.assert_allclose(camera.distortion, (-0.07, 0.02, 0.0, 0.0, 0.003))
    other = replace(rich, distortion=(-0.1, 0.02, 0.0, 0.0, 0.009))
    begun = Calibration(robot.name, cameras={"left": other})
    assert parameters.unpack(vector, begun).cameras["left"].distortion[4] == 0.009


def test_each_group_has_its_own_prior(robot):
    parameters = Parameters(robot)
    groups = {
        "offsets": ["neck offset", "squint offset"],
        "arm_offsets": ["shoulder offset", "elbow offset"],
        "links": ["neck x", "elbow z"],
        "turn": ["left turn x", "right turn z"],
        "shift": ["left shift x"],
        "focal": ["left fx", "right fy"],
        "centre": ["left cx", "left cy"],
        "radial": ["left k1", "right k2"],
        "tangential": ["left p1", "left p2"],
        "hand": ["hand x", "hand z"],
    }
    assert set(groups) == set(Priors.__dataclass_fields__)
    for group, names in groups.items():
        sigma = dict(zip(parameters.names, parameters.sigmas(Priors(**{group: 0.77})), strict=True))
        scale = CAMERA.fx if group == "centre" else 1.0
        assert {name for name, value in sigma.items() if value == 0.77 * scale} >= set(names)
        untouched = [name for other, many in groups.items() if other != group for name in many]
        assert all(sigma[name] != 0.77 * scale for name in untouched)


def test_the_palm_s_frame_may_sit_anywhere_on_the_hand(robot):
    moved = replace(robot, palm=Palm("upper", np.eye(4)), arm=("shoulder",))
    points = KinematicProjection(moved).hand_points(np.append(Q, 0.7))
    expected = reference_pose("base", "upper", {"waist": -0.2, "shoulder": 0.7})
    np.testing.assert_allclose(points, expected[None, :3, 3], atol=1e-12)


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_a_prior_that_is_no_standard_deviation_is_an_error(value):
    with pytest.raises(ArgumentError, match=r"priors\.focal"):
        Priors(focal=value)
