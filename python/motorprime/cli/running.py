"""``motorprime reach`` and ``motorprime bench``."""

from __future__ import annotations

import json
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from .options import AsJson, JsonFile, PictureFile, Seed, err, out

LARGEST = 4096  # side of the eyes' images [px]


class ProjectionName(str, Enum):
    """Ways to know where points appear in the eyes."""

    KINEMATIC = "kinematic"
    NEURAL = "neural"
    HYBRID = "hybrid"


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
    obstacle: Annotated[
        bool, typer.Option("--obstacle", help="Let something stand between hand and glass.")
    ] = False,
    perturb: Annotated[
        bool,
        typer.Option(
            "--perturb",
            help="Let the glass jump 10 cm during the reach; with --obstacle, let that appear only then.",
        ),
    ] = False,
    video: Annotated[bool, typer.Option(help="Write a video of the run.")] = True,
    gui: Annotated[bool, typer.Option("--gui", help="Watch in pybullet's window.")] = False,
    as_json: AsJson = False,
) -> None:
    """Let the simulated iCub find a red glass, reach for it and lift it, looking only where it matters.

    The robot starts in a random posture, searches the glass with windows over its reachable space, turns its
    gaze there, and looks along the way that its hand would take for what may stand in it. It plans by coupled
    dynamical systems of eye, arm and hand, around an obstacle by a via-point, and moves with a fresh look
    along the plan at every vision cycle; then it closes the hand and lifts the glass by friction. A scan of
    the full images runs beside every cycle, for comparison only.

    Leaves runs/NAME/ with report.html (open it in a browser), video.webm and result.json.

    Exit code: 0 when the glass was lifted, 1 when it was not, 2 for an error, 130 when interrupted.
    """
    image_size, place = _size(size), _place(glass_at)
    if not glass and (obstacle or perturb):
        option = "--obstacle" if obstacle else "--perturb"
        raise typer.BadParameter("there is no glass to stand behind or to jump", param_hint=option)
    from ..demo import ReachOptions, run_reach

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
        obstacle=obstacle,
        perturb=perturb,
    )
    result = run_reach(options, err if as_json else out)
    if as_json:
        sys.stdout.write(json.dumps(result, indent=2) + "\n")
    if result["outcome"] == "interrupted":
        raise typer.Exit(130)
    raise typer.Exit(0 if result.get("judged", {}).get("lifted") else 1)


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


def bench(
    kernel: Annotated[
        list[str] | None, typer.Option(help="Measure this kernel only; may be given several times.")
    ] = None,
    seed: Seed = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="A few repetitions only: seconds, and figures for a first look.")
    ] = False,
    json_file: JsonFile = None,
    picture: PictureFile = None,
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
    from ..bench.face import bench as run

    run(kernel or [], seed, quick, json_file, picture, markdown, out, err)
