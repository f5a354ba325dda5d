"""Samples: what belongs together stays together, and what does not is refused."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.samples import Samples


def some(count=6, points=True):
    rng = np.random.default_rng(1)
    pixels = {name: rng.uniform(0, 100, (count, 2)) for name in ("left", "right")}
    pixels["left"][1] = np.nan
    return Samples(
        ("a", "b"), rng.normal(size=(count, 2)), pixels, rng.normal(size=(count, 3)) if points else None
    )


def test_an_index_takes_the_same_rows_of_everything():
    samples = some()
    for index in (slice(1, 4), np.array([1, 2, 3]), np.array([False, True, True, True, False, False])):
        part = samples.take(index)
        assert len(part) == 3
        np.testing.assert_array_equal(part.joints, samples.joints[1:4])
        np.testing.assert_array_equal(part.points, samples.points[1:4])
        np.testing.assert_array_equal(part.pixels["right"], samples.pixels["right"][1:4])
    assert samples.seen("left").tolist() == [True, False, True, True, True, True]


def test_columns_come_in_the_order_asked_for():
    samples = some()
    np.testing.assert_array_equal(samples.columns(("b", "a")), samples.joints[:, ::-1])
    with pytest.raises(ArgumentError, match="no joint 'c'; there are a, b"):
        samples.columns(("a", "c"))


def test_samples_of_the_same_robot_join_and_others_do_not():
    one, two = some(4), some(3)
    both = one.joined(two)
    assert len(both) == 7
    np.testing.assert_array_equal(both.joints[4:], two.joints)
    np.testing.assert_array_equal(both.pixels["left"][4:], two.pixels["left"])
    np.testing.assert_array_equal(both.points[:4], one.points)
    with pytest.raises(ArgumentError, match="points in one"):
        one.joined(some(3, points=False))
    with pytest.raises(ArgumentError, match="joints"):
        one.joined(Samples(("a", "c"), two.joints, two.pixels, two.points))
    with pytest.raises(ArgumentError, match="cameras"):
        one.joined(Samples(("a", "b"), two.joints, {"left": two.pixels["left"]}, two.points))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": np.zeros((6, 3))}, r"joints: expected shape \(N, 2\)"),
        ({"joints": np.full((6, 2), np.nan)}, "joints: expected finite"),
        ({"points": np.zeros((6, 2))}, r"points: expected shape \(N, 3\)"),
        ({"points": np.zeros((5, 3))}, "same number of rows"),
        ({"pixels": {}}, "at least one camera"),
        ({"pixels": {"left": np.zeros((5, 2))}}, "same number of rows"),
        ({"pixels": {"left": np.array([[1.0, np.nan]] * 6)}}, "row 0 has one NaN"),
        ({"pixels": {"left": np.full((6, 2), np.inf)}}, "expected finite"),
        ({"names": ("a", "a")}, "comes twice"),
    ],
)
def test_what_does_not_belong_together_is_refused(change, message):
    good = some()
    parts = {"names": good.names, "joints": good.joints, "pixels": good.pixels, "points": good.points}
    with pytest.raises(ArgumentError, match=message):
        Samples(**(parts | change))


def test_pixels_that_are_no_mapping_are_a_type_error():
    with pytest.raises(ArgumentTypeError, match="mapping of cameras"):
        Samples(("a",), np.zeros((1, 1)), np.zeros((1, 2)))
