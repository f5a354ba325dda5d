"""The evaluations: their keys, their judgement, and that a seed names a result."""

import io
import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from motorprime import ArgumentError
from motorprime.attention import Look
from motorprime.cylinder import Located
from motorprime.detectors import Silhouette
from motorprime.evaluate import reach as reaches
from motorprime.evaluate.common import Progress, check_writable, table, write_json
from motorprime.evaluate.projection import evaluate_projection
from motorprime.evaluate.reach import evaluate_reach
from motorprime.evaluate.search import LIMITS, Outcome, _search, _summary, evaluate_search
from motorprime.evaluate.search_strategies import Chooser
from motorprime.tasks.trial import Verdict

pytestmark = pytest.mark.sim

SEARCH_KEYS = {
    "scenes", "found_attended", "cycles_median", "found_uniform", "cycles_median_uniform", "found_full",
    "false_reports", "median_error_m", "covered_median",
}  # fmt: skip


def console():
    return Console(file=io.StringIO(), width=100)


# What they share.


def test_progress_passes_everything_on_with_and_without_a_bar():
    assert list(Progress().over(range(3), "counting")) == [0, 1, 2]
    shown = console()
    assert list(Progress(shown).over([5, 6], "counting")) == [5, 6]
    assert "counting" in shown.file.getvalue()
    assert list(Progress(console()).over(itertools.islice(itertools.count(), 2), "unsized")) == [0, 1]


def test_the_table_names_nested_figures_by_dots():
    shown = console()
    shown.print(table("figures", {"poses": 5, "median_px": 0.123456789, "small": {"found": 2, "none": None}}))
    text = shown.file.getvalue()
    for part in ("figures", "poses", "0.1235", "small.found", "None"):
        assert part in text


def test_json_is_what_was_measured(tmp_path):
    path = tmp_path / "new" / "figures.json"
    check_writable(path)
    assert not path.exists()  # asking leaves nothing behind
    write_json(path, {"a": 1.5, "b": None})
    check_writable(path)
    assert json.loads(path.read_text()) == {"a": 1.5, "b": None}


@pytest.mark.parametrize("place", ["file/figures.json", "."])
def test_a_file_that_cannot_be_written_is_named(tmp_path, place):
    (tmp_path / "file").write_text("in the way")
    for write in (check_writable, lambda path: write_json(path, {})):
        with pytest.raises(ArgumentError, match=r"json: cannot write .*: \w+"):
            write(tmp_path / place)


# Projection.


def test_projection_is_right_to_a_fraction_of_a_pixel_and_the_same_for_a_seed(icub):
    first = evaluate_projection(icub, poses=6, seed=1)
    assert set(first) == {"seed", "poses", "median_px", "p95_px"}
    assert (first["seed"], first["poses"]) == (1, 6)
    assert 0.0 < first["median_px"] < 0.15
    assert first["median_px"] <= first["p95_px"] < 0.5
    assert evaluate_projection(icub, poses=6, seed=1) == first
    assert evaluate_projection(icub, poses=6, seed=2) != first


def test_projection_would_notice_eyes_that_are_elsewhere(icub, monkeypatch):
    from motorprime.projection import KinematicProjection

    right = KinematicProjection.posed

    def tilted(self, joints):
        joints = np.array(joints, dtype=float)
        joints[icub.gaze.index("eyes_tilt")] += np.deg2rad(0.5)  # 2.2 px
        return right(self, joints)

    monkeypatch.setattr(KinematicProjection, "posed", tilted)
    assert evaluate_projection(icub, poses=3, seed=1)["median_px"] > 1.5


# Search.


@pytest.fixture(scope="module")
def searched(icub):
    return evaluate_search(icub, scenes=2, seed=3)


def test_search_says_what_it_found(searched):
    assert set(searched) >= SEARCH_KEYS | {"seed", "small"}
    assert set(searched["small"]) >= SEARCH_KEYS
    for name, result in {"normal": searched, "small": searched["small"]}.items():
        limit = LIMITS[name]
        assert result["scenes"] == 2
        for kind in ("attended", "uniform", "full"):
            assert 0 <= result[f"found_{kind}"] <= 2
        assert result["found_attended"] + result["false_reports"] <= 2
        for cycles in (result["cycles_median"], result["cycles_median_uniform"]):
            assert 1 <= cycles <= limit + 1
        assert 0.0 < result["covered_median"] <= 1.0
        assert (result["median_error_m"] is None) == (result["found_attended"] + result["false_reports"] == 0)
    assert searched["found_full"] == 2  # a fair chance for all: the full scan sees a glass that is in view
    json.dumps(searched, allow_nan=False)


def test_search_of_the_same_seed_is_the_same_whatever_else_is_compared(icub, searched):
    """With strategies the scenes and the other figures stay as they are."""
    compared = evaluate_search(icub, scenes=2, seed=3, strategies=["apart"])
    for result in (compared, compared["small"]):
        strategies = result.pop("strategies")
        assert set(strategies) == {"apart", "apart_memory"}
        limit = 5 * result["cycles_limit"]
        for figures in strategies.values():
            assert 0 <= figures["found"] <= 2 and 1.0 <= figures["cycles_mean"] <= limit + 1
    assert compared == searched
    with pytest.raises(ArgumentError, match=r"strategy: one of gibbs, .* got 'best'"):
        evaluate_search(icub, scenes=1, strategies=["best"])


class HittingFinder:
    """Has hit a square of 10 x 10 at (30, 20) in the left eye."""

    def __init__(self):
        silhouette = Silhouette(np.ones((10, 10), bool), (30, 20), np.array([34.5, 24.5]), 0.5)
        self.memory = {"left": (silhouette,)}


def test_a_chooser_keeps_off_what_was_looked_at_in_vain_and_not_off_what_was_hit():
    look = Look(np.ones((60, 80), np.float32))
    chooser = Chooser(
        HittingFinder(), lambda: {"left": look}, "independent", True, 6, 8, np.random.default_rng(0)
    )
    seen = np.zeros((60, 80), bool)  # in the last cycle, in vain
    hit = np.zeros((60, 80), bool)
    hit[20:30, 30:40] = True
    for _ in range(4):
        windows = chooser()["left"]
        assert not seen[windows.centres[:, 1], windows.centres[:, 0]].any()
        seen[:] = False
        for u, v in windows.corners((60, 80)):
            window = np.s_[v : v + 8, u : u + 8]
            seen[window] |= not hit[window].any()
    forgetful = Chooser(
        HittingFinder(), lambda: {"left": look}, "gibbs", False, 6, 8, np.random.default_rng(0)
    )
    assert len(forgetful()["left"].centres) == len(forgetful()["left"].centres) == 6


class ScriptedFinder:
    """Reports a place at a given cycle, with a silhouette centred at a pixel."""

    def __init__(self, cycle, centre, pixel=(5.0, 5.0)):
        self.cycle, self.centre, self.count = cycle, np.asarray(centre, float), 0
        self.reported = {"left": SimpleNamespace(centroid=np.array(pixel))}

    def look(self, images, views, where):
        self.count += 1
        there = Located(self.centre, 1.0, 1.0, 1.0) if self.count >= self.cycle else None
        return SimpleNamespace(located=there)


def judged(finder, limit=4):
    truth = np.zeros((10, 10), bool)
    truth[3:8, 3:8] = True
    return _search(finder, {}, {}, dict, limit, {"left": truth}, np.zeros(3))


def test_a_right_report_counts_at_its_cycle():
    outcome = judged(ScriptedFinder(3, [0.0, 0.012, 0.0]))
    assert (outcome.found, outcome.reported, outcome.cycles) == (True, True, 3)
    assert outcome.error == pytest.approx(0.012)


def test_a_report_two_centimetres_off_is_false_and_ends_the_search():
    finder = ScriptedFinder(2, [0.0, 0.0201, 0.0])
    outcome = judged(finder)
    assert (outcome.found, outcome.reported, outcome.cycles) == (False, True, 2)
    assert finder.count == 2


def test_a_report_whose_window_is_not_on_the_glass_is_false():
    assert not judged(ScriptedFinder(1, [0, 0, 0], pixel=(9.0, 5.0))).found
    assert not judged(ScriptedFinder(1, [0, 0, 0], pixel=(5.0, 1.0))).found  # (u, v), not (v, u)
    assert judged(ScriptedFinder(1, [0, 0, 0], pixel=(7.4, 3.0))).found


def test_no_report_within_the_limit_is_none():
    finder = ScriptedFinder(5, [0, 0, 0])
    outcome = judged(finder)
    assert (outcome.found, outcome.reported, outcome.cycles) == (False, False, 5)
    assert finder.count == 4


def test_the_summary_counts_what_was_not_found_beyond_the_limit():
    good, false, none = (
        Outcome(True, True, 2, 0.004),
        Outcome(False, True, 1, 0.5),
        Outcome(False, False, 5, float("nan")),
    )
    trials = [
        {"attended": attended, "uniform": none, "full": good, "covered": 0.5}
        for attended in (good, false, none)
    ]
    summary = _summary(trials, 4)
    assert summary["found_attended"] == 1
    assert summary["false_reports"] == 1
    assert summary["cycles_median"] == 5.0  # of 2, 5 and 5: a false report is none
    assert summary["cycles_median_uniform"] == 5.0
    assert summary["found_full"] == 3
    assert summary["median_error_m"] == pytest.approx(0.252)  # of both reports, the false one too
    assert _summary(trials[2:], 4)["median_error_m"] is None


# Reach.


def test_reach_counts_its_trials(icub):
    result = evaluate_reach(icub, trials=1, seed=0)
    assert set(result) == {
        "seed", "trials", "reached", "refused", "not_found", "collisions", "median_error_m", "max_error_m",
        "details",
    }  # fmt: skip
    assert result["trials"] == len(result["details"]) == 1
    assert result["reached"] + result["refused"] + result["not_found"] <= 1
    assert set(result["details"][0]) >= {"outcome", "palm_error_m", "touched"}
    json.dumps(result, allow_nan=False)


def test_reach_sums_up_verdicts(icub, monkeypatch):
    verdicts = iter(
        [
            Verdict("reached", "", True, 0.002, 0.001, ()),
            Verdict("reached", "", False, 0.030, 0.020, ("glass",)),
            Verdict("refused", "out of reach", False, None, 0.01, ()),
            Verdict("not found", "no glass", False, None, None, ()),
        ]
    )
    seeds, seen_by, projection = [], [], object()

    class ScriptedTrial:
        def __init__(self, robot, seed, **options):
            seeds.append(seed)
            assert not options["settings"].compare
            seen_by.append((options["projection"], options["settings"].slack))
            self.task = SimpleNamespace(run=lambda: iter(()))

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def judge(self):
            return next(verdicts)

    monkeypatch.setattr(reaches, "Trial", ScriptedTrial)
    result = evaluate_reach(icub, trials=4, seed=7, projection=projection, slack=3.0)
    assert seen_by == [(projection, 3.0)] * 4
    assert seeds == [[7, 0], [7, 1], [7, 2], [7, 3]]
    assert (result["reached"], result["refused"], result["not_found"]) == (1, 1, 1)
    assert result["collisions"] == 1
    assert result["median_error_m"] == pytest.approx(0.016)
    assert result["max_error_m"] == 0.030
