"""``motorprime babble`` and ``motorprime train``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from .options import AsJson, Seed, err, out

train = typer.Typer(help="Train what the robot learns from babbling.", no_args_is_help=True)


def babble(
    folder: Annotated[
        Path, typer.Argument(help="Folder of the samples; made if it is missing, continued if not.")
    ],
    samples: Annotated[
        int, typer.Option(min=1, max=10**7, help="How many it is to hold in the end.")
    ] = 15000,
    what: Annotated[str, typer.Option(help="gaze, arm or marker; see above.")] = "gaze",
    mode: Annotated[
        str, typer.Option(help="near: postures that have the ball in view; uniform: all postures.")
    ] = "near",
    seed: Seed = 1,
    workers: Annotated[
        int, typer.Option(min=1, max=256, help="Processes that compute beside each other.")
    ] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers compute instead.")
    ] = None,
    noise: Annotated[
        float, typer.Option(min=0.0, max=255.0, help="Noise of the eyes' sensors [grey levels].")
    ] = 0.0,
    picture: Annotated[
        Path | None,
        typer.Option(help="Write a sheet of a dozen samples and their labels to this file.", dir_okay=False),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Collect samples to learn from, by motor babbling with the simulated iCub.

    gaze: random postures of torso, neck and eyes, and a green ball somewhere within the hand's reach.
    Encoders, the ball's place and its pixels in both eyes are kept. arm: random postures of the arm and the
    palm's place in the chest's frame. marker: gaze and arm move, and the ball is fixed to the hand, as on a
    real robot.

    The folder holds manifest.json and Parquet files. A run that was stopped, or asked for more samples, goes
    on where it is; sample number i depends on the seed and i only, whoever computes it. Samples of another
    seed, mode or robot need another folder.

    Exit code: 0 when the folder holds all samples, 2 for an error, 130 when interrupted.
    """
    from ..babble_face import BabbleOptions, run_babble

    options = BabbleOptions(folder, samples, what, mode, seed, workers, scheduler, noise, picture)
    result = run_babble(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")
    if result["outcome"] == "interrupted":
        raise typer.Exit(130)


@train.command("projection", short_help="From a point and the joints to its pixels in each eye.")
def _train_projection(
    folders: Annotated[list[Path], typer.Argument(help="Folders that 'motorprime babble' filled.")],
    output: Annotated[
        Path, typer.Option("--out", help="File of the weights (.safetensors).", dir_okay=False)
    ] = Path("projection.safetensors"),
    hidden: Annotated[
        str | None,
        typer.Option(help="Nodes of the hidden layers; default 25,25, or what the search finds best."),
    ] = None,
    samples: Annotated[
        int, typer.Option(min=1, help="Samples that each eye saw to learn from, at most.")
    ] = 10_000,
    iterations: Annotated[int, typer.Option(min=1, help="Iterations of training, at most.")] = 400,
    patience: Annotated[
        int, typer.Option(min=1, help="Iterations without progress in validation before it stops.")
    ] = 30,
    restarts: Annotated[int, typer.Option(min=1, help="Random starts; the best in validation wins.")] = 1,
    seed: Seed = 1,
    grid: Annotated[
        Path | None,
        typer.Option(
            help="Search ten architectures first and keep every run in this folder.", file_okay=False
        ),
    ] = None,
    grid_samples: Annotated[int, typer.Option(min=1, help="Samples for the search, at most.")] = 4000,
    grid_iterations: Annotated[int, typer.Option(min=1, help="Iterations in the search, at most.")] = 100,
    runs: Annotated[int, typer.Option(min=1, help="Runs of each architecture in the search.")] = 10,
    workers: Annotated[
        int, typer.Option(min=1, max=256, help="Processes that search beside each other.")
    ] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers search instead.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML report with plots to this file.", dir_okay=False)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Learn where points of the workspace appear in the eyes, from babbled samples alone.

    For each eye one network learns the pixel, and one whether the eye sees the point at all. For the latter
    some samples must be out of view, so babble twice:

      motorprime babble data/near --samples 24000 --seed 1

      motorprime babble data/uniform --samples 16000 --seed 2 --mode uniform

      motorprime train projection data/near data/uniform --report report.html

    Training is Levenberg-Marquardt on 70 % of the samples, stopped early by 15 %, tested on the rest. A
    search that was stopped goes on where it is.
    """
    from ..training import TrainOptions, run_train

    options = TrainOptions(
        folders=tuple(folders),
        output=output,
        hidden=None if hidden is None else _layers(hidden),
        samples=samples,
        iterations=iterations,
        patience=patience,
        restarts=restarts,
        seed=seed,
        grid=grid,
        grid_samples=grid_samples,
        grid_iterations=grid_iterations,
        runs=runs,
        workers=workers,
        scheduler=scheduler,
        report=report,
    )
    result = run_train(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")


@train.command("peripersonal", short_help="From head and eye joints to the reachable space's ellipse.")
def _train_peripersonal(
    output: Annotated[
        Path, typer.Option("--out", help="File of the weights (.safetensors).", dir_okay=False)
    ] = Path("peripersonal.safetensors"),
    postures: Annotated[
        int, typer.Option(min=1, help="Random postures of head and eyes to learn from.")
    ] = 12_000,
    hidden: Annotated[str, typer.Option(help="Nodes of the hidden layers.")] = "16,16",
    iterations: Annotated[int, typer.Option(min=1, help="Iterations of training, at most.")] = 150,
    restarts: Annotated[int, typer.Option(min=1, help="Random starts; the best in validation wins.")] = 1,
    seed: Seed = 1,
    picture: Annotated[
        Path | None,
        typer.Option(help="Draw postures with both ellipses to this .png or .svg.", dir_okay=False),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Learn the ellipse of the reachable space (Eq. 2-5) in each eye from neck and eye joints.

    The simulated iCub's reachable space is projected for random postures of head and eyes; a Gaussian is
    fitted to the points deeper than 5 cm within three image sizes, and networks learn its mean and Cholesky
    factor. Prints how well the ellipses overlap with direct fits over 500 postures it has not seen.
    """
    from ..training import PeripersonalOptions, run_train_peripersonal

    options = PeripersonalOptions(
        output=output,
        postures=postures,
        hidden=_layers(hidden),
        iterations=iterations,
        restarts=restarts,
        seed=seed,
        picture=picture,
    )
    result = run_train_peripersonal(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")


def _layers(text: str) -> tuple[int, ...]:
    parts = text.replace("-", ",").split(",")
    if not all(part.isdecimal() and 0 < int(part) <= 1000 for part in parts):
        raise typer.BadParameter(f"'{text}' is not numbers of nodes, e.g. 25,25", param_hint="--hidden")
    return tuple(int(part) for part in parts)
