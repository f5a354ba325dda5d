"""Cameras: against OpenCV, against their own inverse, and what they refuse."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime.camera import Camera, PosedCamera, sphere_outline_centre
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError

ICUB = Camera(320, 240, 257.34, 257.34, 160.0, 120.0)
LENS = Camera(640, 480, 520.0, 525.0, 322.5, 236.0, (-0.36, 0.17, 1e-3, -7e-4, -0.05))
COUNTS = (0, 4, 5, 8, 12, 14)


def random_camera(seed: int, count: int) -> Camera:
    rng = np.random.default_rng(seed)
    fx, fy, cx, cy = rng.uniform((300, 300, 280, 200), (700, 700, 360, 280))
    return Camera(640, 480, fx, fy, cx, cy, tuple(rng.normal(0.0, 0.02, count)))


def points_in_front(seed: int, n: int = 60) -> np.ndarray:
    return np.random.default_rng(seed).uniform((-0.3, -0.3, 0.5), (0.3, 0.3, 2.0), (n, 3))


def turned(roll: float, pitch: float, yaw: float, translation=(0.0, 0.0, 0.0)) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array([roll, pitch, yaw]))[0]
    pose[:3, 3] = translation
    return pose


def test_right_is_larger_u_and_down_is_larger_v():
    (u, v), *_ = ICUB.project([[0.1, 0.0, 0.5]])
    assert (u, v) == pytest.approx((160 + 257.34 / 5, 120))
    (u, v), *_ = ICUB.project([[0.0, 0.1, 0.5]])
    assert (u, v) == pytest.approx((160, 120 + 257.34 / 5))


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("seed", range(5))
def test_project_agrees_with_opencv(count, seed):
    camera, points = random_camera(seed, count), points_in_front(seed)
    coefficients = np.array(camera.distortion) if count else None
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, coefficients)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("count", COUNTS)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_rays_invert_project(count, seed):
    camera, points = random_camera(seed, count), points_in_front(seed)
    rays = camera.rays(camera.project(points))
    np.testing.assert_array_equal(rays[:, 2], 1.0)
    np.testing.assert_allclose(rays * points[:, 2:], points, atol=1e-9)


def test_rays_agree_with_opencv_iterated_to_convergence():
    pixels = np.random.default_rng(3).uniform((0, 0), (639, 479), (200, 2))
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    k, distortion = LENS.matrix, np.array(LENS.distortion)
    if hasattr(cv2, "undistortPointsIter"):
        expected = cv2.undistortPointsIter(pixels[:, None], k, distortion, np.eye(3), np.eye(3), criteria)
    else:
        expected = cv2.undistortPoints(pixels[:, None], k, distortion, R=None, P=None, criteria=criteria)
    np.testing.assert_allclose(LENS.rays(pixels)[:, :2], expected[:, 0], atol=1e-8)


@pytest.mark.parametrize("count", COUNTS)
def test_jacobian_is_the_central_difference_of_project(count):
    camera, points, h = random_camera(9, count), points_in_front(9), 1e-6
    columns = [(camera.project(points + h * e) - camera.project(points - h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(camera.jacobian(points), np.stack(columns, axis=-1), atol=1e-5)


@pytest.mark.parametrize("camera", [ICUB, LENS])
def test_points_behind_or_nearer_than_a_centimetre_are_nan_and_the_others_are_not(camera):
    points = [[0.1, 0.1, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0099], [0.0, 0.0, 0.01], [0.1, 0.1, 1.0]]
    unseen = [True, True, True, False, False]
    np.testing.assert_array_equal(np.isnan(camera.project(points)).all(axis=1), unseen)
    np.testing.assert_array_equal(np.isnan(camera.project(points)).any(axis=1), unseen)
    np.testing.assert_array_equal(np.isnan(camera.jacobian(points)).all(axis=(1, 2)), unseen)


def test_a_point_that_the_polynomial_folds_back_into_the_image_is_nan():
    """r (1 - 0.3 r^2) grows up to r = 1 / sqrt(0.9) and comes back to the axis at r = 1.83."""
    camera = replace(ICUB, distortion=(-0.3, 0.0, 0.0, 0.0))
    fold = 1.0 / math.sqrt(0.9)
    points = np.array([[r, 0.0, 1.0] for r in (0.5, fold - 1e-6, fold + 1e-6, 1.7, 1.83, 5.0)])
    mirrored, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    assert 0 < mirrored[3, 0, 0] < 320  # what it protects from
    np.testing.assert_array_equal(np.isnan(camera.project(points)[:, 0]), [False] * 2 + [True] * 4)
    assert np.isnan(camera.jacobian(points)[2:]).all()


def test_a_pole_of_the_rational_model_ends_the_field_of_view():
    camera = replace(ICUB, distortion=(0.0, 0.0, 0.0, 0.0, 0.0, -0.25, 0.0, 0.0))  # 1 / (1 - r^2 / 4)
    pixels = camera.project([[r, 0.0, 1.0] for r in (0.0, 1.0, 1.9, 1.9999, 2.1)])
    np.testing.assert_array_equal(np.isnan(pixels).any(axis=1), [False] * 4 + [True])
    np.testing.assert_allclose(camera.rays(pixels[:4])[:, 0], (0.0, 1.0, 1.9, 1.9999), atol=1e-9)


def test_a_pixel_beyond_the_fold_has_no_ray():
    camera = replace(ICUB, distortion=(-0.3, 0.0, 0.0, 0.0))
    edge = 257.34 / math.sqrt(0.9) * (1 - 0.3 / 0.9)  # the largest distorted radius
    rays = camera.rays([[160 + edge - 0.01, 120], [160 + edge + 0.01, 120], [160, 120]])
    np.testing.assert_array_equal(np.isnan(rays).all(axis=1), [False, True, False])
    np.testing.assert_allclose(camera.project(rays[:1]), [[160 + edge - 0.01, 120]], atol=1e-6)


def test_crop_moves_pixels_by_its_corner():
    points = points_in_front(1)
    part = LENS.crop(100, 50, 200, 300)
    assert part.shape == (300, 200)
    np.testing.assert_allclose(part.project(points), LENS.project(points) - (100, 50), atol=1e-9)


def test_scale_is_that_of_cv2_resize():
    """A blob's centroid in the halved image is where the halved camera projects it."""
    image = np.zeros((240, 320), np.float32)
    image[100:104, 200:208] = 1.0
    ray = ICUB.rays([[203.5, 101.5]])
    small = cv2.resize(image, (160, 120), interpolation=cv2.INTER_AREA)
    v, u = np.nonzero(small)
    np.testing.assert_allclose(ICUB.scale(0.5).project(ray), [[u.mean(), v.mean()]], atol=1e-9)


@given(st.integers(1, 2000), st.integers(1, 2000))
@settings(deadline=None)
def test_scale_there_and_back_is_the_same_camera(width, height):
    back = LENS.scale((width, height)).scale((640, 480))
    assert back.shape == LENS.shape
    np.testing.assert_allclose(back.matrix, LENS.matrix, rtol=1e-12)


def test_scale_by_a_factor_rounds_the_size_and_keeps_the_edges():
    small = replace(LENS, width=641).scale(0.5)
    assert small.shape == (240, 320)
    # The left and right edges of the image look in the same directions as before.
    edges = replace(LENS, width=641, distortion=()).rays([[-0.5, 0.0], [640.5, 0.0]])[:, 0]
    np.testing.assert_allclose(
        replace(small, distortion=()).rays([[-0.5, 0.0], [319.5, 0.0]])[:, 0], edges, atol=1e-12
    )


def test_from_fov_spans_the_angle_between_the_edges():
    camera = Camera.from_fov(320, 240, math.radians(64))
    left, right = camera.rays([[-0.5, 119.5], [319.5, 119.5]])
    assert math.degrees(math.atan(right[0]) - math.atan(left[0])) == pytest.approx(64)
    assert left[1] == right[1] == 0.0
    tall = Camera.from_fov(320, 240, math.radians(64), axis="vertical")
    assert tall.fx == tall.fy == pytest.approx(120 / math.tan(math.radians(32)))


def test_fields_become_plain_numbers_and_equal_cameras_hash_alike():
    a = Camera(np.int64(4), 3, np.float32(2.0), 2, 1, 1, np.array([[0.1, 0.0, 0.0, 0.0]]))
    b = Camera(4, 3, 2.0, 2.0, 1.0, 1.0, (0.1, 0.0, 0.0, 0.0))
    assert a == b and hash(a) == hash(b)
    assert [type(value) for value in (a.width, a.fx, a.cx, a.distortion[0])] == [int, float, float, float]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": -1}, "width"),
        ({"height": 0}, "width, height"),
        ({"width": 320.0}, "width"),
        ({"fx": 0.0}, "fx"),
        ({"fy": -257.0}, "fy"),
        ({"cx": math.nan}, "cx"),
        ({"cy": "120"}, "cy"),
        ({"distortion": (0.1, 0.2, 0.3)}, r"distortion: expected 0, 4, 5.*got 3"),
        ({"distortion": (0.1, 0.2, math.inf, 0.0)}, r"distortion.*inf at \[2\]"),
    ],
)
def test_wrong_fields_are_named(changes, message):
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        replace(ICUB, **changes)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([0.0, 0.0, 1.0], r"points.*: expected shape \(N, 3\), got \(3,\)"),
        (np.zeros((3, 2)), r"got \(3, 2\)"),
        ([[0, 0, 1], [0, math.nan, 1]], r"points.*: expected finite numbers, got nan at \[1, 1\]"),
        ([[0, 0, -math.inf]], r"-inf at \[0, 2\]"),
        ([[0, 0, 1], [0, 1]], "points"),
        ([["a", "b", "c"]], "points.*: expected real numbers"),
        (np.zeros((1, 3), complex), "complex"),
    ],
)
@pytest.mark.parametrize("call", [ICUB.project, ICUB.jacobian, PosedCamera(ICUB, np.eye(4)).to_camera])
def test_wrong_points_are_named(call, points, message):
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        call(points)


def test_no_points_give_no_pixels():
    assert LENS.project(np.zeros((0, 3))).shape == (0, 2)
    assert LENS.jacobian(np.zeros((0, 3))).shape == (0, 2, 3)
    assert LENS.rays(np.zeros((0, 2))).shape == (0, 3)


def test_integer_lists_transposed_and_strided_arrays_project_alike():
    points = points_in_front(2)
    expected = LENS.project(points)
    np.testing.assert_array_equal(LENS.project(np.asfortranarray(points)), expected)
    np.testing.assert_array_equal(LENS.project(np.repeat(points, 2, axis=0)[::2]), expected)
    np.testing.assert_array_equal(ICUB.project([[0, 0, 1]]), [[160.0, 120.0]])


def test_arguments_are_not_changed():
    points, pixels = points_in_front(4), np.array([[10.0, 20.0], [-5000.0, 0.0]])
    before = points.copy(), pixels.copy()
    LENS.project(points), LENS.jacobian(points), LENS.rays(pixels)
    np.testing.assert_array_equal(points, before[0])
    np.testing.assert_array_equal(pixels, before[1])


@pytest.mark.parametrize("window", [(0, 0, 321, 10), (0, 0, 10, 241), (-1, 0, 10, 10), (0, 0, 0, 10)])
def test_crop_outside_the_image_is_an_error(window):
    with pytest.raises(ArgumentError, match=r"u0|width"):
        ICUB.crop(*window)


@pytest.mark.parametrize("size", [0.0, -1.0, 1e-4, (0, 10), (10,), math.nan])
def test_scale_to_nothing_is_an_error(size):
    with pytest.raises(ArgumentError, match="size"):
        ICUB.scale(size)


@pytest.mark.parametrize(
    "matrix", [np.eye(4), [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 1, 0], [0, 0, 2]]]
)
def test_from_matrix_refuses_skew_and_other_scales(matrix):
    with pytest.raises(ArgumentError, match="matrix"):
        Camera.from_matrix(matrix, (240, 320))


def test_a_camera_of_unknown_size_projects_and_says_so_when_its_size_is_asked():
    camera = Camera(0, 0, 257.34, 257.34, 160.0, 120.0)
    np.testing.assert_array_equal(camera.project([[0, 0, 1]]), [[160.0, 120.0]])
    for ask in (lambda: camera.shape, lambda: camera.crop(0, 0, 1, 1), lambda: camera.scale(2.0)):
        with pytest.raises(StateError, match="size"):
            ask()


def test_posed_camera_looks_where_its_pose_says():
    """iCub root frame: x backwards, y right, z up. A camera 0.3 m up looks forward along -x."""
    pose = np.array([[0, 0, -1, 0], [1, 0, 0, 0], [0, -1, 0, 0.3], [0, 0, 0, 1]], float)
    posed = PosedCamera(ICUB, pose)
    ahead, right, down = posed.project([[-0.5, 0.0, 0.3], [-0.5, 0.1, 0.3], [-0.5, 0.0, 0.2]])
    assert tuple(ahead) == pytest.approx((160, 120))
    assert right[0] > 160 and right[1] == pytest.approx(120)
    assert down[1] > 120 and down[0] == pytest.approx(160)
    np.testing.assert_allclose(posed.depth([[-0.5, 0.1, 0.3], [0.5, 0.0, 0.0]]), [0.5, -0.5])
    assert np.isnan(posed.project([[0.5, 0.0, 0.3]])).all()


def test_posed_project_agrees_with_opencv_and_rays_lead_back():
    pose = turned(0.2, -0.4, 0.3, (0.1, -0.2, 0.05))
    posed, local = PosedCamera(LENS, pose), points_in_front(6)
    points = local @ pose[:3, :3].T + pose[:3, 3]
    to_camera = np.linalg.inv(pose)
    expected, _ = cv2.projectPoints(
        points,
        cv2.Rodrigues(to_camera[:3, :3])[0],
        to_camera[:3, 3],
        LENS.matrix,
        np.array(LENS.distortion),
    )
    pixels = posed.project(points)
    np.testing.assert_allclose(pixels, expected[:, 0], atol=1e-9)
    origin, directions = posed.rays(pixels)
    np.testing.assert_allclose(origin + posed.depth(points)[:, None] * directions, points, atol=1e-9)


@pytest.mark.parametrize(
    "pose", [np.eye(3), np.diag([1.0, 1.0, -1.0, 1.0]), 2 * np.eye(4), np.full((4, 4), np.nan)]
)
def test_a_pose_that_is_no_rigid_motion_is_an_error(pose):
    with pytest.raises(ArgumentError, match="pose"):
        PosedCamera(ICUB, pose)


def test_a_posed_camera_keeps_its_own_read_only_pose():
    pose = np.eye(4)
    posed = PosedCamera(ICUB, pose)
    pose[0, 3] = 1.0
    assert posed.origin[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        posed.pose[0, 3] = 1.0


@pytest.mark.parametrize("centre", [(0.2, -0.12, 0.4), (-0.1, 0.15, 0.3)])
@pytest.mark.parametrize("radius", [0.02, 0.04])
def test_sphere_outline_centre_is_that_of_the_pixels_whose_rays_hit_the_sphere(centre, radius):
    """The silhouette by brute force: a ray hits if it passes the centre nearer than the radius."""
    camera, fine = replace(ICUB, fy=300.0), 8  # rays on a grid eight times finer than the pixels
    u0, v0 = camera.project([centre])[0]
    grid = np.arange(-60 * fine, 60 * fine + 1) / fine
    u, v = (axis.ravel() for axis in np.meshgrid(u0 + grid, v0 + grid))
    rays = camera.rays(np.column_stack([u, v]))
    distance = np.linalg.norm(np.cross(rays, centre), axis=1) / np.linalg.norm(rays, axis=1)
    hit = distance < radius
    outline = sphere_outline_centre(camera, centre, radius)
    np.testing.assert_allclose(outline, [u[hit].mean(), v[hit].mean()], atol=0.01)
    # The correction is no less than what the projected centre lacks.
    assert np.linalg.norm(outline - (u0, v0)) > 0.1


def test_sphere_outline_centre_of_a_point_and_on_the_axis_is_its_projection():
    np.testing.assert_allclose(
        sphere_outline_centre(ICUB, (0.1, 0.2, 0.5), 0.0), ICUB.project([[0.1, 0.2, 0.5]])[0]
    )
    np.testing.assert_allclose(sphere_outline_centre(ICUB, (0.0, 0.0, 0.5), 0.1), [160, 120])


def test_sphere_outline_centre_refuses_what_has_no_ellipse():
    with pytest.raises(NotInViewError):
        sphere_outline_centre(ICUB, (0.0, 0.0, 0.1), 0.095)
    with pytest.raises(ArgumentError, match="radius"):
        sphere_outline_centre(ICUB, (0.0, 0.0, 0.5), -0.1)
    with pytest.raises(ArgumentError, match="distortion"):
        sphere_outline_centre(LENS, (0.0, 0.0, 0.5), 0.1)
