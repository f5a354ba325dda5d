"""A detector of one's own on tiles: in the image's pixels, each object once; and one that fails."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorprime as mp
from motorprime import Detections, Detector, Everywhere, Guarded, Mask, OnTiles, Tiles, Windows
from motorprime.detectors.merging import collect, intersection_over_union, suppress
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.where import paint

SHAPE = (120, 200)
ALL = Tiles(np.array([[0, 0, 100, 120], [100, 0, 200, 120]]))


def bright(image):
    """A detector of one's own: boxes around bright rectangles, named by their colour's first channel."""
    _, _, stats, _ = cv2.connectedComponentsWithStats((image[..., 0] > 0).astype(np.uint8))
    boxes = np.array([[u, v, u + w, v + h] for u, v, w, h, _ in stats[1:]], np.float32).reshape(-1, 4)
    values = [int(image[int(v) : int(v1), int(u) : int(u1), 0].max()) for u, v, u1, v1 in boxes]
    return Detections(boxes, np.array(values, np.float32) / 255, tuple(f"c{x}" for x in values))


def picture(*rectangles, shape=SHAPE):
    image = np.zeros((*shape, 3), np.uint8)
    for k, (u0, v0, u1, v1) in enumerate(rectangles):
        image[v0:v1, u0:u1] = 200 - 10 * (k % 20)
    return image


def found(detections):
    return sorted(map(tuple, detections.boxes.astype(int).tolist()))


# Coordinates and shares.


def test_findings_are_in_the_image_s_pixels_and_count_where_their_centre_was_asked_for():
    image = picture((10, 10, 20, 20), (60, 30, 80, 40), (150, 90, 160, 100))
    detector = OnTiles(bright, halo=12)
    everywhere = detector.detect(image, Everywhere())
    assert found(everywhere) == [(10, 10, 20, 20), (60, 30, 80, 40), (150, 90, 160, 100)]
    assert everywhere.attended == 120 * 200 and everywhere.failure is None
    assert everywhere.labels == ("c200", "c190", "c180")  # the highest score first
    where = Mask(paint([[65, 25, 75, 45]], SHAPE))
    seen = detector.detect(image, where)
    assert found(seen) == [(60, 30, 80, 40)]
    assert seen.attended == 34 * 44
    assert found(detector.detect(image, Mask(paint([[60, 25, 69, 45]], SHAPE)))) == []
    assert found(detector.detect(image, Windows(np.array([[155, 95]]), 4))) == [(150, 90, 160, 100)]
    assert found(detector.detect(image, Tiles(np.array([[0, 0, 15, 15], [16, 16, 200, 89]])))) == [
        (60, 30, 80, 40)
    ]


def test_the_centre_of_a_pixel_s_box_is_that_pixel():
    image = picture((50, 60, 51, 61))
    for u, v, hit in ((50, 60, True), (49, 60, False), (51, 60, False), (50, 59, False), (50, 61, False)):
        seen = OnTiles(bright, halo=3).detect(image, Mask(paint([[u, v, u + 1, v + 1]], SHAPE)))
        assert bool(len(seen)) == hit


@given(seed=st.integers(0, 10**6), halo=st.integers(8, 20), align=st.integers(1, 16))
@settings(max_examples=60, deadline=None)
def test_with_a_halo_as_large_as_the_objects_a_mask_finds_what_the_whole_image_has_there(seed, halo, align):
    rng = np.random.default_rng(seed)
    places = [(u, v) for u in range(0, 180, 20) for v in range(0, 100, 20) if rng.random() < 0.4]
    rectangles = [(u + 3, v + 2, u + 3 + rng.integers(1, 9), v + 2 + rng.integers(1, 9)) for u, v in places]
    image = picture(*rectangles)
    mask = paint(
        [(u, v, u + 40, v + 30) for u, v in rng.integers(0, (160, 90), (rng.integers(1, 4), 2))], SHAPE
    )
    detector = OnTiles(bright, halo=halo, align=align)
    expected = [
        box for box in found(detector.detect(image, Everywhere()))
        if mask[(box[1] + box[3]) // 2, (box[0] + box[2]) // 2]
    ]  # fmt: skip
    assert found(detector.detect(image, Mask(mask))) == sorted(expected)


def test_nothing_is_looked_at_where_nothing_is_asked_for():
    def never(image):
        pytest.fail("called")

    seen = OnTiles(never).detect(picture(), Mask(np.zeros(SHAPE, bool)))
    assert len(seen) == 0 and seen.attended == 0


def test_tiles_are_aligned_and_contiguous_and_one_pixel_is_enough():
    sizes = []

    def note(image):
        assert image.flags.c_contiguous
        sizes.append(image.shape)
        return Detections()

    one = paint([[199, 119, 200, 120]], SHAPE)
    OnTiles(note, halo=10, align=32).detect(picture(), Mask(one))
    assert sizes == [(24, 40, 3)]  # from (160, 96) to the corner of the image


# Duplicates and pieces.


def test_an_object_in_two_tiles_halos_is_found_once():
    image = picture((95, 50, 105, 60))
    assert found(OnTiles(bright, halo=16).detect(image, ALL)) == [(95, 50, 105, 60)]


@pytest.mark.parametrize("halo", [0, 4, 10])
def test_an_object_cut_by_the_border_of_tiles_is_joined(halo):
    image = picture((60, 50, 150, 60), (20, 100, 30, 110), (97, 10, 99, 20))
    seen = OnTiles(bright, halo=halo).detect(image, ALL)
    assert found(seen) == [(20, 100, 30, 110), (60, 50, 150, 60), (97, 10, 99, 20)]


def test_an_object_over_four_tiles_is_joined():
    image = picture((80, 40, 130, 80))
    four = Tiles(np.array([[0, 0, 100, 60], [100, 0, 200, 60], [0, 60, 100, 120], [100, 60, 200, 120]]))
    assert found(OnTiles(bright).detect(image, four)) == [(80, 40, 130, 80)]


def test_the_image_s_own_border_cuts_nothing():
    """Two objects at the right border, each in a tile of its own, one above the other."""
    image = picture((190, 20, 200, 58), (190, 62, 200, 100))
    rows = Tiles(np.array([[0, 0, 200, 60], [0, 60, 200, 120]]))
    assert len(OnTiles(bright).detect(image, rows)) == 2
    overlapping = Tiles(np.array([[0, 0, 200, 70], [0, 10, 200, 120]]))
    assert len(two((100, 20, 200, 60), (190, 30, 200, 60), tiles=overlapping)) == 2


def two(a, b, *, labels=("x", "x"), scores=(0.5, 0.9), tiles=ALL):
    """One finding in each of the two tiles, given in pixels of the image."""
    corners = tiles.boxes[:, :2]
    parts = [
        Detections(np.array([box], np.float32) - np.tile(corner, 2), np.array([score], np.float32), (label,))
        for box, corner, score, label in zip((a, b), corners, scores, labels, strict=True)
    ]
    return collect(parts, tiles, Everywhere(), SHAPE)


OVERLAPPING = Tiles(np.array([[0, 0, 120, 120], [80, 0, 200, 120]]))


def test_of_two_findings_of_one_object_the_better_stays():
    merged = two((85, 20, 110, 40), (86, 21, 111, 41), tiles=OVERLAPPING)
    assert found(merged) == [(86, 21, 111, 41)] and merged.scores.tolist() == pytest.approx([0.9])


def test_other_labels_and_little_overlap_are_other_objects():
    assert len(two((85, 20, 110, 40), (86, 21, 111, 41), labels=("x", "y"), tiles=OVERLAPPING)) == 2
    assert len(two((85, 20, 105, 40), (95, 31, 115, 51), tiles=OVERLAPPING)) == 2


def test_pieces_that_do_not_meet_at_the_border_are_not_joined():
    assert len(two((60, 20, 100, 30), (100, 60, 140, 70))) == 2  # at other heights
    assert len(two((60, 20, 90, 30), (110, 20, 140, 30))) == 2  # not cut
    assert len(two((60, 20, 100, 30), (115, 20, 140, 30))) == 2  # far behind the border
    assert len(two((60, 20, 100, 30), (100, 20, 140, 30), labels=("x", "y"))) == 2
    joined = two((60, 20, 100, 30), (100, 21, 140, 31))
    assert found(joined) == [(60, 20, 140, 31)]
    assert joined.scores.tolist() == pytest.approx([0.9]) and joined.labels == ("x",)


def test_what_one_tile_reports_twice_is_left_to_its_detector():
    twice = Detections(np.array([[1, 1, 9, 9], [1, 1, 9, 9]], np.float32), np.ones(2, np.float32), ("a", "a"))
    one = Tiles(np.array([[0, 0, 100, 120]]))
    assert len(collect([twice], one, one, SHAPE)) == 2


def test_suppression_keeps_the_best_of_each_crowd():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [5, 0, 15, 10], [30, 30, 40, 40]], np.float32)
    scores = np.array([0.5, 0.9, 0.8, 0.1], np.float32)
    assert suppress(boxes, scores, 0.5).tolist() == [1, 2, 3]  # 9 of 11, then 6 of 14
    assert suppress(boxes, scores, 0.3).tolist() == [1, 3]
    np.testing.assert_allclose(
        intersection_over_union(boxes[0], boxes), [1.0, 90 / 110, 50 / 150, 0.0], rtol=1e-6
    )


# What a detector of one's own may get wrong.


def test_a_function_is_a_detector():
    assert isinstance(OnTiles(bright), Detector)
    for arguments, name, error in (
        ((3,), "function", ArgumentTypeError),
        ((bright, -1), "halo", ArgumentError),
        ((bright, 0, 0), "align", ArgumentError),
    ):
        with pytest.raises(error, match=name):
            OnTiles(*arguments)


@pytest.mark.parametrize(
    ("result", "name", "error"),
    [
        (None, "detections: Detections expected, got NoneType", ArgumentTypeError),
        (Detections(np.zeros((1, 3), np.float32), np.zeros(1), ("a",)), "boxes", ArgumentError),
        (Detections(np.zeros((1, 4), np.float32), np.zeros(2), ("a",)), "scores and labels", ArgumentError),
        (Detections(np.zeros((1, 4), np.float32), np.zeros(1), ()), "scores and labels", ArgumentError),
        (Detections(np.full((1, 4), np.nan), np.zeros(1), ("a",)), r"boxes\[0\]: finite", ArgumentError),
        (Detections(np.zeros((1, 4)), np.array([np.nan]), ("a",)), r"boxes\[0\]: finite", ArgumentError),
    ],
)
def test_what_is_no_finding_is_named(result, name, error):
    with pytest.raises(error, match=name):
        OnTiles(lambda image: result).detect(picture(), Everywhere())


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (np.zeros((*SHAPE, 3), np.uint16), ArgumentTypeError),
        (np.zeros((*SHAPE, 3), np.float32), ArgumentTypeError),
        (np.zeros((*SHAPE, 4), np.uint8), ArgumentError),
        (np.zeros(SHAPE, np.uint8), ArgumentError),
        (np.zeros((0, 5, 3), np.uint8), ArgumentError),
        (None, ArgumentTypeError),
    ],
)
def test_an_image_of_another_kind_is_named(image, error):
    with pytest.raises(error, match="image"):
        OnTiles(bright).detect(image, Everywhere())


def test_a_mask_of_another_size_is_named():
    with pytest.raises(ArgumentError, match=r"mask: shape \(120, 200\) expected, got \(200, 120\)"):
        OnTiles(bright).detect(picture(), Mask(np.ones((200, 120), bool)))


# A detector that fails.


class Moody:
    """Fails in every frame whose upper left pixel is 1."""

    def detect(self, image, where):
        if image[0, 0, 0] == 1:
            raise ZeroDivisionError("mood")
        return bright(image)


def test_a_frame_in_which_a_detector_raises_is_reported_and_the_loop_goes_on():
    frames = [picture((50, 50, 60, 60)) for _ in range(3)]
    frames[1][0, 0] = 1
    reported = []
    detector = Guarded(Moody(), reported.append)
    assert isinstance(detector, Detector)
    seen = [detector.detect(frame, Everywhere()) for frame in frames]
    assert [len(one) for one in seen] == [1, 0, 1]
    assert [one.failure for one in seen] == [None, "ZeroDivisionError: mood", None]
    assert detector.failures == 1 and reported == [detector.error]
    assert isinstance(detector.error, ZeroDivisionError) and detector.error.__traceback__ is not None
    assert seen[1].boxes.shape == (0, 4) and seen[1].attended == 0


def test_a_failure_in_one_tile_is_the_frame_s():
    def fails(image):
        raise ValueError("tile")

    assert Guarded(OnTiles(fails)).detect(picture(), ALL).failure == "ValueError: tile"


def test_what_is_no_finding_is_a_failure_too():
    class Silent:
        def detect(self, image, where):
            return None

    failure = Guarded(Silent()).detect(picture(), Everywhere()).failure
    assert failure == "ArgumentTypeError: detections: Silent returned NoneType"


def test_somebody_who_wants_to_stop_the_program_can():
    class Stopped:
        def detect(self, image, where):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Guarded(Stopped()).detect(picture(), Everywhere())


def test_what_cannot_detect_cannot_be_guarded():
    with pytest.raises(ArgumentTypeError, match="detector: something with detect"):
        Guarded(3)


def test_the_names_are_public():
    assert {"Guarded", "OnTiles", "Keypoints", "regions", "tiles"} <= set(mp.__all__)
