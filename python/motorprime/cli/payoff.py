"""``motorprime evaluate payoff``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import show, writable, wrote
from .options import JsonFile, PictureFile, Seed, TextModel, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("payoff", short_help="Which detectors attention makes faster, and which it does not.")(
        _payoff
    )


def _payoff(
    rounds: Annotated[int, typer.Option(min=1, help="Timed runs, of which the median counts.")] = 5,
    picture: PictureFile = None,
    text_model: TextModel = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Where attention pays: six detectors, images of 320 x 240 to 1920 x 1080, 5 to 100 % of the pixels.

    The attended side's time begins with a projected path and holds landscape, choice of pixels and detector;
    both sides run on one thread, in turn, in processor time. "speedup" is by the part of the image that is
    attended, "pays_up_to" the largest part at which attention is no loss. "break_even_ns_per_pixel" is the
    price of full frames below which a detector is better off without it even if its time is proportional to
    its pixels. Back-projection of a histogram is about that cheap.
    """
    from ..evaluate.common import Progress
    from ..evaluate.payoff import evaluate_payoff
    from ..report.picture import check_picture

    if picture is not None:
        check_picture(picture)
    writable(json=json_file, picture=picture)
    result = evaluate_payoff(rounds=rounds, seed=seed, text_model=text_model, progress=Progress(err))
    show("payoff", result, json_file)
    if picture is not None:
        from ..evaluate.payoff_picture import draw_payoff

        draw_payoff(result, picture)
        wrote(picture)
