"""``motorprime evaluate attention``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import show, writable, wrote
from .options import JsonFile, PictureFile, Seed, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("attention", short_help="How much must be looked at to see what the task needs?")(
        _attention
    )


def _attention(
    scenes: Annotated[int, typer.Option(min=1, help="Scenes with a reach under way.")] = 200,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    picture: PictureFile = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Recall of what the task needs against the part of the image looked at, while the robot reaches.

    Relevant are the pixels of the glass, of the obstacle on the way, and of the own palm and fingers. Each
    method ranks all pixels: anywhere (uniform), the middle of the image (center), a disc between palm and
    target (zoom_lens), two saliency maps, the reachable space (peripersonal), the path of the palm alone
    (palm_path), all that the plan involves (motorplan: path, own hand, target and obstacle where they were
    located), and that weighted with saliency. "pixels_for_95" is the part of the image at which 95 % of the
    relevant pixels are seen, in the mean over scenes; "auc" the mean recall over all parts.
    """
    from ..evaluate.attention import evaluate_attention
    from ..evaluate.common import Progress
    from ..report.picture import check_picture
    from ..sim.icub import load_icub

    if picture is not None:
        check_picture(picture)
    writable(json=json_file, picture=picture)
    robot = load_icub()
    result = evaluate_attention(robot, scenes=scenes, seed=seed, workers=workers, progress=Progress(err))
    show("attention", result, json_file)
    if picture is not None:
        from ..evaluate.attention_moments import first_moment
        from ..evaluate.attention_picture import draw_attention

        draw_attention(result, first_moment(robot, seed), picture)
        wrote(picture)
