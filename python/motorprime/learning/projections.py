"""Learn a projection from what babbling gave (section III-A)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator, image_shape
from ..errors import ArgumentError
from ..projection.base import inside
from ..projection.neural import UNSEEN, LearnedCamera, NeuralProjection, inputs_of
from ..samples import Samples
from .levenberg_marquardt import PATIENCE, Training, train

HIDDEN = (25, 25)
"""Hidden layers of the network for the pixel: the paper's choice."""
SIGHT_HIDDEN = (15,)
"""Hidden layer of the network that judges whether a camera sees the point."""
SIGHT_ITERATIONS = 60
STARTS = 8
"""Places among those seen from which triangulation starts."""

Watch = Callable[[str, int, Floats], None]
"""Called after each iteration: what is trained, the iteration, and the (2,) mean squared errors."""


@dataclass(frozen=True, eq=False)
class Lesson:
    """How the networks of one camera came about.

    Attributes:
        training: of the network for the pixel.
        sight: of the network for the view.
        rows: samples that the camera saw, which ``training.split`` counts.
        errors: (T,) errors [px] on the test part.
        sight_right: share of the test part's judgements whether the camera sees the point that are right.
    """

    training: Training
    sight: Training
    rows: npt.NDArray[np.intp]
    errors: Floats
    sight_right: float


def learn_projection(
    samples: Samples,
    shapes: Mapping[str, tuple[int, int]],
    joints: tuple[str, ...],
    *,
    robot: str,
    hidden: tuple[int, ...] = HIDDEN,
    most: int | None = None,
    seed: int | np.random.Generator | None = None,
    restarts: int = 1,
    iterations: int = 150,
    patience: int = PATIENCE,
    watch: Watch | None = None,
) -> tuple[NeuralProjection, dict[str, Lesson]]:
    """Train a network for the pixel and one for the view, for each camera.

    Args:
        samples: with points; some of them seen by each camera and some by none, or the networks cannot tell
            what is in view.
        shapes: {camera: (height, width)} of the images.
        joints: those of the samples that move the cameras.
        robot: name of the robot that babbled.
        hidden: nodes of the hidden layers of the networks for the pixel.
        most: samples that each camera saw to train on, of more the first ones; None for all.
        seed: draws partitions and starts.
        restarts: random starts of the networks for the pixel; the best in validation wins.
        iterations: at most, of those networks.
        patience: iterations without progress in validation before they stop.
        watch: for progress.

    Raises:
        ArgumentError: samples without points, or a camera that saw none or all of them, or too few.
    """
    x = inputs_of(samples, joints)
    rng = generator(seed)
    learned, lessons = {}, {}
    for camera, shape in shapes.items():
        height, width = image_shape(f"shapes['{camera}']", shape)
        if camera not in samples.pixels:
            raise ArgumentError(f"samples: no camera '{camera}'; there are {', '.join(samples.cameras)}")
        seen = samples.seen(camera)
        if not seen.any() or seen.all():
            raise ArgumentError(
                f"samples: camera '{camera}' saw the point in {int(seen.sum())} of {len(seen)} samples; "
                "some of each kind are needed to learn what is in view"
            )
        rows = np.flatnonzero(seen)[:most]
        x_seen, pixels = x[rows], samples.pixels[camera][rows]
        training = train(
            x_seen,
            pixels,
            hidden,
            seed=rng,
            restarts=restarts,
            iterations=iterations,
            patience=patience,
            watch=_named(watch, f"pixel, {camera}"),
        )
        sight = train(
            x,
            np.where(seen, 1.0, -1.0)[:, None],
            SIGHT_HIDDEN,
            seed=rng,
            iterations=SIGHT_ITERATIONS,
            watch=_named(watch, f"view, {camera}"),
        )
        test = training.split.test
        errors = np.linalg.norm(training.network.forward(x_seen[test]) - pixels[test], axis=1)
        held = sight.split.test
        judged = sight.network.forward(x[held])[:, 0] > UNSEEN
        judged &= inside(training.network.forward(x[held]), (height, width))
        learned[camera] = LearnedCamera(
            (height, width), training.network, sight.network, float(np.median(errors))
        )
        lessons[camera] = Lesson(training, sight, rows, errors, float(np.mean(judged == seen[held])))
    anywhere = np.any([samples.seen(camera) for camera in shapes], axis=0)
    starts = spread(x[anywhere, :3], STARTS)
    return NeuralProjection(learned, joints, robot=robot, points=starts), lessons


def spread(points: Floats, count: int) -> Floats:
    """``count`` of the points (N, 3) far from each other: the one nearest to the mean, then the farthest."""
    chosen = [int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.full(len(points), np.inf)
    for _ in range(min(count, len(points)) - 1):
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(distance)))
    return points[chosen]


def _named(watch: Watch | None, what: str) -> Callable[[int, Floats], None] | None:
    if watch is None:
        return None
    report = watch
    return lambda iteration, errors: report(what, iteration, errors)
