"""Networks in ONNX files as detectors: small ones that the tests write, and a real text detector."""

from __future__ import annotations

import numpy as np
import pytest

import tiny_onnx
from motorprime import Detector, Everywhere, Guarded, Mask, Tiles
from motorprime.detectors.onnx import ColumnBoxes, OnnxDetector, RowBoxes, TextMap
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.evaluate import text_model
from motorprime.evaluate.drawn import labelled
from motorprime.evaluate.regions import same_boxes
from motorprime.where import paint

pytestmark = pytest.mark.onnx

SHAPE = (120, 200)


@pytest.fixture
def write(tmp_path):
    def file(content, name="net.onnx"):
        (tmp_path / name).write_bytes(content)
        return tmp_path / name

    return file


def bright(*rectangles, shape=SHAPE, value=255):
    image = np.zeros((*shape, 3), np.uint8)
    for u0, v0, u1, v1 in rectangles:
        image[v0:v1, u0:u1] = value
    return image


def found(detections):
    return sorted(map(tuple, detections.boxes.round().astype(int).tolist()))


PLAIN = TextMap(unclip=0.0)


# Maps.


def test_a_map_s_regions_are_boxes_in_the_image_s_pixels(write):
    detector = OnnxDetector(write(tiny_onnx.map_network()), PLAIN, halo=16, align=16)
    assert isinstance(detector, Detector)
    rectangles = [(10, 12, 40, 24), (90, 50, 130, 62), (180, 100, 200, 120)]
    image = bright(*rectangles)
    full = detector.detect(image, Everywhere())
    assert found(full) == rectangles
    assert full.scores.tolist() == pytest.approx([1.0] * 3) and set(full.labels) == {"text"}
    part = detector.detect(image, Mask(paint([[100, 50, 120, 60]], SHAPE)))
    assert found(part) == [(90, 50, 130, 62)]
    assert part.attended == 64 * 48  # columns 80 to 144, rows 32 to 80


def test_a_region_that_tiles_cut_is_joined(write):
    detector = OnnxDetector(write(tiny_onnx.map_network()), PLAIN, halo=0, align=8)
    image = bright((60, 30, 150, 42))
    halves = Tiles(np.array([[0, 0, 104, 120], [104, 0, 200, 120]]))
    assert found(detector.detect(image, halves)) == [(60, 30, 150, 42)]


def test_pixels_are_scaled_and_their_channels_ordered(write):
    path = write(tiny_onnx.map_network())
    image = bright((40, 40, 60, 60))
    image[40:60, 40:60] = (240, 120, 60)
    for channels, mean, expected in (
        ("rgb", (0, 0, 0), (240 + 120 + 60) / 3),
        ("rgb", (90, 0, 0), (150 + 120 + 60) / 3),
        ("bgr", (90, 0, 0), (240 + 120 - 30) / 3),
        ("bgr", (0, 0, 90), (150 + 120 + 60) / 3),
        ("rgb", 30.0, (210 + 90 + 30) / 3),
    ):
        detector = OnnxDetector(path, TextMap(0.2, 0.2), mean=mean, scale=1 / 255, channels=channels)
        assert detector.detect(image, Everywhere()).scores.tolist() == pytest.approx(
            [expected / 255], rel=1e-5
        )
    heavy = OnnxDetector(path, TextMap(0.2, 0.2), scale=(2 / 255, 0.0, 0.0)).detect(image, Everywhere())
    assert heavy.scores.tolist() == pytest.approx([480 / 3 / 255], rel=1e-5)


def test_a_region_grows_by_what_it_was_shrunk(write):
    """A line of w x h pixel steps grows by unclip w h / (2 (w + h)) to every side."""
    detector = OnnxDetector(write(tiny_onnx.map_network()), TextMap(unclip=1.6))
    ((u0, v0, u1, v1),) = detector.detect(bright((50, 50, 91, 61)), Everywhere()).boxes
    grown = 1.6 * 40 * 10 / (2 * 50)
    np.testing.assert_allclose((u0, v0, u1, v1), (50 - grown, 50 - grown, 91 + grown, 61 + grown), atol=0.01)


def test_faint_and_thin_regions_are_dropped(write):
    path = write(tiny_onnx.map_network())
    image = bright((20, 20, 60, 40), value=100)
    image[60:62, 20:60] = 255
    assert found(OnnxDetector(path, PLAIN).detect(image, Everywhere())) == []
    assert found(OnnxDetector(path, TextMap(score=0.35, unclip=0)).detect(image, Everywhere())) == [
        (20, 20, 60, 40)
    ]
    assert len(OnnxDetector(path, TextMap(side=1.0, unclip=0)).detect(image, Everywhere())) == 1


def test_what_lies_in_the_padding_is_no_finding(write):
    """The image ends at 200 x 120, the network sees 208 x 128 of it."""
    detector = OnnxDetector(write(tiny_onnx.map_network()), TextMap(unclip=3.0), align=16)
    ((u0, v0, u1, v1),) = detector.detect(bright((180, 100, 200, 120)), Everywhere()).boxes
    assert (u1, v1) == (200, 120) and u0 < 180 and v0 < 100
    # Black is not the mean: were the padding black, it would be as bright as the image is dark.
    inverse = OnnxDetector(write(tiny_onnx.map_network()), PLAIN, mean=255, scale=-1 / 255, align=16)
    image = np.full((*SHAPE, 3), 255, np.uint8)
    image[10:30, 10:30] = 0
    assert found(inverse.detect(image, Everywhere())) == [(10, 10, 30, 30)]


# Boxes.


@pytest.mark.parametrize(("name", "layout"), [("rows", RowBoxes), ("columns", ColumnBoxes)])
@pytest.mark.parametrize("batch", ["n", 1, 4])
def test_boxes_of_fixed_inputs_cover_any_image(write, name, layout, batch):
    """A network of 64 x 64 on an image of 200 x 120, with a halo."""
    detector = OnnxDetector(
        write(tiny_onnx.box_network(name, 64, batch=batch)), layout(("thing",)), halo=8, align=8
    )
    cells = [(8, 8, 16, 16), (96, 56, 104, 64), (192, 112, 200, 120), (48, 40, 56, 48)]
    image = bright(*cells)
    full = detector.detect(image, Everywhere())
    assert found(full) == sorted(cells) and set(full.labels) == {"thing"}
    part = detector.detect(image, Mask(paint([[90, 50, 110, 70]], SHAPE)))
    assert found(part) == [(96, 56, 104, 64)] and part.attended <= 2 * 64 * 64
    two = detector.detect(image, Tiles(np.array([[0, 0, 20, 20], [180, 100, 200, 120]])))
    assert found(two) == [(8, 8, 16, 16), (192, 112, 200, 120)]


def test_of_overlapping_boxes_of_a_class_the_best_stays():
    rows = np.array([[10, 10, 8, 8, 1, 0.9, 0.1], [11, 10, 8, 8, 1, 0.8, 0], [11, 10, 8, 8, 0.5, 0, 0.9],
                     [40, 40, 8, 8, 0.3, 0.5, 0]], np.float32)  # fmt: skip
    layout = RowBoxes(("a", "b"))
    seen = layout.read(rows, (64, 64))
    assert sorted(zip(seen.labels, seen.scores.tolist(), strict=True)) == [
        ("a", pytest.approx(0.9)), ("b", pytest.approx(0.45))
    ]  # fmt: skip
    columns = np.hstack([rows[:, :4], rows[:, 5:] * rows[:, 4:5]]).T
    same = ColumnBoxes(("a", "b")).read(columns, (64, 64))
    np.testing.assert_array_equal(same.boxes, seen.boxes)
    assert same.labels == seen.labels
    assert len(RowBoxes(("a", "b"), score=0.1).read(rows, (64, 64))) == 3
    assert len(RowBoxes(("a", "b"), overlap=0.9).read(rows, (64, 64))) == 3
    assert len(layout.read(np.zeros((0, 7), np.float32), (64, 64))) == 0
    assert seen.boxes[0].tolist() == [6, 6, 14, 14]
    at_border = np.array([[62, 1, 8, 8, 1, 0.9, 0]], np.float32)
    assert layout.read(at_border, (64, 64)).boxes.tolist() == [[58, 0, 64, 5]]


def test_a_batch_gives_what_single_tiles_give(write):
    path = write(tiny_onnx.box_network("columns", 32))
    image = np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), dtype=np.uint8)
    results = [
        OnnxDetector(path, ColumnBoxes(("x",), score=0.5), halo=0, align=8, batch=batch).detect(
            image, Everywhere()
        )
        for batch in (1, 3, 100)
    ]
    assert len(results[0]) > 20
    for other in results[1:]:
        np.testing.assert_array_equal(other.boxes, results[0].boxes)
        np.testing.assert_allclose(other.scores, results[0].scores)


# Files, models and options that cannot work.


def test_a_file_that_is_no_onnx_is_named(write, tmp_path):
    for content in (b"no model", b"", b"\x89PNG\r\n" + bytes(50)):
        with pytest.raises(
            ArgumentError, match=rf"model: an ONNX model expected, .* of {len(content)} bytes"
        ):
            OnnxDetector(write(content), PLAIN)
    with pytest.raises(ArgumentError, match=r"model: cannot read .*nowhere\.onnx: No such file"):
        OnnxDetector(tmp_path / "nowhere.onnx", PLAIN)
    with pytest.raises(ArgumentError, match="model: cannot read"):
        OnnxDetector(tmp_path, PLAIN)


def test_other_outputs_are_listed(write):
    rows = write(tiny_onnx.box_network("rows", 64))
    with pytest.raises(ArgumentError, match=r"output \(1, 1, H, W\) .*found 'boxes' \('n', 64, 6\) tensor"):
        OnnxDetector(rows, PLAIN)
    with pytest.raises(ArgumentError, match=r"output \(1, N, 7\) .*found 'boxes' \('n', 64, 6\)"):
        OnnxDetector(rows, RowBoxes(("a", "b")))
    with pytest.raises(ArgumentError, match=r"output \(1, 5, N\) .*found 'boxes'"):
        OnnxDetector(rows, ColumnBoxes(("a",)))
    with pytest.raises(ArgumentTypeError, match="layout: RowBoxes, ColumnBoxes or TextMap expected, got str"):
        OnnxDetector(rows, "rows")


def test_other_inputs_are_listed(write):
    with pytest.raises(ArgumentError, match=r"one input \(N, 3, H, W\) .*found 'image' \('n', 1, 'h', 'w'\)"):
        OnnxDetector(write(tiny_onnx.map_network(channels=1)), PLAIN)


@pytest.mark.parametrize(
    ("options", "name", "error"),
    [
        ({"mean": (1, 2)}, "mean: one number or 3", ArgumentError),
        ({"mean": np.nan}, "mean", ArgumentError),
        ({"scale": "x"}, "scale", ArgumentTypeError),
        ({"channels": "grey"}, "channels: 'rgb' or 'bgr'", ArgumentError),
        ({"halo": -1}, "halo", ArgumentError),
        ({"align": 0}, "align", ArgumentError),
        ({"batch": 0}, "batch", ArgumentError),
        ({"threads": -1}, "threads", ArgumentError),
        ({"overlap": 0.0}, "overlap", ArgumentError),
        ({"overlap": 1.5}, "overlap", ArgumentError),
    ],
)
def test_options_that_make_no_sense_are_named(write, options, name, error):
    with pytest.raises(error, match=name):
        OnnxDetector(write(tiny_onnx.map_network()), PLAIN, **options)


def test_a_halo_that_leaves_nothing_of_a_fixed_input_is_named(write):
    with pytest.raises(ArgumentError, match=r"halo: less than half of the model's input \(64, 64\)"):
        OnnxDetector(write(tiny_onnx.box_network("rows", 64)), RowBoxes(("a",)), halo=32, align=32)


def test_layouts_that_make_no_sense_are_named():
    for layout in (RowBoxes, ColumnBoxes):
        with pytest.raises(ArgumentError, match="labels"):
            layout(())
        with pytest.raises(ArgumentError, match="overlap"):
            layout(("a",), overlap=0.0)
        with pytest.raises(ArgumentError, match="score"):
            layout(("a",), score=-0.1)
    with pytest.raises(ArgumentError, match="unclip"):
        TextMap(unclip=np.nan)


def test_images_and_places_of_another_kind_are_named(write):
    detector = OnnxDetector(write(tiny_onnx.map_network()), PLAIN)
    for image, error in (
        (np.zeros((*SHAPE, 3), np.uint16), ArgumentTypeError),
        (np.zeros((*SHAPE, 4), np.uint8), ArgumentError),
    ):
        with pytest.raises(error, match="image"):
            detector.detect(image, Everywhere())
    with pytest.raises(ArgumentError, match="mask: shape"):
        detector.detect(bright(), Mask(np.ones((3, 3), bool)))
    assert len(detector.detect(bright((0, 0, 50, 50)), Mask(np.zeros(SHAPE, bool)))) == 0


def test_a_network_that_fails_or_gives_nan_in_a_frame_is_a_failure_of_that_frame(write, monkeypatch):
    detector = OnnxDetector(write(tiny_onnx.map_network()), PLAIN)
    guarded, session = Guarded(detector), detector._session
    image = bright((20, 20, 60, 40))

    class Broken:
        def __init__(self, answer):
            self.answer = answer

        def run(self, outputs, inputs):
            return self.answer(next(iter(inputs.values())))

    def fails(images):
        raise RuntimeError("out of memory")

    for answer, words in (
        (fails, "StateError: model: it failed on an input (1, 3, 128, 224): out of memory"),
        (lambda images: [np.full((1, 1, 128, 224), np.nan)], "finite numbers expected"),
        (
            lambda images: [np.zeros((1, 5, 128, 224))],
            "model: an output (1, 1, H, W) expected, it gave (1, 5",
        ),
    ):
        detector._session = Broken(answer)
        assert words in guarded.detect(image, Everywhere()).failure
    with pytest.raises(StateError):
        detector.detect(image, Everywhere())
    detector._session = session
    assert len(guarded.detect(image, Everywhere())) == 1 and guarded.failures == 3


# A real network.


@pytest.fixture(scope="module")
def text():
    if not text_model.PLACE.is_file():
        pytest.skip(f"the text detector was not fetched: {text_model.HINT}")
    return text_model.text_detector()


def test_the_text_detector_finds_printed_labels(text):
    image, labels = labelled(np.random.default_rng(3), (480, 640))
    full = text.detect(image, Everywhere())
    assert len(full) >= 0.9 * len(labels)
    centres = (full.boxes[:, :2] + full.boxes[:, 2:]) / 2
    inside = [
        bool(((centre >= labels[:, :2]) & (centre <= labels[:, 2:])).all(axis=1).any()) for centre in centres
    ]
    assert all(inside)


def test_the_text_detector_finds_on_tiles_what_it_finds_in_the_image(text):
    expected = recovered = 0
    for seed in range(3):
        image, _ = labelled(np.random.default_rng(seed), (480, 640))
        box = np.array([[160, 96, 480, 384]])
        full, part = text.detect(image, Everywhere()), text.detect(image, Tiles(box))
        counts = same_boxes(full, part, box[0])
        expected, recovered = expected + counts[0], recovered + counts[1]
        assert part.attended == 384 * 352
    assert expected >= 10 and recovered >= 0.9 * expected


def test_a_text_detector_that_was_not_fetched_says_how_to(tmp_path):
    with pytest.raises(StateError, match=r"fetch it by python -m motorprime\.evaluate\.text_model"):
        text_model.text_detector(tmp_path / "none.onnx")
