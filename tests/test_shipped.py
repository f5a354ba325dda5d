"""The weights in the package are those of the simulated iCub, and as good as they are said to be."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from motorprime import shipped
from motorprime.errors import ArgumentError, StateError
from motorprime.evaluate.adaptation import errors_of
from motorprime.evaluate.peripersonal_figures import evaluate_peripersonal
from motorprime.learning.synthetic import draw_samples
from motorprime.robot import ICUB

WEIGHTS = files("motorprime") / "weights"


@pytest.mark.parametrize("name", [shipped.NEURAL, shipped.PERIPERSONAL])
def test_the_files_are_there_and_small(name):
    assert 1_000 < len((WEIGHTS / name).read_bytes()) < 200_000


def test_the_projection_needs_no_simulator_and_no_urdf():
    projection = shipped.neural_projection(ICUB)
    assert projection.joints == ICUB.gaze
    assert projection.shapes == {"left": (240, 320), "right": (240, 320)}
    assert shipped.peripersonal_model(ICUB).cameras == ("left", "right")


@pytest.mark.sim
def test_the_projection_is_right_to_a_few_pixels(icub):
    samples = draw_samples(icub, icub, 1500, 31)
    errors = errors_of(shipped.neural_projection(icub), samples)
    assert np.median(errors) < 4.5
    # What it takes as out of view, though it is in the image, counts as an infinite error.
    assert np.percentile(errors, 95) < 16.0


@pytest.mark.sim
def test_the_ellipses_are_those_of_the_direct_fit(icub):
    figures = evaluate_peripersonal(shipped.peripersonal_model(icub), icub, seed=32, postures=60)
    assert figures["iou_mean"] > 0.94


@pytest.mark.sim
def test_the_projection_follows_the_images_size(icub):
    larger = icub.with_image_size(640, 480)
    projection = shipped.neural_projection(larger)
    samples = draw_samples(larger, larger, 300, 33)
    assert np.median(errors_of(projection, samples)) < 9.0


def test_another_robot_s_weights_are_refused_and_missing_ones_named(monkeypatch):
    with pytest.raises(ArgumentError, match="belongs to robot 'iCub', not to 'arm'"):
        shipped.neural_projection(replace(ICUB, name="arm"))
    monkeypatch.setattr(shipped, "NEURAL", "nothing.safetensors")
    with pytest.raises(StateError, match=r"nothing\.safetensors is missing"):
        shipped.neural_projection(ICUB)
