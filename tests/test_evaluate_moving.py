"""The evaluations of planned paths and of picking up: what they count, and their commands."""

import json
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest

import pick_verdicts
from motorprime import cli, shipped
from motorprime.control.motion import Leg, simulate
from motorprime.control.obstacle import ALLOWANCE
from motorprime.errors import StateError, UnreachableError
from motorprime.evaluate import grasp as grasping
from motorprime.evaluate import obstacle as paths
from motorprime.evaluate.grasp import ROUNDS, evaluate_grasp
from motorprime.evaluate.obstacle import SPARE, TABLE, evaluate_obstacle
from pick_verdicts import FakePickTrial
from small_dynamics import simple

pytestmark = pytest.mark.sim

OBSTACLE_KEYS = {
    "seed", "scenes", "clear", "refused", "minimum_distance_m", "median_detour",
    "anterior", "posterior", "above",
}  # fmt: skip
GRASP_KEYS = {
    "seed", "trials", "lifted", "touched_obstacle", "refused", "not_found", "missed", "dropped",
    "undisturbed", "median_glass_error_m", "details",
}  # fmt: skip


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["motorprime", *map(str, arguments)])
    try:
        cli.main()
    except SystemExit as end:
        return end.code
    return 0


# Planned paths.


@pytest.fixture(scope="module")
def learned():
    return shipped.coupled_dynamics()


def test_every_scene_is_counted_once_and_clear_are_those_that_keep_off(learned):
    figures = evaluate_obstacle(learned, scenes=25, seed=1)
    assert set(figures) == OBSTACLE_KEYS
    assert (figures["seed"], figures["scenes"]) == (1, 25)
    planned = figures["scenes"] - figures["refused"]
    assert figures["clear"] <= planned
    assert figures["anterior"] + figures["posterior"] + figures["above"] == planned
    assert figures["clear"] == planned  # the plan promises it
    assert figures["minimum_distance_m"] >= 0.0
    assert figures["median_detour"] > 1.0
    json.dumps(figures)


def test_a_seed_names_the_scenes():
    first, again, other = (evaluate_obstacle(simple(), scenes=8, seed=seed) for seed in (3, 3, 4))
    assert first == again
    assert {k: first[k] for k in ("minimum_distance_m", "median_detour")} != {
        k: other[k] for k in ("minimum_distance_m", "median_detour")
    }


def test_scenes_are_as_they_are_said_to_be(learned):
    generator = np.random.default_rng(5)
    for _ in range(15):
        state, goal, obstacle, direct = paths._draw(learned, generator)
        begin, end = state.palm[:3, 3], goal.palm[:3, 3]
        assert 0.25 <= np.linalg.norm(begin - end) <= 0.5
        assert 0.02 <= obstacle.shape.radius <= 0.045
        assert 0.08 <= obstacle.shape.height <= 0.20
        assert obstacle.centre[2] - obstacle.shape.height / 2 == pytest.approx(TABLE)
        assert begin[2] > TABLE and end[2] > TABLE
        for place in (begin, end):  # so that there is a detour
            assert obstacle.gap(place[None])[0][0] > ALLOWANCE + SPARE
        path = simulate(learned, state, [Leg(goal)]).simulated.path
        assert obstacle.gap(path)[0].min() < ALLOWANCE  # and a reason for one
        assert direct == pytest.approx(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        assert direct >= np.linalg.norm(begin - end) - 2e-3


def test_what_is_refused_is_counted_and_measured_no_further(monkeypatch):
    plan, calls = paths.plan_motion, []

    def sometimes(*arguments, **options):
        calls.append(arguments)
        if len(calls) % 2:
            raise UnreachableError("obstacle: no")
        return plan(*arguments, **options)

    monkeypatch.setattr(paths, "plan_motion", sometimes)
    figures = evaluate_obstacle(simple(), scenes=6, seed=0)
    assert figures["scenes"] == 6
    assert figures["refused"] >= 3
    assert figures["anterior"] + figures["posterior"] + figures["above"] == 6 - figures["refused"]


def test_with_everything_refused_there_are_no_distances(monkeypatch):
    def never(*arguments, **options):
        raise UnreachableError("obstacle: no")

    monkeypatch.setattr(paths, "plan_motion", never)
    figures = evaluate_obstacle(simple(), scenes=3, seed=0)
    assert figures["refused"] == 3 and figures["clear"] == 0
    assert figures["minimum_distance_m"] is None and figures["median_detour"] is None
    json.dumps(figures, allow_nan=False)


def test_a_path_that_comes_too_close_is_not_clear(monkeypatch):
    """The direct way, as if it had been planned."""
    monkeypatch.setattr(paths, "plan_motion", careless)
    figures = evaluate_obstacle(simple(), scenes=5, seed=0)
    assert figures["clear"] == 0
    assert figures["minimum_distance_m"] < 0.0
    assert figures["median_detour"] == pytest.approx(1.0)


def careless(dynamics, state, legs, obstacles):
    motion = simulate(dynamics, state, legs)
    (obstacle,) = obstacles
    return replace(motion, clearance=float(obstacle.gap(motion.simulated.path)[0].min()))


# Picking up.


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.setattr(grasping, "PickTrial", FakePickTrial)
    FakePickTrial.made.clear()
    return FakePickTrial


def test_refused_trials_are_replaced_and_counted_apart(icub, fake):
    figures = evaluate_grasp(icub, trials=16, seed=7)
    assert set(figures) == GRASP_KEYS
    # Of the numbers 0 to 19, 0, 5, 10 and 15 are refused; 16 are left.
    assert figures["trials"] == 16
    assert figures["refused"] == 4
    assert [detail["trial"] for detail in figures["details"]] == list(range(20))
    assert figures["not_found"] == figures["missed"] == figures["dropped"] == 2
    assert figures["lifted"] == 16 - 6
    assert figures["touched_obstacle"] == figures["undisturbed"] == 0
    assert figures["trials"] == sum(figures[k] for k in ("lifted", "not_found", "missed", "dropped"))
    counted = [pick_verdicts.verdict(k).glass_error_m for k in range(20)]
    assert figures["median_glass_error_m"] == np.median([error for error in counted if error is not None])
    assert [seed for seed, *_ in fake.made] == [[7, number] for number in range(20)]
    assert {made[1:] for made in fake.made} == {(False, False)}
    json.dumps(figures)


def test_each_detail_is_the_trial_s_own_verdict(icub, fake):
    figures = evaluate_grasp(icub, trials=6, seed=0, obstacle=True)
    for detail in figures["details"]:
        expected = asdict(pick_verdicts.verdict(detail["trial"], obstacle=True))
        assert detail == {"trial": detail["trial"], **expected}


def test_touches_of_an_obstacle_are_counted(icub, fake):
    figures = evaluate_grasp(icub, trials=16, seed=0, obstacle=True)
    assert figures["touched_obstacle"] == 2  # 4 and 14
    assert {made[1:] for made in fake.made} == {(True, False)}


def test_trials_in_which_nothing_happened_are_replaced_too(icub, fake):
    figures = evaluate_grasp(icub, trials=14, seed=0, perturb=True)
    # Of the numbers 0 to 19, four are refused, and 6 and 16 were not disturbed.
    assert figures["trials"] == 14
    assert figures["refused"] == 4
    assert figures["undisturbed"] == 2
    assert len(figures["details"]) == 20
    assert {made[1:] for made in fake.made} == {(False, True)}


def test_what_a_replaced_trial_did_counts_for_nothing_else(icub, fake):
    """Number 6 is lifted but undisturbed: it is no success of a disturbed trial."""
    figures = evaluate_grasp(icub, trials=5, seed=0, perturb=True)
    counted = [d for d in figures["details"] if d["outcome"] != "refused" and d["disturbed"]]
    assert figures["trials"] == len(counted) == 5
    assert figures["lifted"] == sum(d["lifted"] for d in counted)


def test_the_first_numbers_count_whatever_is_asked_for_beside(icub, fake):
    few, many = (evaluate_grasp(icub, trials=trials, seed=0) for trials in (4, 16))
    assert few["details"] == many["details"][: len(few["details"])]


def test_trials_that_are_all_refused_end(icub, fake, monkeypatch):
    refused = pick_verdicts.verdict(0)
    monkeypatch.setattr(fake, "judge", lambda self: refused)
    figures = evaluate_grasp(icub, trials=2, seed=0)
    assert figures["trials"] == figures["lifted"] == 0
    assert figures["refused"] == 2 * ROUNDS
    assert figures["median_glass_error_m"] is None


def test_several_processes_count_what_one_does(icub, monkeypatch):
    monkeypatch.setattr(grasping, "_run", pick_verdicts.run_fake)
    options = {"trials": 13, "seed": 2, "obstacle": True, "perturb": True}
    alone = evaluate_grasp(icub, workers=1, **options)
    assert evaluate_grasp(icub, workers=2, **options) == alone
    assert alone["trials"] == 13


def test_an_error_in_a_trial_is_not_swallowed(icub, fake, monkeypatch):
    def fail(self):
        raise StateError("start: none")

    monkeypatch.setattr(fake, "judge", fail)
    with pytest.raises(StateError, match="start: none"):
        evaluate_grasp(icub, trials=1, seed=0)


# The commands.


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("obstacle", ["--scenes", "--seed", "--json"], ["clear", "minimum_distance_m", "half a hand"]),
        (
            "grasp",
            ["--trials", "--obstacle", "--perturb", "--workers", "--seed", "--json"],
            ["friction", "lifted"],
        ),
        ("stand", ["--trials", "--seed", "--json"], ["friction", "pushed"]),
    ],
)
def test_help_says_what_is_measured(monkeypatch, capsys, name, options, words):
    monkeypatch.setenv("COLUMNS", "200")
    assert run(monkeypatch, "evaluate", name, "--help") == 0
    shown = capsys.readouterr().out
    for word in (*options, *words):
        assert word in shown
    run(monkeypatch, "evaluate", "--help")
    assert name in capsys.readouterr().out


def test_obstacle_prints_a_table_and_writes_json(monkeypatch, capsys, tmp_path):
    path = tmp_path / "deep" / "obstacle.json"
    assert run(monkeypatch, "evaluate", "obstacle", "--scenes", 3, "--seed", 1, "--json", path) == 0
    shown = capsys.readouterr()
    assert "minimum_distance_m" in shown.out
    assert path.name in shown.err
    written = json.loads(path.read_text())
    assert set(written) == OBSTACLE_KEYS
    assert written == evaluate_obstacle(shipped.coupled_dynamics(), scenes=3, seed=1)


def test_grasp_prints_no_details_and_writes_them(monkeypatch, capsys, tmp_path, fake):
    path = tmp_path / "grasp.json"
    arguments = ["--trials", 3, "--seed", 4, "--obstacle", "--perturb", "--json", path]
    assert run(monkeypatch, "evaluate", "grasp", *arguments) == 0
    shown = capsys.readouterr()
    assert "touched_obstacle" in shown.out and "details" not in shown.out and "reason" not in shown.out
    written = json.loads(path.read_text())
    assert set(written) == GRASP_KEYS
    assert written["trials"] == 3 and written["seed"] == 4
    assert {made[1:] for made in fake.made} == {(True, True)}


@pytest.mark.parametrize(
    "arguments",
    [
        ("obstacle", "--scenes", 0),
        ("grasp", "--trials", 0),
        ("grasp", "--workers", 0),
        ("stand", "--trials", 0),
    ],
)
def test_nothing_to_measure_is_refused(monkeypatch, capsys, arguments):
    assert run(monkeypatch, "evaluate", *arguments) == 2
    assert arguments[1] in capsys.readouterr().err


@pytest.mark.parametrize("name", ["obstacle", "grasp", "stand"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_measured(
    monkeypatch, capsys, tmp_path, name, fake
):
    (tmp_path / "file").write_text("in the way")

    def never(*arguments, **options):
        pytest.fail("measured although the result could not be kept")

    monkeypatch.setattr(paths, "evaluate_obstacle", never)
    monkeypatch.setattr(grasping, "evaluate_grasp", never)
    monkeypatch.setattr("motorprime.evaluate.grasp_stand.evaluate_stand", never)
    assert run(monkeypatch, "evaluate", name, "--json", tmp_path / "file" / "figures.json") not in (0, None)
    assert "cannot write" in capsys.readouterr().err
