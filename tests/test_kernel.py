"""The kernel landscape against its twin and against what its equations say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorprime.errors
import reference
from motorprime.landscape import kernel_landscape

examples = settings(deadline=None, derandomize=True, max_examples=150)
kernels = st.sampled_from(["triangular", "gaussian"])
sizes = st.tuples(st.integers(1, 40), st.integers(1, 40))
coordinates = st.floats(-100, 140) | st.integers(-5, 45).map(float) | st.floats(-1e6, 1e6)
trajectories = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=100).map(np.array)
lengths = st.floats(0.01, 1) | st.floats(1, 60) | st.floats(60, 1e4)


def assert_is_the_twin(landscape, points, width, kernel, weights=None):
    """Within 1e-5 of the larger of the twin's maximum and one point's peak; equal support; never negative."""
    twin = reference.kernel_landscape(points, landscape.shape, width, kernel, weights)
    unit = max(twin.max(), reference.kernel_peak(points, width, kernel))
    assert landscape.dtype == np.float32
    assert np.abs(landscape - twin).max() <= 1e-5 * unit
    assert landscape.min() >= 0
    assert not landscape[twin == 0].any()


@examples
@given(trajectories, sizes, lengths, lengths, kernels)
def test_agrees_with_the_twin_for_any_points_widths_and_sizes(points, shape, wide, high, kernel):
    landscape = kernel_landscape(points, shape, width=(wide, high), kernel=kernel)
    assert_is_the_twin(landscape, points, (wide, high), kernel)


@examples
@given(trajectories, sizes, kernels, st.data())
def test_agrees_with_the_twin_for_weights_and_widths_per_point(points, shape, kernel, data):
    count = len(points)
    weights = np.array(data.draw(st.lists(st.floats(0, 10), min_size=count, max_size=count)))
    weights[data.draw(st.integers(0, count - 1))] = 1.0
    pair = st.tuples(st.floats(0.1, 100), st.floats(0.1, 100))
    width = np.array(data.draw(st.lists(pair, min_size=count, max_size=count)))
    landscape = kernel_landscape(points, shape, width=width, kernel=kernel, weights=weights)
    assert_is_the_twin(landscape, points, width, kernel, weights)


@pytest.mark.parametrize("count", [64, 65, 1024, 1025, 20_000])
@pytest.mark.parametrize("kernel", ["triangular", "gaussian"])
def test_rounding_does_not_grow_with_the_number_of_points(count, kernel):
    points = np.random.default_rng(count).normal((20, 15), (5, 5), (count, 2))
    points[::2] = (17.3, 12.9)
    landscape = kernel_landscape(points, (30, 40), width=11.3, kernel=kernel)
    assert_is_the_twin(landscape, points, 11.3, kernel)


@pytest.mark.parametrize("width", [0.01, 1e-4, 1e5, 1e12])
@pytest.mark.parametrize("kernel", ["triangular", "gaussian"])
def test_tiny_and_huge_widths(width, kernel):
    points = np.array([[3.0, 2.0], [5.004, 1.0], [-4.0, 90.0]])
    landscape = kernel_landscape(points, (6, 8), width=width, kernel=kernel)
    assert_is_the_twin(landscape, points, width, kernel)
    assert landscape[2, 3] > 0


def test_a_point_far_from_the_origin_keeps_its_subpixel_position():
    points = np.array([[30_000.3, 0.0]])
    landscape = kernel_landscape(points, (1, 30_002), width=0.5)
    assert landscape[0, 30_000] == pytest.approx((1 - 0.3 / 0.5) / 0.25, rel=1e-5)
    assert np.count_nonzero(landscape) == 1


def test_a_triangle_by_hand():
    landscape = kernel_landscape([[4.0, 2.0]], (5, 9), width=(4.0, 2.0))
    across = np.array([0, 0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25, 0])
    down = np.array([0, 0.5, 1, 0.5, 0])
    np.testing.assert_allclose(landscape, np.outer(down, across) / 8, rtol=1e-6)


def test_a_gaussian_by_hand():
    landscape = kernel_landscape([[4.0, 2.0]], (5, 9), width=(4.0, 2.0), kernel="gaussian")
    assert landscape[2, 4] == pytest.approx(1 / (2 * math.pi * 8), rel=1e-6)
    assert landscape[2, 8] == pytest.approx(math.exp(-0.5) / (2 * math.pi * 8), rel=1e-6)
    assert landscape[4, 4] == pytest.approx(math.exp(-0.5) / (2 * math.pi * 8), rel=1e-6)


def test_horizontal_comes_first_in_points_and_widths():
    landscape = kernel_landscape([[30.0, 10.0]], (20, 50), width=(15.0, 3.0))
    rows, columns = np.nonzero(landscape)
    assert (columns.min(), columns.max()) == (16, 44)
    assert (rows.min(), rows.max()) == (8, 12)
    assert landscape[10, 30] == landscape.max()


@pytest.mark.parametrize("width", [3.0, 7.0, 49.0, 1 / 3 + 3, 40.0])
def test_a_triangle_is_exactly_zero_at_its_ends(width):
    centre = 60.0
    landscape = kernel_landscape([[centre, centre]], (121, 121), width=width)
    reach = math.ceil(width) - 1
    rows, columns = np.nonzero(landscape)
    assert rows.min() == columns.min() == centre - reach
    assert rows.max() == columns.max() == centre + reach


def test_a_gaussian_is_cut_at_five_widths_and_its_border_is_inside():
    landscape = kernel_landscape([[20.0, 20.0]], (41, 41), width=3.0, kernel="gaussian")
    assert landscape[20, 35] > 0
    assert landscape[20, 36] == 0
    assert landscape[35, 35] > 0


@pytest.mark.parametrize("kernel", ["triangular", "gaussian"])
def test_every_kernel_has_unit_mass(kernel):
    points = np.random.default_rng(5).uniform(90, 110, (30, 2))
    width = np.random.default_rng(6).uniform(5, 15, (30, 2))
    landscape = kernel_landscape(points, (200, 200), width=width, kernel=kernel)
    assert landscape.sum(dtype=float) == pytest.approx(1, rel=1e-2)


def test_points_outside_the_image_count():
    inside = kernel_landscape([[10.0, 10.0]], (20, 20), width=4.0)
    half = kernel_landscape([[10.0, 10.0], [-500.0, 10.0]], (20, 20), width=4.0)
    np.testing.assert_allclose(half, inside / 2, rtol=1e-6)


def test_a_trajectory_wholly_outside_gives_zeros():
    assert not kernel_landscape([[-500.0, 10.0]], (20, 20), width=4.0).any()


def test_a_shift_of_the_points_shifts_the_landscape():
    points = np.random.default_rng(0).uniform(30, 40, (20, 2))
    first = kernel_landscape(points, (80, 90), width=12.5)
    second = kernel_landscape(points + np.array([7, 11]), (80, 90), width=12.5)
    np.testing.assert_allclose(second[11:, 7:], first[:-11, :-7], atol=1e-6 * first.max())


def test_mirrored_points_give_the_mirrored_landscape():
    points = np.random.default_rng(1).uniform(0, 40, (20, 2))
    first = kernel_landscape(points, (50, 60), width=9.0)
    across = kernel_landscape(points * (-1, 1) + (59, 0), (50, 60), width=9.0)
    np.testing.assert_allclose(across, first[:, ::-1], atol=1e-6 * first.max())
    swapped = kernel_landscape(points[:, ::-1], (60, 50), width=9.0)
    np.testing.assert_allclose(swapped, first.T, atol=1e-6 * first.max())


def test_equal_weights_change_nothing_and_whole_weights_repeat_points():
    points = np.random.default_rng(2).uniform(0, 30, (5, 2))
    plain = kernel_landscape(points, (30, 30), width=8.0)
    np.testing.assert_allclose(
        kernel_landscape(points, (30, 30), width=8.0, weights=[0.3] * 5), plain, rtol=1e-5
    )
    counts = [1, 2, 0, 3, 1]
    weighted = kernel_landscape(points, (30, 30), width=8.0, weights=counts)
    repeated = kernel_landscape(np.repeat(points, counts, axis=0), (30, 30), width=8.0)
    np.testing.assert_allclose(weighted, repeated, rtol=1e-5, atol=1e-9)


def test_a_width_per_point_is_the_mean_of_the_single_kernels():
    points = np.array([[10.0, 12.0], [20.0, 9.0], [15.0, 15.0]])
    width = np.array([[4.0, 3.0], [9.0, 8.0], [2.0, 6.0]])
    singles = [
        kernel_landscape(p[None], (30, 30), width=tuple(w)) for p, w in zip(points, width, strict=True)
    ]
    np.testing.assert_allclose(
        kernel_landscape(points, (30, 30), width=width), np.mean(singles, axis=0), rtol=1e-5
    )
    column = np.ascontiguousarray(width[:, 0])
    np.testing.assert_array_equal(
        kernel_landscape(points, (30, 30), width=column),
        kernel_landscape(points, (30, 30), width=np.stack([column, column], axis=1)),
    )


def test_with_two_points_a_tuple_is_a_pair_and_an_array_is_per_point():
    points = np.array([[10.0, 12.0], [20.0, 9.0]])
    pair = kernel_landscape(points, (30, 30), width=(4.0, 8.0))
    each = kernel_landscape(points, (30, 30), width=np.array([4.0, 8.0]))
    assert_is_the_twin(pair, points, (4.0, 8.0), "triangular")
    assert_is_the_twin(each, points, np.array([[4.0, 4.0], [8.0, 8.0]]), "triangular")


def test_one_pixel_is_an_image():
    assert kernel_landscape([[0.0, 0.0]], (1, 1), width=2.0).item() == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"points": np.zeros((0, 2))}, r"points must be \(N, 2\) with N >= 1, got \(0, 2\)"),
        ({"points": []}, r"points must be \(N, 2\), got \(0,\)"),
        ({"points": np.zeros((2, 50))}, r"points must be \(N, 2\), got \(2, 50\)"),
        ({"points": [[0, 0], [1, math.nan]]}, r"points must be finite, got NaN at points\[1, 1\]"),
        ({"points": [[math.inf, 0]]}, r"points\[0, 0\]"),
        ({"width": 0}, "width must be positive and finite, got 0"),
        ({"width": -2.0}, "width.*-2"),
        ({"width": math.nan}, "width.*NaN"),
        ({"width": math.inf}, "width.*inf"),
        ({"width": (3, 0)}, "width"),
        ({"width": (1, 2, 3)}, "width must be a number, a tuple"),
        ({"width": np.array([4.0, 5.0])}, r"width must be .*array \(3,\).*got an array of shape \(2,\)"),
        ({"width": np.array([4.0, -5.0, 6.0])}, r"width\[1\]"),
        ({"width": np.ones((3, 3))}, r"width.*\(3, 3\)"),
        ({"width": 1e-30}, "width must be such that"),
        ({"width": 1e30}, "width must be such that"),
        ({"kernel": "box"}, "kernel must be one of 'triangular', 'gaussian', got 'box'"),
        ({"weights": [1, 2]}, r"weights must be one per point, \(3,\), got \(2,\)"),
        ({"weights": [1, -2, 1]}, r"weights must be finite and >= 0, got -2.0 at weights\[1\]"),
        ({"weights": [1, math.nan, 1]}, r"weights\[1\]"),
        ({"weights": [0, 0, 0]}, "weights must be of a positive and finite sum"),
        ({"weights": [[1, 1, 1]]}, "weights"),
        ({"shape": (0, 0)}, "shape"),
    ],
)
def test_values_outside_their_domain_are_named(arguments, words):
    good = {"points": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], "shape": (10, 10), "width": 4.0}
    with pytest.raises(motorprime.errors.ArgumentError, match=words):
        kernel_landscape(**(good | arguments))
