"""The search over architectures: every run kept once, whoever ran it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from motorprime.errors import ArgumentError, StateError
from motorprime.learning.selection import ARCHITECTURES, Candidate, Grid, search, summary

pytestmark = pytest.mark.learn


def grid(seed=0, **changes):
    rng = np.random.default_rng(3)
    x = rng.uniform(-2.0, 2.0, (200, 2))
    y = np.column_stack([np.sin(2.0 * x[:, 0]), x[:, 0] * x[:, 1]])
    return replace(Grid(x, y, seed=seed, architectures=((2,), (12,)), runs=3, iterations=12), **changes)


def test_ten_architectures_with_the_paper_s_among_them():
    assert len(set(ARCHITECTURES)) == 10 and (25, 25) in ARCHITECTURES


def test_the_larger_network_wins_where_the_smaller_one_cannot(tmp_path):
    rows = summary(list(search(grid(), tmp_path)))
    assert [row["hidden"] for row in rows] == [[12], [2]]
    assert rows[0]["mse"] < 0.5 * rows[1]["mse"]
    assert rows[0]["weights"] == 3 * 12 + 13 * 2 and rows[0]["runs"] == 3
    assert rows[0]["mse_best"] <= rows[0]["mse"]


def test_a_search_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    whole = sorted(search(grid(), tmp_path / "whole"), key=str)
    stopped = search(grid(), tmp_path / "stopped")
    next(stopped), next(stopped)
    stopped.close()
    ran = []
    own = Grid.__call__
    monkeypatch.setattr(Grid, "__call__", lambda self, c: ran.append(c.name) or own(self, c))
    again = sorted(search(grid(), tmp_path / "stopped"), key=str)
    assert len(ran) == 4 and len(set(ran)) == 4
    assert again == whole
    ran.clear()
    assert sorted(search(grid(), tmp_path / "stopped"), key=str) == whole and not ran


def test_two_processes_find_what_one_does(tmp_path):
    one = sorted(search(grid(runs=2), tmp_path / "one"), key=str)
    two = sorted(search(grid(runs=2), tmp_path / "two", workers=2), key=str)
    assert [(o.hidden, o.number) for o in one] == [(o.hidden, o.number) for o in two]
    np.testing.assert_allclose([o.mse for o in one], [o.mse for o in two], rtol=1e-2)


def test_more_runs_extend_a_search(tmp_path):
    few = set(search(grid(runs=1), tmp_path))
    assert few < set(search(grid(runs=2), tmp_path))


def test_run_k_of_every_architecture_shares_its_partition():
    """So architectures are judged by the same test parts: on noise alone the MSE is the partition's."""
    noise = grid(y=np.random.default_rng(1).normal(size=(200, 2)), iterations=1)
    by_run = [[noise(Candidate(h, k)).mse for h in ((1,), (2,))] for k in range(6)]
    within = np.mean([abs(a - b) for a, b in by_run])
    assert within < 0.7 * np.std([a for a, _ in by_run])


def test_a_folder_of_another_search_is_refused(tmp_path):
    list(search(grid(runs=1), tmp_path))
    with pytest.raises(ArgumentError, match="other seed"):
        list(search(grid(seed=1), tmp_path))
    with pytest.raises(ArgumentError, match="other data"):
        list(search(grid(x=grid().x + 1.0), tmp_path))
    with pytest.raises(ArgumentError, match="other iterations"):
        list(search(grid(iterations=3), tmp_path))
    (tmp_path / "search.json").unlink()
    with pytest.raises(ArgumentError, match="holds runs, but no"):
        list(search(grid(), tmp_path))
    (tmp_path / "search.json").write_text("{")
    with pytest.raises(ArgumentError, match="not readable"):
        list(search(grid(), tmp_path))


def test_an_outcome_that_was_cut_off_is_named(tmp_path):
    list(search(grid(runs=1), tmp_path))
    path = tmp_path / "12-run00.json"
    path.write_text(path.read_text()[:20])
    with pytest.raises(StateError, match=r"12-run00\.json was cut off"):
        list(search(grid(runs=1), tmp_path))
    path.write_text(json.dumps({"hidden": [12]}))
    with pytest.raises(StateError, match="no outcome"):
        list(search(grid(runs=1), tmp_path))


def test_a_folder_that_cannot_be_used_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ArgumentError, match="cannot use"):
        list(search(grid(), tmp_path / "file"))


def test_bad_searches_are_refused():
    with pytest.raises(ArgumentError, match="architectures"):
        grid(architectures=())
    with pytest.raises(ArgumentError, match="runs"):
        grid(runs=0)
    with pytest.raises(ArgumentError, match="same number"):
        grid(y=np.zeros((3, 2)))
