"""``motorprime train`` and ``motorprime evaluate maps``: from babbled folders to weights and reports."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from motorprime.cli import app
from motorprime.errors import ArgumentError
from motorprime.evaluate.adaptation import adapt_to_robots, errors_of
from motorprime.evaluate.common import Progress
from motorprime.evaluate.maps import Size, evaluate_maps, report_maps
from motorprime.evaluate.maps_speed import parameter_jacobian
from motorprime.learning.levenberg_marquardt import normal_equations
from motorprime.learning.network import Network
from motorprime.learning.store import Store
from motorprime.learning.synthetic import draw_samples
from motorprime.projection import KinematicProjection, NeuralProjection
from motorprime.samples import Samples

pytestmark = pytest.mark.learn


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two folders of babbled samples, in view and anywhere."""
    base = tmp_path_factory.mktemp("babbled")
    near, uniform = base / "near", base / "uniform"
    assert run("babble", near, "--samples", 260, "--seed", 1).exit_code == 0
    assert run("babble", uniform, "--samples", 260, "--seed", 2, "--mode", "uniform").exit_code == 0
    return near, uniform


@pytest.mark.sim
@pytest.mark.viz
def test_babbled_folders_become_weights_and_a_report(folders, tmp_path):
    weights, report = tmp_path / "weights.safetensors", tmp_path / "report.html"
    result = run(
        "train", "projection", *folders, "--out", weights, "--hidden", "6", "--iterations", 12, "--json",
        "--report", report,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert figures["hidden"] == "6" and figures["samples"] == 520
    assert figures["median_px"] < 60.0 < 120.0  # better than the middle of the image
    projection = NeuralProjection.load(weights, robot="iCub")
    assert projection.shapes == {"left": (240, 320), "right": (240, 320)}
    page = report.read_text()
    assert page.count("<img") == 3
    assert {"What the network learned", "Where it errs", "How training went"} <= set(
        re.findall("<h2>(.*?)<", page)
    )


@pytest.mark.sim
def test_training_options_that_make_no_sense_are_refused(folders, tmp_path):
    near, _ = folders
    weights = tmp_path / "weights.safetensors"
    for arguments, message in (
        ((tmp_path / "nothing",), "is no store of samples"),
        ((near, "--out", tmp_path / "no-folder" / "x" / "\0"), "null|invalid|cannot"),
    ):
        result = run("train", "projection", *arguments)
        assert result.exit_code != 0
        assert re.search(message, str(result.exception) + result.output)
    for hidden in ("", "a", "5,0", "5,,5", "-3"):
        result = run("train", "projection", near, "--out", weights, f"--hidden={hidden}")
        assert result.exit_code == 2 and "--hidden" in result.output
    result = run("train", "projection", near, "--out", weights, "--hidden", "400,400")
    assert isinstance(result.exception, ArgumentError) and "too few" in str(result.exception)
    result = run("train", "projection", near, near, "--out", weights)
    assert isinstance(result.exception, ArgumentError) and "the same samples" in str(result.exception)
    result = run("train", "projection", near, "--out", weights, "--workers", 2)
    assert isinstance(result.exception, ArgumentError) and "--grid" in str(result.exception)
    result = run("train", "projection", near, "--out", weights, "--report", tmp_path / "x.txt")
    assert isinstance(result.exception, ArgumentError) and ".html" in str(result.exception)
    result = run("train", "projection", near, "--out", weights, "--grid", tmp_path / "grid")
    assert isinstance(result.exception, ArgumentError) and "too few" in str(result.exception)
    assert not (tmp_path / "grid").exists()
    arm = tmp_path / "arm"
    assert run("babble", arm, "--what", "arm", "--samples", 20).exit_code == 0
    result = run("train", "projection", arm, "--out", weights)
    assert isinstance(result.exception, ArgumentError) and "samples of the arm" in str(result.exception)
    assert not weights.exists()


@pytest.mark.sim
@pytest.mark.viz
def test_evaluate_maps_babbles_learns_adapts_and_reports(icub, tmp_path):
    size = Size(800, 200, 400, 2, 1, 400, 5, 10, best=False, peers=False)
    maps = evaluate_maps(icub, seed=3, data=tmp_path, size=size, progress=Progress())
    figures = maps.figures
    assert {"median_px", "p95_px", "train_s", "project_us", "numpy_us"} <= set(figures["neural"])
    for model in ("neural", "kinematic", "hybrid"):
        assert figures["adapt"][model]["after_px"] < figures["adapt"][model]["before_px"]
    assert figures["adapt"]["kinematic"]["after_px"] < 0.7
    assert figures["label_to_geometry_median_px"] < 0.2
    assert {"iou_mean", "iou_p05", "infer_us"} <= set(figures["peripersonal"])
    json.dumps(figures)
    held = {mode: len(Store.open(tmp_path / mode)) for mode in ("near-3", "uniform-1003")}
    assert held == {"near-3": 800, "uniform-1003": 200}
    report_maps(maps, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text().count("<img") == 3
    with pytest.raises(ArgumentError, match="report: cannot write"):
        report_maps(maps, tmp_path / "no" / "report.html")


@pytest.mark.sim
def test_errors_are_those_of_the_labels_seen(icub):
    samples = draw_samples(icub, icub, 30, 1)
    kinematic = KinematicProjection(icub)
    assert errors_of(kinematic, samples).max() < 1e-9
    shifted = {camera: uv + np.array([3.0, 4.0]) for camera, uv in samples.pixels.items()}
    moved = Samples(samples.names, samples.joints, shifted, samples.points)
    errors = errors_of(kinematic, moved)
    np.testing.assert_allclose(errors, 5.0)
    assert len(errors) == sum(int(samples.seen(camera).sum()) for camera in samples.cameras)
    with pytest.raises(ArgumentError, match="points"):
        errors_of(kinematic, Samples(samples.names, samples.joints, samples.pixels))


@pytest.mark.sim
def test_adapting_is_reproducible_and_judged_per_robot(icub):
    models = {"kinematic": KinematicProjection(icub)}
    one, two = (adapt_to_robots(icub, models, robots=1, seed=4).figures() for _ in range(2))
    assert one == two
    assert len(one["kinematic"]["robots_px"]) == 1
    assert one["kinematic"]["before_px"] > 5.0


def test_the_peer_s_jacobian_is_ours(rng):
    network = Network.random((3, 5, 4, 2), rng, rng.normal(size=(40, 3)), rng.normal(size=(40, 2)))
    z, t = rng.normal(size=(40, 3)), rng.normal(size=(40, 2))
    jacobian = parameter_jacobian(network, z)
    residual = (network.activations(z)[-1] - t).ravel()
    hessian, gradient = normal_equations(network, z, t)
    np.testing.assert_allclose(jacobian.T @ jacobian / 40, hessian, atol=1e-5)
    np.testing.assert_allclose(jacobian.T @ residual / 40, gradient, atol=1e-10)
