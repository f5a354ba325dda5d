"""``motorprime evaluate stand``."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import JsonFile, Seed


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("stand", short_help="The grasp alone, without eyes: how often is the glass lifted?")(_grasp)


def _grasp(
    trials: Annotated[int, typer.Option(min=1, help="Glasses to lift.")] = 100,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Glasses of 80-300 g and 60-75 mm grasped and lifted 6 cm by friction, the palm a little off.

    No eyes take part: the palm goes where it ought to, but for up to 4 mm along each axis and 2 deg. Lifted
    is what stays 5 cm over the table for a whole second, touched by nothing but the hand. "pushed" is how
    far the glass was moved before the hand closed, "dragged" after; "depth" is how far hand and glass were
    inside each other.
    """
    from ..evaluate.grasp_stand import evaluate_stand
    from .evaluating import _measure

    _measure("stand", evaluate_stand, json_file, trials=trials, seed=seed)
