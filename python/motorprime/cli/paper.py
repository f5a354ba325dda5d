"""``motorprime evaluate paper``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import measure, writable, wrote
from .options import JsonFile, PictureFile, Seed


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("paper", short_help="The paper's experiments: how much faster, and is as much found?")(
        _paper
    )


def _paper(
    measurements: Annotated[
        int, typer.Option(min=1, help="Of each kind, with and without an obstacle.")
    ] = 200,
    workers: Annotated[int, typer.Option(min=1, help="Processes. Times are best taken with one.")] = 1,
    picture: PictureFile = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Two detectors, by the reachable space and by the plan of a reach, with and without an obstacle.

    The histogram detector scores windows of 20 x 20 px by the intersection of histograms: every one of them
    on the one side, 50 for each eye, sampled from the landscape, on the other. SURF (threshold 300) looks at
    all pixels, or at 30 % of them, in a room with print about; speedup_in_bare_room is without. The detector
    is the same on both sides, on one thread, in turn; the attended side's time begins with the posture or the
    plan.

    speedup is beside paper_speedup. found is the share of the eyes that have the target in view in which it
    is found within ten cycles; false_positives counts detections beside the target, in the same scenes with
    things about that look like it, for a stereo pair. back_projection is the short cut for a full frame,
    which is no part of any ratio.
    """
    from ..evaluate.paper import evaluate_paper
    from ..report.picture import check_picture

    if picture is not None:
        check_picture(picture)
    writable(picture=picture)
    result = measure(
        "paper", evaluate_paper, json_file, measurements=measurements, seed=seed, workers=workers
    )
    if picture is not None:
        from ..evaluate.paper_picture import draw_paper

        draw_paper(result, picture)
        wrote(picture)
