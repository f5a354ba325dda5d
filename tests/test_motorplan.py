"""Landscapes of planned paths (Eq. 6-9): where they lie, how wide they are, what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime import Camera, PinholeProjection, PosedCamera, motorplan_landscape
from motorprime.errors import ArgumentError, ArgumentTypeError, Error, NotInViewError, StateError
from motorprime.motorplan import PATH_SHARE, _widths, all_involved, default_width, pixel_landscapes
from reference import kernel_landscape as reference_landscape

SHAPE = (240, 320)
F = 250.0
AHEAD = np.array([[F, 0, 160, 0], [0, F, 120, 0], [0, 0, 1, 0.0]])
BEHIND = np.array([[-F, 0, -160, 0], [0, F, -120, 0], [0, 0, -1, 0.0]])  # the same camera, turned about y


def fixed(shape=SHAPE, **matrices):
    return PinholeProjection(matrices or {"camera": AHEAD}, shape)


def peak(landscape):
    v, u = np.unravel_index(int(landscape.argmax()), landscape.shape)
    return int(u), int(v)


@pytest.mark.parametrize("kernel", ["triangular", "gaussian"])
def test_the_peak_lies_where_the_path_appears_u_to_the_right_and_v_down(kernel):
    """(0.1, -0.06, 0.5) m is 50 px to the right and 30 px above the principal point (160, 120)."""
    landscape = motorplan_landscape([[0.1, -0.06, 0.5]], fixed(), kernel=kernel)["camera"]
    assert landscape.shape == SHAPE and landscape.dtype == np.float32
    assert peak(landscape) == (210, 90)


def test_it_is_the_mean_of_kernels_at_the_projected_points_of_every_camera():
    shifted = AHEAD.copy()
    shifted[:, 3] = -AHEAD[:, :3] @ (0.07, 0.0, 0.0)
    path = np.random.default_rng(0).uniform((-0.1, -0.1, 0.3), (0.1, 0.1, 0.6), (9, 3))
    landscapes = motorplan_landscape(path, fixed(left=AHEAD, right=shifted), width=31.0)
    assert list(landscapes) == ["left", "right"]
    for name, x in (("left", 0.0), ("right", 0.07)):
        pixels = F * (path[:, :2] - (x, 0.0)) / path[:, 2:] + (160, 120)
        expected = reference_landscape(pixels, SHAPE, 31.0)
        np.testing.assert_allclose(landscapes[name], expected, rtol=1e-4, atol=1e-6 * expected.max())


@pytest.mark.parametrize(("shape", "width"), [((240, 320), 40.0), ((480, 640), 80.0), ((90, 160), 20.0)])
def test_the_default_width_is_40_px_at_320_and_scales_with_the_image(shape, width):
    assert default_width(shape) == width
    middle = np.array([[shape[1] // 2, shape[0] // 2]], float)
    landscape = pixel_landscapes({"c": middle}, {"c": shape})["c"]
    # A triangle of width h ends h from its point: h - 1 pixels to either side are positive.
    assert np.count_nonzero(landscape[shape[0] // 2]) == 2 * width - 1
    np.testing.assert_array_equal(landscape, pixel_landscapes({"c": middle}, {"c": shape}, width=width)["c"])


@pytest.mark.parametrize(("depth", "metres"), [(0.5, 0.051), (0.25, 0.0507), (1.0, 0.103), (0.4, 0.02)])
def test_a_width_in_metres_on_the_axis_is_f_metres_over_depth(depth, metres):
    """One point on the axis: the peak of a triangular kernel is 1 / h^2, its support 2 h - 1 pixels."""
    h = F * metres / depth
    landscape = motorplan_landscape([[0.0, 0.0, depth]], fixed(), metres=metres)["camera"]
    assert landscape[120, 160] == pytest.approx(1 / h**2, rel=1e-4)
    assert np.count_nonzero(landscape[120]) == 2 * math.floor(h) + 1
    np.testing.assert_allclose(
        _widths(np.array([[0.0, 0.0, depth]]), fixed(), None, "camera", metres), [h], rtol=1e-5
    )


@given(
    x=st.floats(-0.3, 0.3),
    y=st.floats(-0.3, 0.3),
    z=st.floats(0.2, 1.5),
    angle=st.floats(-1.0, 1.0),
    fx=st.floats(150, 900),
)
@settings(max_examples=60, deadline=None)
def test_a_width_in_metres_is_the_root_of_the_area_that_a_square_across_the_sight_covers(x, y, z, angle, fx):
    """sqrt(det(J J^T))^(1/2), J the pinhole's derivative; off the axis f / z (1 + tan^2)^(1/4)."""
    camera = Camera(320, 240, fx, 1.1 * fx, 160.0, 120.0)
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]]
    pose[:3, 3] = (0.3, -0.2, 0.1)
    point = np.array([[x, y, z]]) @ pose[:3, :3].T + pose[:3, 3]
    projection = PinholeProjection({"c": PosedCamera(camera, pose)})
    expected = 0.04 * math.sqrt(fx * 1.1 * fx) / z * (1 + (x * x + y * y) / z**2) ** 0.25
    np.testing.assert_allclose(_widths(point, projection, None, "c", 0.04), [expected], rtol=1e-4)


def test_nearer_points_of_one_path_get_wider_and_lower_kernels():
    path = np.array([[-0.1, 0.0, 0.5], [0.05, 0.0, 0.25]])
    landscape = motorplan_landscape(path, fixed(), metres=0.04)["camera"]
    expected = reference_landscape(
        F * path[:, :2] / path[:, 2:] + (160, 120),
        SHAPE,
        _widths(path, fixed(), None, "camera", 0.04),
    )
    np.testing.assert_allclose(landscape, expected, rtol=1e-4, atol=1e-6 * expected.max())
    assert landscape[120, 110] > 3.9 * landscape[120, 210]


def test_points_behind_a_camera_are_dropped_not_mirrored():
    seen = [[0.0, 0.0, 0.5], [0.1, 0.0, 0.5]]
    behind = [[-0.2, 0.1, -0.5], [0.0, 0.0, 0.0], [0.3, 0.3, -2.0]]
    for arguments in ({}, {"metres": 0.05}, {"width": 20.0}):
        both = motorplan_landscape([*behind, *seen], fixed(), **arguments)["camera"]
        np.testing.assert_array_equal(both, motorplan_landscape(seen, fixed(), **arguments)["camera"])


def test_a_point_at_the_very_edge_of_what_a_camera_sees_has_no_width_in_metres_and_is_dropped():
    """At 0.01 m in front the derivative reaches behind the limit; that is no NaN in the kernel."""
    seen = [[0.1, 0.0, 0.5]]
    edge = [[0.0, 0.0, 0.01005]]
    both = motorplan_landscape([*edge, *seen], fixed(), metres=0.05)["camera"]
    np.testing.assert_array_equal(both, motorplan_landscape(seen, fixed(), metres=0.05)["camera"])


def test_a_row_that_is_nan_in_one_coordinate_only_is_dropped_too():
    rows = np.array([[np.nan, 5.0], [100.0, 90.0], [4.0, np.nan], [np.inf, 3.0]])
    landscape = pixel_landscapes({"camera": rows}, {"camera": SHAPE})["camera"]
    expected = pixel_landscapes({"camera": rows[1:2]}, {"camera": SHAPE})["camera"]
    np.testing.assert_array_equal(landscape, expected)


def test_a_camera_that_has_all_of_it_behind_is_left_out_and_all_cameras_is_an_error():
    projection = fixed(front=AHEAD, back=BEHIND)
    assert list(motorplan_landscape([[0.0, 0.0, 0.5]], projection)) == ["front"]
    assert list(motorplan_landscape([[0.0, 0.0, -0.5]], projection, metres=0.05)) == ["back"]
    with pytest.raises(NotInViewError, match="in front of a camera"):
        motorplan_landscape([[0.0, 0.0, -0.5], [0.1, 0.0, -1.0]], fixed())


def test_a_path_outside_the_image_leaves_zeros():
    landscape = motorplan_landscape([[5.0, 0.0, 0.5]], fixed())["camera"]
    assert landscape.shape == SHAPE and not landscape.any()


def test_the_path_is_not_changed_and_its_layout_does_not_matter():
    path = np.random.default_rng(4).uniform((-0.1, -0.1, 0.3), (0.1, 0.1, 0.6), (8, 3))
    kept = path.copy()
    expected = motorplan_landscape(path, fixed())["camera"]
    wide = np.zeros((16, 6))
    wide[::2, ::2] = path
    for same in (np.asfortranarray(path), wide[::2, ::2], path[::-1][::-1], path.tolist()):
        np.testing.assert_array_equal(motorplan_landscape(same, fixed())["camera"], expected)
    np.testing.assert_array_equal(path, kept)
    np.testing.assert_allclose(
        motorplan_landscape(path.astype(np.float32), fixed())["camera"], expected, atol=1e-4 * expected.max()
    )


POINT = [[0.0, 0.0, 0.5]]


@pytest.mark.parametrize(
    ("path", "arguments", "name", "error"),
    [
        (np.zeros((0, 3)), {}, "path.*empty", ArgumentError),
        ([[0.0, np.nan, 0.5]], {}, "path", ArgumentError),
        ([[0.0, np.inf, 0.5]], {}, "path", ArgumentError),
        (np.zeros((3, 4)), {}, "path", ArgumentError),
        ([0.0, 0.0, 0.5], {}, "path", ArgumentError),
        ([[0.0, 0.0]], {}, "path", ArgumentError),
        ("path", {}, "path", ArgumentTypeError),
        (None, {}, "path", ArgumentTypeError),
        (POINT, {"width": 20.0, "metres": 0.05}, "width, metres", ArgumentError),
        (POINT, {"width": 0.0}, "width", ArgumentError),
        (POINT, {"width": -4.0}, "width", ArgumentError),
        (POINT, {"width": np.nan}, "width", ArgumentError),
        (POINT, {"width": "wide"}, "width", ArgumentTypeError),
        (POINT, {"metres": 0.0}, "metres", ArgumentError),
        (POINT, {"metres": -0.1}, "metres", ArgumentError),
        (POINT, {"metres": np.inf}, "metres", ArgumentError),
        (POINT, {"metres": np.ones(3)}, "metres", ArgumentError),
        (POINT, {"metres": "5 cm"}, "metres", ArgumentTypeError),
        (POINT, {"kernel": "round"}, "kernel", ArgumentError),
    ],
)
def test_what_is_wrong_is_named(path, arguments, name, error):
    with pytest.raises(error, match=name) as caught:
        motorplan_landscape(path, fixed(), **arguments)
    assert isinstance(caught.value, Error)


def test_without_an_image_size_it_says_how_to_give_one():
    with pytest.raises(StateError, match="shape=\\(height, width\\)"):
        motorplan_landscape(POINT, PinholeProjection({"camera": AHEAD}))


@pytest.mark.parametrize(
    ("pixels", "name", "error"),
    [
        ({"tail": np.zeros((2, 2))}, "unknown camera 'tail'; there are camera", ArgumentError),
        ({"camera": np.zeros((2, 3))}, r"pixels\['camera'\]", ArgumentError),
        ({"camera": np.zeros(2)}, r"pixels\['camera'\]", ArgumentError),
        ({"camera": np.zeros((2, 2), int)}, r"pixels\['camera'\]", ArgumentTypeError),
        ({"camera": np.full((2, 2), np.nan)}, "in front of a camera", NotInViewError),
        ({"camera": np.zeros((0, 2))}, "in front of a camera", NotInViewError),
        ({}, "in front of a camera", NotInViewError),
    ],
)
def test_wrong_projected_paths_are_named(pixels, name, error):
    with pytest.raises(error, match=name):
        pixel_landscapes(pixels, {"camera": SHAPE})


def test_all_that_a_plan_involves_has_its_share_however_many_points_it_has():
    path, hand = np.ones((7, 3)), np.zeros((10, 3))
    points, weights = all_involved(path, hand=hand, things=[np.full((4, 3), 2.0), np.full((1, 3), 3.0)])
    assert points.shape == (22, 3)
    np.testing.assert_allclose(
        [weights[points[:, 0] == value].sum() for value in (1.0, 0.0, 2.0, 3.0)], [PATH_SHARE, 1.0, 1.0, 1.0]
    )
    alone, equal = all_involved(path)
    np.testing.assert_array_equal(alone, path)
    assert len(set(equal)) == 1


def test_a_part_without_points_is_refused_by_name():
    path = np.ones((7, 3))
    with pytest.raises(ArgumentError, match="path: at least one point"):
        all_involved(path[:0])
    with pytest.raises(ArgumentError, match="hand: at least one point"):
        all_involved(path, hand=path[:0])
    with pytest.raises(ArgumentError, match=r"things\[1\]: .*shape"):
        all_involved(path, things=[path, path[:, :2]])


def test_weights_of_points_that_are_not_seen_do_not_count():
    pixels = {"left": np.array([[10.0, 10.0], [np.nan, np.nan], [30.0, 20.0]])}
    found = pixel_landscapes(pixels, {"left": (40, 50)}, width=5.0, weights=[1.0, 9.0, 3.0])["left"]
    assert found[20, 30] == pytest.approx(3.0 * found[10, 10])
    with pytest.raises(ArgumentError, match=r"weights: expected shape \(3,\)"):
        pixel_landscapes(pixels, {"left": (40, 50)}, weights=[1.0])
