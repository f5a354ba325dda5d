"""What about 100 samples of a robot that does not match its model change: part of ``evaluate maps``."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from .._arrays import Floats
from ..errors import ArgumentError
from ..learning.synthetic import draw_samples, palm_points
from ..perturbed import build, draw_errors
from ..projection import KinematicProjection
from ..robot import Robot
from ..samples import Samples
from .common import Progress

ROBOTS, SAMPLES, TESTED, NOISE = 5, 100, 1500, 0.3
CURVE = (0, 10, 25, 50, 100, 200)


class Adaptable(Protocol):
    """A projection that learns from samples."""

    def adapt(self, samples: Samples) -> Any:
        """The adapted projection."""
        ...

    def project(self, points: Floats, joints: Floats) -> dict[str, Floats]:
        """As :meth:`Projection.project`."""
        ...


@dataclass(frozen=True, eq=False)
class Adapted:
    """Median errors [px] of each robot, both eyes pooled.

    Attributes:
        before: {model: one error per robot}.
        after: {model: one error per robot}, after 100 samples.
        curve: {model: {samples: median over the robots}}.
    """

    before: Mapping[str, Sequence[float]]
    after: Mapping[str, Sequence[float]]
    curve: Mapping[str, Mapping[int, float]]

    def figures(self) -> dict[str, Any]:
        """Medians over the robots, and every robot's."""
        return {
            model: {
                "before_px": float(np.median(self.before[model])),
                "after_px": float(np.median(self.after[model])),
                "robots_px": [float(error) for error in self.after[model]],
            }
            for model in self.before
        }


def errors_of(projection: Adaptable, samples: Samples) -> Floats:
    """Errors (M,) [px] of all labels of the samples, all cameras pooled; infinite where it says not in view.

    Raises:
        ArgumentError: samples without points.
    """
    if samples.points is None:
        raise ArgumentError("samples: points expected, got none")
    errors = []
    for k, (point, joints) in enumerate(zip(samples.points, samples.joints, strict=True)):
        pixels = projection.project(point[None], joints)
        for camera, labels in samples.pixels.items():
            if not np.isnan(labels[k, 0]):
                error = float(np.linalg.norm(pixels[camera][0] - labels[k]))
                errors.append(np.inf if np.isnan(error) else error)
    return np.array(errors)


def adapt_to_robots(
    robot: Robot,
    models: Mapping[str, Adaptable],
    *,
    robots: int = ROBOTS,
    seed: int = 0,
    arm: bool = False,
    curve: Sequence[int] = (0, SAMPLES),
    progress: Progress | None = None,
) -> Adapted:
    """Adapt models of a robot to perturbed ones and test them on samples that they have not seen.

    Args:
        robot: the nominal one.
        models: projections of it, by name.
        robots: how many to draw.
        seed: draws robots, samples and labels' noise.
        arm: perturb the arm too. The points are then where the nominal arm says, not where the hand is.
        curve: numbers of samples to test after; those of 100 and 0 are always tested.
        progress: shows how far it is.
    """
    counts = sorted({0, SAMPLES, *curve})
    errors: dict[str, dict[int, list[float]]] = {name: {n: [] for n in counts} for name in models}
    for k in (progress or Progress()).over(range(robots), "adapting to other robots"):
        with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
            draws = np.random.default_rng([seed, k, int(arm)])
            true = build(robot, draw_errors(robot, draws, arm=arm), Path(folder))
            samples = _samples(true, robot, max(counts), draws, arm, NOISE)
            test = _samples(true, robot, TESTED, draws, arm, 0.0)
        for name, model in models.items():
            for n in counts:
                adapted = model if n == 0 else model.adapt(samples.take(slice(n)))
                errors[name][n].append(float(np.median(errors_of(adapted, test))))
    return Adapted(
        {name: found[0] for name, found in errors.items()},
        {name: found[SAMPLES] for name, found in errors.items()},
        {name: {n: float(np.median(e)) for n, e in found.items()} for name, found in errors.items()},
    )


def _samples(
    true: Robot, nominal: Robot, count: int, draws: np.random.Generator, arm: bool, noise: float
) -> Samples:
    """Samples with the places that the nominal model of the arm tells."""
    drawn = draw_samples(true, nominal, count, draws, noise, arm=arm)
    if not arm:
        return drawn
    gaze, reach = drawn.columns(nominal.gaze), drawn.columns(nominal.arm)
    return Samples(nominal.gaze, gaze, drawn.pixels, palm_points(nominal, gaze, reach))


def adapt_by_encoders(
    robot: Robot, *, robots: int = ROBOTS, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Calibrate kinematics of robots whose arm is off too, by the arm's encoders instead of the hand's place.

    Arm and gaze are calibrated together, so nothing is believed of where the hand is; tested by
    :meth:`KinematicProjection.hand_pixels`.
    """
    before, after = [], []
    nominal = KinematicProjection(robot)
    for k in (progress or Progress()).over(range(robots), "calibrating by encoders"):
        with tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
            draws = np.random.default_rng([seed, k, 1])
            true = build(robot, draw_errors(robot, draws, arm=True), Path(folder))
            samples = draw_samples(true, robot, SAMPLES, draws, NOISE, arm=True)
            test = draw_samples(true, robot, TESTED, draws, arm=True)
        before.append(_hand_error(nominal, test))
        after.append(_hand_error(nominal.adapt(samples), test))
    return {"before_px": float(np.median(before)), "after_px": float(np.median(after)), "robots_px": after}


def _hand_error(projection: KinematicProjection, test: Samples) -> float:
    pixels = projection.hand_pixels(test.joints)
    errors = [np.linalg.norm(pixels[c][:, 0] - labels, axis=1) for c, labels in test.pixels.items()]
    return float(np.nanmedian(np.concatenate(errors)))
