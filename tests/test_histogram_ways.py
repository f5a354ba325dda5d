"""The histogram detector's three ways to search a region: OpenCV's windows, the scan, the back-projection."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import Everywhere, HistogramDetector, Mask, Tiles, Windows, _core
from motorprime.detectors import silhouettes
from motorprime.detectors.colours import (
    BINS,
    MIN_SATURATION,
    MIN_VALUE,
    NO_BIN,
    bin_indices,
    histogram,
    hsv,
    window_hits,
    window_scores,
)
from motorprime.detectors.merging import merge_windows
from motorprime.errors import ArgumentError, ArgumentTypeError
from test_detectors import BLUE, DETECTOR, RED, reference_scores, scene

TARGET = np.random.default_rng(1).normal(RED, 20, (400, 3)).clip(0, 255).astype(np.uint8)
WAYS = ("windows", "scan", "back-projection")
WINDOWS, SCAN, PROJECTION = (HistogramDetector(TARGET, way=way, hit=0.2) for way in WAYS)
PURE = [HistogramDetector(DETECTOR.target, way=way) for way in WAYS]


def motley(seed=0, shape=(120, 160)):
    """A scene in which most windows share something with the target."""
    image = scene((60, 50, 14, RED), (110, 80, 12, BLUE), (130, 20, 9, (200, 60, 50)), shape=shape, seed=seed)
    generator = np.random.default_rng(seed)
    v, u = generator.integers((0, 0), shape, (shape[0] * shape[1] // 3, 2)).T
    image[v, u] = generator.normal(RED, 40, (len(v), 3)).clip(0, 255)
    return image


def corners_of(scores):
    return np.stack(np.meshgrid(*(np.arange(n) for n in scores.shape[::-1])), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("window", [20, 7, 1])
def test_the_scan_scores_every_position_as_opencv_s_windows_do(window):
    """To 1e-6: float32 sums in another order."""
    image = motley(shape=(45, 60))
    scan = HistogramDetector(TARGET, way="scan", window=window)
    scores = scan.scores(image)
    assert scores.shape == (46 - window, 61 - window) and scores.std() > 0.01
    windows = HistogramDetector(TARGET, window=window, hit=1e-9, stride=1, min_area=10**6)
    one_by_one = np.array(
        [windows._score(hsv(image[v : v + window, u : u + window])) for u, v in corners_of(scores)]
    )
    np.testing.assert_allclose(scores.ravel(), one_by_one, atol=1e-6)
    np.testing.assert_allclose(
        scores.ravel(), reference_scores(image, corners_of(scores), window, scan.model), atol=1e-6
    )


@pytest.mark.parametrize("stride", [1, 4, 7])
@pytest.mark.parametrize("region", ["everywhere", "mask", "tiles"])
def test_at_the_same_positions_the_scan_hits_what_the_windows_hit(stride, region):
    image = motley()[30:95, 30:120]
    where = {
        "everywhere": Everywhere(),
        "mask": Mask(np.random.default_rng(2).random((65, 90)) < 0.1),
        "tiles": Tiles(np.array([[3, 5, 50, 31], [60, 0, 90, 65], [50, 30, 55, 60]])),
    }[region]
    hit = 0.20003  # no score is so near to it that rounding decides
    one_by_one = HistogramDetector(TARGET, stride=stride, hit=hit).search(image, where)
    at_once = HistogramDetector(TARGET, stride=stride, hit=hit, way="scan").search(image, where)
    assert len(one_by_one.hits) > 5
    np.testing.assert_array_equal(at_once.hits, one_by_one.hits)
    if region == "everywhere":
        assert at_once.attended.all()
    else:
        # Where a hit grows may differ; the windows themselves are looked at by both.
        assert (at_once.attended >= covered(image, where, stride)).all()


def covered(image, where, stride):
    nothing = HistogramDetector(np.full((60, 3), (0, 255, 0), np.uint8), stride=stride)
    return nothing.search(np.zeros_like(image), where).attended


def test_a_silhouette_is_the_same_whichever_way_it_was_hit():
    image = scene((60, 50, 14, RED), (110, 80, 12, RED), (20, 100, 9, BLUE))
    truth = (image == RED).all(axis=2)
    for detector in PURE:
        found = detector.search(image, Everywhere()).silhouettes
        assert [s.box for s in found] == [(46, 36, 75, 65), (98, 68, 123, 93)]
        np.testing.assert_array_equal(np.any([s.paint((120, 160)) for s in found], axis=0), truth)
        assert detector.detect(image, Everywhere()).labels == ("target", "target")


def test_the_scan_finds_a_best_window_that_the_coarse_grid_steps_over():
    image = np.full((120, 160, 3), 128, np.uint8)
    image[41:61, 51:57], image[41:61, 57:63] = RED, BLUE  # a window one row off loses of both
    flag = np.array([RED, BLUE] * 50, np.uint8)
    coarse, fine = (HistogramDetector(flag, way=w).search(image, Everywhere()) for w in WAYS[:2])
    best = max(s.score for s in fine.silhouettes)
    assert best == pytest.approx(
        reference_scores(image, [(47, 41)], 20, HistogramDetector(flag).model)[0], abs=1e-6
    )
    assert best > max(s.score for s in coarse.silhouettes)


def test_windows_that_are_named_score_alike_in_all_ways_that_count():
    image, where = motley(), Windows(np.array([[60, 50], [20, 20], [110, 80]]), 16)
    np.testing.assert_array_equal(SCAN.search(image, where).hits, WINDOWS.search(image, where).hits)


def test_a_back_projected_window_scores_by_its_share_of_pixels_of_the_target_s_colours():
    image = motley()
    marked = PROJECTION.back_project(image) > 0
    scores = PROJECTION.scores(image)
    assert scores.shape == (101, 141)
    for u, v in ((0, 0), (140, 100), (47, 33)):
        share = marked[v : v + 20, u : u + 20].mean()
        assert scores[v, u] == pytest.approx(share, abs=1e-6)
        assert PROJECTION._score(hsv(image[v : v + 20, u : u + 20])) == pytest.approx(share)


@pytest.mark.parametrize("detector", [SCAN, PROJECTION], ids=lambda d: d.way)
def test_windows_that_were_not_asked_for_score_zero(detector):
    image, where = motley(), Tiles(np.array([[40, 30, 70, 60], [90, 70, 125, 95]]))
    everywhere, some = detector.scores(image), detector.scores(image, where)
    asked = np.zeros(some.shape, bool)
    asked[30:41, 40:51] = asked[70:76, 90:106] = True
    np.testing.assert_array_equal(some, np.where(asked, everywhere, 0.0))
    assert (everywhere[asked] > 0).any() and (everywhere[~asked] > 0).any()


def test_a_pixel_s_index_is_its_bin_of_the_histogram():
    colours = np.random.default_rng(3).integers(0, 256, (50, 200, 3)).astype(np.uint8)
    colours[25:, :, :] //= 8  # about the least value, with every saturation
    index = bin_indices(colours)
    counts = np.bincount(index[index < NO_BIN], minlength=NO_BIN)
    np.testing.assert_array_equal(counts, histogram(hsv(colours)).ravel())
    grey = np.repeat(np.arange(256, dtype=np.uint8), 3).reshape(16, 16, 3)
    assert (bin_indices(grey) == NO_BIN).all()


def test_every_colour_there_is_has_the_bin_that_opencv_gives_it():
    level = np.arange(256, dtype=np.uint8)
    for red in range(0, 256, 16):
        cube = np.stack(np.meshgrid(level[red : red + 16], level, level, indexing="ij"), axis=-1)
        cube = cube.reshape(16 * 256, 256, 3)
        hue, saturation, value = hsv(cube).astype(int).transpose(2, 0, 1)
        expected = hue * BINS[0] // 180 * BINS[1] + saturation * BINS[1] // 256
        expected[(saturation < MIN_SATURATION) | (value < MIN_VALUE)] = NO_BIN
        np.testing.assert_array_equal(bin_indices(cube), expected)


@pytest.mark.parametrize("size", [20, 1, 33])
def test_some_windows_score_the_bits_that_the_scan_of_the_whole_image_gives_them(size):
    image, scan = motley(shape=(90, 130)), HistogramDetector(TARGET, way="scan", window=size)
    everywhere = scan.scores(image)
    corners = np.random.default_rng(4).integers((0, 0), (131 - size, 91 - size), (40, 2))
    corners = np.vstack([corners, [[0, 0], [130 - size, 90 - size]]])
    found = window_scores(image, corners, size, scan.model.ravel())
    np.testing.assert_array_equal(found, everywhere[corners[:, 1], corners[:, 0]])
    np.testing.assert_array_equal(
        found, window_scores(np.asfortranarray(image), corners[:, ::-1][:, ::-1], size, scan.model.ravel())
    )
    assert found.dtype == np.float32 and len(np.unique(found)) > 3
    assert window_scores(image, corners[:0], size, scan.model.ravel()).shape == (0,)


@pytest.mark.parametrize("gap", [0, 7])
def test_hits_of_windows_are_found_in_one_call_as_one_by_one(gap):
    rng = np.random.default_rng(3)
    image = motley(3, (60, 80))
    centres = rng.integers(-5, 90, (40, 2)).astype(np.int32)
    corners = Windows(centres, 12).corners((60, 80))
    scores = window_scores(image, corners, 12, SCAN.model.ravel())
    expected = merge_windows(corners[scores >= np.float32(0.2)], 12, gap=gap)
    assert len(expected) > 0
    found = window_hits(image, centres, 12, SCAN.model.ravel(), 0.2, gap=gap)
    np.testing.assert_array_equal(found, expected)
    assert window_hits(image, centres[:0], 12, SCAN.model.ravel(), 0.2).shape == (0, 4)
    with pytest.raises(ArgumentError, match="window"):
        window_hits(image, centres, 61, SCAN.model.ravel(), 0.2)
    with pytest.raises(ArgumentError, match="centres"):
        window_hits(image, centres[:, :1].copy(), 12, SCAN.model.ravel(), 0.2)


def test_pixels_beside_the_windows_do_not_matter():
    image = motley(shape=(90, 130))
    corners = np.random.default_rng(4).integers((0, 0), (111, 71), (6, 2))
    before = window_scores(image, corners, 20, SCAN.model.ravel())
    beside = np.ones((90, 130), bool)
    for u, v in corners:
        beside[v : v + 20, u : u + 20] = False
    image[beside] = 255 - image[beside]
    np.testing.assert_array_equal(window_scores(image, corners, 20, SCAN.model.ravel()), before)


PICTURE, CORNERS = np.zeros((30, 40, 3), np.uint8), np.zeros((2, 2), np.int32)
BIN_ARGUMENTS = {"bins": (30, 16), "min_saturation": 70, "min_value": 25}


@pytest.mark.parametrize(
    ("change", "message", "error"),
    [
        ({"rgb": PICTURE[..., 0]}, r"rgb must be \(H, W, 3\)", ArgumentError),
        (
            {"rgb": np.zeros((30, 40, 4), np.uint8)},
            r"rgb must be \(H, W, 3\), got \(30, 40, 4\)",
            ArgumentError,
        ),
        ({"rgb": PICTURE.astype(np.uint16)}, "rgb must be an array .* of uint8", ArgumentTypeError),
        ({"rgb": PICTURE[:0]}, "rgb", ArgumentError),
        ({"rgb": None}, "rgb", ArgumentTypeError),
        ({"bins": (0, 16)}, r"bins must be \(hues, saturations\)", ArgumentError),
        ({"bins": (181, 16)}, "bins", ArgumentError),
        ({"bins": (30, 257)}, "bins", ArgumentError),
        ({"bins": 30}, "bins", ArgumentTypeError),
        ({"min_saturation": 256}, "min_saturation must be at most 255, got 256", ArgumentError),
        ({"min_value": -1}, "min_value", ArgumentError),
        ({"min_value": 0.5}, "min_value", ArgumentTypeError),
    ],
)
def test_what_has_no_hues_is_named(change, message, error):
    given = {"rgb": PICTURE, **BIN_ARGUMENTS} | change
    with pytest.raises(error, match=message):
        _core.hue_saturation_bins(*given.values(), None)
    rgb, *bins = given.values()
    with pytest.raises(error, match=message):
        _core.window_intersections(rgb, CORNERS, np.ones(480), (20, 20), *bins)


@pytest.mark.parametrize(
    ("change", "message", "error"),
    [
        ({"corners": CORNERS.astype(np.int64)}, "corners must be an array .* int32", ArgumentTypeError),
        ({"corners": CORNERS[0]}, r"corners must be \(N, 2\)", ArgumentError),
        ({"corners": CORNERS[:, :1]}, r"corners must be \(N, 2\), got \(2, 1\)", ArgumentError),
        ({"corners": CORNERS - 1}, r"corners\[0, 0\]", ArgumentError),
        (
            {"corners": np.array([[0, 0], [21, 0]], np.int32)},
            r"from 0 to 20, got 21 at corners\[1, 0\]",
            ArgumentError,
        ),
        (
            {"corners": np.array([[0, 11]], np.int32)},
            r"from 0 to 10, got 11 at corners\[0, 1\]",
            ArgumentError,
        ),
        ({"target": np.ones(479)}, "target must be one share for each of 480 bins, got 479", ArgumentError),
        ({"target": np.zeros(480)}, "target is zero everywhere", ArgumentError),
        ({"target": np.full(480, np.nan)}, r"target\[0\]", ArgumentError),
        ({"window": (31, 20)}, "window must be .*, got \\(31, 20\\)", ArgumentError),
        ({"window": 20}, "window", ArgumentTypeError),
    ],
)
def test_what_is_no_window_of_an_image_is_named(change, message, error):
    given = {"corners": CORNERS, "target": np.ones(480), "window": (20, 20)} | change
    with pytest.raises(error, match=message):
        _core.window_intersections(PICTURE, *given.values(), *BIN_ARGUMENTS.values())


def test_bins_are_written_where_they_are_asked_for_and_not_over_the_image():
    out = np.full((120, 160), 9, np.uint16)
    assert _core.hue_saturation_bins(motley(), *BIN_ARGUMENTS.values(), out) is out
    np.testing.assert_array_equal(out, bin_indices(motley()))
    memory = np.zeros((6, 8, 3), np.uint8)
    with pytest.raises(ArgumentError, match="out overlaps an input"):
        over = memory.view(np.uint8).reshape(-1)[:96].view(np.uint16).reshape(6, 8)
        _core.hue_saturation_bins(memory, *BIN_ARGUMENTS.values(), over)


# Where they look.


@pytest.mark.parametrize("detector", PURE, ids=lambda d: d.way)
def test_a_tile_is_looked_at_by_the_windows_inside_it_and_nothing_else_is(detector):
    image = scene((60, 50, 14, RED))
    tile = Tiles(np.array([[100, 20, 131, 67]]))
    attended = detector.search(image, tile).attended
    v, u = np.nonzero(attended)
    assert (u.min(), v.min(), u.max() + 1, v.max() + 1) == (100, 20, 131, 67)
    assert attended.sum() == 31 * 47 and detector.detect(image, tile).attended == 31 * 47
    (found,) = detector.search(image, Tiles(np.array([[40, 30, 80, 70], [45, 30, 90, 70]]))).silhouettes
    assert found.box == (46, 36, 75, 65)


@pytest.mark.parametrize("detector", PURE, ids=lambda d: d.way)
def test_a_tile_smaller_than_a_window_is_looked_at_by_one_around_its_middle(detector):
    image = scene(shape=(60, 80))
    for tile, corner in (([40, 30, 41, 31], (30, 20)), ([0, 59, 2, 60], (0, 40)), ([70, 0, 80, 19], (60, 0))):
        v, u = np.nonzero(detector.search(image, Tiles(np.array([tile]))).attended)
        assert (u.min(), v.min()) == corner and len(u) == 400


@pytest.mark.parametrize("detector", PURE, ids=lambda d: d.way)
def test_an_empty_mask_no_tiles_and_a_one_pixel_mask(detector):
    image, mask = scene((60, 50, 14, RED)), np.zeros((120, 160), bool)
    for nothing in (Mask(mask), Tiles(np.zeros((0, 4), int)), Windows(np.zeros((0, 2), int))):
        found = detector.detect(image, nothing)
        assert len(found) == 0 and found.attended == 0
    mask[18, 22] = True  # on every grid: of the window with the corner (12, 8)
    v, u = np.nonzero(detector.search(image, Mask(mask)).attended)
    assert (u.min(), v.min(), len(u)) == (12, 8, 400)


def test_what_a_scan_was_not_told_to_look_at_does_not_matter():
    image = scene((60, 50, 14, RED), (110, 80, 12, RED))
    mask = np.zeros((120, 160), bool)
    mask[40:70, 40:75] = mask[100:105, 140:150] = True
    scan = PURE[1]
    search = scan.search(image, Mask(mask))
    assert [s.box for s in search.silhouettes] == [(46, 36, 75, 65)]
    noise = np.random.default_rng(0).integers(0, 256, image.shape)
    spoilt = np.where(search.attended[..., None], image, noise).astype(np.uint8)
    again = scan.search(spoilt, Mask(mask))
    np.testing.assert_array_equal(again.hits, search.hits)
    np.testing.assert_array_equal(again.attended, search.attended)
    assert search.attended.sum() < 0.5 * search.attended.size


def test_hits_from_which_nothing_grows_are_not_all_tried(monkeypatch):
    """Specks smaller than the least area, in hundreds of windows: one try per neighbourhood."""
    image = np.full((120, 160, 3), 128, np.uint8)
    image[10:110:3, 10:150:3] = RED
    tries, grow = [], silhouettes._grow
    monkeypatch.setattr(silhouettes, "_grow", lambda *given: tries.append(given[1]) or grow(*given))
    search = PURE[1].search(image, Everywhere())
    assert len(search.hits) > 1000 and search.silhouettes == ()
    assert 4 < len(tries) <= (120 // 10) * (160 // 10)


@pytest.mark.parametrize(
    ("box", "message"),
    [
        (
            [0, 0, 161, 10],
            r"boxes\[1\]: pixels u0 < u1, v0 < v1 of .* 160 x 120 expected, got \[0, 0, 161, 10\]",
        ),
        ([-1, 0, 20, 20], r"boxes\[1\]"),
        ([10, 10, 10, 40], r"boxes\[1\]"),
        ([10, 40, 40, 30], r"boxes\[1\]"),
    ],
)
def test_a_tile_that_is_empty_or_not_inside_the_image_is_named(box, message):
    for detector in (WINDOWS, SCAN, PROJECTION):
        with pytest.raises(ArgumentError, match=message):
            detector.detect(scene(), Tiles(np.array([[0, 0, 30, 30], box])))


@pytest.mark.parametrize("detector", [SCAN, PROJECTION], ids=lambda d: d.way)
def test_what_cannot_be_looked_at_is_named(detector):
    with pytest.raises(ArgumentError, match="image: 80 x 10 is smaller than the window of 20 px"):
        detector.detect(np.zeros((10, 80, 3), np.uint8), Everywhere())
    with pytest.raises(ArgumentError, match=r"mask: shape \(120, 160\) expected, got \(160, 120\)"):
        detector.detect(scene(), Mask(np.zeros((160, 120), bool)))
    with pytest.raises(ArgumentTypeError, match="image: a uint8 array"):
        detector.detect(scene().astype(np.uint16), Everywhere())
    with pytest.raises(ArgumentError, match="image: shape"):
        detector.detect(np.zeros((60, 80, 4), np.uint8), Everywhere())
    with pytest.raises(ArgumentTypeError, match=r"where: .* got Windows"):
        detector.scores(scene(), Windows(np.array([[5, 5]])))
    with pytest.raises(
        ArgumentError, match="way: one of windows, scan, back-projection expected, got 'fast'"
    ):
        HistogramDetector(TARGET, way="fast")
