"""Reading lines of text: a small network that the tests write, and a real one."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import tiny_onnx
from motorprime import Detections, Everywhere
from motorprime.detectors.reading import ReadText, TextReader
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.evaluate import text_model

pytestmark = pytest.mark.onnx

BLANK, LETTER, SPACE = (0, 0, 255), (0, 255, 0), (255, 0, 0)


@pytest.fixture
def reader(tmp_path):
    (tmp_path / "reader.onnx").write_bytes(tiny_onnx.reader_network())
    return TextReader(tmp_path / "reader.onnx", mean=0.0, scale=1 / 255)


def line(*colours, wide=12):
    """Stripes of colours, 48 px high: what the small network takes for text."""
    image = np.zeros((100, 200, 3), np.uint8)
    for k, colour in enumerate(colours):
        image[20:68, 10 + wide * k : 10 + wide * (k + 1)] = colour
    return image, (10, 20, 10 + wide * len(colours), 68)


@pytest.mark.parametrize(
    ("colours", "text"),
    [
        ((BLANK, LETTER, BLANK), "A"),
        ((LETTER, LETTER, LETTER), "A"),  # one letter, however wide
        ((LETTER, BLANK, LETTER), "AA"),
        ((LETTER, SPACE, LETTER, BLANK), "A A"),
        ((BLANK, BLANK), ""),
    ],
)
def test_equal_neighbours_are_one_letter_and_blanks_are_none(reader, colours, text):
    image, box = line(*colours)
    ((read, likely),) = reader.read(image, [box])
    assert read == text
    assert likely == (pytest.approx(1.0, abs=0.02) if text else 0.0)


def test_every_box_is_read_and_what_lies_outside_the_image_is_not(reader):
    image, box = line(LETTER, BLANK, LETTER)
    texts = [
        text for text, _ in reader.read(image, [box, (10, 20, 20, 68), (-50, -50, -5, -5), (-9, 20, 20, 68)])
    ]
    assert texts[:3] == ["AA", "A", ""] and "A" in texts[3]
    assert reader.read(image, np.zeros((0, 4))) == []


def test_what_is_read_is_the_label(reader):
    image, box = line(LETTER, BLANK, LETTER)

    class Finder:
        def detect(self, image, where):
            return Detections(np.array([box], np.float32), np.array([0.7], np.float32), ("text",), 77)

    seen = ReadText(Finder(), reader).detect(image, Everywhere())
    assert seen.labels == ("AA",) and seen.scores.tolist() == pytest.approx([0.7]) and seen.attended == 77


def test_models_and_boxes_that_cannot_be_read_are_named(reader, tmp_path):
    path = tmp_path / "other.onnx"
    for content, words in (
        (tiny_onnx.reader_network(None), "metadata 'character' expected, found none"),
        (tiny_onnx.reader_network("A\nB", classes=3), r"output \(1, T, 4\) expected, found 'likely'"),
        (tiny_onnx.map_network(), "metadata 'character'"),
        (b"none", "an ONNX model expected"),
    ):
        path.write_bytes(content)
        with pytest.raises(ArgumentError, match=words):
            TextReader(path)
    image = line(LETTER)[0]
    with pytest.raises(ArgumentError, match="boxes"):
        reader.read(image, [(1, 2, 3)])
    with pytest.raises(ArgumentError, match="boxes"):
        reader.read(image, [(1, 2, 3, np.nan)])
    with pytest.raises(ArgumentTypeError, match="image"):
        reader.read(image.astype(np.uint16), [(1, 2, 3, 4)])

    class Broken:
        def run(self, outputs, inputs):
            raise RuntimeError("no")

    reader._session = Broken()
    with pytest.raises(StateError, match="it failed on an input"):
        reader.read(image, [(10, 20, 22, 68)])


def test_the_real_reader_reads_what_is_printed():
    if not text_model.READER.is_file():
        pytest.skip(f"the text reader was not fetched: {text_model.HINT}")
    real, image = text_model.text_reader(), np.full((120, 300, 3), 235, np.uint8)
    cv2.putText(image, "BREAD", (20, 50), cv2.FONT_HERSHEY_DUPLEX, 1.2, (20, 20, 60), 2, cv2.LINE_AA)
    cv2.putText(image, "37", (200, 100), cv2.FONT_HERSHEY_DUPLEX, 1.2, (20, 20, 60), 2, cv2.LINE_AA)
    texts = real.read(image, [(12, 16, 160, 58), (192, 66, 260, 108)])
    assert [text for text, _ in texts] == ["BREAD", "37"]
    assert min(likely for _, likely in texts) > 0.8


def test_a_reader_that_was_not_fetched_says_how_to(monkeypatch, tmp_path):
    monkeypatch.setattr(text_model, "READER", tmp_path / "none.onnx")
    with pytest.raises(StateError, match="fetch it by"):
        text_model.text_reader()
