"""Learning peripersonal attention: g of section III-B2, from head and eye joints to Gaussians."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._arrays import Floats, generator, integer
from ..errors import ArgumentError
from ..peripersonal import MIN_INSIDE, ReachCloud
from ..peripersonal_model import PeripersonalModel
from ..projection import KinematicProjection, Projection
from ..robot import Robot
from .levenberg_marquardt import Training, train
from .posture_ellipses import PostureEllipses, fit_postures, head_eye_joints, random_head_eye

LEAST_INSIDE = MIN_INSIDE / 10
"""Fewer points of the cloud inside an image count as so many: how far out of view it is does not matter, and
the logarithm needs a floor."""


def learn_peripersonal(
    robot: Robot,
    *,
    projection: Projection | None = None,
    cloud: ReachCloud | None = None,
    postures: int = 12000,
    hidden: tuple[int, ...] = (16, 16),
    seed: int | np.random.Generator | None = 0,
    restarts: int = 1,
    iterations: int = 150,
    watch: Callable[[str, int, Floats], None] | None = None,
) -> tuple[PeripersonalModel, dict[str, Any]]:
    """Learn the reachable space's Gaussians from fits over random head and eye postures.

    The fits of every camera are learned from those postures that have the space in its view; whether it is
    in view is learned from all.

    Args:
        robot: with its URDF.
        projection: from points in the root frame to pixels; by default that of the robot's kinematics, which
            is the fastest to learn from.
        cloud: the reachable space; by default :class:`ReachCloud` of the robot.
        postures: to draw, uniform within the limits of head and eyes, the torso at rest.
        hidden: nodes of the networks' hidden layers.
        seed: draws the postures, then the networks' starts.
        restarts: random starts of each network.
        iterations: of the training, at most, for each start.
        watch: called after each iteration with what is learned ('view', or the camera), the iteration's
            number and the (2,) mean squared errors of training and validation.

    Returns:
        The model, and a report of the training with errors on postures that it was not trained on::

            postures, cloud    postures drawn, and points of the cloud
            view               samples, iterations, reason, restart; 'agreement', the share of judgements of
                               what is in view that are those of the direct fit
            cameras            for each: samples, iterations, reason, restart; 'mean_px', the median distance
                               of the ellipses' centres, and 'factor', the median relative error
                               |L' - L| / |L| of the Cholesky factors

    Raises:
        ArgumentError: a camera sees the space in too few postures to learn from, a robot without the needed
            joints, or a cloud or projection of another robot's joints.
    """
    postures = integer("postures", postures, at_least=1)
    rng = generator(seed)
    cloud = ReachCloud(robot) if cloud is None else cloud
    projection = KinematicProjection(robot) if projection is None else projection
    inputs = head_eye_joints(robot)
    drawn = random_head_eye(robot, postures, rng)
    fits = fit_postures(cloud, projection, drawn)
    x = drawn[:, [robot.gaze.index(name) for name in inputs]]

    def learn(what: str, x: Floats, y: Floats) -> Training:
        def seen(iteration: int, errors: Floats) -> None:
            if watch is not None:
                watch(what, iteration, errors)

        return train(x, y, hidden, seed=rng, restarts=restarts, iterations=iterations, watch=seen)

    counts = np.column_stack([fit.inside for fit in fits.values()])
    view = learn("view", x, np.log(np.maximum(counts, LEAST_INSIDE)))
    held = view.split.test
    judged = np.exp(view.network.forward(x[held])) >= MIN_INSIDE
    report: dict[str, Any] = {
        "postures": postures,
        "cloud": len(cloud.points),
        "view": _story(view) | {"agreement": float(np.mean(judged == (counts[held] >= MIN_INSIDE)))},
        "cameras": {},
    }
    networks = {}
    for camera, fit in fits.items():
        try:
            training = learn(camera, x[fit.in_view], targets(fit)[fit.in_view])
        except ArgumentError as error:
            raise ArgumentError(
                f"postures: of {postures} drawn, camera '{camera}' has the reachable space in view in "
                f"{int(fit.in_view.sum())}; {error}"
            ) from None
        networks[camera] = training.network
        report["cameras"][camera] = _story(training) | _errors(training, x[fit.in_view], fit)
    model = PeripersonalModel(networks, view.network, projection.shapes, robot.gaze, inputs, robot=robot.name)
    return model, report


def targets(fit: PostureEllipses) -> Floats:
    """What a network learns of fits: (N, 5) of (u, v, ln L1, L2, ln L3)."""
    return np.column_stack([fit.mean, np.log(fit.chol[:, 0]), fit.chol[:, 1], np.log(fit.chol[:, 2])])


def _story(training: Training) -> dict[str, Any]:
    samples = sum(
        len(part) for part in (training.split.train, training.split.validation, training.split.test)
    )
    return {
        "samples": samples,
        "iterations": training.best,
        "reason": training.reason,
        "restart": training.restart,
    }


def _errors(training: Training, x: Floats, fit: PostureEllipses) -> dict[str, float]:
    """Errors on the test part of the samples, which are the fits in view."""
    test = training.split.test
    mean, chol = fit.mean[fit.in_view][test], fit.chol[fit.in_view][test]
    y = training.network.forward(x[test])
    learned = np.column_stack([np.exp(y[:, 2]), y[:, 3], np.exp(y[:, 4])])
    off = np.linalg.norm(learned - chol, axis=1) / np.linalg.norm(chol, axis=1)
    return {
        "mean_px": float(np.median(np.linalg.norm(y[:, :2] - mean, axis=1))),
        "factor": float(np.median(off)),
    }
