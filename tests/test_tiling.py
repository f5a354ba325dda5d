"""Rectangles over what is attended: nothing is left out, and little is read besides."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import motorprime as mp
from motorprime import landscape
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.evaluate.cover import evaluate_cover, fewest_tiles, least_price, read
from motorprime.tiling import grow, looked_at, reading, regions, tiles
from motorprime.where import Everywhere, Mask, Tiles, Windows, paint

masks = arrays.arrays(bool, st.tuples(st.integers(1, 40), st.integers(1, 60)), fill=st.just(False))
halos, aligns = st.integers(0, 12), st.integers(1, 9)


def check(found, mask, halo, align):
    """Cores cover the mask; boxes are the cores with their halo, inside the image, at multiples of align."""
    height, width = mask.shape
    found.within(mask.shape)
    assert not (mask & ~paint(found.cores, mask.shape)).any()
    for box, core in zip(found.boxes, found.cores, strict=True):
        for k, length in ((0, width), (1, height)):
            assert box[k] == 0 or (box[k] % align == 0 and core[k] - box[k] >= halo)
            assert box[k + 2] == length or (box[k + 2] % align == 0 and box[k + 2] - core[k + 2] >= halo)
            assert core[k] - box[k] < halo + align and box[k + 2] - core[k + 2] < halo + align


# Cover.


@given(mask=masks, halo=halos, align=aligns, overhead=st.integers(0, 200))
@settings(max_examples=200, deadline=None)
def test_regions_cover_every_attended_pixel_with_its_halo_and_no_core_has_an_empty_edge(
    mask, halo, align, overhead
):
    before = mask.copy()
    found = regions(mask, halo=halo, align=align, overhead=overhead)
    np.testing.assert_array_equal(mask, before)
    check(found, mask, halo, align)
    assert len(found) == 0 or mask.any()
    assert read(found.cores, 0) == np.count_nonzero(paint(found.cores, mask.shape))  # none overlap
    for u0, v0, u1, v1 in found.cores:
        inside = mask[v0:v1, u0:u1]
        assert inside[0].any() and inside[-1].any() and inside[:, 0].any() and inside[:, -1].any()


@given(mask=masks, halo=halos, align=aligns, data=st.data())
@settings(max_examples=200, deadline=None)
def test_tiles_of_one_size_cover_every_attended_pixel_with_its_halo(mask, halo, align, data):
    size = data.draw(st.tuples(st.integers(align, 70), st.integers(align, 70)))
    before = mask.copy()
    found = tiles(mask, size, halo=halo, align=align)
    np.testing.assert_array_equal(mask, before)
    check(found, mask, halo, align)
    height, width = mask.shape
    for u0, v0, u1, v1 in found.cores:
        assert v1 - v0 == size[0] or v1 == height
        assert u1 - u0 == size[1] or u1 == width
        assert u0 % align == 0 and v0 % align == 0
        assert mask[v0:v1, u0:u1].any()


@given(mask=masks, size=st.integers(1, 50))
@settings(max_examples=100, deadline=None)
def test_unaligned_tiles_all_have_the_one_size_that_the_image_has_room_for(mask, size):
    found = tiles(mask, size)
    sides = {(int(v1 - v0), int(u1 - u0)) for u0, v0, u1, v1 in found.boxes}
    assert sides <= {(min(size, mask.shape[0]), min(size, mask.shape[1]))}


def test_aligned_tiles_with_a_halo_have_one_shape_away_from_the_border():
    mask = paint([[200, 150, 420, 330]], (480, 640))
    found = tiles(mask, (64, 96), halo=20, align=32)
    sides = set(zip(*(found.boxes[:, 2:] - found.boxes[:, :2]).T.tolist(), strict=True))
    assert sides == {(96 + 64, 64 + 64)}


# Cheap.

CASES = [(cell, halo, over) for cell in (1, 16) for halo in (0, cell) for over in (0, 2 * cell * cell)]


@pytest.mark.parametrize(("cell", "halo", "overhead"), CASES)
def test_no_cover_of_small_masks_is_cheaper_than_regions(cell, halo, overhead, rng):
    """Not even one whose rectangles overlap. Only what no cuts from side to side give could be: see below."""
    ratios = []
    for _ in range(20):
        cells = rng.random((4, 5)) < rng.uniform(0.2, 0.8)
        cells[0, 0] = True
        mask = np.kron(cells, np.ones((cell, cell), bool))
        found = regions(mask, halo=halo, align=cell, overhead=overhead)
        ratios.append(read(found.boxes, overhead) / least_price(cells, cell, halo, overhead))
    assert min(ratios) >= 1.0
    assert np.mean(np.array(ratios) == 1.0) >= 0.95 and max(ratios) < 1.05


def test_a_pinwheel_costs_one_rectangle_more_than_it_must():
    """Four strips around a middle: every cut from side to side halves one of them."""
    pinwheel = paint([[0, 0, 4, 2], [5, 0, 7, 4], [3, 5, 7, 7], [0, 3, 2, 7]], (7, 7))
    assert least_price(pinwheel, 1, 0, 1) == 32 + 4
    assert read(regions(pinwheel, overhead=1).boxes, 1) == 32 + 5


def test_tiles_are_nearly_as_few_as_can_be(rng):
    ratios = []
    for _ in range(60):
        cells = rng.random((5, 6)) < rng.uniform(0.1, 0.6)
        cells[2, 3] = True
        mask = np.kron(cells, np.ones((8, 8), bool))
        ratios.append(len(tiles(mask, 16, align=8)) / fewest_tiles(cells, 2))
    assert min(ratios) >= 1.0
    assert np.mean(ratios) < 1.03 and max(ratios) <= 1.5


def test_the_evaluation_of_covers_counts_what_is_optimal():
    figures = evaluate_cover(8, seed=1)
    for part in ("regions", "tiles"):
        assert figures[part]["cases"] == 8
        assert 1.0 <= figures[part]["mean"] <= figures[part]["worst"]
        assert (figures[part]["worst"] == 1.0) == (figures[part]["optimal"] == 1.0)
    assert figures == evaluate_cover(8, seed=1) != evaluate_cover(8, seed=2)


def test_two_distant_blobs_are_two_rectangles_until_another_costs_more_than_it_saves():
    mask = paint([[10, 10, 20, 20], [80, 10, 90, 20]], (100, 100))
    assert regions(mask, overhead=100).boxes.tolist() == [[10, 10, 20, 20], [80, 10, 90, 20]]
    assert regions(mask, overhead=599).boxes.tolist() == [[10, 10, 20, 20], [80, 10, 90, 20]]
    assert regions(mask, overhead=601).boxes.tolist() == [[10, 10, 90, 20]]
    # Halos meet: 40 x 40 and 40 x 40 against 100 x 40.
    assert len(regions(mask, overhead=599, halo=15)) == 2
    assert len(regions(mask, overhead=601, halo=30)) == 1


def test_a_path_across_the_image_is_not_one_rectangle():
    path = np.linspace((40.0, 40.0), (600.0, 440.0), 60, dtype=np.float32)
    along = mp.kernel_landscape(path, (480, 640), width=40.0)
    found = regions(along, fraction=0.15)
    mask = looked_at(mp.Look(along).mask(fraction=0.15), (480, 640))
    check(found, mask, 0, 1)
    whole = regions(along, fraction=0.15, overhead=10**9)
    assert len(whole) == 1
    assert read(found.boxes, 0) < 0.5 * read(whole.boxes, 0)


# Landscapes and masks.


def test_a_landscape_is_attended_where_its_threshold_says(rng):
    values = rng.random((60, 80)).astype(np.float32)
    values[20:40, 20:60] += 1.0
    values[:5] = 0.0
    for share in (0.1, 0.3):
        mask = looked_at(mp.Look(values).mask(fraction=share), values.shape)
        for cover in (regions, lambda where, **options: tiles(where, 8, **options)):
            expected, found = cover(mask), cover(values, fraction=share)
            np.testing.assert_array_equal(found.boxes, expected.boxes)
            np.testing.assert_array_equal(cover(Mask(mask)).boxes, expected.boxes)
            np.testing.assert_array_equal(cover(values.astype(np.float64), fraction=share).boxes, found.boxes)
    assert regions(values).cores.tolist() == [[0, 5, 80, 60]]  # all that is positive
    look = mp.Look(values)
    np.testing.assert_array_equal(
        look.regions(fraction=0.1, halo=4, align=8).boxes,
        regions(values, fraction=0.1, halo=4, align=8).boxes,
    )


def test_the_settled_names_are_where_they_are_said_to_be():
    assert mp.regions is landscape.regions is regions
    assert mp.tiles is landscape.tiles is tiles


def test_an_empty_mask_has_no_tiles_and_one_pixel_has_one():
    nothing = np.zeros((30, 40), bool)
    for found in (regions(nothing, halo=5, align=4), tiles(nothing, 8)):
        assert found.boxes.shape == found.cores.shape == (0, 4)
        assert found.attended((30, 40)) == 0
    nothing[29, 39] = True
    assert regions(nothing).boxes.tolist() == [[39, 29, 40, 30]]
    assert regions(nothing, halo=5, align=4).boxes.tolist() == [[32, 24, 40, 30]]
    assert tiles(nothing, 8).boxes.tolist() == [[32, 22, 40, 30]]


def test_a_tile_larger_than_the_image_is_the_image():
    mask = paint([[3, 4, 5, 6]], (30, 40))
    assert tiles(mask, 100, halo=3).boxes.tolist() == [[0, 0, 40, 30]]
    assert tiles(mask, (100, 16), align=16).boxes.tolist() == [[0, 0, 16, 30]]


@pytest.mark.parametrize(
    ("where", "options", "name", "error"),
    [
        (np.zeros((4, 5), np.float32), {}, "landscape: at least one positive", ArgumentError),
        (np.full((4, 5), np.nan, np.float32), {}, "landscape", ArgumentError),
        (np.full((4, 5), -1.0, np.float32), {}, "landscape", ArgumentError),
        (np.ones((4, 5), np.uint8), {}, "landscape: a float or bool array", ArgumentTypeError),
        (np.ones(5, np.float32), {}, "landscape", ArgumentTypeError),
        ([[True]], {}, "landscape", ArgumentTypeError),
        (np.ones((4, 5), bool), {"fraction": 0.3}, "fraction: a mask", ArgumentError),
        (np.ones((4, 5), np.float32), {"fraction": 0.0}, "fraction", ArgumentError),
        (np.ones((4, 5), np.float32), {"fraction": 1.5}, "fraction", ArgumentError),
        (np.ones((4, 5), bool), {"halo": -1}, "halo", ArgumentError),
        (np.ones((4, 5), bool), {"halo": 1.5}, "halo", ArgumentTypeError),
        (np.ones((4, 5), bool), {"align": 0}, "align", ArgumentError),
    ],
)
def test_what_cannot_be_covered_is_named(where, options, name, error):
    with pytest.raises(error, match=name):
        regions(where, **options)
    with pytest.raises(error, match=name):
        tiles(where, 3, **options)


def test_overheads_and_sizes_that_make_no_sense_are_named():
    mask = np.ones((4, 5), bool)
    with pytest.raises(ArgumentError, match="overhead"):
        regions(mask, overhead=-1)
    for size, error in (
        (0, ArgumentError),
        ((3, 0), ArgumentError),
        ((1, 2, 3), ArgumentError),
        (2.0, ArgumentTypeError),
    ):
        with pytest.raises(error, match="size"):
            tiles(mask, size)
    with pytest.raises(ArgumentError, match="size: expected an integer >= 8"):
        tiles(mask, 7, align=8)


# What a detector reads.


def test_a_detector_reads_what_it_needs_for_what_is_asked():
    shape = (60, 100)
    assert reading(Everywhere(), shape, halo=9, align=8).boxes.tolist() == [[0, 0, 100, 60]]
    mask = paint([[30, 20, 40, 30]], shape)
    found = reading(Mask(mask), shape, halo=4, align=8)
    assert found.cores.tolist() == [[30, 20, 40, 30]] and found.boxes.tolist() == [[24, 16, 48, 40]]
    found = reading(Tiles(np.array([[30, 20, 40, 30], [90, 50, 100, 60]])), shape, halo=4, align=8)
    assert found.cores.tolist() == [[30, 20, 40, 30], [90, 50, 100, 60]]
    assert found.boxes.tolist() == [[24, 16, 48, 40], [80, 40, 100, 60]]
    found = reading(Windows(np.array([[35, 25], [0, 0]]), 10), shape, halo=4, align=8)
    assert found.cores.tolist() == [[0, 0, 10, 10], [30, 20, 40, 30]] or len(found) == 1
    assert not (
        looked_at(Windows(np.array([[35, 25], [0, 0]]), 10), shape) & ~paint(found.cores, shape)
    ).any()
    # Tiles with a halo of their own: the detector reads what it needs, and answers for the cores.
    own = Tiles(np.array([[0, 0, 60, 60]]), np.array([[30, 20, 40, 30]]))
    assert reading(own, shape, halo=4, align=8).boxes.tolist() == [[24, 16, 48, 40]]


def test_what_is_asked_for_is_a_mask():
    shape = (6, 10)
    assert looked_at(Everywhere(), shape) is None
    mask = paint([[1, 2, 3, 4]], shape)
    assert looked_at(Mask(mask), shape) is mask
    windows = looked_at(Windows(np.array([[5, 3]]), 2), shape)
    np.testing.assert_array_equal(windows, paint([[4, 2, 6, 4]], shape))
    own = Tiles(np.array([[0, 0, 6, 6]]), np.array([[3, 2, 4, 3]]))
    np.testing.assert_array_equal(looked_at(own, shape), paint([[3, 2, 4, 3]], shape))


@pytest.mark.parametrize(
    ("where", "name", "error"),
    [
        (Mask(np.ones((5, 10), bool)), r"mask: shape \(6, 10\) expected, got \(5, 10\)", ArgumentError),
        (Tiles(np.array([[0, 0, 11, 6]])), r"boxes\[0\]: .* 10 x 6 .*, got \[0, 0, 11, 6\]", ArgumentError),
        (Tiles(np.array([[0, 0, 9, 6], [-1, 0, 3, 3]])), r"boxes\[1\]", ArgumentError),
        (Tiles(np.array([[3, 3, 3, 6]])), r"boxes\[0\]", ArgumentError),
        (Windows(np.array([[3, 3]]), 7), "size: a window of 7 px", ArgumentError),
        (np.ones((6, 10), bool), "where: Everywhere, Mask", ArgumentTypeError),
    ],
)
def test_what_does_not_fit_the_image_is_named(where, name, error):
    with pytest.raises(error, match=name):
        reading(where, (6, 10))


def test_cores_lie_in_their_boxes():
    boxes = np.array([[0, 0, 10, 10], [10, 0, 20, 10]])
    with pytest.raises(ArgumentError, match=r"cores\[1\]: inside \[10, 0, 20, 10\] expected"):
        Tiles(boxes, np.array([[2, 2, 8, 8], [9, 2, 18, 8]]))
    with pytest.raises(ArgumentError, match="cores: a row for each of the 2 boxes"):
        Tiles(boxes, boxes[:1])
    with pytest.raises(ArgumentTypeError, match="cores"):
        Tiles(boxes, boxes.astype(float))
    assert Tiles(boxes).counted is boxes and len(Tiles(boxes)) == 2


def test_pixels_of_overlapping_tiles_count_once():
    assert Tiles(np.array([[0, 0, 10, 10], [5, 0, 15, 10]])).attended((20, 20)) == 150
    assert Tiles(np.array([[0, 0, 10, 10]])).attended((20, 20)) == 100


def test_a_grown_box_has_its_halo_and_lies_on_the_grid_or_the_border():
    box = np.array([[33, 20, 64, 50]], dtype=np.int32)
    assert grow(box, (60, 200), halo=2, align=16).tolist() == [[16, 16, 80, 60]]
    assert grow(box, (60, 200), halo=0, align=1).tolist() == box.tolist()
    assert grow(box, (60, 200), halo=1, align=32).tolist() == [[32, 0, 96, 60]]
