"""Where detectors look, what they return, and the histogram detector on drawn images."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime import Detections, Detector, Everywhere, HistogramDetector, Mask, Tiles, Windows
from motorprime.detectors import Silhouette
from motorprime.detectors.histogram import GROW, merge
from motorprime.errors import ArgumentError, ArgumentTypeError, Error

RED, BLUE, GREY = (220, 30, 40), (40, 30, 220), (90, 90, 90)
DETECTOR = HistogramDetector(np.array([RED] * 100, np.uint8))


def scene(*discs, shape=(120, 160), seed=0):
    """Grey noise, which has no hue, with (u, v, radius, colour) discs."""
    grey = np.random.default_rng(seed).integers(40, 200, shape, dtype=np.uint8)
    image = np.ascontiguousarray(np.stack([grey] * 3, axis=2))
    v, u = np.mgrid[: shape[0], : shape[1]]
    for cu, cv, radius, colour in discs:
        image[(u - cu) ** 2 + (v - cv) ** 2 <= radius**2] = colour
    return image


# Where to look.


@given(u=st.integers(-30, 350), v=st.integers(-30, 270), size=st.integers(1, 60))
@settings(max_examples=100, deadline=None)
def test_a_window_covers_half_its_size_to_the_left_and_above_and_is_shifted_into_the_image(u, v, size):
    ((left, top),) = Windows(np.array([[u, v]]), size).corners((240, 320))
    for start, centre, extent in ((left, u, 320), (top, v, 240)):
        wanted = centre - size // 2
        assert 0 <= start <= extent - size
        assert start == wanted or (wanted < 0 and start == 0) or (wanted > extent - size == start)


def test_an_even_window_of_20_covers_10_before_and_9_after_and_an_odd_one_is_centred():
    assert Windows(np.array([[100, 50]]), 20).corners((240, 320)).tolist() == [[90, 40]]
    assert Windows(np.array([[100, 50]]), 21).corners((240, 320)).tolist() == [[90, 40]]
    assert Windows(np.array([[0, 239], [319, 0]]), 20).corners((240, 320)).tolist() == [[0, 220], [300, 0]]
    assert Windows(np.array([[7, 3]]), 20).corners((20, 20)).tolist() == [[0, 0]]
    assert Windows(np.zeros((0, 2), np.int32), 20).corners((240, 320)).shape == (0, 2)
    assert Windows(np.array([[5, 5]], np.uint8), 20).corners((240, 320)).tolist() == [[0, 0]]


@pytest.mark.parametrize("shape", [(19, 320), (240, 19)])
def test_an_image_smaller_than_a_window_is_named(shape):
    with pytest.raises(ArgumentError, match=f"20 px does not fit into an image of {shape[1]} x {shape[0]}"):
        Windows(np.array([[5, 5]]), 20).corners(shape)


@pytest.mark.parametrize(
    ("make", "name", "error"),
    [
        (lambda: Windows(np.zeros((3, 3), int)), "centres", ArgumentError),
        (lambda: Windows(np.zeros(2, int)), "centres", ArgumentError),
        (lambda: Windows(np.zeros((3, 2))), "centres", ArgumentTypeError),
        (lambda: Windows([[1, 2], [3]]), "centres", ArgumentError),
        (lambda: Windows(np.array([[True, False]])), "centres", ArgumentTypeError),
        (lambda: Windows(np.zeros((1, 2), int), 0), "size", ArgumentError),
        (lambda: Windows(np.zeros((1, 2), int), 2.5), "size", ArgumentTypeError),
        (lambda: Windows(np.zeros((1, 2), int), "20"), "size", ArgumentTypeError),
        (lambda: Mask(np.zeros((3, 3), np.uint8)), "mask", ArgumentTypeError),
        (lambda: Mask(np.zeros((3, 3, 1), bool)), "mask", ArgumentTypeError),
        (lambda: Mask([[True]]), "mask", ArgumentTypeError),
        (lambda: Tiles(np.zeros((1, 3), int)), "boxes", ArgumentError),
        (lambda: Tiles(np.zeros((1, 4))), "boxes", ArgumentTypeError),
    ],
)
def test_places_to_look_that_are_wrong_are_named(make, name, error):
    with pytest.raises(error, match=name):
        make()


@pytest.mark.parametrize(
    "make",
    [
        lambda: Windows(np.array([[5, 5]])),
        lambda: Mask(np.ones((4, 4), np.bool_)),
        lambda: Tiles(np.array([[0, 0, 2, 2]])),
        Detections,
        lambda: HistogramDetector(np.full((60, 3), (200, 0, 0), np.uint8)),
    ],
)
def test_values_that_hold_arrays_are_compared_by_identity_and_never_fail(make):
    one = make()
    assert one == one and one != make()
    assert len({one, one}) == 1


def test_no_detections_are_empty_arrays_of_the_right_shape():
    nothing = Detections()
    assert len(nothing) == 0 and nothing.attended == 0 and nothing.labels == ()
    assert nothing.boxes.shape == (0, 4) and nothing.boxes.dtype == np.float32
    assert nothing.scores.shape == (0,) and nothing.scores.dtype == np.float32


# What is found.


def test_a_disc_s_silhouette_box_and_centroid_are_exact_wherever_it_is_hit():
    image = scene((60, 50, 14, RED), (110, 80, 12, BLUE))
    truth = (image == RED).all(axis=2)
    v, u = np.nonzero(truth)
    for where in (
        Everywhere(),
        Mask(truth),
        Windows(np.array([[52, 41]])),
        Windows(np.array([[68, 60]]), 16),
    ):
        (silhouette,) = DETECTOR.search(image, where).silhouettes
        np.testing.assert_array_equal(silhouette.paint((120, 160)), truth)
        assert silhouette.box == (u.min(), v.min(), u.max() + 1, v.max() + 1) == (46, 36, 75, 65)
        np.testing.assert_allclose(silhouette.centroid, (u.mean(), v.mean()), atol=1e-9)
        assert silhouette.area == truth.sum()
        found = DETECTOR.detect(image, where)
        assert found.boxes.tolist() == [[46, 36, 75, 65]] and found.labels == ("target",)
        assert found.boxes.dtype == found.scores.dtype == np.float32
    assert isinstance(DETECTOR, Detector)


@pytest.mark.parametrize("radius", [30, 55])
def test_a_silhouette_grows_from_one_window_as_far_as_it_goes_and_to_the_border(radius):
    image = scene((150, 60, radius, RED))
    truth = (image == RED).all(axis=2)
    (silhouette,) = DETECTOR.search(image, Windows(np.array([[125, 60]]))).silhouettes
    np.testing.assert_array_equal(silhouette.paint((120, 160)), truth)


def test_several_targets_come_apart_the_largest_first():
    image = scene((30, 30, 8, RED), (100, 60, 20, RED), (140, 20, 11, RED))
    found = DETECTOR.search(image, Everywhere()).silhouettes
    assert [silhouette.box[0] for silhouette in found] == [80, 129, 22]
    assert sum(s.paint((120, 160)).astype(int) for s in found).max() == 1
    assert [len(DETECTOR.detect(image, w)) for w in (Windows(np.array([[60, 60]])), Everywhere())] == [0, 3]


def test_regions_that_touch_at_a_corner_only_are_two():
    image = scene()
    image[30:50, 40:60] = image[50:70, 60:80] = RED
    found = DETECTOR.search(image, Everywhere()).silhouettes
    assert sorted(silhouette.box for silhouette in found) == [(40, 30, 60, 50), (60, 50, 80, 70)]


def test_red_and_blue_are_not_swapped_and_a_hue_beyond_zero_still_counts():
    """Images are RGB. Reds lie on both ends of the hue circle."""
    assert len(DETECTOR.detect(scene((60, 50, 14, BLUE)), Everywhere())) == 0
    purplish = HistogramDetector(np.array([(220, 30, 33)] * 100, np.uint8))  # hue 359 degrees
    assert len(purplish.detect(scene((60, 50, 14, (220, 36, 30))), Everywhere())) == 1  # hue 2 degrees


def reference_scores(image, corners, size, model):
    """Sum of min(window, target) over the bins: hue in 12 degree steps, saturation in sixteenths."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV).astype(int)
    coloured = (hsv[..., 1] >= 70) & (hsv[..., 2] >= 25)
    bins = hsv[..., 0] // 6 * 16 + hsv[..., 1] // 16
    scores = []
    for u, v in corners:
        window = np.s_[v : v + size, u : u + size]
        counts = np.bincount(bins[window][coloured[window]], minlength=480)
        scores.append(np.minimum(counts / size**2, model.ravel()).sum())
    return np.array(scores)


def test_a_hit_is_where_the_intersection_of_normalised_histograms_is_large_enough():
    image = scene((60, 50, 14, RED), (75, 52, 9, (230, 60, 60)), (110, 80, 12, BLUE))
    corners = np.stack(np.meshgrid(np.arange(0, 141, 4), np.arange(0, 101, 4)), axis=-1).reshape(-1, 2)
    scores = reference_scores(image, corners, 20, DETECTOR.model)
    detector = HistogramDetector(DETECTOR.target, hit=0.1513)  # no share of 400 pixels
    search = detector.search(image, Everywhere())
    np.testing.assert_array_equal(search.hits, corners[scores >= 0.1513])
    assert search.silhouettes[0].score == pytest.approx(scores.max(), abs=1e-5)


def test_the_target_s_model_sums_to_one_and_spreads_a_little_around_the_circle_of_hues():
    """(220, 30, 40) has hue 356.8 degrees, bin 29, and saturation 220, bin 13."""
    model = DETECTOR.model
    assert model.shape == (30, 16) and model.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.unravel_index(model.argmax(), model.shape) == (29, 13)
    assert model[0, 13] == pytest.approx(model[28, 13]) and model[0, 13] > 0.05
    assert np.count_nonzero(model) == 9


# What it costs.


@pytest.mark.parametrize("count", [0, 1, 3, 40])
def test_attended_pixels_are_counted_once_and_nothing_else_is_looked_at(count):
    """Whatever the other pixels are, the result is the same."""
    image = scene((60, 50, 14, RED), (110, 80, 12, RED))
    generator = np.random.default_rng(count)
    where = Windows(generator.integers((40, 30), (80, 70), (count, 2)))
    search = DETECTOR.search(image, where)
    scanned = np.zeros((120, 160), bool)
    for u, v in where.corners((120, 160)):
        scanned[v : v + 20, u : u + 20] = True
    assert search.attended[scanned].all()
    assert DETECTOR.detect(image, where).attended == search.attended.sum()
    if not search.silhouettes:
        np.testing.assert_array_equal(search.attended, scanned)
    spoilt = np.where(search.attended[..., None], image, generator.integers(0, 256, image.shape)).astype(
        np.uint8
    )
    again = DETECTOR.search(spoilt, where)
    np.testing.assert_array_equal(again.attended, search.attended)
    np.testing.assert_array_equal(again.hits, search.hits)
    assert [s.box for s in again.silhouettes] == [s.box for s in search.silhouettes]


def test_two_equal_windows_cost_one_and_a_hit_costs_the_region_it_grows_in():
    image = scene((60, 50, 14, RED))
    centre = np.array([[20, 100], [20, 100]])
    assert DETECTOR.detect(image, Windows(centre)).attended == 400
    assert DETECTOR.detect(image, Windows(np.array([[60, 50]]))).attended == (20 + 2 * GROW) ** 2
    assert DETECTOR.detect(image, Everywhere()).attended == 120 * 160


def test_a_mask_looks_at_the_windows_whose_centres_it_holds():
    image = scene((60, 50, 14, RED))
    mask = np.zeros((120, 160), bool)
    mask[90:94, 100:104] = True  # holds one centre of the grid with stride 4: (102, 90) of corner (92, 80)
    attended = DETECTOR.search(image, Mask(mask)).attended
    v, u = np.nonzero(attended)
    assert attended.sum() == 400 and (u.min(), v.min()) == (92, 80)
    assert DETECTOR.detect(image, Mask(np.zeros((120, 160), bool))).attended == 0


# What it refuses, and what does not matter.


def test_the_image_s_layout_does_not_matter_and_it_is_not_changed():
    image = scene((60, 50, 14, RED), (110, 80, 9, RED))
    double = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)
    flipped = np.ascontiguousarray(image[::-1, ::-1])
    padded = np.zeros((120, 160, 4), np.uint8)
    padded[..., :3] = image
    views = [double[::2, ::2], flipped[::-1, ::-1], np.asfortranarray(image), padded[..., :3]]
    image.setflags(write=False)
    for where in (Everywhere(), Windows(np.array([[60, 50], [0, 0]]))):
        expected = DETECTOR.detect(image, where)
        for view in views:
            assert not view.flags.c_contiguous
            found = DETECTOR.detect(view, where)
            assert found.boxes.tolist() == expected.boxes.tolist() and found.attended == expected.attended
            np.testing.assert_array_equal(DETECTOR.back_project(view), DETECTOR.back_project(image))


def test_back_projection_marks_the_target_s_colours_only():
    image = scene((60, 50, 14, RED), (110, 80, 12, BLUE), (20, 20, 5, GREY))
    np.testing.assert_array_equal(DETECTOR.back_project(image) > 0, (image == RED).all(axis=2))


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (np.zeros((60, 80)), ArgumentTypeError),
        (np.zeros((60, 80, 3)), ArgumentTypeError),
        ([[[0, 0, 0]]], ArgumentTypeError),
        (None, ArgumentTypeError),
        (np.zeros((60, 80), np.uint8), ArgumentError),
        (np.zeros((60, 80, 4), np.uint8), ArgumentError),
        (np.zeros((3, 60, 80), np.uint8), ArgumentError),
        (np.zeros((0, 80, 3), np.uint8), ArgumentError),
        (np.zeros((10, 80, 3), np.uint8), ArgumentError),
    ],
)
def test_an_image_that_is_none_is_named(image, error):
    for where in (Everywhere(), Windows(np.array([[5, 5]]))):
        with pytest.raises(error, match="image"):
            DETECTOR.detect(image, where)


@pytest.mark.parametrize(
    ("where", "message", "error"),
    [
        (Tiles(np.zeros((1, 4), int)), r"boxes\[0\]: .* expected, got \[0, 0, 0, 0\]", ArgumentError),
        (
            Mask(np.zeros((160, 120), bool)),
            r"mask: shape \(120, 160\) expected, got \(160",
            ArgumentError,
        ),
        (None, "where.*NoneType", ArgumentTypeError),
        (np.zeros((120, 160), bool), "where.*ndarray", ArgumentTypeError),
    ],
)
def test_a_place_that_this_detector_does_not_know_is_named(where, message, error):
    with pytest.raises(error, match=message) as caught:
        DETECTOR.detect(scene(), where)
    assert isinstance(caught.value, Error)


PIXELS = np.array([RED] * 100, np.uint8)


@pytest.mark.parametrize(
    ("target", "arguments", "name", "error"),
    [
        (PIXELS[:49], {}, "target: at least 50 coloured pixels expected, 49", ArgumentError),
        (PIXELS[:0], {}, "target", ArgumentError),
        (np.array([GREY] * 100, np.uint8), {}, "target: .* 0 have a hue", ArgumentError),
        (PIXELS.T, {}, "target", ArgumentError),
        (PIXELS[None], {}, "target", ArgumentError),
        (PIXELS.astype(float), {}, "target", ArgumentTypeError),
        (PIXELS.tolist(), {}, "target", ArgumentTypeError),
        (PIXELS, {"window": 0}, "window", ArgumentError),
        (PIXELS, {"window": 2.5}, "window", ArgumentTypeError),
        (PIXELS, {"stride": 0}, "stride", ArgumentError),
        (PIXELS, {"stride": -4}, "stride", ArgumentError),
        (PIXELS, {"hit": 0.0}, "hit", ArgumentError),
        (PIXELS, {"hit": np.nan}, "hit", ArgumentError),
        (PIXELS, {"hit": 1.5}, "hit", ArgumentError),
        (PIXELS, {"min_area": -1}, "min_area", ArgumentError),
    ],
)
def test_a_detector_that_cannot_work_is_refused(target, arguments, name, error):
    with pytest.raises(error, match=name):
        HistogramDetector(target, **arguments)


# Pieces of one object.


def piece(u, v, width, height):
    centroid = np.array([u + (width - 1) / 2, v + (height - 1) / 2])
    return Silhouette(np.ones((height, width), bool), (u, v), centroid, 0.1 * height)


def test_pieces_near_the_largest_are_one_object_and_distant_ones_are_not():
    """Within half the larger side of the largest one's box: 20 px."""
    large, below, aside = piece(50, 20, 30, 40), piece(55, 79, 20, 5), piece(101, 30, 10, 10)
    merged = merge([aside, below, large])
    truth = large.paint((120, 160)) | below.paint((120, 160))
    np.testing.assert_array_equal(merged.paint((120, 160)), truth)
    v, u = np.nonzero(truth)
    np.testing.assert_allclose(merged.centroid, (u.mean(), v.mean()), atol=1e-9)
    assert merged.score == large.score and merged.box == (50, 20, 80, 84)
    assert merge([large, piece(50, 80, 5, 5)]).area == large.area
    assert merge([large, piece(99, 20, 5, 5)]).area == large.area + 25
    assert merge([large, aside]) is large and merge([aside]) is aside
    assert merge([large, aside], gap=0.6).area == large.area + aside.area
    with pytest.raises(ArgumentError, match="pieces"):
        merge([])


def test_a_disc_behind_a_bar_is_found_in_two_pieces_that_merge_to_what_is_visible():
    image = scene((80, 60, 20, RED))
    image[57:62] = (30, 120, 200)
    pieces = DETECTOR.search(image, Everywhere()).silhouettes
    assert len(pieces) == 2
    np.testing.assert_array_equal(merge(pieces).paint((120, 160)), (image == RED).all(axis=2))


def test_the_largest_region_is_the_box_of_the_largest_patch_of_the_target_s_colours():
    image = np.full((60, 80, 3), 128, np.uint8)
    image[10:20, 30:45] = RED
    image[40:44, 5:9] = RED
    detector = HistogramDetector(np.tile(np.array([RED], np.uint8), (100, 1)))
    assert detector.largest_region(image) == (30, 10, 45, 20)
    assert detector.largest_region(np.full((60, 80, 3), 128, np.uint8)) is None
