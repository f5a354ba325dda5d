"""``motorprime evaluate maps``: what is learned from babbling, how well, and what a few samples change."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Floats
from ..learning.babbling import Source, babble
from ..learning.levenberg_marquardt import train
from ..learning.peripersonal import learn_peripersonal
from ..learning.projections import HIDDEN, Lesson, learn_projection
from ..learning.selection import dashed
from ..learning.store import Store
from ..projection import HybridProjection, KinematicProjection, NeuralProjection
from ..projection.neural import inputs_of
from ..report.maps import adapted_shot, errors_shot, learned_shot
from ..report.sheet import Section, Sheet, write_sheet
from ..robot import Robot
from ..samples import Samples
from ..tasks.babble import GazeBabble
from ..tasks.studio import close_studio
from .adaptation import CURVE, SAMPLES, Adaptable, Adapted, adapt_by_encoders, adapt_to_robots
from .babble_rate import two_worker_ratio
from .common import Progress
from .maps_speed import POINTS, peer_training, project_speed
from .peripersonal_figures import evaluate_peripersonal

NEAR, UNIFORM, MOST = 24_000, 16_000, 10_000
ITERATIONS, PATIENCE, TIMED = 400, 30, 150
BEST = (30, 30)
"""The hidden layers that the search over architectures found best."""


@dataclass(frozen=True)
class Size:
    """How much of everything; the smaller one is for a first look and for tests, its figures mean nothing."""

    near: int = NEAR
    uniform: int = UNIFORM
    most: int = MOST
    iterations: int = ITERATIONS
    robots: int = 5
    postures: int = 12_000
    ellipse_iterations: int = 150
    judged: int = 500
    best: bool = True
    peers: bool = True


QUICK = Size(1500, 1000, 1000, 15, 2, 600, 15, 20, best=False, peers=False)


@dataclass(frozen=True, eq=False)
class Maps:
    """The evaluation's figures, and what its report draws.

    Attributes:
        figures: as JSON has them.
        samples: babbled.
        projection: the network of the paper.
        lessons: how it was learned.
        adapted: to perturbed robots.
    """

    figures: dict[str, Any]
    samples: Samples
    projection: NeuralProjection
    lessons: Mapping[str, Lesson]
    adapted: Adapted


def evaluate_maps(
    robot: Robot, *, seed: int = 0, data: Path, size: Size | None = None, progress: Progress | None = None
) -> Maps:
    """Babble, train, adapt to robots that do not match, and time it.

    Args:
        robot: the iCub.
        seed: of everything.
        data: folder that keeps what is babbled, for the next time.
        size: how much of everything.
        progress: shows how far it is.
    """
    size, progress = size or Size(), progress or Progress()
    samples, labels = babbled(robot, seed, data, size, progress)
    shapes = {name: mount.camera.shape for name, mount in robot.cameras.items()}
    projection, lessons, seconds = _learn(samples, shapes, robot, HIDDEN, size, seed, progress)
    neural: dict[str, Any] = _errors(lessons)
    neural |= {"train_s": seconds, "train_iterations": min(TIMED, size.iterations)}
    x = inputs_of(samples, samples.names)
    if size.best:
        neural["best"] = _best(x, samples, lessons, size, seed, progress)
    lesson = next(iter(lessons.values()))
    camera = next(iter(lessons))
    if size.peers:
        rows = lesson.rows
        neural |= peer_training(
            projection.learned[camera].place, x[rows], samples.pixels[camera][rows], lesson.training.split
        )
        neural["s_per_iteration"] = seconds / neural["train_iterations"]
    one_posture = np.repeat(x[lesson.rows[:1]], POINTS, axis=0)
    one_posture[:, :3] = x[lesson.rows[:POINTS], :3]
    neural |= project_speed(projection, one_posture, quick=not size.peers)
    kinematic = KinematicProjection(robot)
    models: dict[str, Adaptable] = {
        "neural": projection,
        "kinematic": kinematic,
        "hybrid": HybridProjection(kinematic),
    }
    adapted = adapt_to_robots(
        robot, models, robots=size.robots, seed=seed, curve=CURVE if size.peers else (), progress=progress
    )
    armed = adapt_to_robots(robot, models, robots=size.robots, seed=seed, arm=True, progress=progress)
    figures: dict[str, Any] = {
        "seed": seed,
        "samples": len(samples),
        "label_to_geometry_median_px": labels[0],
        "label_to_geometry_p95_px": labels[1],
        "neural": neural,
        "adapt": {"robots": size.robots, "samples": SAMPLES, **adapted.figures()},
        "adapt_arm_too": {
            **armed.figures(),
            "kinematic_by_encoders": adapt_by_encoders(
                robot, robots=size.robots, seed=seed, progress=progress
            ),
        },
    }
    figures["peripersonal"] = _peripersonal(robot, size, seed, progress)
    if size.peers:
        figures["babble"] = {"two_worker_ratio": two_worker_ratio(robot, seed, progress=progress)["ratio"]}
    ratio = figures["adapt"]["neural"]["after_px"] / neural["median_px"]
    figures["adapt"]["neural"]["ratio_to_own_robot"] = ratio
    return Maps(figures, samples, projection, lessons, adapted)


def babbled(
    robot: Robot, seed: int, data: Path, size: Size, progress: Progress
) -> tuple[Samples, tuple[float, float]]:
    """Samples near the gaze and uniform ones, from the folder as far as it has them.

    Returns:
        the samples, and median and 95th percentile [px] of labels off the simulator's geometry.
    """
    parts, offsets = [], []
    for mode, wanted, own in (("near", size.near, seed), ("uniform", size.uniform, seed + 1000)):
        source = GazeBabble(robot, mode=mode)
        store = Store.create(data / f"{mode}-{own}", source.manifest(own))
        _fill(store, source, wanted, progress)
        parts.append(store.samples(None, f"i < {wanted}"))
        found = store.read(f"i < {wanted}")
        for camera in robot.cameras:
            du, dv = (found[f"{camera}_{axis}"] - found[f"{camera}_predicted_{axis}"] for axis in "uv")
            offsets.append(np.hypot(du, dv))
    close_studio()
    off = np.concatenate(offsets)
    off = off[~np.isnan(off)]
    return parts[0].joined(parts[1]), (float(np.median(off)), float(np.percentile(off, 95)))


def _peripersonal(robot: Robot, size: Size, seed: int, progress: Progress) -> dict[str, Any]:
    """The reachable space's ellipses: learned with this seed, judged by postures of another."""
    with progress.counting(3 * size.ellipse_iterations, "learning the reachable space") as done:
        steps = count(1)
        began = time.perf_counter()
        model, _ = learn_peripersonal(
            robot,
            postures=size.postures,
            iterations=size.ellipse_iterations,
            seed=seed,
            watch=lambda *_: done(next(steps)),
        )
        seconds = time.perf_counter() - began
    judged = evaluate_peripersonal(model, robot, seed=seed + 1000, postures=size.judged, progress=progress)
    return {**judged, "train_s": seconds}


def _fill(store: Store, source: Source, wanted: int, progress: Progress) -> None:
    with progress.counting(wanted, f"babbling {store.folder.name}") as done:
        babble(store, source, wanted, progress=done)


def _learn(
    samples: Samples,
    shapes: Mapping[str, tuple[int, int]],
    robot: Robot,
    hidden: tuple[int, ...],
    size: Size,
    seed: int,
    progress: Progress,
) -> tuple[NeuralProjection, dict[str, Lesson], float]:
    """Projection, lessons, and the seconds that the first camera's first iterations took."""
    networks = 2 * len(shapes)
    times: dict[int, float] = {}
    with progress.counting(networks * size.iterations, f"training {dashed(hidden)}") as done:
        order: list[str] = []

        def watch(what: str, iteration: int, errors: Floats) -> None:
            if what not in order:
                order.append(what)
            if len(order) == 1:
                times[iteration] = time.perf_counter()
            done((len(order) - 1) * size.iterations + iteration)

        began = time.perf_counter()
        projection, lessons = learn_projection(
            samples,
            shapes,
            samples.names,
            robot=robot.name,
            hidden=hidden,
            most=size.most,
            seed=seed,
            iterations=size.iterations,
            patience=PATIENCE,
            watch=watch,
        )
    reached = min(TIMED, max(times))
    return projection, lessons, (times[reached] - began) * min(TIMED, size.iterations) / reached


def _best(
    x: Floats,
    samples: Samples,
    lessons: Mapping[str, Lesson],
    size: Size,
    seed: int,
    progress: Progress,
) -> dict[str, Any]:
    """Errors of the best architecture of the search, on the same partitions as the paper's."""
    errors = []
    with progress.counting(len(lessons) * size.iterations, f"training {dashed(BEST)}") as done:
        for k, (camera, lesson) in enumerate(lessons.items()):
            pixels, parts = samples.pixels[camera][lesson.rows], lesson.training.split
            training = train(
                x[lesson.rows],
                pixels,
                BEST,
                seed=seed,
                iterations=size.iterations,
                patience=PATIENCE,
                parts=parts,
                watch=_onwards(done, k * size.iterations),
            )
            told = training.network.forward(x[lesson.rows][parts.test])
            errors.append(np.linalg.norm(told - pixels[parts.test], axis=1))
    pooled = np.concatenate(errors)
    return {
        "hidden": dashed(BEST),
        "median_px": float(np.median(pooled)),
        "p95_px": float(np.percentile(pooled, 95)),
    }


def _onwards(done: Callable[[int], None], start: int) -> Callable[[int, Floats], None]:
    return lambda iteration, _: done(start + iteration)


def _errors(lessons: Mapping[str, Lesson]) -> dict[str, Any]:
    pooled = np.concatenate([lesson.errors for lesson in lessons.values()])
    return {
        "median_px": float(np.median(pooled)),
        "p95_px": float(np.percentile(pooled, 95)),
        **{f"{camera}_median_px": float(np.median(lesson.errors)) for camera, lesson in lessons.items()},
        "iterations": [len(lesson.training.history) - 1 for lesson in lessons.values()],
        "trained_on": [len(lesson.rows) for lesson in lessons.values()],
        "view_right": [lesson.sight_right for lesson in lessons.values()],
    }


def report_maps(maps: Maps, path: Path) -> None:
    """Write the report: what was learned, where it errs, and what 100 samples changed.

    Raises:
        ArgumentError: it cannot be written.
        MissingExtraError: matplotlib is missing.
    """
    figures, samples, lessons = maps.figures, maps.samples, maps.lessons
    neural, adapt, armed = figures["neural"], figures["adapt"], figures["adapt_arm_too"]
    x = inputs_of(samples, samples.names)
    held = {camera: lesson.rows[lesson.training.split.test] for camera, lesson in lessons.items()}
    labels = {camera: samples.pixels[camera][rows] for camera, rows in held.items()}
    told = {camera: maps.projection.learned[camera].place.forward(x[rows]) for camera, rows in held.items()}
    shapes = maps.projection.shapes
    errors = {camera: lesson.errors for camera, lesson in lessons.items()}
    robots = {
        name: {"before": maps.adapted.before[name], "after": maps.adapted.after[name]}
        for name in maps.adapted.before
    }
    shots = (
        learned_shot(labels, told, shapes),
        errors_shot(labels, errors, shapes),
        adapted_shot(robots, maps.adapted.curve, neural["median_px"]),
    )
    rows = [
        (name, f"{adapt[name]['before_px']:.2f}", f"{adapt[name]['after_px']:.2f}",
         f"{armed[name]['after_px']:.2f}")
        for name in robots
    ]  # fmt: skip
    sheet = Sheet(
        title="Visuomotor maps: babble, learn, adapt",
        headline=(
            "Learned from pictures and encoders alone to ",
            f"{neural['median_px']:.1f} px",
            "; on another robot ",
            f"{adapt['neural']['before_px']:.0f} px",
            " off, and after 100 of its samples ",
            f"{adapt['neural']['after_px']:.1f} px",
            f" as a network, {adapt['kinematic']['after_px']:.2f} px as calibrated kinematics.",
        ),
        numbers=[
            (f"{neural['median_px']:.2f} px", "median test error of the networks"),
            (f"{neural['p95_px']:.1f} px", "95 % of the test errors are below"),
            (f"{neural['project_us']:.0f} µs", "to project 50 points to both eyes"),
            (f"{neural['train_s']:.0f} s", f"for {neural['train_iterations']} iterations of training"),
        ],
        sections=[
            *(Section(shot.title, shots=[shot]) for shot in shots),
            Section(
                "In numbers",
                "Medians over the robots of the median errors in px. In the last column the arm is off as "
                "well, so that where the hand is said to be is wrong by centimetres. Calibrated by the arm's "
                f"encoders instead, kinematics come to {armed['kinematic_by_encoders']['after_px']:.2f} px.",
                header=("model", "before", "after 100 samples", "after, arm off too"),
                rows=rows,
            ),
        ],
        footer=f"motorprime evaluate maps --seed {figures['seed']}; {figures['samples']} samples babbled.",
    )
    write_sheet(path, sheet)
