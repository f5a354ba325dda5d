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
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the result as JSON on stdout, everything else on stderr.")
    ] = False,
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
