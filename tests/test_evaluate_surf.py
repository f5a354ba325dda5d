"""``motorprime evaluate surf``: its figures mean what they say, and what it refuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from motorprime import Surf, cli
from motorprime.bench.timing import Effort
from motorprime.errors import ArgumentError
from motorprime.evaluate import surf as evaluation
from motorprime.evaluate.surf import compare_masks, draw_masks, evaluate_surf, golden_files, odd_masks
from motorprime.evaluate.surf_pairs import agreement, compare_golden, evaluate_pair
from motorprime.evaluate.textures import draw_texture

ONCE = Effort(rounds=1, batch_us=0.001, least=1, most=1)
SMALL = {"images": 1, "shape": (100, 140), "effort": ONCE}


def test_the_figures_are_there_and_what_was_compared_is_the_same():
    result = evaluate_surf(seed=3, golden=golden_files()[:1], **SMALL)
    assert {"full_ms", "mask30", "mask10", "scattered30", "two_threads", "identical"} <= set(result)
    assert result["identical"] is True and result["compared"] > 30 and result["keypoints"] > 30
    assert result["golden"]["found"] >= 0.95 and result["golden"]["cosine_share"] >= 0.95
    assert result["opencv342_ratio"] is None and result["graf"] is None
    json.dumps(result)


def test_the_same_seed_draws_the_same_and_another_seed_other_images():
    keys = ("keypoints", "compared")
    first, again, other = (evaluate_surf(seed=seed, **SMALL) for seed in (1, 1, 2))
    assert [first[k] for k in keys] == [again[k] for k in keys] != [other[k] for k in keys]
    np.testing.assert_array_equal(draw_texture(5, 40, 50), draw_texture(5, 40, 50))


def test_masks_cover_what_their_names_say():
    masks = draw_masks(np.random.default_rng(0), (240, 320))
    for name, share in (("mask30", 0.3), ("mask10", 0.1), ("scattered30", 0.3)):
        assert masks[name].mean() == pytest.approx(share, abs=0.02)
    v, u = np.nonzero(masks["mask30"])
    assert (np.ptp(v) + 1) * (np.ptp(u) + 1) == masks["mask30"].sum()
    odd = odd_masks(np.random.default_rng(0), (240, 320))
    assert (
        0 < odd["pixels"].sum() <= 200
        and odd["lines"].all(axis=0).any()
        and 0.25 < odd["noise"].mean() < 0.35
    )


def test_a_mask_that_changes_a_keypoint_would_be_seen(monkeypatch):
    class Wrong(Surf):
        def detect(self, gray, mask=None):
            keypoints, descriptors = super().detect(gray, mask)
            if mask is not None and len(descriptors):
                descriptors = descriptors.copy()
                descriptors[-1, 5] = np.nextafter(descriptors[-1, 5], 2)
            return keypoints, descriptors

    image, masks = draw_texture(1, 100, 140), {"all": np.ones((100, 140), bool)}
    assert compare_masks(image, masks, 300.0)[0] is True
    monkeypatch.setattr(evaluation, "Surf", Wrong)
    assert not compare_masks(image, masks, 300.0)[0]


def test_agreement_wants_place_size_and_descriptor():
    keypoints, descriptors = Surf().detect(draw_texture(1, 100, 140))
    rows = np.stack([keypoints[name].astype(float) for name in ("u", "v", "size")], axis=1)
    exact = descriptors.astype(float)
    found, cosines = agreement(keypoints, descriptors, rows, exact)
    assert found.all() and cosines.min() > 0.9999
    for shift, all_found in (((0.7, 0.7, 0), True), ((0, 1.5, 0), False), ((0, 0, 6), False)):
        found, _ = agreement(keypoints[:1], descriptors[:1], rows[:1] + shift, exact[:1])
        assert found.all() == all_found
    _, cosines = agreement(keypoints, descriptors, rows, -exact)
    assert cosines.max() < -0.9999


def write_pair(folder, homography):
    first = draw_texture(9, 300, 400)
    cv2.imwrite(str(folder / "graf1.png"), first)
    cv2.imwrite(str(folder / "graf3.png"), cv2.warpPerspective(first, homography, (400, 300)))
    storage = cv2.FileStorage(str(folder / "H1to3p.xml"), cv2.FILE_STORAGE_WRITE)
    storage.write("H13", homography)
    storage.release()


def test_a_pair_of_views_repeats_itself_and_only_by_the_right_homography(tmp_path):
    # By multiples of 8 px, so that the samples of all octaves fall on the same places again.
    shift = np.array([[1.0, 0.0, 40.0], [0.0, 1.0, -24.0], [0.0, 0.0, 1.0]])
    write_pair(tmp_path, shift)
    right = evaluate_pair(tmp_path, 300.0)
    # Some are so near to the border of the other view that no filter fits there.
    assert right["repeatability"] > 0.85 and right["matching"] > 0.8 and right["precision"] > 0.9
    assert right["mutual"] <= right["matching"]
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    write_pair(wrong, shift)
    storage = cv2.FileStorage(str(wrong / "H1to3p.xml"), cv2.FILE_STORAGE_WRITE)
    storage.write("H13", np.linalg.inv(shift))
    storage.release()
    assert evaluate_pair(wrong, 300.0)["matching"] < 0.05


def test_files_and_interpreters_that_do_not_serve_are_named(tmp_path):
    (tmp_path / "surf-x.npz").write_text("nothing")
    with pytest.raises(ArgumentError, match=r"golden: .*surf-x"):
        compare_golden([tmp_path / "surf-x.npz"])
    with pytest.raises(ArgumentError, match="opencv342: cannot run"):
        evaluate_surf(opencv342=tmp_path / "no-python", **SMALL)
    for name in ("graf1.png", "graf3.png", "H1to3p.xml"):
        with pytest.raises(ArgumentError, match=name):
            evaluation.check_folder(tmp_path)
        (tmp_path / name).write_text("<?xml version='1.0'?><opencv_storage><a>1</a></opencv_storage>")
    evaluation.check_folder(tmp_path)
    with pytest.raises(ArgumentError, match="graf"):
        evaluate_pair(tmp_path, 300.0)
    with pytest.raises(ArgumentError, match="images"):
        evaluate_surf(images=0)


def test_an_interpreter_without_that_opencv_is_named(tmp_path):
    silent = tmp_path / "python"
    silent.write_text("#!/bin/sh\n")
    silent.chmod(0o755)
    for python, found in ((silent, "none"), (Path(sys.executable), cv2.__version__)):
        with pytest.raises(ArgumentError, match=rf"OpenCV 3\.4\.2 expected, .* has {found}"):
            evaluate_surf(opencv342=python, **SMALL)


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["motorprime", *map(str, arguments)])
    try:
        cli.main()
    except SystemExit as end:
        return end.code
    return 0


def test_the_command_writes_its_figures(tmp_path, monkeypatch):
    file = tmp_path / "surf.json"
    options = ["--images", 1, "--width", 96, "--height", 80, "--json", file]
    assert run(monkeypatch, "evaluate", "surf", *options) == 0
    result = json.loads(file.read_text())
    assert result["identical"] is True and result["shape"] == [80, 96] and result["golden"]["found"] >= 0.95
    assert run(monkeypatch, "evaluate", "surf", "--images", 0) == 2
    assert run(monkeypatch, "evaluate", "surf", "--graf", tmp_path) != 0
