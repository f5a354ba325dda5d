"""The Gaussian landscape against its twin and against what its equations say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorprime.errors
import reference
from motorprime.landscape import gaussian_landscape

examples = settings(deadline=None, derandomize=True, max_examples=150)
sizes = st.tuples(st.integers(1, 40), st.integers(1, 40))
centres = st.tuples(st.floats(-60, 100), st.floats(-60, 100))
scales = st.floats(0.01, 1.0) | st.floats(1.0, 300.0)
factors = st.tuples(scales, st.floats(-100, 100), scales)


@examples
@given(sizes, centres, factors, st.floats(0.2, 8), st.floats(0, 1))
def test_agrees_with_the_twin_and_has_the_same_support(shape, mean, chol, cutoff, mixing):
    landscape = gaussian_landscape(mean, chol, shape, cutoff=cutoff, mixing=mixing)
    twin = reference.gaussian_landscape(mean, chol, shape, cutoff, mixing)
    assert landscape.dtype == np.float32 and landscape.shape == shape
    assert landscape.min() >= 0
    np.testing.assert_allclose(landscape, twin, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(landscape > 0, twin > 0)


def test_the_mean_has_the_value_one_and_u_comes_first():
    landscape = gaussian_landscape((7, 3), (2.0, 0.0, 1.0), (11, 20))
    assert landscape[3, 7] == 1
    assert np.unravel_index(landscape.argmax(), landscape.shape) == (3, 7)


def test_one_standard_deviation_along_u_is_l1():
    landscape = gaussian_landscape((10, 10), (4.0, 0.0, 2.0), (21, 21))
    assert landscape[10, 14] == pytest.approx(math.exp(-0.5), rel=1e-6)
    assert landscape[12, 10] == pytest.approx(math.exp(-0.5), rel=1e-6)


def test_a_positive_l2_leans_towards_growing_v_as_u_grows():
    landscape = gaussian_landscape((20, 20), (5.0, 4.0, 3.0), (41, 41))
    assert landscape[24, 25] == pytest.approx(math.exp(-0.5), rel=1e-6)
    assert landscape[16, 25] < landscape[24, 25] / 2
    leaning_back = gaussian_landscape((20, 20), (5.0, -4.0, 3.0), (41, 41))
    np.testing.assert_allclose(leaning_back, landscape[::-1], atol=1e-6)


def test_the_factor_gives_the_covariance_l_lt():
    shape, chol = (301, 401), (30.0, 12.0, 20.0)
    landscape = gaussian_landscape((200, 150), chol, shape, cutoff=6.0).astype(float)
    v, u = np.mgrid[: shape[0], : shape[1]]
    weights = landscape / landscape.sum()
    du, dv = u - 200.0, v - 150.0
    covariance = [[(weights * a * b).sum() for a in (du, dv)] for b in (du, dv)]
    factor = np.array([[chol[0], 0], [chol[1], chol[2]]])
    np.testing.assert_allclose(covariance, factor @ factor.T, rtol=1e-3)


def test_point_symmetric_about_the_mean():
    landscape = gaussian_landscape((15, 12), (6.0, 2.5, 4.0), (25, 31))
    np.testing.assert_allclose(landscape, landscape[::-1, ::-1], atol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.7, 0.1, 1 / 3, 1e-3])
def test_a_pixel_on_the_border_is_inside_whatever_the_rounding(scale):
    chol = (7 * scale, 0.0, 7 * scale)
    landscape = gaussian_landscape((10, 10), chol, (21, 21), cutoff=1 / scale, mixing=0.5)
    assert landscape[10, 17] > 0 and landscape[10, 3] > 0
    assert landscape[17, 10] > 0 and landscape[3, 10] > 0
    assert landscape[10, 18] == 0 and landscape[18, 10] == 0


def test_the_uniform_part_carries_the_same_mass_as_the_gaussian():
    shape, mean, chol = (401, 601), (300.4, 200.7), (60.0, 21.0, 35.0)
    gaussian = gaussian_landscape(mean, chol, shape, mixing=1.0).astype(float)
    uniform = gaussian_landscape(mean, chol, shape, mixing=0.0).astype(float)
    half = gaussian_landscape(mean, chol, shape, mixing=0.5).astype(float)
    assert uniform.sum() == pytest.approx(gaussian.sum(), rel=2e-3)
    np.testing.assert_allclose(half, (gaussian + uniform) / 2, atol=1e-6)
    np.testing.assert_array_equal(uniform > 0, gaussian > 0)


def test_the_uniform_level_is_that_of_the_whole_ellipse_wherever_the_image_ends():
    level = 2 * (1 - math.exp(-4.5)) / 9
    landscape = gaussian_landscape((0, 0), (50.0, 0.0, 50.0), (5, 5), mixing=0.0)
    np.testing.assert_allclose(landscape, level, rtol=1e-6)


def test_a_mean_far_outside_leaves_nothing():
    assert not gaussian_landscape((1e9, -1e9), (5.0, 1.0, 5.0), (20, 20)).any()
    assert not gaussian_landscape((-40, 10), (5.0, 1.0, 5.0), (20, 20)).any()


def test_a_huge_cutoff_covers_the_image_and_keeps_the_gaussian():
    landscape = gaussian_landscape((5, 5), (0.5, 0.1, 0.5), (11, 300), cutoff=1e6, mixing=0.5)
    twin = reference.gaussian_landscape((5, 5), (0.5, 0.1, 0.5), (11, 300), 1e6, 0.5)
    np.testing.assert_allclose(landscape, twin, rtol=1e-5, atol=0)


def test_extreme_scales_stay_finite():
    for size in (1e-100, 1e-9, 1e9, 1e100):
        landscape = gaussian_landscape((3, 3), (size, 0.0, size), (7, 7))
        assert np.isfinite(landscape).all() and landscape[3, 3] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"mean": (math.nan, 0)}, r"mean must be finite, got NaN at mean\[0\]"),
        ({"mean": (0, math.inf)}, r"mean\[1\]"),
        ({"mean": (0, 0, 0)}, r"mean must be \(2,\), got \(3,\)"),
        ({"chol": (0.0, 0, 1)}, r"chol\[0\]"),
        ({"chol": (1, 0, -1)}, r"chol\[2\]"),
        ({"chol": (1, math.nan, 1)}, r"chol\[1\]"),
        ({"chol": [[1, 0], [0, 1]]}, r"chol must be \(3,\), got \(2, 2\)"),
        ({"cutoff": 0}, "cutoff must be positive.*got 0"),
        ({"cutoff": -3}, "cutoff must be positive.*got -3"),
        ({"cutoff": math.nan}, "cutoff.*NaN"),
        ({"mixing": 1.1}, r"mixing must be in \[0, 1\], got 1.1"),
        ({"mixing": -0.1}, "mixing.*-0.1"),
        ({"mixing": math.nan}, "mixing.*NaN"),
        ({"shape": (0, 5)}, r"shape must be .*got \(0, 5\)"),
        ({"shape": (-1, 5)}, "shape.*-1"),
        ({"shape": (10**9, 10**9)}, "shape"),
        ({"shape": (240, 320, 3)}, r"shape must be \(height, width\), got \(240, 320, 3\)"),
    ],
)
def test_values_outside_their_domain_are_named(arguments, words):
    good = {"mean": (5, 5), "chol": (2, 0, 2), "shape": (10, 10)}
    with pytest.raises(motorprime.errors.ArgumentError, match=words):
        gaussian_landscape(**(good | arguments))
