"""Projections: pixels of fixed cameras and triangulation back."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime.camera import Camera, PosedCamera
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.projection import PinholeProjection, PosedProjection, Projection

PLAIN = Camera(320, 240, 257.34, 257.34, 160.0, 120.0)
LENS = Camera(320, 240, 260.0, 258.0, 158.0, 122.5, (-0.36, 0.17, 1e-3, -7e-4, -0.05))
NAN = math.nan


def pose(rotation=(0.0, 0.0, 0.0), origin=(0.0, 0.0, 0.0)) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = cv2.Rodrigues(np.array(rotation, float))[0]
    result[:3, 3] = origin
    return result


def matrix_of(posed: PosedCamera) -> np.ndarray:
    return posed.camera.matrix @ np.linalg.inv(posed.pose)[:3]


def stereo(camera: Camera, others: int = 0) -> PinholeProjection:
    """Eyes 68 mm apart that converge, and further cameras above them."""
    cameras = {
        "left": PosedCamera(camera, pose((0.0, 0.05, 0.0), (-0.034, 0.0, 0.0))),
        "right": PosedCamera(camera, pose((0.0, -0.05, 0.0), (0.034, 0.0, 0.0))),
    }
    for i in range(others):
        cameras[f"top{i}"] = PosedCamera(camera, pose((-0.3, 0.0, 0.2 * i), (0.05 * i, -0.1, 0.0)))
    return PinholeProjection(cameras)


def table(seed: int, n: int = 40) -> np.ndarray:
    return np.random.default_rng(seed).uniform((-0.12, -0.08, 0.3), (0.12, 0.08, 0.6), (n, 3))


@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1.0, -1.0, 1e-3, -250.0]))
@settings(max_examples=50, deadline=None)
def test_a_matrix_projects_as_its_direct_product_whatever_its_scale_and_sign(seed, scale):
    rng = np.random.default_rng(seed)
    camera = Camera(0, 0, *rng.uniform((200, 200, 100, 80), (900, 900, 700, 500)))
    posed = PosedCamera(camera, pose(rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3)))
    p = matrix_of(posed)
    local = rng.uniform((-1, -1, 0.1), (1, 1, 3), (30, 3))
    points = local @ posed.pose[:3, :3].T + posed.pose[:3, 3]
    expected = np.column_stack([points, np.ones(30)]) @ p.T
    projection = PinholeProjection({"camera": scale * p})
    np.testing.assert_allclose(
        projection.project(points)["camera"], expected[:, :2] / expected[:, 2:], rtol=1e-9, atol=1e-7
    )
    np.testing.assert_allclose(projection.depths(points)["camera"], local[:, 2], atol=1e-9)
    found = projection.posed()["camera"]
    np.testing.assert_allclose(found.camera.matrix, camera.matrix, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.pose, posed.pose, atol=1e-9)


def test_decomposition_agrees_with_opencv():
    posed = PosedCamera(PLAIN, pose((0.4, -1.0, 2.0), (0.3, 0.2, -0.9)))
    k, rotation, centre, *_ = cv2.decomposeProjectionMatrix(matrix_of(posed))
    found = PinholeProjection({"c": matrix_of(posed)}).posed()["c"]
    np.testing.assert_allclose(found.camera.matrix, k / k[2, 2], atol=1e-9)
    np.testing.assert_allclose(found.pose[:3, :3].T, rotation, atol=1e-9)
    np.testing.assert_allclose(found.origin, (centre[:3] / centre[3]).ravel(), atol=1e-9)


def test_right_is_larger_u_and_down_is_larger_v_and_the_left_eye_sees_further_right():
    pixels = stereo(PLAIN).project([[0.0, 0.0, 0.4], [0.05, 0.0, 0.4], [0.0, 0.05, 0.4]])
    for uv in pixels.values():
        assert uv[1, 0] > uv[0, 0] + 20
        assert uv[2, 1] > uv[0, 1] + 20
    straight = PinholeProjection(
        {name: PosedCamera(PLAIN, pose(origin=(x, 0, 0))) for name, x in (("left", -0.034), ("right", 0.034))}
    ).project([[0.0, 0.0, 0.4]])
    assert straight["left"][0, 0] > 160 > straight["right"][0, 0]


def test_a_matrix_whose_v_runs_upwards_sees_nothing_rather_than_a_mirror_image():
    upside = np.diag([257.34, -257.34, 1.0]) @ np.eye(3, 4)
    assert np.isnan(PinholeProjection({"c": upside}).project([[0.1, 0.1, 0.5]])["c"]).all()


def test_points_behind_are_nan_in_that_camera_only():
    back = PosedCamera(PLAIN, pose((0.0, math.pi, 0.0)))
    projection = PinholeProjection({"front": PosedCamera(PLAIN, np.eye(4)), "back": back})
    points = [[0.0, 0.0, 0.5], [0.0, 0.0, -0.5], [0.0, 0.0, 0.005]]
    pixels = projection.project(points)
    np.testing.assert_array_equal(np.isnan(pixels["front"]).all(axis=1), [False, True, True])
    np.testing.assert_array_equal(np.isnan(pixels["back"]).all(axis=1), [True, False, True])
    np.testing.assert_allclose(projection.depths(points)["back"], [-0.5, 0.5, -0.005])


@pytest.mark.parametrize("camera", [PLAIN, LENS], ids=["plain", "lens"])
@pytest.mark.parametrize("others", [0, 2])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_triangulate_inverts_project_to_a_micrometre(camera, others, seed):
    projection, points = stereo(camera, others), table(seed)
    np.testing.assert_allclose(projection.triangulate(projection.project(points)), points, atol=1e-6)


@pytest.mark.parametrize("camera", [PLAIN, LENS], ids=["plain", "lens"])
def test_triangulate_finds_the_minimum_of_the_reprojection_error(camera):
    """No step of 10 um in any direction lowers the error of noisy pixels."""
    projection, rng = stereo(camera, 1), np.random.default_rng(0)
    pixels = {name: uv + rng.normal(0, 1, uv.shape) for name, uv in projection.project(table(0)).items()}

    def cost(points):
        return sum(((uv - pixels[name]) ** 2).sum(axis=1) for name, uv in projection.project(points).items())

    found = projection.triangulate(pixels)
    for step in np.random.default_rng(1).normal(size=(20, 3)):
        assert (cost(found + 1e-5 * step / np.linalg.norm(step)) > cost(found)).all()


def test_one_pixel_of_disparity_at_forty_centimetres_is_nine_millimetres():
    """z^2 / (f b) = 0.91 cm for the iCub's eyes: the scale of the depth is right."""
    straight = PinholeProjection(
        {name: PosedCamera(PLAIN, pose(origin=(x, 0, 0))) for name, x in (("left", -0.034), ("right", 0.034))}
    )
    pixels = straight.project([[0.0, 0.0, 0.4]])
    pixels["left"] = pixels["left"] - (1.0, 0.0)
    assert straight.triangulate(pixels)[0, 2] - 0.4 == pytest.approx(0.0091, abs=5e-4)


def test_a_point_is_triangulated_from_those_cameras_that_see_it():
    projection, points = stereo(LENS, 1), table(5, 4)
    pixels = projection.project(points)
    pixels["top0"][0] = NAN
    pixels["left"][1, 0] = NAN  # half a pixel is none
    pixels["left"][2] = pixels["right"][2] = NAN
    found = projection.triangulate(pixels)
    np.testing.assert_allclose(found[[0, 1, 3]], points[[0, 1, 3]], atol=1e-6)
    assert np.isnan(found[2]).all()


def test_parallel_and_diverging_rays_give_nan():
    straight = PinholeProjection(
        {name: PosedCamera(PLAIN, pose(origin=(x, 0, 0))) for name, x in (("left", -0.034), ("right", 0.034))}
    )
    left = np.array([[160.0, 120.0], [150.0, 120.0], [170.0, 120.0]])
    right = np.array([[160.0, 120.0], [170.0, 120.0], [150.0, 120.0]])
    found = straight.triangulate({"left": left, "right": right})
    np.testing.assert_array_equal(np.isnan(found).all(axis=1), [True, True, False])


def test_two_cameras_in_one_place_determine_nothing():
    twins = PinholeProjection(
        {"a": PosedCamera(PLAIN, np.eye(4)), "b": PosedCamera(PLAIN, pose((0, 0.1, 0)))}
    )
    assert np.isnan(twins.triangulate(twins.project(table(1)))).all()
    assert np.isnan(twins.triangulate({"a": [[10.0, 120.0]], "b": [[20.0, 90.0]]})).all()


def test_a_pixel_without_a_ray_is_not_seen():
    folded = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (-0.3, 0.0, 0.0, 0.0))
    projection = stereo(folded)
    assert np.isnan(projection.triangulate({"left": [[2000.0, 120.0]], "right": [[160.0, 120.0]]})).all()


def test_no_points_give_empty_arrays():
    projection = stereo(LENS)
    pixels = projection.project(np.zeros((0, 3)))
    assert {name: uv.shape for name, uv in pixels.items()} == {"left": (0, 2), "right": (0, 2)}
    assert projection.depths(np.zeros((0, 3)))["left"].shape == (0,)
    assert projection.triangulate(pixels).shape == (0, 3)


def test_pixels_that_triangulate_is_given_are_not_changed():
    projection = stereo(LENS)
    pixels = projection.project(table(7))
    pixels["left"][0] = NAN
    before = {name: uv.copy() for name, uv in pixels.items()}
    projection.triangulate(pixels)
    for name, uv in pixels.items():
        np.testing.assert_array_equal(uv, before[name])


def test_joints_are_accepted_and_ignored():
    projection, points = stereo(PLAIN), table(2)
    for joints in (None, np.zeros(9), [1.0] * 9):
        np.testing.assert_array_equal(
            projection.project(points, joints)["left"], projection.project(points)["left"]
        )
        projection.triangulate(projection.project(points, joints=joints), joints=joints)


def test_names_keep_their_order_and_shapes_come_from_the_cameras():
    projection = stereo(PLAIN, 1)
    assert projection.cameras == tuple(projection.project(table(0))) == ("left", "right", "top0")
    assert projection.shapes == {"left": (240, 320), "right": (240, 320), "top0": (240, 320)}
    assert isinstance(projection, PosedProjection) and isinstance(projection, Projection)


def test_shapes_of_matrices_are_those_given_and_asking_without_says_what_to_pass():
    p = PLAIN.matrix @ np.eye(3, 4)
    assert PinholeProjection({"a": p, "b": p}, shape=(240, 320)).shapes == {"a": (240, 320), "b": (240, 320)}
    mixed = PinholeProjection({"a": p, "b": PosedCamera(LENS, np.eye(4))}, shape={"a": (480, 640)})
    assert mixed.shapes == {"a": (480, 640), "b": (240, 320)}
    with pytest.raises(StateError, match=r"'a'.*pass shape=\(height, width\)"):
        _ = PinholeProjection({"a": p}).shapes


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(4), r"cameras\['c'\]: expected shape \(3, 4\), got \(4, 4\)"),
        (np.zeros((3, 4)), "singular"),
        (np.eye(3, 4)[[0, 1, 1]], "singular"),
        ([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], "singular"),  # an affine camera
        (np.full((3, 4), NAN), "finite"),
        (np.array([[500.0, 3.0, 320.0], [0, 500, 240], [0, 0, 1]]) @ np.eye(3, 4), "skew 3 px at fx = 500"),
    ],
)
def test_a_matrix_that_is_no_camera_is_an_error(matrix, message):
    with pytest.raises(ArgumentError, match=message):
        PinholeProjection({"c": matrix})


def test_wrong_cameras_and_shapes_are_named():
    posed = PosedCamera(PLAIN, np.eye(4))
    with pytest.raises(ArgumentError, match="at least one camera"):
        PinholeProjection({})
    with pytest.raises(ArgumentTypeError, match="mapping"):
        PinholeProjection([posed])
    with pytest.raises(ArgumentTypeError, match="cameras"):
        PinholeProjection({"c": "camera"})
    with pytest.raises(ArgumentError, match=r"\(240, 320\), got \(320, 240\)"):
        PinholeProjection({"c": posed}, shape=(320, 240))
    with pytest.raises(ArgumentError, match=r"'d'; there are c"):
        PinholeProjection({"c": posed}, shape={"d": (240, 320)})
    with pytest.raises(ArgumentError, match="height, width"):
        PinholeProjection({"c": matrix_of(posed)}, shape=(240, 320, 3))


@pytest.mark.parametrize("call", ["project", "depths"])
def test_wrong_points_are_named(call):
    function = getattr(stereo(PLAIN), call)
    with pytest.raises(ArgumentError, match=r"points: expected shape \(N, 3\), got \(3, 4\)"):
        function(np.zeros((3, 4)))
    with pytest.raises(ArgumentError, match=r"points: expected finite numbers, got nan at \[1, 2\]"):
        function([[0.0, 0.0, 1.0], [0.0, 0.0, NAN]])


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        ({"left": [[0.0, 0.0]]}, "at least two cameras, got left"),
        ({}, "at least two cameras, got none"),
        ({"left": [[0.0, 0.0]], "middle": [[0.0, 0.0]]}, "unknown camera 'middle'; there are left, right"),
        ({"left": [[0.0, 0.0]], "right": [[0.0, 0.0]] * 2}, "same number of rows.*'left': 1, 'right': 2"),
        ({"left": [[0.0, 0.0]], "right": [[0.0, math.inf]]}, r"pixels\['right'\].*inf at \[0, 1\]"),
        ({"left": [[0.0, 0.0]], "right": [0.0, 0.0]}, r"pixels\['right'\]: expected shape \(N, 2\)"),
    ],
)
def test_wrong_pixels_are_named(pixels, message):
    with pytest.raises(ArgumentError, match=message):
        stereo(PLAIN).triangulate(pixels)


def test_a_subclass_that_only_poses_its_cameras_projects_and_triangulates():
    """The camera on a joint: what a kinematic projection is."""

    class Turntable(PosedProjection):
        def posed(self, joints=None):
            origins = {"a": (-0.1, 0.0, 0.0), "b": (0.1, 0.0, 0.0)}
            return {
                name: PosedCamera(camera, pose((0.0, joints[0], 0.0)) @ pose(origin=origins[name]))
                for name, camera in self._cameras.items()
            }

    table_ = Turntable({"a": PLAIN, "b": LENS})
    points = table(3)
    turned = points @ pose((0.0, 0.5, 0.0))[:3, :3].T
    for name, uv in table_.project(turned, [0.5]).items():
        np.testing.assert_allclose(uv, table_.project(points, [0.0])[name], atol=1e-9)
    np.testing.assert_allclose(table_.triangulate(table_.project(turned, [0.5]), [0.5]), turned, atol=1e-6)
