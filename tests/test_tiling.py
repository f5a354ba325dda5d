"""Rectangles over what is attended: nothing is left out, and little is read besides."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from motorprime.tiling import grow, regions, tiles
from motorprime.where import paint

masks = arrays.arrays(bool, st.tuples(st.integers(1, 40), st.integers(1, 60)), fill=st.just(False))
halos, aligns = st.integers(0, 12), st.integers(1, 9)


def areas(boxes):
    return (boxes[:, 2] - boxes[:, 0]).astype(int) * (boxes[:, 3] - boxes[:, 1])


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
@settings(max_examples=300, deadline=None)
def test_regions_cover_every_attended_pixel_with_its_halo(mask, halo, align, overhead):
    found = regions(mask, halo=halo, align=align, overhead=overhead)
    check(found, mask, halo, align)
    assert len(found) == 0 or mask.any()
    # No core has a row or column that nothing attends, and none overlap.
    assert areas(found.cores).sum() == np.count_nonzero(paint(found.cores, mask.shape))
    for u0, v0, u1, v1 in found.cores:
        inside = mask[v0:v1, u0:u1]
        assert inside[0].any() and inside[-1].any() and inside[:, 0].any() and inside[:, -1].any()


@given(mask=masks, halo=halos, align=aligns, data=st.data())
@settings(max_examples=300, deadline=None)
def test_tiles_of_one_size_cover_every_attended_pixel_with_its_halo(mask, halo, align, data):
    size = data.draw(st.tuples(st.integers(align, 70), st.integers(align, 70)))
    found = tiles(mask, size, halo=halo, align=align)
    check(found, mask, halo, align)
    height, width = mask.shape
    for u0, v0, u1, v1 in found.cores:
        assert (v1 - v0, u1 - u0) == size or u1 == width or v1 == height
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


def optimum(mask, cell, halo, overhead):
    """Least price of any rectangles of cells that cover the mask of cells, overlapping ones too."""
    height, width = mask.shape
    shape = (height * cell, width * cell)
    bit = {place: 1 << k for k, place in enumerate(zip(*np.nonzero(mask), strict=True))}
    offers = []
    for v0, v1 in itertools.combinations(range(height + 1), 2):
        for u0, u1 in itertools.combinations(range(width + 1), 2):
            covered = sum(b for (v, u), b in bit.items() if v0 <= v < v1 and u0 <= u < u1)
            box = np.array([[u0, v0, u1, v1]]) * cell
            offers.append((covered, int(areas(grow(box, shape, halo=halo, align=cell))[0]) + overhead))
    cheap = {}
    for covered, price in offers:
        cheap[covered] = min(price, cheap.get(covered, price))

    @functools.cache
    def least(left):
        if not left:
            return 0
        lowest = left & -left
        return min(price + least(left & ~covered) for covered, price in cheap.items() if covered & lowest)

    return least(sum(bit.values()))


CASES = [(cell, halo, over) for cell in (1, 16) for halo in (0, cell) for over in (0, 2 * cell * cell)]


@pytest.mark.parametrize(("cell", "halo", "overhead"), CASES)
def test_regions_are_near_the_cheapest_of_all_covers(cell, halo, overhead):
    """Rectangles that overlap, and the pinwheel, are beyond cuts from side to side: 5 % at the worst."""
    rng = np.random.default_rng(cell + halo + overhead)
    worst, ratios = 0.0, []
    for _ in range(25):
        cells = rng.random((4, 5)) < rng.uniform(0.2, 0.8)
        if not cells.any():
            continue
        mask = np.kron(cells, np.ones((cell, cell), bool))
        found = regions(mask, halo=halo, align=cell, overhead=overhead)
        ratios.append((areas(found.boxes) + overhead).sum() / optimum(cells, cell, halo, overhead))
        worst = max(worst, ratios[-1])
    assert min(ratios) >= 1.0
    print(f"cell {cell} halo {halo} overhead {overhead}: {np.mean(np.array(ratios) == 1):.2f}, {worst:.3f}")
    assert np.mean(np.array(ratios) == 1.0) >= 0.8
    assert worst <= 1.2
