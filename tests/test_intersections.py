"""The scan of histogram intersections against windows that are counted one by one."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from motorprime import intersections
from motorprime.errors import ArgumentError, ArgumentTypeError

BINS = np.random.default_rng(0).integers(0, 9, (40, 50)).astype(np.uint16)
TARGET = np.array([0.1, 0.0, 0.3, 0.05, 0.2, 0.0, 0.35])


@st.composite
def scans(draw):
    """An image of few bins with empty stretches, a target, a window that fits, and what is wanted of it."""
    height, width = draw(st.integers(1, 30)), draw(st.integers(1, 60))
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kinds = draw(st.integers(1, 40))
    bins = generator.integers(0, kinds + 3, (height, width))
    for _ in range(draw(st.integers(0, 8))):
        v, u = generator.integers((0, 0), (height, width))
        bins[v : v + 9, u : u + 40] = 255
    target = generator.random(kinds) * (generator.random(kinds) < 0.7)
    target[generator.integers(kinds)] = 0.2
    window = draw(st.integers(1, height)), draw(st.integers(1, width))
    stride = draw(st.sampled_from([1, 1, 2, 5]))
    rows, columns = ((size - side) // stride + 1 for size, side in zip((height, width), window, strict=True))
    wanted = generator.random((rows, columns)) < draw(st.sampled_from([0.02, 0.3, 1.0]))
    return bins.astype(draw(st.sampled_from([np.uint8, np.uint16]))), target, window, stride, wanted


@given(scans())
@settings(max_examples=150, deadline=None)
def test_every_window_that_is_wanted_scores_as_if_it_were_counted_alone(scan):
    bins, target, window, stride, wanted = scan
    found = intersections(bins, target, window, stride=stride)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, reference.intersections(bins, target, window, stride), atol=1e-6)
    some = intersections(bins, target, window, stride=stride, wanted=wanted)
    np.testing.assert_array_equal(some, np.where(wanted, found, 0.0))


def test_a_window_with_the_target_s_shares_scores_one_and_one_without_its_bins_zero():
    bins = np.array([[0, 0, 1, 2], [0, 2, 5, 5]], np.uint8)
    assert intersections(bins, [0.75, 0.0, 0.25], (2, 2))[0].tolist() == [1.0, 0.5, 0.25]
    assert intersections(bins, [0.0, 0.0, 0.0, 1.0], (2, 2)).tolist() == [[0.0, 0.0, 0.0]]


def test_a_window_of_more_pixels_than_16_bits_count_is_exact():
    bins = np.random.default_rng(1).integers(0, 3, (260, 270)).astype(np.uint8)
    found = intersections(bins, [0.2, 0.9], (258, 268))
    np.testing.assert_allclose(found, reference.intersections(bins, [0.2, 0.9], (258, 268)), atol=1e-6)


def test_any_layout_and_byte_order_is_read_right():
    expected = intersections(BINS, TARGET, (7, 5))
    wide = np.zeros((40, 100), np.uint16)
    wide[:, ::2] = BINS
    for view in (np.asfortranarray(BINS), wide[:, ::2], BINS[::-1][::-1], BINS.astype(">u2")):
        np.testing.assert_array_equal(intersections(view, TARGET, (7, 5)), expected)
    np.testing.assert_array_equal(intersections(BINS.T, TARGET, (5, 7)), expected.T)
    mask = np.asfortranarray(expected > np.median(expected))
    some = intersections(BINS, TARGET.astype(np.float32).astype(float), (7, 5), wanted=mask)
    np.testing.assert_allclose(some, np.where(mask, expected, 0.0), atol=1e-7)


def test_out_is_written_and_returned_and_inputs_stay():
    bins, out = BINS.copy(), np.full((34, 46), np.nan, np.float32)
    assert intersections(bins, TARGET, (7, 5), out=out) is out
    np.testing.assert_array_equal(out, intersections(BINS, TARGET, (7, 5)))
    np.testing.assert_array_equal(bins, BINS)


def test_a_single_thread_gives_the_same_bytes():
    """480 rows are cut into bands, which several threads compute."""
    program = (
        "import numpy as np, hashlib, motorprime\n"
        "bins = np.random.default_rng(3).integers(0, 30, (480, 160)).astype(np.uint16)\n"
        "scores = motorprime.intersections(bins, np.linspace(0, 0.1, 20), (20, 20))\n"
        "print(hashlib.sha256(scores.tobytes()).hexdigest())"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "RAYON_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "3")
    }
    assert len(digests) == 1


@pytest.mark.parametrize(
    ("change", "message", "error"),
    [
        (
            {"window": (41, 5)},
            r"window must be \(height, width\) of 1 to \(40, 50\).*\(41, 5\)",
            ArgumentError,
        ),
        ({"window": (5, 51)}, "window", ArgumentError),
        ({"window": (0, 5)}, "window", ArgumentError),
        ({"window": (5, -1)}, "window", ArgumentError),
        ({"window": 5}, "window", ArgumentTypeError),
        ({"window": (5, 5, 5)}, "window", ArgumentError),
        ({"window": (5.0, 5)}, "window", ArgumentTypeError),
        ({"stride": 0}, "stride", ArgumentError),
        ({"stride": 1.5}, "stride", ArgumentTypeError),
        ({"target": [0.5, -0.1]}, r"target must be finite and >= 0.*target\[1\]", ArgumentError),
        ({"target": [0.5, np.nan]}, r"target\[1\]", ArgumentError),
        ({"target": [0.0, 0.0]}, "target is zero everywhere", ArgumentError),
        ({"target": []}, "target", ArgumentError),
        ({"target": [[0.5]]}, "target", ArgumentError),
        ({"target": np.array([1, 2])}, "target", ArgumentTypeError),
        ({"target": np.ones(70000)}, "target must be of at most 65535 bins", ArgumentError),
        ({"bins": BINS.astype(np.int32)}, "bins must be an array .* of uint8 or uint16", ArgumentTypeError),
        ({"bins": BINS.astype(np.float32)}, "bins", ArgumentTypeError),
        ({"bins": BINS > 3}, "bins", ArgumentTypeError),
        ({"bins": BINS.tolist()}, "bins", ArgumentTypeError),
        ({"bins": None}, "bins", ArgumentTypeError),
        ({"bins": BINS[0]}, r"bins must be \(H, W\)", ArgumentError),
        ({"bins": BINS[..., None]}, "bins", ArgumentError),
        ({"bins": BINS[:0]}, "bins", ArgumentError),
        ({"wanted": np.ones((34, 47), bool)}, r"wanted must be .*\(34, 46\), got \(34, 47\)", ArgumentError),
        ({"wanted": np.ones((34, 46), np.uint8)}, "wanted", ArgumentTypeError),
        ({"wanted": [[True]]}, "wanted", ArgumentTypeError),
        ({"out": np.zeros((34, 46))}, "out", ArgumentTypeError),
        ({"out": np.zeros((3, 46), np.float32)}, "out", ArgumentError),
    ],
)
def test_what_cannot_be_scanned_is_named(change, message, error):
    given = {"bins": BINS, "target": TARGET, "window": (7, 5)} | change
    bins, target, window = (given.pop(name) for name in ("bins", "target", "window"))
    with pytest.raises(error, match=message):
        intersections(bins, target, window, **given)


def test_out_that_is_the_image_s_memory_is_refused():
    memory = np.zeros((40, 50), np.float32)
    bins = memory.view(np.uint16)[:, :50]
    with pytest.raises(ArgumentError, match="out overlaps an input in memory"):
        intersections(bins, TARGET, (1, 1), out=memory)
