"""Windows that hit, merged into detections."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from motorprime import _core
from motorprime.detectors.merging import merge_hits, merge_windows
from motorprime.errors import ArgumentError, ArgumentTypeError


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 30)), max_size=30),
    st.integers(1, 9),
)
def test_a_detection_is_a_connected_block_of_the_pixels_that_windows_cover(corners, size):
    expected = reference.merge_windows(corners, size)
    found = merge_windows(np.array(corners, int).reshape(-1, 2), size)
    assert {tuple(box) for box in found.tolist()} == expected and len(found) == len(expected)
    scores = np.full((31, 51), 0.29, np.float32)
    for u, v in corners:
        scores[v, u] = 0.3
    found = merge_hits(scores, float(np.float32(0.3)), size)
    assert {tuple(box) for box in found.tolist()} == expected and len(found) == len(expected)


def test_windows_in_a_row_are_one_and_those_a_pixel_apart_are_two():
    np.testing.assert_array_equal(merge_windows(np.array([[0, 0], [20, 0], [40, 20]]), 20), [[0, 0, 60, 40]])
    assert len(merge_windows(np.array([[0, 0], [21, 0]]), 20)) == 2
    # Or at the gap that is allowed.
    assert len(merge_windows(np.array([[0, 0], [24, 24]]), 20, gap=4)) == 1
    assert len(merge_windows(np.array([[0, 0], [25, 24]]), 20, gap=4)) == 2
    assert merge_windows(np.zeros((0, 2), int), 20).shape == (0, 4)
    assert merge_hits(np.zeros((3, 4), np.float32), 0.5, 20).shape == (0, 4)


@pytest.mark.parametrize(
    ("call", "message", "error"),
    [
        (lambda: merge_windows(np.zeros((2, 3), int), 20), r"corners must be \(N, 2\)", ArgumentError),
        (lambda: merge_windows(np.array([[3, -1]]), 20), r"corners\[0\]", ArgumentError),
        (lambda: merge_windows(np.array([[2**31 - 5, 0]]), 20), r"corners\[0\]", ArgumentError),
        (lambda: merge_windows(np.zeros((1, 2), int), 0), "size", ArgumentError),
        (lambda: merge_windows(np.zeros((1, 2), int), 2**31), "size must be at most", ArgumentError),
        (lambda: merge_windows(np.zeros((1, 2), int), 2.0), "size", ArgumentTypeError),
        (lambda: merge_windows(np.zeros((1, 2), int), 2, gap=-1), "gap", ArgumentError),
        (lambda: merge_windows(np.array([[2**31 - 30, 0]]), 20, gap=11), r"corners\[0\]", ArgumentError),
        (lambda: merge_hits(np.zeros((3, 4), np.float32), 0.5, 20, gap=0.5), "gap", ArgumentTypeError),
        (lambda: merge_hits(np.zeros((3, 4)), 0.5, 20), "scores must be .* float32", ArgumentTypeError),
        (lambda: merge_hits(np.zeros(3, np.float32), 0.5, 20), r"scores must be \(H, W\)", ArgumentError),
        (lambda: merge_hits(np.zeros((3, 4), np.float32), "0.5", 20), "hit", ArgumentTypeError),
        (lambda: _core.merge_windows([[0, 0]], 20, 0), "corners", ArgumentTypeError),
    ],
)
def test_what_cannot_be_merged_is_named(call, message, error):
    with pytest.raises(error, match=message):
        call()
