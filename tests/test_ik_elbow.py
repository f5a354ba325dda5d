"""A person's elbow from motion capture to the robot: reader, evaluation, and what is shipped."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from motorprime import shipped
from motorprime.cli import app
from motorprime.control.swivel import Swivel, learn_swivel
from motorprime.errors import ArgumentError
from motorprime.recordings import elbows
from motorprime.recordings.elbows import arms_in_reaches
from motorprime.recordings.motion_capture import MotionCapture, read_motion_capture
from motorprime.recordings.reaches import Reach, Reaches

DATA = os.environ.get("MOTORPRIME_DATA")
TIMES = np.arange(300) / 100


@pytest.fixture
def capture(monkeypatch):
    """An arm that drifts along x, found to reach twice; the elbow is hidden during the second reach."""
    drift = 0.1 * TIMES[:, None] * [1.0, 0.0, 0.0]
    places = {
        "right_shoulder": (0.0, 0.0, 0.6),
        "right_elbow": (0.1, -0.05, 0.4),
        "hand_top": (0.3, 0.06, 0.3),
        "hand_left": (0.3, 0.09, 0.3),
        "hand_right": (0.3, 0.0, 0.3),
    }
    markers = {name: drift + place for name, place in places.items()}
    markers["right_elbow"][200:260] = np.nan

    def found(_):
        reaches = [
            Reach(TIMES[part], np.tile(np.eye(4), (len(TIMES[part]), 1, 1)), np.zeros(len(TIMES[part])))
            for part in (slice(20, 120), slice(180, 280))
        ]
        return Reaches(tuple(reaches), {}, (0.02, 0.1))

    monkeypatch.setattr(elbows, "find_reaches", found)
    return MotionCapture(TIMES, markers)


def test_an_arm_is_cut_at_its_reaches_and_left_out_where_it_was_hidden(capture):
    ((shoulder, elbow, wrist),) = arms_in_reaches(capture)
    assert len(shoulder) == len(elbow) == len(wrist) == 100
    np.testing.assert_allclose(shoulder[0], [0.02, 0.0, 0.6], atol=1e-9)
    np.testing.assert_allclose(wrist - elbow, np.tile([0.2, 0.10, -0.1], (100, 1)), atol=1e-9)


def test_the_way_the_person_faces_becomes_forward(capture):
    ((shoulder, _, wrist),) = arms_in_reaches(capture, forward=(0.0, 1.0, 0.0))
    np.testing.assert_allclose(wrist - shoulder, np.tile([0.05, -0.3, -0.3], (100, 1)), atol=1e-9)


@pytest.mark.parametrize("forward", [(0.0, 0.0, 1.0), (2.0, 0.0, 0.0), (1.0, 0.0)])
def test_a_direction_that_is_none_is_named(capture, forward):
    with pytest.raises(ArgumentError, match="forward"):
        arms_in_reaches(capture, forward=forward)


def test_the_shipped_elbow_hangs_a_little_outwards_and_knows_its_error():
    swivel = shipped.elbow_swivel()
    assert -0.6 < swivel.constant < -0.2
    assert 0.0 < swivel.error < swivel.spread < 0.1
    assert (swivel.shown[0] < swivel.middle).all() and (swivel.middle < swivel.shown[1]).all()


@pytest.fixture
def recording():
    if not DATA:
        pytest.skip("set MOTORPRIME_DATA to the folder that holds reach_to_grasp")
    return Path(DATA) / "reach_to_grasp" / "recording.tsv"


def test_what_is_shipped_is_what_the_recording_teaches(recording):
    learned = learn_swivel(arms_in_reaches(read_motion_capture(recording)))
    packed = shipped.elbow_swivel()
    np.testing.assert_allclose(learned.slope, packed.slope, rtol=1e-6)
    assert learned.constant == pytest.approx(packed.constant) and learned.error == pytest.approx(packed.error)


@pytest.mark.sim
def test_the_command_learns_measures_and_saves(recording, tmp_path):
    learned, figures = tmp_path / "elbow.safetensors", tmp_path / "elbow.json"
    arguments = ["evaluate", "elbow", str(recording), "--poses", "4", "--out", str(learned)]
    result = CliRunner().invoke(app, [*arguments, "--json", str(figures)])
    assert result.exit_code == 0, result.output
    assert Swivel.load(learned).constant == pytest.approx(shipped.elbow_swivel().constant)
    found = json.loads(figures.read_text())
    assert set(found["uniform"]) == set(found["side_grasps"])
    assert found["uniform"]["weight 1"]["off_deg"] < found["uniform"]["weight 0"]["off_deg"]
