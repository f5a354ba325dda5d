"""The command line: ``motorprime reach`` does the main job, ``motorprime evaluate NAME`` measures it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from . import __version__
from .errors import Error

app = typer.Typer(
    help="Motor-primed visual attention: look only where the robot is going to move.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
evaluate = typer.Typer(help="Measure a figure; print a table, and JSON for machines.", no_args_is_help=True)
app.add_typer(evaluate, name="evaluate")
train = typer.Typer(help="Train what the robot learns from babbling.", no_args_is_help=True)
app.add_typer(train, name="train")


class ProjectionName(str, Enum):
    """Ways to know where points appear in the eyes."""

    KINEMATIC = "kinematic"
    NEURAL = "neural"
    HYBRID = "hybrid"


LARGEST = 4096  # side of the eyes' images [px]

out = Console()
err = Console(stderr=True)

Seed = Annotated[int, typer.Option(min=0, help="Draws everything; the same seed gives the same result.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", help="Write the figures to this file as JSON.", dir_okay=False)
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON on stdout, everything else on stderr.")
]


def main() -> None:
    """Run the command line; errors of the library are one line on stderr and exit code 2."""
    try:
        app()
    except Error as error:
        err.print(f"motorprime: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)


def _version(value: bool) -> None:
    if value:
        out.print(f"motorprime {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command(short_help="Let the simulated iCub find a glass and reach for it.")
def reach(
    seed: Seed = 1,
    name: Annotated[str | None, typer.Option(help="Name of the run's folder; default reach-SEED.")] = None,
    runs: Annotated[Path, typer.Option(help="Folder that holds the runs.", file_okay=False)] = Path("runs"),
    windows: Annotated[int, typer.Option(min=1, help="Windows per eye and vision cycle.")] = 50,
    width: Annotated[
        float | None,
        typer.Option(min=0.01, max=1e4, help="Kernel width of the plan [px]; default 40 at 320 x 240."),
    ] = None,
    size: Annotated[str, typer.Option(help="Images of the eyes, WIDTHxHEIGHT in pixels.")] = "320x240",
    noise: Annotated[
        float, typer.Option(min=0.0, max=255.0, help="Noise of the eyes' sensors [grey levels].")
    ] = 2.0,
    clutter: Annotated[int, typer.Option(min=0, max=6, help="Other kitchenware on the table.")] = 4,
    glass: Annotated[bool, typer.Option(help="Whether the glass stands on the table at all.")] = True,
    glass_at: Annotated[
        str | None,
        typer.Option(help="Where it stands, X,Y in metres in the root frame (x points backwards, y right)."),
    ] = None,
    projection: Annotated[
        ProjectionName,
        typer.Option(
            help="How the robot knows where points appear in its eyes: by its model, or as learned."
        ),
    ] = ProjectionName.KINEMATIC,
    video: Annotated[bool, typer.Option(help="Write a video of the run.")] = True,
    gui: Annotated[bool, typer.Option("--gui", help="Watch in pybullet's window.")] = False,
    as_json: AsJson = False,
) -> None:
    """Let the simulated iCub find a red glass and reach for it, looking only where it matters.

    The robot starts in a random posture, searches the glass with windows over its reachable space, turns its
    gaze there, plans the hand's path, and moves with a fresh look along the plan at every vision cycle. A
    scan of the full images runs beside every cycle, for comparison only.

    Leaves runs/NAME/ with report.html (open it in a browser), video.webm and result.json.

    Exit code: 0 when the palm arrived, 1 when it did not, 2 for an error, 130 when interrupted.
    """
    image_size, place = _size(size), _place(glass_at)
    from .demo import ReachOptions, run_reach

    options = ReachOptions(
        seed=seed,
        name=name or f"reach-{seed}",
        runs=runs,
        windows=windows,
        width=width,
        size=image_size,
        noise=noise,
        clutter=clutter,
        glass=glass,
        glass_at=place,
        video=video,
        gui=gui,
        projection=projection.value,
    )
    result = run_reach(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")
    if result["outcome"] == "interrupted":
        raise typer.Exit(130)
    raise typer.Exit(0 if result.get("judged", {}).get("reached") else 1)


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise typer.BadParameter(f"'{text}' is not WIDTHxHEIGHT, e.g. 640x480", param_hint="--size")
    width, height = int(parts[0]), int(parts[1])
    if max(width, height) > LARGEST:  # the renderer would die of it, and no report be written
        raise typer.BadParameter(f"'{text}' is larger than {LARGEST}x{LARGEST}", param_hint="--size")
    return width, height


def _place(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"'{text}' is not X,Y in metres, e.g. -0.3,0.1", param_hint="--glass-at"
        ) from None
    return x, y


@app.command(short_help="Collect samples to learn from: random postures and a ball.")
def babble(
    folder: Annotated[
        Path, typer.Argument(help="Folder of the samples; made if it is missing, continued if not.")
    ],
    samples: Annotated[int, typer.Option(min=1, help="How many it is to hold in the end.")] = 15000,
    what: Annotated[str, typer.Option(help="gaze, arm or marker; see above.")] = "gaze",
    mode: Annotated[
        str, typer.Option(help="near: postures that have the ball in view; uniform: all postures.")
    ] = "near",
    seed: Seed = 1,
    workers: Annotated[int, typer.Option(min=1, help="Processes that compute beside each other.")] = 1,
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
    from .babble_face import BabbleOptions, run_babble

    options = BabbleOptions(folder, samples, what, mode, seed, workers, scheduler, noise, picture)
    result = run_babble(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")
    if result["outcome"] == "interrupted":
        raise typer.Exit(130)


@app.command(short_help="Time the kernels beside their best exact peers.")
def bench(
    kernel: Annotated[
        list[str] | None, typer.Option(help="Measure this kernel only; may be given several times.")
    ] = None,
    seed: Seed = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="A few repetitions only: seconds, and figures for a first look.")
    ] = False,
    json_file: JsonFile = None,
    picture: Annotated[
        Path | None, typer.Option(help="Draw the figures to this .png or .svg (extra viz).", dir_okay=False)
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            help="Write the tables to this file, or between its marks, as Markdown.", dir_okay=False
        ),
    ] = None,
) -> None:
    """Time the kernels, called from Python, beside the fastest exact ways to do without them.

    Everything runs on one thread, in a process of its own, on landscapes of 320 x 240 float32, and once more
    at 1920 x 1080. The unit is a copy of such a landscape in memory: no kernel that writes one can be much
    faster. Before it is timed, every peer (NumPy, OpenCV, ONNX Runtime if it is installed) must give the
    kernel's own result. Kernel and peers take turns, so that a slow phase of the machine hits all alike; a
    ratio is the median over the rounds.

    Kernels: triangular, triangular_wide, triangular_400, gaussian, gibbs, sample, threshold,
    threshold_quicksort_4800, threshold_select_4800, mlp, attention_step.

    Prints a table with the target of every kernel and whether it was met. Takes about a minute; let the
    machine do nothing else meanwhile.

    Exit code: 0 whether or not the targets are met, 2 for an error, 130 when interrupted.
    """
    from .bench.face import bench as run

    run(kernel or [], seed, quick, json_file, picture, markdown, out, err)


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
    workers: Annotated[int, typer.Option(min=1, help="Processes that search beside each other.")] = 1,
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
    from .training import TrainOptions, run_train

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


def _layers(text: str) -> tuple[int, ...]:
    parts = text.replace("-", ",").split(",")
    if not all(part.isdecimal() and 0 < int(part) <= 1000 for part in parts):
        raise typer.BadParameter(f"'{text}' is not numbers of nodes, e.g. 25,25", param_hint="--hidden")
    return tuple(int(part) for part in parts)


@evaluate.command("projection", short_help="Pixels between rendered balls and their projection.")
def _projection(
    poses: Annotated[int, typer.Option(min=1, help="Random postures.")] = 200,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Rendered balls: segmented centroid against the projected outline's centre, in pixels."""
    from .evaluate.projection import evaluate_projection

    _measure("projection", evaluate_projection, json_file, poses=poses, seed=seed)


@evaluate.command("search", short_help="Cycles to find the glass: primed, anywhere, full scan.")
def _search(
    scenes: Annotated[int, typer.Option(min=1, help="Scenes for each size of glass.")] = 100,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Cycles to find the glass: peripersonal windows, windows anywhere, and one full scan."""
    from .evaluate.search import evaluate_search

    _measure("search", evaluate_search, json_file, scenes=scenes, seed=seed)


@evaluate.command("reach", short_help="How often the palm ends before the glass.")
def _reach(
    trials: Annotated[int, typer.Option(min=1, help="Reaches from random starts.")] = 20,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """How often the palm ends within 1 cm of the true pre-grasp point."""
    from .evaluate.reach import evaluate_reach

    _measure("reach", evaluate_reach, json_file, trials=trials, seed=seed)


@evaluate.command("maps", short_help="Learned projections: errors, speed, adapting to other robots.")
def _maps(
    seed: Seed = 0,
    data: Annotated[
        Path, typer.Option(help="Folder that keeps what is babbled, for the next time.", file_okay=False)
    ] = Path("runs/maps"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Very little of everything: does it run? Figures mean nothing.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML report with plots to this file.", dir_okay=False)
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Babble, learn, adapt: how well the maps from the workspace to the eyes are learned.

    Babbles 24,000 postures near the gaze and 16,000 uniform ones, about five minutes the first time; trains
    the paper's network (12-25-25-2) and the best of a search over architectures for each eye; draws five
    robots that do not match the model and adapts every kind of projection to each by 100 samples; times the
    projection of 50 points and the training beside their peers.
    """
    from .evaluate.common import Progress, check_writable, table, write_json
    from .evaluate.maps import QUICK, evaluate_maps, report_maps
    from .sim.icub import load_icub

    for path, option in ((json_file, "json"), (report, "report")):
        if path is not None:
            check_writable(path, option)
    maps = evaluate_maps(
        load_icub(), seed=seed, data=data, size=QUICK if quick else None, progress=Progress(err)
    )
    out.print(table("evaluate maps", maps.figures))
    if report is not None:
        report_maps(maps, report)
        err.print(f"Report: {report}", markup=False, highlight=False, soft_wrap=True)
    if json_file is not None:
        write_json(json_file, maps.figures)
        err.print(f"wrote {json_file}", markup=False, highlight=False, soft_wrap=True)


@evaluate.command("recording", short_help="A recorded iCub: its thumb predicted from its joints.")
def _recording(
    path: Annotated[Path, typer.Argument(help="Folder that yarpdatadumper wrote, with head, arm and eyes.")],
    seed: Seed = 0,
    picture: Annotated[
        Path | None,
        typer.Option(help="Draw tips and errors to this .png or .svg (extra viz).", dir_okay=False),
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Thumb of a recorded iCub in both eyes, predicted from its joints before and after adapting, in pixels.

    Trained on the first 70 % of the time and tested on the rest; "wide" is the other way round, tested on
    the first 30 %. "before" has the encoders and the model as they are and fits only where the tip is on the
    hand, "after" is calibrated, "hand_map" is a network on the joints that knows no robot.

    PATH holds the streams head, rightArm, images/left and images/right, each with its data.log.
    """
    from .evaluate.common import Progress, check_writable, table, write_json
    from .evaluate.recording import evaluate_recording
    from .sim.icub import load_icub

    if picture is not None:
        from .report import check_plots

        if picture.suffix not in (".png", ".svg"):
            raise typer.BadParameter(f"'{picture}' is no .png or .svg", param_hint="--picture")
        check_plots()
    for file, option in ((json_file, "json"), (picture, "picture")):
        if file is not None:
            check_writable(file, option)
    measured = evaluate_recording(load_icub(), path, seed=seed, progress=Progress(err))
    out.print(table("evaluate recording", measured.figures))
    if picture is not None:
        from .evaluate.recording_picture import draw_recording

        draw_recording(measured, picture)
        err.print(f"wrote {picture}", markup=False, highlight=False, soft_wrap=True)
    if json_file is not None:
        write_json(json_file, measured.figures)
        err.print(f"wrote {json_file}", markup=False, highlight=False, soft_wrap=True)


def _measure(
    name: str, evaluation: Callable[..., dict[str, Any]], json_file: Path | None, **options: Any
) -> None:
    from .evaluate.common import Progress, check_writable, table, write_json
    from .sim.icub import load_icub

    if json_file is not None:
        check_writable(json_file)  # now, not after an hour of measuring
    result = evaluation(load_icub(), progress=Progress(err), **options)
    out.print(table(f"evaluate {name}", {k: v for k, v in result.items() if k != "details"}))
    if json_file is not None:
        write_json(json_file, result)
        err.print(f"wrote {json_file}", markup=False, highlight=False, soft_wrap=True)
