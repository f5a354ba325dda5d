"""``motorprime evaluate recording`` on a drawn recording of an iCub that differs from its model."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from motorprime import ICUB
from motorprime.cli import app
from motorprime.errors import ArgumentError
from motorprime.projection import Calibration, KinematicProjection
from motorprime.recordings import ICUB_RIGHT_ARM, read_recording
from yarp_folder import write_encoders, write_images

pytestmark = pytest.mark.sim

DATA = os.environ.get("MOTORPRIME_DATA")
HEAD = (-10.0, 0.0, 0.0, -10.0, 0.0, 0.0)
ARM = (-70.0, 12.0, 30.0, 68.0, 40.0, -20.0, 10.0)
OFFSETS = (8.0, 6.0, -5.0, -4.0, 3.0, 7.0, -6.0)  # [deg], what the encoders say too little
COUNT = 40


@pytest.fixture(scope="module")
def folder(icub, tmp_path_factory):
    """A recorded arm whose encoders are off; its thumb, as far as it is in view."""
    folder = tmp_path_factory.mktemp("recording")
    offsets = dict(zip(ICUB.arm, np.deg2rad(OFFSETS), strict=True))
    true = KinematicProjection(icub, Calibration("iCub", offsets, hand=np.array([[0.02, -0.06, 0.03]])))
    # A wandering arm, as on the robot: wide at first and less and less later, always in view.
    rng = np.random.default_rng(1)
    gaze = np.tile(HEAD, (COUNT, 1))
    joints = np.zeros((COUNT, 16))
    for k, reach in enumerate(np.linspace(12.0, 4.0, COUNT)):
        arms = np.array(ARM) - OFFSETS + reach * rng.uniform(-1, 1, (200, 7))
        postures = np.deg2rad(np.hstack([np.zeros((200, 3)), np.tile(HEAD, (200, 1)), arms]))
        shown = np.concatenate(list(true.hand_pixels(postures).values()), axis=1)
        joints[k] = postures[((shown > 15) & (shown < (290, 210))).all(axis=(1, 2))][0]
    arm = np.rad2deg(joints[:, 9:])
    fingers = np.tile((0.0, 60.0, 0.0, 25.0, 28.0, 45.0, 36.0, 65.0, 117.0), (COUNT, 1))
    write_encoders(folder / "head", gaze, hold=0.3)
    write_encoders(folder / "rightArm", np.hstack([arm, fingers]), hold=0.3)
    for camera, pixels in true.hand_pixels(joints).items():
        write_images(folder / "images" / camera, pixels[:, 0], hold=0.3, every=0.13, shape=(240, 320))
    return folder


@pytest.fixture(scope="module")
def recording(folder):
    return read_recording(folder)


@pytest.fixture(scope="module")
def measured(icub, folder):
    from motorprime.evaluate.recording import evaluate_recording

    return evaluate_recording(icub, folder, seed=0)


def test_adapting_finds_what_the_encoders_hide(measured):
    figures = measured.figures["recording"]
    assert figures["before_px"] > 2.0
    assert figures["wide_before_px"] > 2.0
    assert figures["after_px"] < 0.5
    assert figures["p90_px"] < 1.0
    assert figures["wide_after_px"] < 1.0


def test_what_was_counted_is_reported(measured):
    figures = measured.figures["recording"]
    assert figures["postures"] == figures["seen"] == COUNT
    assert figures["train"] + figures["test"] == COUNT
    assert figures["test"] == figures["wide_test"] == 12
    assert figures["outliers"] == figures["skipped"] == 0
    assert figures["lag_s"] == pytest.approx(0.03, abs=0.012)
    assert 0.0 <= figures["wide_hand_map_inside"] <= 1.0
    assert json.loads(json.dumps(measured.figures)) == measured.figures


def test_the_tests_samples_take_no_part_in_learning(icub, recording, measured, monkeypatch):
    """Labels that only the last 30 % of the time have wrong change no prediction of it."""
    from motorprime.evaluate import recording as module

    def spoiled(path):
        read = recording
        bad = (read.times / read.duration >= module.SHARE)[:, None]
        pixels = {c: np.where(bad, p + 30.0, p) for c, p in read.samples.pixels.items()}
        return replace(read, samples=replace(read.samples, pixels=pixels))

    monkeypatch.setattr(module, "read_recording", spoiled)
    again = module.evaluate_recording(icub, Path(), seed=0)
    for camera in ("left", "right"):
        np.testing.assert_array_equal(again.after.late[camera], measured.after.late[camera])
        np.testing.assert_array_equal(again.before.late[camera], measured.before.late[camera])
        assert (again.after.wide[camera] != measured.after.wide[camera]).any()
    assert again.figures["recording"]["after_px"] > 30.0


def test_a_recording_that_shows_nothing_at_its_end_is_an_error(icub, recording, monkeypatch):
    from motorprime.evaluate import recording as module

    def early(path):
        return replace(recording, duration=100.0)

    monkeypatch.setattr(module, "read_recording", early)
    with pytest.raises(ArgumentError, match="no posture in the last 30% of its time"):
        module.evaluate_recording(icub, Path())


@pytest.mark.viz
def test_the_command_writes_figures_and_a_picture(folder, tmp_path):
    import cv2

    picture, figures = tmp_path / "tips.png", tmp_path / "figures.json"
    arguments = ["evaluate", "recording", str(folder), "--picture", str(picture), "--json", str(figures)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "recording.after_px" in result.output
    assert json.loads(figures.read_text())["recording"]["postures"] == COUNT
    image = cv2.imread(str(picture))
    assert image is not None and image.std() > 10


@pytest.mark.viz
def test_the_command_refuses_what_it_cannot_write_before_it_measures(folder, tmp_path):
    command = ["evaluate", "recording", str(tmp_path / "nowhere")]
    result = CliRunner().invoke(app, [*command, "--picture", "tips.gif"])
    assert result.exit_code == 2
    result = CliRunner().invoke(app, [*command, "--picture", "/proc/nowhere/tips.png"])
    assert isinstance(result.exception, ArgumentError) and "picture" in str(result.exception)
    result = CliRunner().invoke(app, command)
    assert isinstance(result.exception, ArgumentError) and "no such folder" in str(result.exception)


@pytest.mark.skipif(not DATA, reason="set MOTORPRIME_DATA to the folder that holds icub_babbling")
def test_the_thumb_of_a_real_recording_is_predicted_from_its_joints(icub):
    from motorprime.evaluate.recording import evaluate_recording

    figures = evaluate_recording(icub, Path(DATA) / "icub_babbling", seed=0).figures["recording"]
    assert (figures["postures"], figures["outliers"], figures["skipped"]) == (69, 12, 0)
    assert 0.008 <= figures["lag_s"] <= 0.03
    assert figures["after_px"] <= 1.5 and figures["p90_px"] <= 3.0
    assert 14.0 < figures["wide_before_px"] < 20.0
    assert figures["wide_after_px"] <= 5.0


def test_the_recording_s_columns_are_the_robot_s_variables(recording):
    samples = recording.samples
    assert samples.names == (*ICUB.gaze, *ICUB.arm) == ICUB_RIGHT_ARM.names
    np.testing.assert_allclose(samples.joints[:, 3:9], np.deg2rad([HEAD] * COUNT), atol=1e-7)
    assert not samples.joints[:, :3].any()
