"""What a detector costs: measured on a clock that is set by hand, written down, read back."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from motorprime import Everywhere, HistogramDetector, Mask, Tiles, Windows
from motorprime.costs import CostModel, _non_negative, calibrate_costs
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from timed_detector import SetClock, TimedDetector

IMAGE = np.zeros((120, 160, 3), np.uint8)


def prices(model):
    return tuple(asdict(model).values())


def test_prices_are_found_as_they_are():
    clock = SetClock(tick=0.0)
    detector = TimedDetector(clock, call=8e-5, window=1.1e-5, tile=4e-5, pixel=2e-8)
    found = calibrate_costs(detector, IMAGE, clock=clock)
    np.testing.assert_allclose(prices(found), (8e-5, 1.1e-5, 4e-5, 2e-8), rtol=1e-6)
    windows = calibrate_costs(detector, IMAGE, clock=clock, kinds=["windows"])
    np.testing.assert_allclose(prices(windows), (8e-5, 1.1e-5, 0, 0), rtol=1e-6)
    masks = calibrate_costs(detector, IMAGE, clock=clock, kinds=["mask"])
    np.testing.assert_allclose(prices(masks), (8e-5, 0, 0, 2e-8), rtol=1e-6)


def test_a_run_that_was_interrupted_spoils_nothing():
    clock, generator = SetClock(), np.random.default_rng(0)
    detector = TimedDetector(clock, noise=lambda t: t + (0.01 if generator.random() < 0.15 else 0.0))
    found = calibrate_costs(detector, IMAGE, clock=clock, repeats=15)
    np.testing.assert_allclose(prices(found), (1e-4, 1e-5, 5e-5, 1e-8), rtol=0.02)


def test_a_little_is_weighed_like_a_lot():
    """Each run is off by up to a tenth of itself: the price of a call must not drown in the long ones."""
    clock, generator = SetClock(), np.random.default_rng(0)
    detector = TimedDetector(clock, pixel=1e-7, noise=lambda t: t * generator.uniform(0.9, 1.1))
    calls = [calibrate_costs(detector, IMAGE, clock=clock, kinds=["mask"], repeats=1).call for _ in range(30)]
    np.testing.assert_allclose(calls, 1e-4, rtol=0.35)


def test_a_detector_that_does_the_same_work_wherever_it_looks_costs_its_call():
    clock = SetClock(tick=0.0)
    detector = TimedDetector(clock, call=0.03, window=0.0, tile=0.0, pixel=0.0)
    found = calibrate_costs(detector, IMAGE, clock=clock)
    np.testing.assert_allclose(prices(found), (0.03, 0, 0, 0), atol=1e-12)


def test_prices_are_the_least_squares_among_those_that_are_not_negative():
    """By the conditions of Karush, Kuhn and Tucker: downhill leads only below zero."""
    generator = np.random.default_rng(1)
    clipped = 0
    for _ in range(200):
        matrix, wanted = generator.random((7, 4)), generator.normal(size=7)
        x = _non_negative(matrix, wanted)
        slope = matrix.T @ (matrix @ x - wanted)
        assert (x >= 0).all() and (slope > -1e-9).all() and np.abs(slope[x > 0]).max(initial=0.0) < 1e-9
        clipped += (x == 0).any()
    assert clipped > 100


def test_a_look_costs_its_call_and_what_it_holds():
    model = CostModel(call=1.0, window=2.0, tile=3.0, pixel=0.001)
    mask = np.zeros((10, 20), bool)
    mask[2:4, 5:9] = True
    assert model.of(Windows(np.zeros((5, 2), int)), (30, 40)) == 11.0
    assert model.of(Tiles(np.array([[0, 0, 10, 5], [0, 0, 2, 3]])), (30, 40)) == pytest.approx(7.056)
    assert model.of(Mask(mask), (10, 20)) == pytest.approx(1.008)
    assert model.of(Everywhere(), (30, 40)) == pytest.approx(2.2)
    assert model.seconds(windows=3, tiles=1, pixels=100) == pytest.approx(10.1)
    with pytest.raises(ArgumentTypeError, match=r"where: .* got None"):
        model.of(None, (30, 40))


def test_prices_that_are_written_are_read_back_to_the_bit(tmp_path):
    model = CostModel(1 / 3e4, 1.1e-5, 0.0, 2**-40)
    model.save(tmp_path / "costs.toml")
    assert CostModel.load(tmp_path / "costs.toml") == model
    text = (tmp_path / "costs.toml").read_text()
    assert "[costs]" in text and f"window = {1.1e-5!r}" in text
    (tmp_path / "costs.toml").write_text(text.replace("tile = 0.0", "tile = 1"))
    assert CostModel.load(tmp_path / "costs.toml").tile == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("call = ", "is no TOML file"),
        ("\xff", "is no TOML file"),
        ("", r"should hold \[costs\] with call, window, tile, pixel"),
        ("costs = 3", r"should hold \[costs\]"),
        ("[costs]\ncall = 1.0\nwindow = 1.0\ntile = 0.0", r"should hold \[costs\]"),
        ("[costs]\ncall = 1.0\nwindow = 1.0\ntile = 0.0\npixel = 0.0\nmore = 1.0", "nothing else"),
        ("[costs]\ncall = -1.0\nwindow = 1.0\ntile = 0.0\npixel = 0.0", "call: expected a number >= 0"),
        ("[costs]\ncall = nan\nwindow = 1.0\ntile = 0.0\npixel = 0.0", "call: expected finite"),
        ("[costs]\ncall = 'x'\nwindow = 1.0\ntile = 0.0\npixel = 0.0", "call: expected real numbers"),
        ("[costs]\ncall = 0\nwindow = 0\ntile = 0\npixel = 0", "all are 0"),
    ],
)
def test_a_file_without_prices_is_named(tmp_path, text, message):
    file = tmp_path / "costs.toml"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ArgumentError, match=message) as caught:
        CostModel.load(file)
    assert "costs.toml" in str(caught.value)


def test_files_that_cannot_be_read_or_written_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="path: cannot read"):
        CostModel.load(tmp_path / "none.toml")
    with pytest.raises(ArgumentError, match="path: cannot write"):
        CostModel(call=1.0).save(tmp_path / "none" / "costs.toml")


@pytest.mark.parametrize("bad", [-1e-9, np.nan, np.inf, "1", None])
@pytest.mark.parametrize("name", ["call", "window", "tile", "pixel"])
def test_a_price_that_is_none_is_named(name, bad):
    with pytest.raises((ArgumentError, ArgumentTypeError), match=name):
        CostModel(**{"call": 1.0, name: bad})


@pytest.mark.parametrize(
    ("change", "message", "error"),
    [
        ({"kinds": []}, "kinds: some of windows, mask, tiles", ArgumentError),
        ({"kinds": "windows"}, "kinds", ArgumentError),
        ({"kinds": ["everywhere"]}, "kinds", ArgumentError),
        ({"size": 0}, "size", ArgumentError),
        ({"size": 121}, "size: a window of 121 px does not fit into an image of 160 x 120", ArgumentError),
        ({"repeats": 0}, "repeats", ArgumentError),
        ({"repeats": 1.5}, "repeats", ArgumentTypeError),
        ({"image": IMAGE.astype(np.uint16)}, "image", ArgumentTypeError),
        ({"image": np.zeros((60, 80, 4), np.uint8)}, "image", ArgumentError),
        ({"seed": -1}, "seed", ArgumentError),
    ],
)
def test_what_cannot_be_calibrated_is_named(change, message, error):
    clock = SetClock()
    given = {"image": IMAGE} | change
    with pytest.raises(error, match=message):
        calibrate_costs(TimedDetector(clock), given.pop("image"), clock=clock, **given)


def test_a_clock_that_stands_still_goes_back_or_says_nothing_is_named():
    detector = TimedDetector(SetClock())
    with pytest.raises(StateError, match="clock: it stood still"):
        calibrate_costs(detector, IMAGE, clock=lambda: 3.0)
    times = iter(range(100, 0, -1))
    with pytest.raises(StateError, match=r"clock: it went back from 100\.0 to 99\.0 s"):
        calibrate_costs(detector, IMAGE, clock=lambda: next(times))
    with pytest.raises(StateError, match="clock: finite seconds expected, it said nan"):
        calibrate_costs(detector, IMAGE, clock=lambda: float("nan"))


def test_what_a_detector_raises_is_not_hidden():
    detector = HistogramDetector(np.full((60, 3), (200, 0, 0), np.uint8), window=50)
    with pytest.raises(ArgumentError, match="smaller than the window of 50 px"):
        calibrate_costs(detector, IMAGE[:40], clock=SetClock())
