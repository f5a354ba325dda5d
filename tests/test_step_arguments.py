"""Arguments of the fused step that do not fit: each is named, with what was expected."""

import math

import numpy as np
import pytest

from motorprime import Attended, attention_step
from motorprime.errors import ArgumentError, ArgumentTypeError, Error, StateError
from step_rig import BLIND, JOINTS, MAPS, MATRIX, PIXELS, POINTS, POSTURE, PROJECTOR, SHAPES, moved


def called(**changes):
    good = {"maps": {"left": MATRIX, "right": PROJECTOR}, "shapes": SHAPES, "points": POINTS}
    good |= {"joints": JOINTS, "windows": 3}
    return attention_step(**(good | changes))


BAD = [
    ({"maps": None}, ArgumentError, "maps, pixels: give exactly one"),
    ({"pixels": PIXELS}, ArgumentError, "maps, pixels: give exactly one"),
    ({"maps": None, "pixels": PIXELS}, ArgumentError, "points, pixels: give one"),
    ({"windows": None}, ArgumentError, "windows, fraction, count: give exactly one"),
    ({"fraction": 0.5}, ArgumentError, "windows, fraction, count: give exactly one"),
    ({"windows": None, "fraction": 0.5, "count": 3}, ArgumentError, "windows, fraction, count: give exactly"),
    ({"maps": [MATRIX]}, ArgumentTypeError, "maps: expected a mapping of cameras, got list"),
    ({"maps": {}}, ArgumentError, "maps: expected at least one camera"),
    (
        {"maps": {3: MATRIX}, "shapes": {3: (9, 9)}},
        ArgumentTypeError,
        "maps: expected names of cameras, got 3",
    ),
    (
        {"maps": {"back": MATRIX}},
        ArgumentError,
        "shapes: camera 'back' is missing; there are left, right, hand",
    ),
    ({"maps": {"left": MATRIX[:, :3]}}, ArgumentError, r"maps\['left'\].*got an array \(3, 3\)"),
    ({"maps": {"left": MATRIX.tolist()}}, ArgumentTypeError, r"maps\['left'\].*got list"),
    ({"maps": {"left": None}}, ArgumentTypeError, r"maps\['left'\].*got NoneType"),
    ({"maps": {"left": "P"}}, ArgumentTypeError, r"maps\['left'\].*got str"),
    (
        {"maps": {"left": MATRIX.astype(int)}},
        ArgumentTypeError,
        r"maps\['left'\] must be an array of float32",
    ),
    ({"maps": {"left": MATRIX * [1, 1, np.nan, 1]}}, ArgumentError, r"got NaN at maps\['left'\]\[0, 2\]"),
    ({"maps": {"left": moved(math.inf, 0.0)}}, ArgumentError, r"maps\['left'\] must be finite"),
    ({"maps": {"left": POSTURE}}, ArgumentError, r"maps.* 6 inputs and 2 outputs.* got one of 3 and 5"),
    ({"points": None}, ArgumentError, r"points: maps\['left'\] is a projection matrix and needs a path"),
    ({"joints": None}, ArgumentError, r"maps\['right'\].* 3 inputs and 2 outputs.* got one of 6 and 2"),
    ({"joints": JOINTS[:2]}, ArgumentError, r"maps\['right'\].* 5 inputs and 2 outputs.* got one of 6 and 2"),
    ({"joints": [0.0, np.nan, 0.0]}, ArgumentError, r"joints must be finite, got NaN at joints\[1\]"),
    ({"joints": [0.0, np.inf, 0.0]}, ArgumentError, r"joints must be finite, got inf at joints\[1\]"),
    ({"joints": JOINTS[None]}, ArgumentError, r"joints must be \(N,\), got \(1, 3\)"),
    ({"joints": np.ones(3, int)}, ArgumentTypeError, "joints must be an array of float32"),
    ({"joints": "abc"}, ArgumentTypeError, "joints must be"),
    ({"points": POINTS[:, :2]}, ArgumentError, r"points must be \(N, 3\), got \(25, 2\)"),
    ({"points": POINTS[0]}, ArgumentError, r"points must be \(N, 3\), got \(3,\)"),
    ({"points": POINTS[:0]}, ArgumentError, r"points must be \(N, 3\) with N >= 1"),
    ({"points": []}, ArgumentError, r"points must be \(N, 3\)"),
    ({"points": np.ones((4, 3), int)}, ArgumentTypeError, "points must be an array of float32"),
    ({"points": "abc"}, ArgumentTypeError, "points must be"),
    ({"points": POINTS * [1, np.nan, 1]}, ArgumentError, r"points must be finite, got NaN at points\[0, 1\]"),
    ({"shapes": None}, ArgumentTypeError, "shapes: expected a mapping of cameras, got NoneType"),
    ({"shapes": (48, 64)}, ArgumentTypeError, "shapes: expected a mapping of cameras, got tuple"),
    ({"windows": -1}, ArgumentError, "windows: expected an integer >= 0, got -1"),
    ({"windows": 2**31}, ArgumentError, "windows: expected at most 2147483647"),
    ({"windows": 10**30}, ArgumentError, "windows: expected at most 2147483647"),
    ({"windows": 3.0}, ArgumentTypeError, "windows: expected an integer"),
    ({"windows": True}, ArgumentTypeError, "windows: expected an integer"),
    ({"windows": "3"}, ArgumentTypeError, "windows: expected an integer"),
    ({"width": 0}, ArgumentError, "width must be positive"),
    ({"width": -3.0}, ArgumentError, "width must be positive"),
    ({"width": math.nan}, ArgumentError, "width must be positive and finite, got NaN"),
    ({"width": math.inf}, ArgumentError, "width must be positive and finite"),
    ({"width": 1e-30}, ArgumentError, "width"),
    ({"width": "3"}, ArgumentTypeError, "width must be a number"),
    ({"width": True}, ArgumentTypeError, "width must be a number"),
    ({"kernel": "box"}, ArgumentError, "kernel must be one of 'triangular', 'gaussian', got 'box'"),
    ({"kernel": None}, ArgumentTypeError, "kernel must be a name"),
    ({"cutoff": "3"}, ArgumentTypeError, "cutoff must be a number"),
    ({"mixing": None}, ArgumentTypeError, "mixing must be a number"),
    ({"seed": -1}, ArgumentError, "seed"),
    ({"seed": 1.0}, ArgumentTypeError, "seed"),
    ({"threads": 1}, ArgumentTypeError, "threads: expected True or False, got 1"),
    ({"threads": "no"}, ArgumentTypeError, "threads: expected True or False"),
]


@pytest.mark.parametrize(("changes", "error", "words"), BAD)
def test_what_does_not_fit_is_named(changes, error, words):
    with pytest.raises(error, match=words):
        called(**changes)


SHARES = [
    ({"fraction": 0.0}, ArgumentError, r"fraction must be in \(0, 1\]"),
    ({"fraction": 2.0}, ArgumentError, r"fraction must be in \(0, 1\]"),
    ({"fraction": math.nan}, ArgumentError, r"fraction must be in \(0, 1\], got NaN"),
    ({"fraction": "half"}, ArgumentTypeError, "fraction must be a number"),
    ({"fraction": True}, ArgumentTypeError, "fraction must be a number"),
    ({"count": 0}, ArgumentError, "count must be a whole number of at least 1"),
    ({"count": -5}, ArgumentError, "count must be a whole number of at least 1"),
    ({"count": 10**30}, ArgumentError, "count must be a whole number"),
    ({"count": 5.0}, ArgumentTypeError, "count must be a whole number"),
    ({"count": True}, ArgumentTypeError, "count must be a whole number"),
]


@pytest.mark.parametrize("matrix", [MATRIX, BLIND, moved(1e5, -1e5)])
@pytest.mark.parametrize(("changes", "error", "words"), SHARES)
def test_a_share_outside_its_domain_is_named_whatever_the_cameras_see(changes, error, words, matrix):
    with pytest.raises(error, match=words):
        called(windows=None, maps={"left": matrix}, **changes)


@pytest.mark.parametrize(
    ("shape", "error"),
    [
        (5, ArgumentError),
        (None, ArgumentError),
        ("ab", ArgumentError),
        ((48,), ArgumentError),
        ((48, 64, 3), ArgumentError),
        (np.array([48, 64]), ArgumentError),
        ((0, 64), ArgumentError),
        ((-1, 64), ArgumentError),
        ((2**16, 2**16), ArgumentError),
        ((10**30, 3), ArgumentError),
        ((48.0, 64.0), ArgumentTypeError),
        (("48", "64"), ArgumentTypeError),
        ((True, 64), ArgumentTypeError),
    ],
    ids=str,
)
@pytest.mark.parametrize("width", [None, 5.0])
def test_a_shape_of_no_image_is_named_with_its_camera(shape, error, width):
    with pytest.raises(error, match=r"shapes\['left'\]"):
        called(shapes=SHAPES | {"left": shape}, width=width)


@pytest.mark.parametrize(
    ("pixels", "error", "words"),
    [
        (PIXELS["left"], ArgumentTypeError, "pixels: expected a mapping of cameras, got ndarray"),
        ({}, ArgumentError, "pixels: expected at least one camera"),
        ({"left": PIXELS["left"].T}, ArgumentError, r"pixels\['left'\] must be \(N, 2\), got \(2, 30\)"),
        ({"left": PIXELS["left"][0]}, ArgumentError, r"pixels\['left'\] must be \(N, 2\), got \(2,\)"),
        (
            {"left": MATRIX},
            ArgumentError,
            r"pixels\['left'\]: expected an array \(N, 2\), got an array \(3, 4\)",
        ),
        ({"left": MATRIX.tolist()}, ArgumentError, r"pixels\['left'\] must be \(N, 2\), got \(3, 4\)"),
        ({"left": PROJECTOR}, ArgumentError, r"pixels\['left'\]: expected an array \(N, 2\), got Mlp"),
        ({"left": None}, ArgumentTypeError, r"pixels\['left'\] must be .* got NoneType"),
        ({"left": "text"}, ArgumentTypeError, r"pixels\['left'\] must be .* got str"),
        ({"left": [[1.0], [1.0, 2.0]]}, ArgumentTypeError, r"pixels\['left'\] must be .* got list"),
        ({"left": np.ones((3, 2), int)}, ArgumentTypeError, r"pixels\['left'\] must be an array of float32"),
        (
            {"left": np.array([["a", "b"]])},
            ArgumentTypeError,
            r"pixels\['left'\] must be an array of float32",
        ),
        (
            {"left": np.array([[np.nan, 1.0], [3.0, -np.inf]])},
            ArgumentError,
            r"pixels\['left'\] must be finite or NaN, got -inf at pixels\['left'\]\[1, 1\]",
        ),
    ],
)
def test_pixels_that_do_not_fit_are_named(pixels, error, words):
    with pytest.raises(error, match=words):
        attention_step(None, SHAPES, pixels=pixels, windows=3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cutoff": 0.0}, "cutoff must be positive"),
        ({"cutoff": math.nan}, "cutoff must be positive"),
        ({"mixing": 1.5}, "mixing must be in"),
        ({"mixing": math.nan}, "mixing must be in"),
        ({"joints": None}, r"maps\['left'\].* 0 inputs and 5 outputs.* got one of 3 and 5"),
        ({"joints": JOINTS[:2]}, r"maps\['left'\].* 2 inputs and 5 outputs.* got one of 3 and 5"),
        ({"maps": {"left": PROJECTOR}}, r"maps\['left'\].* 3 inputs and 5 outputs.* got one of 6 and 2"),
    ],
)
def test_what_does_not_fit_a_posture_is_named(changes, words):
    good = {"maps": {"left": POSTURE}, "shapes": SHAPES, "joints": JOINTS, "windows": 3}
    assert attention_step(**good)
    with pytest.raises(ArgumentError, match=words):
        attention_step(**(good | changes))


def test_an_out_that_cannot_be_written_is_named():
    good = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9)["left"]
    read_only = good.landscape.copy()
    read_only.flags.writeable = False
    wide = np.zeros((9, 4), dtype=np.int32)
    for bad, words in (
        (Attended(read_only, good.centres), r"out\['left'\].landscape must be a writable"),
        (Attended(good.landscape.astype(float), good.centres), r"out\['left'\].landscape must be a writable"),
        (Attended(np.asfortranarray(good.landscape), good.centres), r"out\['left'\].landscape must be"),
        (Attended(good.landscape, wide[:, ::2]), r"out\['left'\].centres must be a writable"),
        (Attended(good.landscape, np.zeros((9, 2))), r"out\['left'\].centres must be a writable"),
        (Attended(good.landscape, np.zeros(9, np.int32)), r"out\['left'\].centres must be a writable"),
        (good.landscape, r"out\['left'\]: expected Attended, got ndarray"),
        ((good.landscape, good.centres), r"out\['left'\]: expected Attended, got tuple"),
    ):
        with pytest.raises(Error, match=words):
            attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, out={"left": bad})
    with pytest.raises(ArgumentTypeError, match="out: expected a mapping of cameras, got list"):
        attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, out=[good])


def test_one_out_cannot_serve_two_cameras_nor_lie_over_the_pixels():
    sizes = dict.fromkeys(PIXELS, SHAPES["left"])
    one = attention_step(None, sizes, pixels=PIXELS, windows=9)["left"]
    with pytest.raises(StateError, match=r"out\['right'\].* used by another"):
        attention_step(None, sizes, pixels=PIXELS, windows=9, out={"left": one, "right": one})
    over = one.landscape.reshape(-1)[:60].reshape(30, 2)
    with pytest.raises(ArgumentError, match=r"out\['left'\].landscape overlaps an input"):
        attention_step(None, sizes, pixels={"left": over}, windows=9, out={"left": one})
