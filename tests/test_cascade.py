"""Cascade classifiers on tiles, on drawn faces."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from motorprime import Detector, Everywhere, Mask, Tiles
from motorprime.detectors.cascade import Cascade
from motorprime.errors import ArgumentError, ArgumentTypeError, MissingExtraError
from motorprime.evaluate.drawn import faces
from motorprime.evaluate.regions import any_box
from motorprime.where import paint

NAME = "haarcascade_frontalface_default.xml"
SHAPE = (300, 400)
HERE = hasattr(cv2, "CascadeClassifier")
needs_cascades = pytest.mark.skipif(not HERE, reason="this OpenCV has no cascade classifiers")


@pytest.fixture(scope="module")
def scene():
    return faces(np.random.default_rng(2), SHAPE, 5)


def near(found, face):
    """How many findings have their centre in the middle of a face."""
    centres = (found.boxes[:, :2] + found.boxes[:, 2:]) / 2
    return int((np.abs(centres - face[:2]).max(axis=1) < 0.2 * face[2]).sum())


@needs_cascades
def test_every_face_is_found_once_in_the_image_and_on_tiles(scene):
    image, drawn = scene
    detector = Cascade(NAME, label="face")
    assert isinstance(detector, Detector) and not detector.exact and len(drawn) == 5
    full = detector.detect(image, Everywhere())
    assert set(full.labels) == {"face"} and (np.diff(full.scores) <= 0).all()
    halves = Tiles(np.array([[0, 0, 200, 300], [200, 0, 400, 300]]))
    for found in (full, detector.detect(image, halves)):
        assert [near(found, face) for face in drawn] == [1] * 5


@needs_cascades
def test_a_face_is_found_where_it_is_asked_for(scene):
    image, drawn = scene
    detector = Cascade(NAME)
    for face in drawn:
        u, v = face[:2].astype(int)
        part = detector.detect(image, Mask(paint([[u - 12, v - 12, u + 12, v + 12]], SHAPE)))
        assert near(part, face) == len(part) == 1
        assert part.attended < SHAPE[0] * SHAPE[1]
    full = detector.detect(image, Everywhere())
    everything = np.array([0, 0, 400, 300])
    assert any_box(full, full, everything) == (len(full), len(full))


@needs_cascades
def test_nothing_asked_for_is_nothing_found(scene):
    assert len(Cascade(NAME).detect(scene[0], Mask(np.zeros(SHAPE, bool)))) == 0


@needs_cascades
@pytest.mark.parametrize(
    ("options", "name", "error"),
    [
        ({"scale": 1.0}, "scale", ArgumentError),
        ({"scale": np.nan}, "scale", ArgumentError),
        ({"neighbours": -1}, "neighbours", ArgumentError),
        ({"smallest": 0}, "smallest", ArgumentError),
        ({"halo": 1.5}, "halo", ArgumentTypeError),
    ],
)
def test_options_that_make_no_sense_are_named(options, name, error):
    with pytest.raises(error, match=name):
        Cascade(NAME, **options)


@needs_cascades
def test_a_file_that_is_no_cascade_is_named(tmp_path, capfd):
    (tmp_path / "text.xml").write_text("no cascade")
    (tmp_path / "empty.xml").write_text("<?xml version='1.0'?><opencv_storage></opencv_storage>")
    for path in (tmp_path / "text.xml", tmp_path / "empty.xml", "no_such_cascade.xml"):
        with pytest.raises(ArgumentError, match=r"cascade: the \.xml of a cascade classifier expected"):
            Cascade(path)


def test_an_opencv_without_cascades_says_what_to_install(monkeypatch):
    monkeypatch.delattr(cv2, "CascadeClassifier", raising=False)
    with pytest.raises(MissingExtraError, match=r"opencv-python-headless 4 .*opencv4"):
        Cascade(NAME)
