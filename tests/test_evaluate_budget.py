"""``motorprime evaluate budget``: what it counts, and the command around it. No figure is judged here."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from motorprime import cli
from motorprime.detectors import Everywhere
from motorprime.errors import ArgumentError
from motorprime.evaluate import budget
from motorprime.evaluate.budget import Cycle, _boxes, _detector, _figures, draw_scene, evaluate_budget


def test_overshoot_is_relative_to_the_budget_or_to_ten_milliseconds():
    def overshoot(b, t):
        return Cycle(b / 1000, t / 1000, 0.2, 0.5).overshoot

    assert overshoot(2, 3) == pytest.approx(0.1)
    assert overshoot(20, 25) == pytest.approx(0.25)
    assert overshoot(10, 9) == pytest.approx(-0.1)


def test_the_figures_are_the_percentile_the_median_and_the_shares():
    ran = [Cycle(0.010, 0.009 + 0.00004 * k, 0.2, 0.5) for k in range(101)]
    ran += [Cycle(0.010, 0.0001, 0.3, 0.0)] * 0
    figures = _figures(ran)
    assert figures["overshoot_p99"] == pytest.approx((0.009 + 0.00004 * 99 - 0.010) / 0.010)
    assert figures["used_median"] == pytest.approx(1.1)
    assert figures["misses"] == 75 and figures["missed"] == pytest.approx(75 / 101)
    assert figures["late"] == pytest.approx(50 / 101, abs=0.011)
    assert figures["skipped"] == 0.5 and figures["looked"] == pytest.approx(0.2)
    done = _figures([Cycle(0.01, 0.002, 0.3, 0.0)])
    assert done["used_median"] is None and done["misses"] == 0


def test_a_drawn_scene_shows_the_target_in_its_landscape():
    image, look = draw_scene((240, 320), np.random.default_rng(2))
    found = _detector("scan").search(image, Everywhere()).silhouettes
    u, v = np.rint(found[0].centroid).astype(int)
    assert look.landscape[v, u] > 0.0 and not look.is_empty


def test_the_rival_of_the_scan_gives_its_scores():
    image, _ = draw_scene((60, 90), np.random.default_rng(2))
    scan = _detector("scan")
    np.testing.assert_allclose(_boxes(image, scan), scan.scores(image), atol=1e-5)


def test_the_evaluation_runs_and_says_all_it_promises(monkeypatch):
    monkeypatch.setattr(budget, "TABLE", {"40x30": (30, 40)})
    result = evaluate_budget(cycles=4, repeats=1, seed=1)
    assert json.loads(json.dumps(result)) == result
    assert result["seed"] == 1 and result["cycles"] == 4 and result["own_time"]["cycles"] == 1
    assert 0 <= result["misses"] <= 4 and result["missed"] == result["misses"] / 4
    for part in (result, result["own_time"]):
        assert 0.0 <= part["skipped"] <= 1.0 and 0.0 < part["looked"] < 1.0
        assert part["used_median"] is None or part["used_median"] > 0.0
        assert part["learned"]["factor"] > 0.0 and part["learned"]["reserve_ms"] >= 0.0
    assert result["costs"]["window_us"] > 0.0
    (ways,) = result["histogram"].values()
    assert set(ways) == {
        "sliding_stride4_ms",
        "windows50_ms",
        "scan_stride1_ms",
        "scan_scores_ms",
        "boxes_scores_ms",
        "back_projection_ms",
        "back_projection_scores_ms",
    }
    assert "histogram" not in evaluate_budget(cycles=1, repeats=0)
    for wrong in ({"cycles": 0}, {"repeats": -1}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            evaluate_budget(**wrong)


def test_the_command_writes_the_figures(monkeypatch, tmp_path, capsys):
    seen = {}
    figures = {"cycles": 3, "overshoot_p99": 0.01, "used_median": 0.9}
    monkeypatch.setattr(budget, "evaluate_budget", lambda **options: seen.update(options) or figures)
    file = tmp_path / "budget.json"
    arguments = ["motorprime", "evaluate", "budget", "--cycles", "3", "--seed", "7", "--json", str(file)]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert not end.value.code and json.loads(file.read_text()) == figures
    assert seen["cycles"] == 3 and seen["seed"] == 7
    assert "overshoot_p99" in capsys.readouterr().out
