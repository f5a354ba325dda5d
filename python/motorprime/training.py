"""``motorprime train``: networks from babbled samples, with progress, a report and a search if asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ._arrays import Floats
from .errors import ArgumentError
from .evaluate.common import check_writable, table
from .learning.projections import SIGHT_ITERATIONS, Lesson, Watch, learn_projection
from .learning.selection import ARCHITECTURES, Grid, Outcome, dashed, search, summary
from .learning.store import Store
from .projection.neural import NeuralProjection, inputs_of
from .report.maps import errors_shot, grid_shot, learned_shot, training_shot
from .report.picture import check_picture, save_picture
from .report.sheet import Section, Sheet, check_report, write_sheet
from .samples import Samples

MOST = 10_000
"""Samples that a camera saw, of which its network learns."""


@dataclass(frozen=True)
class TrainOptions:
    """What ``motorprime train projection`` was asked for; see its ``--help``."""

    folders: tuple[Path, ...]
    output: Path
    hidden: tuple[int, ...] | None
    samples: int
    iterations: int
    patience: int
    restarts: int
    seed: int
    grid: Path | None
    grid_samples: int
    grid_iterations: int
    runs: int
    workers: int
    scheduler: str | None
    report: Path | None


def run_train(options: TrainOptions, console: Console) -> dict[str, Any]:
    """Train, save, print the closing table and return its figures.

    Raises:
        ArgumentError: an option that makes no sense, samples that do not suffice or belong to two robots.
    """
    check_writable(options.output, "out")
    if options.report is not None:
        check_report(options.report)
        check_writable(options.report, "report")
    if options.grid is None and (options.workers > 1 or options.scheduler is not None):
        raise ArgumentError("workers, scheduler: they share a search; give --grid FOLDER too")
    samples, robot, shapes = load_babble(options.folders)
    result: dict[str, Any] = {"samples": len(samples), "robot": robot}
    found: list[Outcome] = []
    hidden = options.hidden or (25, 25)
    if options.grid is not None:
        found = _search(options, samples, console)
        best = summary(found)
        hidden = options.hidden or tuple(best[0]["hidden"])
        result["grid"] = {dashed(row["hidden"]): row for row in best}
    with watching(console, options.iterations) as watch:
        projection, lessons = learn_projection(
            samples,
            shapes,
            samples.names,
            robot=robot,
            hidden=hidden,
            most=options.samples,
            seed=options.seed,
            restarts=options.restarts,
            iterations=options.iterations,
            patience=options.patience,
            watch=watch,
        )
    projection.save(options.output)
    result |= {"hidden": dashed(hidden), **figures_of(lessons)}
    console.print(table("train projection", {k: v for k, v in result.items() if k != "grid"}))
    console.print(f"Wrote {options.output}", markup=False, highlight=False, soft_wrap=True)
    if options.report is not None:
        _write_report(options, samples, projection, lessons, found, result)
        console.print(f"Report: {options.report}", markup=False, highlight=False, soft_wrap=True)
    return result


@dataclass(frozen=True)
class PeripersonalOptions:
    """What ``motorprime train peripersonal`` was asked for; see its ``--help``."""

    output: Path
    postures: int
    hidden: tuple[int, ...]
    iterations: int
    restarts: int
    seed: int
    picture: Path | None


def run_train_peripersonal(options: PeripersonalOptions, console: Console) -> dict[str, Any]:
    """Train, save, judge on unseen postures, print the closing table and return its figures.

    Raises:
        ArgumentError: an option that makes no sense, or too few postures.
    """
    from .evaluate.peripersonal_figures import evaluate_peripersonal
    from .learning.peripersonal import learn_peripersonal
    from .sim.icub import load_icub

    check_writable(options.output, "out")
    if options.picture is not None:
        check_picture(options.picture)
        check_writable(options.picture, "picture")
    robot = load_icub()
    with watching(console, options.iterations) as watch:
        model, report = learn_peripersonal(
            robot,
            postures=options.postures,
            hidden=options.hidden,
            seed=options.seed,
            restarts=options.restarts,
            iterations=options.iterations,
            watch=watch,
        )
    model.save(options.output)
    result = {**report, "unseen": evaluate_peripersonal(model, robot, seed=options.seed + 1)}
    console.print(table("train peripersonal", result))
    console.print(f"Wrote {options.output}", markup=False, highlight=False, soft_wrap=True)
    if options.picture is not None:
        from .evaluate.peripersonal_picture import draw_peripersonal

        save_picture(draw_peripersonal(model, robot, seed=options.seed), options.picture)
        console.print(f"Picture: {options.picture}", markup=False, highlight=False, soft_wrap=True)
    return result


def load_babble(folders: Sequence[Path]) -> tuple[Samples, str, dict[str, tuple[int, int]]]:
    """Samples of gaze babbling from several folders, the robot's name, and the shapes of its images.

    Raises:
        ArgumentError: no folder, another kind of samples, or several robots.
    """
    if not folders:
        raise ArgumentError("folders: at least one folder of samples expected, got none")
    stores = [Store.open(folder) for folder in folders]
    first = stores[0].manifest
    for store in stores:
        if store.manifest.kind not in ("gaze", "marker"):
            raise ArgumentError(
                f"folders: {store.folder} holds samples of the {store.manifest.kind}; "
                "a projection learns from 'motorprime babble --what gaze'"
            )
        if store.manifest.kind != first.kind:
            raise ArgumentError(
                f"folders: {stores[0].folder} holds samples of kind '{first.kind}', {store.folder} of "
                f"kind '{store.manifest.kind}'; train on one kind"
            )
        if store.manifest.fingerprint != first.fingerprint:
            raise ArgumentError(f"folders: {stores[0].folder} and {store.folder} are of different robots")
    drawn = [(store.manifest.mode, store.manifest.seed) for store in stores]
    if len(set(drawn)) < len(drawn):
        raise ArgumentError(
            "folders: two of them hold the same samples, of one mode and seed; "
            "what is trained on would be tested on"
        )
    samples = stores[0].samples(None)
    for store in stores[1:]:
        samples = samples.joined(store.samples(None))
    return samples, first.robot, shapes_of(first.robot, samples)


def shapes_of(robot: str, samples: Samples) -> dict[str, tuple[int, int]]:
    """(height, width) of the images of a known robot's cameras.

    Raises:
        ArgumentError: the robot is not known.
    """
    from .robot import ICUB

    if robot != ICUB.name:
        raise ArgumentError(f"robot: the image sizes of '{robot}' are not known here; call learn_projection")
    return {camera: ICUB.cameras[camera].camera.shape for camera in samples.cameras}


def figures_of(lessons: Mapping[str, Lesson]) -> dict[str, Any]:
    """Errors on the test parts, of both cameras and of each, and how often the view is judged right."""
    pooled = np.concatenate([lesson.errors for lesson in lessons.values()])
    figures: dict[str, Any] = {
        "median_px": float(np.median(pooled)),
        "p95_px": float(np.percentile(pooled, 95)),
    }
    for camera, lesson in lessons.items():
        figures[camera] = {
            "trained_on": len(lesson.rows),
            "median_px": float(np.median(lesson.errors)),
            "p95_px": float(np.percentile(lesson.errors, 95)),
            "iterations": len(lesson.training.history) - 1,
            "view_right": lesson.sight_right,
        }
    return figures


@contextmanager
def watching(console: Console, iterations: int) -> Iterator[Watch]:
    """Progress bars for :func:`learn_projection`, one for each network."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[error]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        tasks: dict[str, Any] = {}

        def watch(what: str, iteration: int, errors: Floats) -> None:
            if what not in tasks:
                total = SIGHT_ITERATIONS if what.startswith("view, ") else iterations
                tasks[what] = bars.add_task(f"training {what}", total=total, error="")
            bars.update(tasks[what], completed=iteration, error=f"validation {errors[1]:.5f}")

        yield watch


def _search(options: TrainOptions, samples: Samples, console: Console) -> list[Outcome]:
    """The grid search, for the camera that saw the most."""
    assert options.grid is not None
    camera = max(samples.cameras, key=lambda name: int(samples.seen(name).sum()))
    rows = np.flatnonzero(samples.seen(camera))[: options.grid_samples]
    grid = Grid(
        inputs_of(samples, samples.names)[rows],
        samples.pixels[camera][rows],
        seed=options.seed,
        runs=options.runs,
        iterations=options.grid_iterations,
    )
    outcomes: list[Outcome] = []
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        task = bars.add_task("searching architectures", total=len(ARCHITECTURES) * options.runs)
        for outcome in search(grid, options.grid, workers=options.workers, scheduler=options.scheduler):
            outcomes.append(outcome)
            bars.advance(task)
    shown = {
        dashed(row["hidden"]): f"{row['mse']:.1f} px², median {row['median']:.2f} px"
        for row in summary(outcomes)
    }
    console.print(table(f"architectures by test MSE ({camera} eye, {len(rows)} samples)", shown))
    return outcomes


def _write_report(
    options: TrainOptions,
    samples: Samples,
    projection: NeuralProjection,
    lessons: Mapping[str, Lesson],
    found: Sequence[Outcome],
    result: Mapping[str, Any],
) -> None:
    assert options.report is not None
    x = inputs_of(samples, samples.names)
    held = {camera: lesson.rows[lesson.training.split.test] for camera, lesson in lessons.items()}
    labels = {camera: samples.pixels[camera][rows] for camera, rows in held.items()}
    predicted = {camera: projection.learned[camera].place.forward(x[rows]) for camera, rows in held.items()}
    shots = [
        learned_shot(labels, predicted, projection.shapes),
        errors_shot(labels, {camera: lesson.errors for camera, lesson in lessons.items()}, projection.shapes),
        training_shot({camera: lesson.training.history for camera, lesson in lessons.items()}),
    ]
    sections = [Section(shot.title, shots=[shot]) for shot in shots]
    if found:
        sections.append(grid_section(found))
    cameras = ", ".join(f"{result[camera]['trained_on']} by the {camera} eye" for camera in lessons)
    sheet = Sheet(
        title="A learned projection from the workspace to the eyes",
        headline=(
            f"From a point's place and {len(samples.names)} joint angles the networks tell its pixel to ",
            f"{result['median_px']:.1f} px",
            ", in the median over places and postures that they were not trained on.",
        ),
        numbers=[
            (f"{result['median_px']:.2f} px", "median test error, both eyes"),
            (f"{result['p95_px']:.1f} px", "95 % of the test errors are below"),
            (result["hidden"], "nodes of the hidden layers"),
            (f"{result['samples']}", f"samples; seen and trained on: {cameras}"),
        ],
        sections=sections,
        footer=f"Trained with seed {options.seed} on {', '.join(str(folder) for folder in options.folders)}.",
    )
    write_sheet(options.report, sheet)


def grid_section(found: Sequence[Outcome]) -> Section:
    """The search's comparison: plot and table."""
    rows = summary(found)
    medians = {
        dashed(row["hidden"]): [o.median for o in found if list(o.hidden) == row["hidden"]] for row in rows
    }
    return Section(
        "Which architecture",
        "Every architecture was trained several times, each time from other random weights and with "
        "another partition of the data.",
        [grid_shot(rows, medians)],
        ("hidden layers", "weights", "runs", "MSE [px²]", "lowest MSE", "median [px]", "95 % [px]"),
        [
            (
                dashed(row["hidden"]),
                str(row["weights"]),
                str(row["runs"]),
                f"{row['mse']:.1f}",
                f"{row['mse_best']:.1f}",
                f"{row['median']:.2f}",
                f"{row['p95']:.1f}",
            )
            for row in rows
        ],
    )
