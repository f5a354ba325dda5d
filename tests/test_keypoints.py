"""Keypoints of OpenCV's detectors on tiles, beside those of the whole image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from motorprime import Detector, Everywhere, Guarded, Keypoints, Mask, Tiles, Windows
from motorprime.detectors import KEYPOINT, opencv
from motorprime.detectors.keypoints import collect_keypoints
from motorprime.detectors.opencv import Akaze, Brisk, Kaze, Orb, Sift, structured
from motorprime.errors import ArgumentError, ArgumentTypeError, MissingExtraError
from motorprime.evaluate.drawn import textured
from motorprime.evaluate.regions import same_keypoints
from motorprime.where import paint

SHAPE = (288, 384)
HERE = [name for name in ("SIFT", "AKAZE", "KAZE", "ORB", "BRISK") if hasattr(cv2, f"{name}_create")]
CLASSES = [one for one in (Sift, Akaze, Kaze, Orb, Brisk) if one.name in HERE]


@pytest.fixture(scope="module")
def image():
    return textured(np.random.default_rng(4), SHAPE)


@pytest.fixture(scope="module")
def full(image):
    return {one.name: one().detect(image, Everywhere()) for one in CLASSES}


def share(full, part, box):
    expected, found = same_keypoints(full, part, np.array(box))
    assert expected > 20
    return found / expected


# The whole image.


@pytest.mark.parametrize("one", CLASSES, ids=lambda one: one.name)
def test_everywhere_is_what_opencv_finds(image, full, one):
    ours = full[one.name]
    theirs, descriptors = getattr(cv2, f"{one.name}_create")().detectAndCompute(
        cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None
    )
    assert len(ours) == len(theirs) > 100
    for k in (0, len(ours) // 2, len(ours) - 1):
        point = ours.points[k]
        assert (point["u"], point["v"]) == pytest.approx(theirs[k].pt)
        assert point["size"] == pytest.approx(theirs[k].size)
        assert point["angle"] == pytest.approx(np.deg2rad(theirs[k].angle), rel=1e-6)
        assert point["octave"] == theirs[k].octave
    np.testing.assert_array_equal(ours.descriptors, descriptors)
    assert ours.descriptors.dtype == descriptors.dtype
    assert ours.attended == SHAPE[0] * SHAPE[1]
    assert isinstance(one(), Detector)


def test_keypoints_are_detections_with_boxes_around_their_circles(full):
    ours = full["SIFT"]
    np.testing.assert_array_equal(ours.scores, ours.points["response"])
    centres = (ours.boxes[:, :2] + ours.boxes[:, 2:]) / 2 - 0.5
    np.testing.assert_allclose(centres, np.column_stack([ours.points["u"], ours.points["v"]]), atol=1e-3)
    np.testing.assert_allclose(ours.boxes[:, 2] - ours.boxes[:, 0], ours.points["size"], rtol=1e-4)
    assert set(ours.labels) == {"keypoint"} and len(ours.labels) == len(ours)


# Tiles.


def test_sift_on_an_aligned_tile_finds_what_the_whole_image_has_there(image, full):
    box = (96, 64, 256, 208)
    part = Sift().detect(image, Tiles(np.array([box])))
    assert share(full["SIFT"], part, box) >= 0.99
    assert same_keypoints(part, full["SIFT"], np.array(box))[1] >= 0.99 * len(part)  # and nothing else
    u, v = np.rint(part.points["u"]), np.rint(part.points["v"])
    assert (u >= 96).all() and (u < 256).all() and (v >= 64).all() and (v < 208).all()
    assert part.attended == (160 + 96) * (144 + 96)


def test_an_odd_origin_would_lose_keypoints(image, full):
    """The reason for the alignment; OpenCV itself on a crop."""
    u, v = 41, 23
    crop = Sift().detect(np.ascontiguousarray(image[v : 208 + 48, u : 256 + 48]), Everywhere())
    shifted = crop.points.copy()
    shifted["u"] += u
    shifted["v"] += v
    odd = Keypoints.of(shifted, crop.descriptors)
    assert share(full["SIFT"], odd, (96, 64, 256, 208)) < 0.97


def test_descriptors_belong_to_their_keypoints(image, full):
    part = Sift().detect(image, Tiles(np.array([[96, 64, 256, 208]])))
    whole = full["SIFT"]
    theirs = {
        (point["u"], point["v"], point["angle"]): described
        for point, described in zip(whole.points, whole.descriptors, strict=True)
    }
    same = [
        np.array_equal(theirs[key], described)
        for point, described in zip(part.points, part.descriptors, strict=True)
        if (key := (point["u"], point["v"], point["angle"])) in theirs
    ]
    assert len(same) > 50 and np.mean(same) > 0.95


@pytest.mark.parametrize("where", ["mask", "windows", "tiles"])
def test_several_tiles_find_every_keypoint_once(image, full, where):
    if where == "mask":
        mask = paint([[0, 0, 120, 100], [250, 180, 384, 288]], SHAPE)
        asked = Mask(mask)
    elif where == "windows":
        asked = Windows(np.array([[60, 60], [70, 90], [300, 200]]), 60)
        mask = paint(np.hstack([asked.corners(SHAPE), asked.corners(SHAPE) + 60]), SHAPE)
    else:  # side by side, and overlapping
        asked = Tiles(np.array([[0, 0, 128, 144], [128, 0, 256, 144], [100, 100, 200, 200]]))
        mask = paint(asked.boxes, SHAPE)
    part = Sift().detect(image, asked)
    u, v = np.rint(part.points["u"]).astype(int), np.rint(part.points["v"]).astype(int)
    assert mask[v, u].all()
    whole = full["SIFT"]
    inside = mask[np.rint(whole.points["v"]).astype(int), np.rint(whole.points["u"]).astype(int)]
    expected = Keypoints.of(whole.points[inside], whole.descriptors[inside])
    _, found = same_keypoints(expected, part, np.array([0, 0, 384, 288]))
    assert found >= 0.97 * len(expected)
    assert len(part) <= 1.02 * len(expected)  # none twice


def test_a_keypoint_that_two_tiles_round_to_two_sides_of_their_border_counts_once():
    tiles = Tiles(np.array([[0, 0, 60, 50], [40, 0, 100, 50]]), np.array([[0, 0, 50, 50], [50, 0, 100, 50]]))
    point = np.zeros(2, KEYPOINT)
    point["v"], point["size"] = 20.0, 5.0
    left, right = point.copy(), point.copy()
    left["u"], right["u"] = (49.48, 20.0), (49.52 - 40.0, 40.0)
    described = np.zeros((2, 8), np.float32)
    merged = collect_keypoints([left, right], [described, described + 1], tiles, Everywhere(), (50, 100))
    assert merged.points["u"].tolist() == pytest.approx([49.48, 20.0, 80.0])
    assert merged.descriptors[:, 0].tolist() == [0.0, 0.0, 1.0]
    right["angle"] = 1.0  # another keypoint at that place
    merged = collect_keypoints([left, right], [described, described], tiles, Everywhere(), (50, 100))
    assert len(merged) == 4


def test_brisk_is_nearly_exact_where_sides_are_multiples_of_48_and_not_elsewhere(image):
    if "BRISK" not in HERE:
        pytest.skip("this OpenCV has no BRISK")
    box = (100, 90, 240, 200)  # read from multiples of 48
    assert (Brisk().halo, Brisk().align) == (96, 48)
    for shape, fits in ((SHAPE, True), ((SHAPE[0], 320), False)):
        picture = np.ascontiguousarray(image[: shape[0], : shape[1]])
        whole = Brisk().detect(picture, Everywhere())
        part = Brisk(halo=48).detect(picture, Tiles(np.array([box])))
        assert (share(whole, part, box) > 0.85) == fits


def test_orb_with_a_factor_of_2_is_aligned_and_finds_the_whole_image_s_keypoints(image):
    orb = Orb(scaleFactor=2.0, nlevels=3, edgeThreshold=19, patchSize=19)
    assert (orb.align, orb.halo) == (16, 76)
    assert Orb(scaleFactor=2.0, nlevels=6).align == 32
    assert Orb().align == 16 and Orb(halo=20).halo == 20
    box = (96, 96, 256, 208)
    whole, part = orb.detect(image, Everywhere()), orb.detect(image, Tiles(np.array([box])))
    assert share(whole, part, box) >= 0.97
    plain = Orb()
    assert share(plain.detect(image, Everywhere()), plain.detect(image, Tiles(np.array([box]))), box) < 0.9


def test_each_says_whether_it_is_exact():
    assert Sift.exact and not any(one.exact for one in (Akaze, Kaze, Orb, Brisk))
    for one in (Akaze, Kaze, Orb, Brisk):
        assert "not exact" in one.__doc__


# What is small, empty or wrong.


@pytest.mark.parametrize("one", CLASSES, ids=lambda one: one.name)
def test_nothing_is_found_where_nothing_is_asked_for_or_there(image, one):
    nothing = one().detect(image, Mask(np.zeros(SHAPE, bool)))
    assert len(nothing) == 0 and nothing.attended == 0
    plain = one().detect(np.full((*SHAPE, 3), 90, np.uint8), Mask(paint([[5, 5, 6, 6]], SHAPE)))
    assert len(plain) == 0 and plain.attended > 0
    for empty in (nothing, plain):
        assert empty.points.dtype == KEYPOINT and len(empty.descriptors) == 0
        assert empty.descriptors.shape[1] > 0
        assert empty.descriptors.dtype == one().detect(image, Everywhere()).descriptors.dtype


def test_a_region_of_one_pixel_has_the_keypoints_at_that_pixel(image, full):
    point = full["SIFT"].points[len(full["SIFT"]) // 2]
    u, v = round(float(point["u"])), round(float(point["v"]))
    part = Sift().detect(image, Mask(paint([[u, v, u + 1, v + 1]], SHAPE)))
    assert 1 <= len(part) <= 4
    assert np.hypot(part.points["u"] - point["u"], part.points["v"] - point["v"]).min() < 0.1


def test_without_keypoints_there_is_still_a_table():
    assert structured(()).dtype == KEYPOINT and len(structured(())) == 0


def test_points_without_a_field_and_descriptors_of_another_number_are_named():
    with pytest.raises(ArgumentTypeError, match="angle, response, octave missing"):
        Keypoints.of(np.zeros(2, KEYPOINT)[["u", "v", "size"]], np.zeros((2, 8)))
    with pytest.raises(ArgumentTypeError, match="missing"):
        Keypoints.of(np.zeros((2, 6)), np.zeros((2, 8)))
    with pytest.raises(ArgumentError, match=r"descriptors: shape \(2, D\) expected, got \(3, 8\)"):
        Keypoints.of(np.zeros(2, KEYPOINT), np.zeros((3, 8)))
    more = np.zeros(2, [*KEYPOINT.descr, ("laplacian", np.int8)])
    assert "laplacian" in Keypoints.of(more, np.zeros((2, 64), np.float32)).points.dtype.names


@pytest.mark.parametrize(
    ("wrong", "error"),
    [(np.uint16, ArgumentTypeError), (np.float32, ArgumentTypeError), (4, ArgumentError), (1, ArgumentError)],
)
def test_images_of_another_kind_are_named(wrong, error):
    image = np.zeros((*SHAPE, wrong), np.uint8) if isinstance(wrong, int) else np.zeros((*SHAPE, 3), wrong)
    with pytest.raises(error, match="image"):
        Sift().detect(image, Everywhere())
    failure = Guarded(Sift()).detect(image, Everywhere()).failure
    assert failure.startswith(error.__name__)


def test_places_of_another_size_are_named(image):
    with pytest.raises(ArgumentError, match="mask: shape"):
        Sift().detect(image, Mask(np.ones((10, 10), bool)))
    with pytest.raises(ArgumentError, match=r"boxes\[0\]"):
        Sift().detect(image, Tiles(np.array([[0, 0, 385, 10]])))


def test_options_that_opencv_does_not_take_are_named():
    with pytest.raises(ArgumentError, match=r"options: what cv2\.SIFT_create takes"):
        Sift(features=3)
    with pytest.raises(ArgumentError, match="halo"):
        Sift(halo=-1)


def test_a_detector_that_this_opencv_lacks_says_what_to_install(monkeypatch):
    monkeypatch.delattr(cv2, "AKAZE_create", raising=False)
    with pytest.raises(
        MissingExtraError, match=r"AKAZE is not in OpenCV .*opencv-python-headless.*opencv4"
    ) as error:
        opencv.Akaze()
    assert error.value.extra == "opencv4"
