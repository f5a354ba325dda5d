"""``motorprime evaluate ik``."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import JsonFile, Seed


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("ik", short_help="Poses of the palm that inverse kinematics solves, and how fast.")(_ik)


def _ik(
    poses: Annotated[int, typer.Option(min=1, help="Poses that are solved.")] = 1000,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Poses of the palm brought within 2 mm and 2 deg by torso and arm, and the time of each.

    The poses are those of uniform joint angles within the limits; every search starts from the resting
    posture and may start again from other ones, which are counted. "with_margin" keeps every joint 2 % of its
    range off its limits. "follow" moves the goal from pose to pose and lets the palm follow at 100 periods a
    second, no joint faster than 1 rad/s.
    """
    from ..evaluate.ik import evaluate_ik
    from .evaluating import _measure

    _measure("ik", evaluate_ik, json_file, poses=poses, seed=seed)
