"""``motorprime evaluate ik``: its keys, its command, and that a seed names a result."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from motorprime.cli import app
from motorprime.errors import ArgumentError
from motorprime.evaluate import ik
from motorprime.evaluate.ik import evaluate_ik

pytestmark = pytest.mark.sim

KEYS = {
    "seed", "poses", "solved", "solved_share", "at_once", "restarts", "median_us", "p99_us",
    "median_cpu_us", "p99_cpu_us", "tolerance_mm",
    "tolerance_deg", "median_mm", "p99_mm", "median_deg", "p99_deg", "with_margin", "follow",
}  # fmt: skip


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(ik, "FOLLOWED", 2)


def test_nearly_all_poses_are_solved_and_followed_and_a_seed_names_the_poses(icub):
    one, two = (evaluate_ik(icub, poses=60, seed=3) for _ in range(2))
    assert set(one) == KEYS
    assert one["poses"] == 60 and one["solved"] >= 59 and one["solved_share"] == one["solved"] / 60
    assert one["at_once"] <= one["solved"] <= one["at_once"] + one["restarts"]
    assert one["median_mm"] < 0.1 and one["median_deg"] < 0.1
    assert 0.0 < one["follow"]["within_tolerance"] <= 1.0
    assert one["follow"]["median_mm"] < 2.0 and one["follow"]["steps"] == 2 * 200
    for timeless in ("solved", "restarts", "median_mm", "p99_deg"):
        assert one[timeless] == two[timeless]
    assert evaluate_ik(icub, poses=5, seed=4)["median_mm"] != evaluate_ik(icub, poses=5)["median_mm"]


def test_the_errors_are_of_all_poses_and_the_tolerance_is_two_and_two(icub):
    result = evaluate_ik(icub, poses=3)
    assert result["tolerance_mm"] == 2.0 and result["tolerance_deg"] == pytest.approx(2.0)
    assert result["p99_mm"] >= result["median_mm"] and result["p99_us"] >= result["median_us"] > 0


def test_one_pose_has_no_way_to_follow(icub):
    assert evaluate_ik(icub, poses=1)["follow"] == {}


def test_no_pose_is_refused(icub):
    with pytest.raises(ArgumentError, match="poses"):
        evaluate_ik(icub, poses=0)


def test_the_command_prints_a_table_and_writes_json(tmp_path):
    path = tmp_path / "ik.json"
    result = CliRunner().invoke(app, ["evaluate", "ik", "--poses", "4", "--seed", "1", "--json", str(path)])
    assert result.exit_code == 0, result.output
    assert "evaluate ik" in result.output and "solved_share" in result.output
    assert set(json.loads(path.read_text())) == KEYS
