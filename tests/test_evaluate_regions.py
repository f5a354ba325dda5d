"""What ``evaluate regions`` counts as recovered, what it draws, and its command."""

import json
import sys

import cv2
import numpy as np
import pytest

from motorprime import Detections, Keypoints, cli
from motorprime.detectors import KEYPOINT
from motorprime.errors import ArgumentError, MissingExtraError
from motorprime.evaluate import regions as evaluation
from motorprime.evaluate.drawn import GAP, faces, labelled, textured
from motorprime.evaluate.regions import compact_tile, evaluate_regions, same_boxes, same_keypoints

BOX = np.array([10, 10, 50, 40])


def keypoints(*rows):
    points = np.zeros(len(rows), KEYPOINT)
    for k, row in enumerate(rows):
        points[k] = (*row, 1.0, 0)
    return Keypoints.of(points, np.zeros((len(rows), 1)))


def boxes(*rows, score=0.9):
    return Detections(
        np.array(rows, np.float32).reshape(-1, 4), np.full(len(rows), score, np.float32), ("x",) * len(rows)
    )


def test_keypoints_are_recovered_within_a_tenth_of_a_pixel_two_percent_and_two_degrees():
    full = keypoints((20.0, 20.0, 10.0, 0.01))
    for change, same in (
        ((0.09, 0.0, 0.0, 0.0), 1), ((0.0, 0.11, 0.0, 0.0), 0), ((0.08, 0.08, 0.0, 0.0), 0),
        ((0.0, 0.0, 0.19, 0.0), 1), ((0.0, 0.0, 0.21, 0.0), 0),
        ((0.0, 0.0, 0.0, -0.03), 1), ((0.0, 0.0, 0.0, 2 * np.pi - 0.03), 1), ((0.0, 0.0, 0.0, 0.04), 0),
    ):  # fmt: skip
        moved = tuple(np.add((20.0, 20.0, 10.0, 0.01), change))
        part = keypoints(moved, (30, 30, 5, 0))
        assert same_keypoints(full, part, BOX) == (1, same), change


def test_only_keypoints_whose_rounded_place_is_in_the_box_are_expected():
    full = keypoints((9.4, 20, 5, 0), (9.6, 20, 5, 0), (49.4, 39.4, 5, 0), (49.6, 20, 5, 0), (20, 39.6, 5, 0))
    assert same_keypoints(full, full, BOX) == (2, 2)
    assert same_keypoints(full, keypoints(), BOX) == (2, 0)
    assert same_keypoints(keypoints(), full, BOX) == (0, 0)


def test_boxes_are_expected_wholly_inside_and_sure_and_recovered_at_seven_tenths():
    inside, outside = (10, 10, 30, 20), (9, 10, 30, 20)
    assert same_boxes(boxes(inside, outside), boxes(inside, outside), BOX) == (1, 1)
    assert same_boxes(boxes(inside, score=0.59), boxes(inside), BOX) == (0, 0)
    assert same_boxes(boxes(inside), boxes((10, 10, 25, 20)), BOX) == (1, 1)  # 0.75
    assert same_boxes(boxes(inside), boxes((10, 10, 23, 20)), BOX) == (1, 0)  # 0.65
    assert same_boxes(boxes(inside), boxes(), BOX) == (1, 0)


@pytest.mark.parametrize(("shape", "align"), [((720, 1280), 16), ((720, 1248), 48), ((480, 640), 32)])
def test_tiles_are_compact_aligned_and_just_over_thirty_percent(shape, align):
    seen = set()
    for seed in range(40):
        ((u0, v0, u1, v1),) = compact_tile(np.random.default_rng(seed), shape, align)
        assert 0 <= u0 < u1 <= shape[1] and 0 <= v0 < v1 <= shape[0]
        assert not any(edge % align for edge in (u0, v0, u1, v1))
        assert 0.3 <= (u1 - u0) * (v1 - v0) / (shape[0] * shape[1]) < 0.31
        assert 0.45 < (u1 - u0) / (v1 - v0) < 2.2
        seen.add((u0, v0, u1, v1))
    assert len(seen) > 20
    with pytest.raises(ArgumentError, match="align"):
        compact_tile(np.random.default_rng(0), (64, 64), 100)


def test_images_are_drawn_from_a_seed():
    for draw in (textured, lambda *a: labelled(*a)[0], lambda *a: faces(*a)[0]):
        first, again, other = (draw(np.random.default_rng(seed), (200, 320)) for seed in (3, 3, 4))
        np.testing.assert_array_equal(first, again)
        assert first.shape == (200, 320, 3) and first.dtype == np.uint8 and first.std() > 5
        assert (first != other).any()


def test_labels_are_apart_and_inside():
    _, plates = labelled(np.random.default_rng(1), (480, 640))
    assert len(plates) >= 10
    for k, (u0, v0, u1, v1) in enumerate(plates):
        assert u0 >= 0 and v0 >= 0 and u1 <= 640 and v1 <= 480
        for a0, b0, a1, b1 in plates[:k]:
            assert u0 >= a1 + GAP or a0 >= u1 + GAP or v0 >= b1 + GAP or b0 >= v1 + GAP


# The whole.

NAMES = {"sift", "akaze", "kaze", "orb", "brisk", "orb_2", "brisk_48", "text", "cascade"}


@pytest.fixture
def small(monkeypatch):
    """Small images, and counting seconds that are no seconds."""
    quick = {"sift": evaluation.DETECTORS["sift"], "brisk_48": evaluation.DETECTORS["brisk_48"]}
    small_ones = {name: (make, (240, 288)) for name, (make, _) in quick.items()}
    monkeypatch.setattr(evaluation, "DETECTORS", small_ones)
    monkeypatch.setattr(evaluation, "TEXT_SHAPE", (256, 320))


def test_every_detector_has_its_figures(small, tmp_path):
    threads = cv2.getNumThreads()
    figures = evaluate_regions(images=1, rounds=1, seed=2, text_model=tmp_path / "none.onnx")
    assert cv2.getNumThreads() == threads
    assert set(figures) == {"seed", "images", "rounds", "fraction", "cover", *NAMES} - {
        "akaze", "kaze", "orb", "brisk", "orb_2"
    }  # fmt: skip
    sift = figures["sift"]
    assert set(sift) == {"ratio", "recovered", "expected", "full_ms", "attended_ms", "pixels_read"}
    assert sift["recovered"] > 0.9 and sift["expected"] > 50
    assert 0.3 < sift["pixels_read"] <= 1.0 and sift["ratio"] == sift["attended_ms"] / sift["full_ms"]
    assert figures["text"]["ratio"] is None and "fetch it by" in figures["text"]["reason"]
    assert figures["cover"]["regions"]["cases"] == 20
    json.dumps(figures, allow_nan=False)


def test_a_detector_that_is_not_there_has_a_reason_and_no_figures(small, monkeypatch, tmp_path):
    def lacking():
        raise MissingExtraError("SIFT", "opencv4")

    monkeypatch.setattr(evaluation, "DETECTORS", {"sift": (lacking, (240, 288))})
    figures = evaluate_regions(images=1, rounds=1, text_model=tmp_path / "none.onnx")["sift"]
    assert figures["ratio"] is figures["recovered"] is None and "opencv4" in figures["reason"]


def test_all_that_is_asked_for_is_measured():
    assert {*evaluation.DETECTORS, "text", "cascade"} == NAMES


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["motorprime", *map(str, arguments)])
    try:
        cli.main()
    except SystemExit as end:
        return end.code
    return 0


def test_the_command_prints_a_table_and_writes_json(small, monkeypatch, capsys, tmp_path):
    path = tmp_path / "regions.json"
    options = ["--images", 1, "--rounds", 1, "--seed", 4, "--text-model", tmp_path / "no.onnx"]
    assert run(monkeypatch, "evaluate", "regions", *options, "--json", path) == 0
    assert "sift.recovered" in capsys.readouterr().out
    written = json.loads(path.read_text())
    assert written["seed"] == 4 and written["sift"]["expected"] > 0


def test_help_says_what_is_measured(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "200")
    assert run(monkeypatch, "evaluate", "regions", "--help") == 0
    shown = capsys.readouterr().out
    for word in ("--images", "--seed", "--json", "--text-model", "recovered", "pixels_read", "brisk_48"):
        assert word in shown
    run(monkeypatch, "evaluate", "--help")
    assert "regions" in capsys.readouterr().out


def test_nothing_to_measure_is_refused(monkeypatch, capsys):
    assert run(monkeypatch, "evaluate", "regions", "--images", 0) == 2
    assert "--images" in capsys.readouterr().err
    with pytest.raises(ArgumentError, match="rounds"):
        evaluate_regions(rounds=0)
