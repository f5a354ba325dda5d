"""The evaluations of coupled dynamics: what they count, and the commands around them."""

import json
import sys

import numpy as np
import pytest

from motorprime import cli, shipped
from motorprime.bench.peers.dynamics import NumpyCoupledDynamics
from motorprime.bench.timing import QUICK
from motorprime.control.cds import Goal, State, Tolerance
from motorprime.control.coupling import Coupling
from motorprime.errors import ArgumentError, StateError
from motorprime.evaluate import stability
from motorprime.evaluate.rollout import difference, evaluate_rollout
from motorprime.evaluate.stability import _Batch, evaluate_stability
from motorprime.kinematics import transform
from motorprime.rotations import rotation_matrices, rotation_vectors
from small_dynamics import linear, open_until, random_model, random_pose, simple


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["motorprime", *map(str, arguments)])
    try:
        cli.main()
    except SystemExit as end:
        return end.code
    return 0


# Rolling out.


def test_the_peer_in_numpy_walks_as_the_kernel_does_and_stops_where_it_stops(rng):
    for _ in range(5):
        model, goal = random_model(rng), Goal(rng.normal(size=3), random_pose(rng), 0.1, 0.7)
        start = State(rng.normal(size=3), random_pose(rng), 0.9)
        near = Tolerance(0.05, 0.05, 0.3, 0.2)
        ours = model.roll_out(start, goal, dt=0.01, seconds=60.0, tolerance=near)
        theirs = NumpyCoupledDynamics(model).roll_out(start, goal, dt=0.01, seconds=60.0, tolerance=near)
        assert ours.arrived and theirs.arrived and len(ours) == len(theirs)
        np.testing.assert_allclose(ours.palms, theirs.palms, atol=1e-9)
        np.testing.assert_allclose(ours.fixations, theirs.fixations, atol=1e-9)
        np.testing.assert_allclose(ours.openings, theirs.openings, atol=1e-9)


def test_the_figures_of_a_roll_out(rng):
    figures = evaluate_rollout(random_model(rng), steps=30, effort=QUICK)
    assert figures["steps"] == 30 and figures["components"] == [4, 4, 4]
    for name in ("rust_us", "kernel_us", "numpy_us", "ratio", "kernel_ratio"):
        assert figures[name] > 0.0
    assert figures["max_difference"] < 1e-9


def test_the_difference_of_movements_is_told_for_the_part_that_differs_most():
    ours = np.ones((3, 10))
    theirs = ours.copy()
    assert difference(ours, theirs) == 0.0
    theirs[1, 9] = 1.1
    theirs[2, 0] = 1.01
    assert difference(ours, theirs) == pytest.approx(0.1 / 1.1)


def test_a_roll_out_of_no_steps_is_refused():
    with pytest.raises(ArgumentError, match="steps: "):
        evaluate_rollout(simple(), steps=0)


# Coming to rest.


def test_a_coupled_hand_waits_and_the_same_hand_uncoupled_does_not():
    figures = evaluate_stability(simple(), starts=150)
    assert figures["converged"] == figures["converged_after_jump"] == figures["starts"] == 150
    assert figures["closed_early_coupled"] == 0
    assert figures["closed_early_uncoupled"] > 140
    assert figures["far_finite"] == figures["far_nearer"] == figures["far_starts"] == 200
    assert 1.0 < figures["median_s"] <= figures["slowest_s"] < 6.0


def test_a_hand_that_is_expected_to_close_on_the_way_is_seen_to_close_early():
    early = Coupling(np.ones(1), np.array([[0.3, 0.05]]), np.diag([0.01, 0.01])[None], 0.02)
    assert evaluate_stability(simple(arm_hand=early), starts=60)["closed_early_coupled"] > 50


def test_what_does_not_come_to_rest_in_its_time_is_not_counted():
    slow = evaluate_stability(simple(eye=linear([0.05] * 3)), starts=60)
    assert slow["converged"] < 3 and slow["converged_after_jump"] < 3
    short = evaluate_stability(simple(), starts=60, seconds=0.5)
    assert short["converged"] == 0 and short["median_s"] is None and short["slowest_s"] is None
    assert 0 < evaluate_stability(simple(), starts=200, seconds=4.2)["converged"] < 200
    # The jump takes from the same time.
    late = evaluate_stability(simple(), starts=200, seconds=7.0)
    assert 0 < late["converged_after_jump"] < late["converged"] == 200


def test_every_start_is_counted_in_whatever_batches(monkeypatch):
    monkeypatch.setattr(stability, "_BATCH", 7)
    assert evaluate_stability(simple(), starts=20)["converged"] == 20


def test_a_seed_names_a_result():
    slow = simple(eye=linear([1.0] * 3))
    assert evaluate_stability(slow, starts=40, seed=1) == evaluate_stability(slow, starts=40, seed=1)
    one, two = (evaluate_stability(slow, starts=40, seed=seed)["median_s"] for seed in (1, 2))
    assert one != two


def test_starts_fill_the_cube_and_all_rotations():
    batch = _Batch.draw(np.random.default_rng(0), 4000)
    assert np.abs(batch.starts[:, :6]).max() == pytest.approx(0.5, abs=0.01)
    angles = np.linalg.norm(batch.starts[:, 6:9], axis=1)
    assert 3.1 < angles.max() <= np.pi and angles.min() < 0.05
    assert 0.2 <= batch.starts[:, 9].min() < 0.21 and 1.19 < batch.starts[:, 9].max() <= 1.2
    assert np.abs(batch.places).max() <= 0.5 and 0.0 <= batch.instants.min() < batch.instants.max() <= 5.0


def test_a_state_after_the_jump_is_that_of_the_moved_goal():
    """The first goal is the root frame: what the batch computes in rows, goals compute one by one."""
    batch = _Batch.draw(np.random.default_rng(3), 20)
    seen = batch.after_the_jump(batch.starts)
    for n in range(20):
        row = batch.starts[n]
        state = State(row[:3], transform(rotation_matrices(row[6:9]), row[3:6]), row[9])
        goal = Goal(batch.places[n], transform(batch.turns[n], batch.places[n]))
        np.testing.assert_allclose(seen[n], goal.relative(state), atol=1e-9)
    still = _Batch(batch.starts, batch.instants, np.zeros((20, 3)), np.repeat(np.eye(3)[None], 20, 0))
    np.testing.assert_allclose(still.after_the_jump(batch.starts), batch.starts, atol=1e-9)
    assert rotation_vectors(batch.turns).shape == (20, 3)


def test_the_far_starts_are_where_all_densities_underflow():
    model = simple(arm_hand=open_until(0.02))
    for system in (model.eye, model.arm):
        off = np.zeros(system.means.shape[1])
        off[0] = 1e3
        off = off - system.means
        square = (off[:, None] @ np.linalg.solve(system.covariances, off[..., None]))[:, 0, 0]
        assert (np.exp(-0.5 * square) == 0.0).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"starts": 0}, "starts: "), ({"seconds": 0.0}, "seconds: "), ({"seed": -1}, "seed: ")],
)
def test_nonsense_is_refused(options, message):
    with pytest.raises(ArgumentError, match=message):
        evaluate_stability(simple(), **options)


# Commands.


def test_the_commands_print_a_table_and_write_json(tmp_path, monkeypatch, capfd):
    model = tmp_path / "model.safetensors"
    simple().save(model)
    file = tmp_path / "figures.json"
    assert run(monkeypatch, "evaluate", "stability", "--starts", 20, "--model", model, "--json", file) == 0
    printed = capfd.readouterr()
    assert "converged_after_jump" in printed.out and "wrote" in printed.err
    assert json.loads(file.read_text())["converged"] == 20
    assert run(monkeypatch, "evaluate", "rollout", "--steps", 5, "--model", model, "--json", file) == 0
    assert {"rust_us", "numpy_us", "ratio", "max_difference"} <= set(json.loads(file.read_text()))


def test_a_model_that_is_none_is_named(tmp_path, monkeypatch, capfd):
    (tmp_path / "no.safetensors").write_bytes(b"no")
    assert run(monkeypatch, "evaluate", "rollout", "--model", tmp_path / "no.safetensors") == 2
    assert "is no model file" in capfd.readouterr().err


def test_a_missing_shipped_model_says_so(monkeypatch):
    monkeypatch.setattr(shipped, "COUPLED", "gone.safetensors")
    with pytest.raises(StateError, match=r"gone\.safetensors is missing"):
        shipped.coupled_dynamics()
