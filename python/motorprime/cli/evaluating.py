"""``motorprime evaluate NAME``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import attention, budget, dynamics, dynamics_learning, ik, looking, moving, paper, payoff, surf
from .measuring import measure, show, writable, wrote
from .options import JsonFile, PictureFile, Seed, err

evaluate = typer.Typer(help="Measure a figure; print a table, and JSON for machines.", no_args_is_help=True)
for part in (attention, budget, dynamics, dynamics_learning, ik, looking, moving, paper, payoff, surf):
    part.register(evaluate)


@evaluate.command("projection", short_help="Pixels between rendered balls and their projection.")
def _projection(
    poses: Annotated[int, typer.Option(min=1, help="Random postures.")] = 200,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Rendered balls: segmented centroid against the projected outline's centre, in pixels."""
    from ..evaluate.projection import evaluate_projection

    measure("projection", evaluate_projection, json_file, poses=poses, seed=seed)


@evaluate.command("search", short_help="Cycles to find the glass: primed, anywhere, full scan.")
def _search(
    scenes: Annotated[int, typer.Option(min=1, help="Scenes for each size of glass.")] = 100,
    strategy: Annotated[
        list[str] | None,
        typer.Option(
            help="Also by few windows chosen so: gibbs, independent, apart or stratified; more than once."
        ),
    ] = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Cycles to find the glass: peripersonal windows, windows anywhere, and one full scan.

    With --strategy the same scenes are searched by 10 windows a cycle as well, in up to five times as many
    cycles, without and with a memory of what was looked at in vain.
    """
    from ..evaluate.search import evaluate_search

    measure("search", evaluate_search, json_file, scenes=scenes, seed=seed, strategies=strategy or [])


@evaluate.command("reach", short_help="How often the palm ends before the glass.")
def _reach(
    trials: Annotated[int, typer.Option(min=1, help="Reaches from random starts.")] = 20,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """How often the palm ends within 1 cm of the true pre-grasp point."""
    from ..evaluate.reach import evaluate_reach

    measure("reach", evaluate_reach, json_file, trials=trials, seed=seed)


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
    from ..evaluate.common import Progress
    from ..evaluate.maps import QUICK, evaluate_maps, report_maps
    from ..report.sheet import check_report
    from ..sim.icub import load_icub

    if report is not None:
        check_report(report)
    writable(json=json_file, report=report)
    maps = evaluate_maps(
        load_icub(), seed=seed, data=data, size=QUICK if quick else None, progress=Progress(err)
    )
    show("maps", maps.figures, json_file)
    if report is not None:
        report_maps(maps, report)
        wrote(report, "Report:")


@evaluate.command("recording", short_help="A recorded iCub: its thumb predicted from its joints.")
def _recording(
    path: Annotated[Path, typer.Argument(help="Folder that yarpdatadumper wrote, with head, arm and eyes.")],
    seed: Seed = 0,
    picture: PictureFile = None,
    json_file: JsonFile = None,
) -> None:
    """Thumb of a recorded iCub in both eyes, predicted from its joints before and after adapting, in pixels.

    Trained on the first 70 % of the time and tested on the rest; "wide" is the other way round, tested on
    the first 30 %. "before" has the encoders and the model as they are and fits only where the tip is on the
    hand, "after" is calibrated, "hand_map" is a network on the joints that knows no robot.

    PATH holds the streams head, rightArm, images/left and images/right, each with its data.log.
    """
    from ..evaluate.common import Progress
    from ..evaluate.recording import evaluate_recording
    from ..sim.icub import load_icub

    if picture is not None:
        from ..report import check_plots

        if picture.suffix not in (".png", ".svg"):
            raise typer.BadParameter(f"'{picture}' is no .png or .svg", param_hint="--picture")
        check_plots()
    writable(json=json_file, picture=picture)
    measured = evaluate_recording(load_icub(), path, seed=seed, progress=Progress(err))
    show("recording", measured.figures, json_file)
    if picture is not None:
        from ..evaluate.recording_picture import draw_recording

        draw_recording(measured, picture)
        wrote(picture)
