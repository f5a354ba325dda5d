"""Where attention pays: what is measured, and when it is called a loss."""

import json
import sys

import cv2
import pytest

from motorprime import cli
from motorprime.errors import ArgumentError
from motorprime.evaluate import payoff
from motorprime.evaluate.payoff import FRACTIONS, evaluate_payoff, pays_up_to
from motorprime.evaluate.payoff_picture import draw_payoff


@pytest.mark.parametrize(
    ("speedup", "part"),
    [
        ({0.1: 3.0, 0.5: 1.5, 1.0: 0.5}, 0.75),
        ({0.1: 3.0, 0.5: 1.5, 1.0: 1.0}, 1.0),
        ({0.1: 0.9, 0.5: 1.5, 1.0: 0.8}, 0.0),
        # What comes back to 1 where nothing is left out has paid no longer than to where it first fell below.
        ({0.1: 2.0, 0.5: 0.0, 1.0: 1.1}, 0.3),
        ({0.3: 1.0}, 0.3),
    ],
)
def test_attention_pays_up_to_where_the_speed_up_falls_below_one(speedup, part):
    assert pays_up_to(speedup) == pytest.approx(part)


def test_speed_ups_of_nothing_are_an_error():
    with pytest.raises(ArgumentError, match="speedup"):
        pays_up_to({})


class Ticking:
    """Its time: a second for each pixel that is looked at, and ten more for a call."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def detect(self, image, where):
        pixels = image.shape[0] * image.shape[1]
        self.now += 10.0 + (where.mask.sum() if hasattr(where, "mask") else pixels)


@pytest.fixture
def ticking(monkeypatch):
    clock = Ticking()

    def missing():
        raise payoff.StateError("the model is not there")

    monkeypatch.setattr(payoff, "makers", lambda text_model: {"sift": lambda: clock, "text": missing})
    return clock


def test_speed_ups_are_ratios_of_full_frame_to_attended(ticking, tmp_path):
    result = evaluate_payoff(sizes=[(60, 80), (120, 160)], rounds=2, clock=ticking)
    assert list(json.loads(json.dumps(result))["sizes"]) == ["80x60", "160x120"]
    for pixels, row in zip((4800, 19200), result["sizes"].values(), strict=True):
        figures = row["sift"]
        assert figures["full_ms"] == pytest.approx(1e3 * (pixels + 10))
        assert figures["full_ns_per_pixel"] == pytest.approx(1e9 * (1 + 10 / pixels))
        for fraction in FRACTIONS:
            # Whole cells of 4 x 4 pixels, and all that are as relevant as the last one.
            expected = (pixels + 10) / (fraction * pixels + 10)
            assert figures["speedup"][str(fraction)] == pytest.approx(expected, rel=0.12)
        assert figures["pays_up_to"] == 1.0
        assert row["text"] == {"reason": "the model is not there"}
        assert row["attention_ms"] == 0.0  # that clock does not see it
    path = tmp_path / "payoff.png"
    draw_payoff(result, path)
    drawn = cv2.imread(str(path))
    assert drawn is not None and 0.02 < (drawn < 200).any(axis=2).mean() < 0.5


def test_the_price_at_which_it_breaks_even_follows_from_the_attention_s_time(ticking, monkeypatch):
    real = payoff.attention_step

    def slow(*given, **named):
        ticking.now += 7.0
        return real(*given, **named)

    monkeypatch.setattr(payoff, "attention_step", slow)
    (row,) = evaluate_payoff(sizes=[(60, 80)], rounds=1, clock=ticking)["sizes"].values()
    assert row["attention_ms"] == pytest.approx(7e3)
    # With that price c for each of n pixels, 7 + 0.3 c n = c n.
    price = row["break_even_ns_per_pixel"] / 1e9
    assert 7.0 + 0.3 * price * 4800 == pytest.approx(price * 4800)


def test_the_real_detectors_run_on_a_small_image():
    result = evaluate_payoff(sizes=[(240, 320)], rounds=1)
    (row,) = result["sizes"].values()
    for name in ("back_projection", "histogram_scan", "orb", "surf", "sift"):
        assert set(row[name]["speedup"]) == {str(fraction) for fraction in FRACTIONS}
        assert row[name]["full_ms"] > 0.0


def test_bad_numbers_are_named_before_anything_is_measured(tmp_path, capsys, monkeypatch):
    with pytest.raises(ArgumentError, match="rounds"):
        evaluate_payoff(rounds=0)
    with pytest.raises(ArgumentError, match="sizes"):
        evaluate_payoff(sizes=[(0, 10)])
    monkeypatch.setattr(
        sys, "argv", ["motorprime", "evaluate", "payoff", "--picture", str(tmp_path / "a.pdf")]
    )
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 2
    assert ".png or .svg" in capsys.readouterr().err
