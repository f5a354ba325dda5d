"""SURF: against its twin in plain NumPy, against OpenCV 3.4.2, and the same bits inside every mask."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from motorprime import Surf
from motorprime.detectors.surf import SURF_KEYPOINT
from motorprime.errors import ArgumentError, ArgumentTypeError, Error
from motorprime.evaluate.surf import golden_files
from motorprime.evaluate.surf_pairs import agreement
from motorprime.evaluate.textures import draw_texture

IMAGE = draw_texture(11, 96, 128)
SURF = Surf()
NUMBERS = ("u", "v", "size", "angle", "response", "octave", "laplacian")


def rows(keypoints):
    return np.stack([keypoints[name].astype(float) for name in NUMBERS], axis=1)


# Against the twin.


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize(
    ("seed", "shape", "octaves", "layers"),
    [(1, (70, 80), 1, 3), (2, (81, 97), 3, 3), (3, (60, 120), 2, 1), (4, (90, 84), 2, 4)],
)
def test_keypoints_and_descriptors_are_those_of_the_twin(seed, shape, octaves, layers, upright):
    image = draw_texture(seed, *shape)
    keypoints, descriptors = Surf(200.0, octaves, layers, upright=upright).detect(image)
    twin, described = reference.surf(image, 200.0, octaves, layers, upright=upright)
    assert len(twin) == len(keypoints) > 10
    ours = rows(keypoints)
    np.testing.assert_allclose(ours[:, :3], twin[:, :3], atol=2e-3)
    np.testing.assert_allclose(ours[:, 4], twin[:, 4], rtol=1e-4)
    np.testing.assert_array_equal(ours[:, 5:], twin[:, 5:])
    turns = np.abs((ours[:, 3] - twin[:, 3] + np.pi) % (2 * np.pi) - np.pi)
    assert np.quantile(turns, 0.95) < 1e-3
    alike = (descriptors * described).sum(axis=1)[turns < 1e-3]
    # An upright square begins at a whole pixel, and half a pixel more is another square.
    assert alike.min() > (0.9 if upright else 0.98) and np.median(alike) > (0.99 if upright else 0.999)


def test_the_orientation_of_a_slope_is_where_it_rises():
    """A dark disc on a slope: the gradient around it points where the slope goes up."""
    v, u = np.mgrid[:120, :120]
    for degrees in (0, 35, 90, 200, 315):
        angle = np.radians(degrees)
        image = 128 + 1.2 * ((u - 60) * np.cos(angle) + (v - 60) * np.sin(angle))
        image = np.where((u - 60) ** 2 + (v - 60) ** 2 <= 25, 20, image)
        keypoints, _ = Surf(100.0, 2).detect(np.clip(np.rint(image), 0, 255).astype(np.uint8))
        near = keypoints[np.hypot(keypoints["u"] - 60, keypoints["v"] - 60) < 3]
        assert len(near) and (near["laplacian"] == 1).any()
        strongest = near[near["size"] > 20][0] if (near["size"] > 20).any() else near[0]
        assert abs((strongest["angle"] - angle + np.pi) % (2 * np.pi) - np.pi) < np.radians(30)


# Against OpenCV 3.4.2.


@pytest.mark.parametrize("path", golden_files(), ids=lambda path: path.stem)
def test_opencv_s_keypoints_and_descriptors_are_found(path):
    with np.load(path) as stored:
        image, keypoints = stored["image"], stored["keypoints"]
        threshold, octaves, layers, upright, extended = stored["parameters"].tolist()
        descriptors = stored["descriptors"].astype(float)
    surf = Surf(threshold, int(octaves), int(layers), upright=bool(upright), extended=bool(extended))
    ours, described = surf.detect(image)
    found, cosines = agreement(ours, described, keypoints, descriptors)
    assert len(keypoints) > 200 and len(ours) == len(keypoints)
    assert found.mean() >= 0.99 and np.mean(cosines >= 0.98) >= 0.99
    for name, column, atol in (("u", 0, 0.01), ("v", 1, 0.01), ("size", 2, 0.5)):
        np.testing.assert_allclose(np.sort(ours[name]), np.sort(keypoints[:, column]), atol=atol)
    assert sorted(ours["laplacian"]) == sorted(keypoints[:, 6])
    if not upright:
        order = np.argsort(-keypoints[:, 4], kind="stable")
        turns = (np.degrees(ours["angle"]) - keypoints[order, 3] + 180) % 360 - 180
        assert np.quantile(np.abs(turns), 0.95) < 1.0


def test_the_stored_keypoints_are_there_and_their_images_are_drawn_the_same_today():
    files = {path.stem: path for path in golden_files()}
    assert set(files) == {"surf-plain", "surf-large", "surf-extended", "surf-upright"}
    assert sum(path.stat().st_size for path in files.values()) < 500_000
    with np.load(files["surf-plain"]) as stored:
        np.testing.assert_array_equal(stored["image"], draw_texture(1, 240, 320))


# Inside a mask.


def check_mask(surf, image, mask):
    keypoints, descriptors = surf.detect(image)
    inside = mask[np.rint(keypoints["v"]).astype(int), np.rint(keypoints["u"]).astype(int)]
    found, described = surf.detect(image, mask)
    assert found.tobytes() == keypoints[inside].tobytes()
    assert described.tobytes() == descriptors[inside].tobytes()
    return len(found)


@st.composite
def masks(draw, shape=IMAGE.shape):
    height, width = shape
    mask = np.zeros(shape, bool)
    v, u = np.mgrid[:height, :width]
    row, column = st.integers(0, height - 1), st.integers(0, width - 1)
    for _ in range(draw(st.integers(0, 4))):
        y, x = draw(row), draw(column)
        match draw(st.sampled_from(["pixel", "blob", "row", "column", "slope", "box"])):
            case "pixel":
                mask[y, x] = True
            case "blob":
                mask |= (u - x) ** 2 + (v - y) ** 2 <= draw(st.integers(1, 30)) ** 2
            case "row":
                mask[y] = True
            case "column":
                mask[:, x] = True
            case "slope":
                mask |= np.abs((u - x) - (v - y)) <= 1
            case _:
                mask[y : y + draw(st.integers(1, 50)), x : x + draw(st.integers(1, 50))] = True
    return ~mask if draw(st.booleans()) else mask


@given(mask=masks(), seed=st.integers(0, 3), upright=st.booleans(), extended=st.booleans())
@settings(max_examples=60, deadline=None)
def test_inside_a_mask_everything_has_the_bits_of_the_whole_image(mask, seed, upright, extended):
    check_mask(Surf(100.0, upright=upright, extended=extended), draw_texture(seed, *IMAGE.shape), mask)


def test_every_single_pixel_gets_its_own_keypoints():
    keypoints, _ = SURF.detect(IMAGE)
    u, v = np.rint(keypoints["u"]).astype(int), np.rint(keypoints["v"]).astype(int)
    for at in range(0, len(keypoints), 3):
        mask = np.zeros(IMAGE.shape, bool)
        mask[v[at], u[at]] = True
        assert check_mask(SURF, IMAGE, mask) >= 1


def test_noise_finds_what_it_holds():
    noise = np.random.default_rng(3).random(IMAGE.shape)
    assert check_mask(SURF, IMAGE, noise < 0.02) >= 1
    assert check_mask(SURF, IMAGE, noise < 0.5) > 20


def test_pixels_far_from_the_mask_do_not_matter():
    """Nothing is computed there: 200 px away, beyond every filter, the image may be anything."""
    image = draw_texture(5, 120, 600)
    mask = np.zeros(image.shape, bool)
    mask[:, :80] = True
    spoilt = image.copy()
    spoilt[:, 400:] = np.random.default_rng(0).integers(0, 256, (120, 200))
    surf = Surf(octaves=2)
    (one, described), (two, again) = surf.detect(image, mask), surf.detect(spoilt, mask)
    assert len(one) > 10 and one.tobytes() == two.tobytes() and described.tobytes() == again.tobytes()


@pytest.mark.parametrize("threads", [1, 2, 3, 100, None])
def test_threads_do_not_change_anything(threads):
    expected = SURF.detect(IMAGE)
    found = Surf(threads=threads).detect(IMAGE)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(expected, found, strict=True))


# What comes out, and what may go in.


def test_the_result_has_its_types_and_the_strongest_come_first():
    for extended, numbers in ((False, 64), (True, 128)):
        keypoints, descriptors = Surf(extended=extended).detect(IMAGE)
        assert keypoints.dtype == SURF_KEYPOINT and descriptors.dtype == np.float32
        assert descriptors.shape == (len(keypoints), numbers) and len(keypoints) > 20
        assert (np.diff(keypoints["response"]) <= 0).all() and (keypoints["response"] > 300).all()
        np.testing.assert_allclose(np.linalg.norm(descriptors, axis=1), 1, atol=1e-5)
        assert ((keypoints["angle"] >= 0) & (keypoints["angle"] < 2 * np.pi)).all()
        assert set(keypoints["laplacian"]) == {-1, 1}


def test_a_higher_threshold_keeps_the_strongest():
    keypoints, descriptors = SURF.detect(IMAGE)
    strong, described = Surf(3000.0).detect(IMAGE)
    assert 5 < len(strong) < len(keypoints)
    assert strong.tobytes() == keypoints[: len(strong)].tobytes()
    np.testing.assert_array_equal(described, descriptors[: len(strong)])


@pytest.mark.parametrize(
    "layout",
    [
        lambda a: np.asfortranarray(a),
        lambda a: np.repeat(np.repeat(a, 2, axis=0), 2, axis=1)[::2, ::2],
        lambda a: np.ascontiguousarray(a[::-1, ::-1])[::-1, ::-1],
        lambda a: np.frombuffer(a.tobytes(), a.dtype).reshape(a.shape),
    ],
)
def test_any_layout_is_read_right_and_nothing_is_changed(layout):
    mask = np.random.default_rng(1).random(IMAGE.shape) < 0.3
    expected = SURF.detect(IMAGE, mask)
    image, same = layout(IMAGE), layout(mask)
    found = SURF.detect(image, same)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(expected, found, strict=True))
    np.testing.assert_array_equal(image, IMAGE)
    np.testing.assert_array_equal(same, mask)


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1), (2, 2), (9, 9), (20, 33)])
def test_an_image_smaller_than_a_filter_has_no_keypoints(shape):
    for surf in (SURF, Surf(0.0, 16, 16)):
        keypoints, descriptors = surf.detect(draw_texture(0, *shape))
        assert keypoints.shape == (0,) and descriptors.shape == (0, 64)


def test_an_empty_mask_and_a_flat_image_have_no_keypoints():
    nothing = np.zeros(IMAGE.shape, bool)
    for image, mask in ((IMAGE, nothing), (np.full(IMAGE.shape, 9, np.uint8), None)):
        keypoints, descriptors = Surf(0.0, extended=True).detect(image, mask)
        assert keypoints.dtype == SURF_KEYPOINT and descriptors.shape == (0, 128) and not len(keypoints)


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (
            np.zeros((30, 40), np.uint16),
            ArgumentTypeError,
            "gray must be an array .* of uint8, got .* uint16",
        ),
        (np.zeros((30, 40)), ArgumentTypeError, "gray must be .* uint8"),
        (np.zeros((30, 40), bool), ArgumentTypeError, "gray must be .* uint8"),
        (np.zeros((30, 40), np.int8), ArgumentTypeError, "gray must be .* uint8"),
        (np.zeros((30, 40, 3), np.uint8), ArgumentError, r"gray must be \(H, W\), got \(30, 40, 3\)"),
        (np.zeros((30, 40, 4), np.uint8), ArgumentError, r"gray must be \(H, W\), got \(30, 40, 4\)"),
        (np.zeros(30, np.uint8), ArgumentError, "gray must be"),
        (np.zeros((0, 40), np.uint8), ArgumentError, "gray must be"),
        ([[0, 1], [2, 3]], ArgumentTypeError, "gray must be an array"),
        (None, ArgumentTypeError, "gray must be an array"),
        (np.ma.masked_array(np.zeros((9, 9), np.uint8)), ArgumentTypeError, "without a mask"),
    ],
)
def test_an_image_that_is_none_is_named(image, error, message):
    with pytest.raises(error, match=message) as caught:
        SURF.detect(image)
    assert isinstance(caught.value, Error)


@pytest.mark.parametrize(
    ("mask", "error", "message"),
    [
        (np.zeros((128, 96), bool), ArgumentError, r"mask must be .* \(96, 128\), got \(128, 96\)"),
        (np.zeros((96, 128, 1), bool), ArgumentError, "mask must be"),
        (np.zeros((96, 128), np.uint8), ArgumentTypeError, "mask must be .* bool, got .* uint8"),
        (np.zeros((96, 128)), ArgumentTypeError, "mask must be .* bool"),
        ([[True]], ArgumentTypeError, "mask must be an array"),
        (True, ArgumentTypeError, "mask must be an array"),
    ],
)
def test_a_mask_that_is_none_is_named(mask, error, message):
    with pytest.raises(error, match=message):
        SURF.detect(IMAGE, mask)


@pytest.mark.parametrize(
    ("arguments", "error", "name"),
    [
        ({"hessian_threshold": np.nan}, ArgumentError, "hessian_threshold"),
        ({"hessian_threshold": np.inf}, ArgumentError, "hessian_threshold"),
        ({"hessian_threshold": -1.0}, ArgumentError, "hessian_threshold"),
        ({"hessian_threshold": "300"}, ArgumentTypeError, "hessian_threshold"),
        ({"hessian_threshold": None}, ArgumentTypeError, "hessian_threshold"),
        ({"octaves": 0}, ArgumentError, "octaves"),
        ({"octaves": 17}, ArgumentError, "octaves"),
        ({"octaves": 10**30}, ArgumentError, "octaves"),
        ({"octaves": 2.0}, ArgumentTypeError, "octaves"),
        ({"layers": 0}, ArgumentError, "layers"),
        ({"layers": True}, ArgumentTypeError, "layers"),
        ({"upright": 1}, ArgumentTypeError, "upright"),
        ({"extended": None}, ArgumentTypeError, "extended"),
        ({"threads": 0}, ArgumentError, "threads"),
        ({"threads": 1.5}, ArgumentTypeError, "threads"),
    ],
)
def test_a_parameter_outside_its_domain_is_named_when_it_is_given(arguments, error, name):
    with pytest.raises(error, match=f"{name} must be"):
        Surf(**arguments)


def test_the_patents_and_what_is_free_instead_are_told():
    from motorprime.detectors import surf

    for word in ("8,165,401", "1,850,270", "6,711,293", "SIFT", "AKAZE", "ORB", "no legal advice"):
        assert word in surf.__doc__
    assert Path(surf.__file__).name == "surf.py"
