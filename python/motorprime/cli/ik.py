"""``motorprime evaluate ik`` and ``elbow``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .measuring import measure, show, writable, wrote
from .options import JsonFile, Seed, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("elbow", short_help="A person's elbow, learned from motion capture, on the robot.")(
        _elbow
    )
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

    measure("ik", evaluate_ik, json_file, poses=poses, seed=seed)


def _elbow(
    path: Annotated[Path, typer.Argument(help="Motion capture of somebody who grasps (.tsv).")],
    poses: Annotated[int, typer.Option(min=1, help="Poses of each kind that are solved.")] = 200,
    save: Annotated[
        Path | None, typer.Option("--out", help="Write what was learned to this file.", dir_okay=False)
    ] = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """A person's elbow learned from the reaches in PATH, and poses of the robot with and without heeding it.

    "error_deg" is how far the elbow's swivel about the line from shoulder to wrist is off on reaches that
    were left out. Under the kind of poses and the preference's weight: "solved", how far the robot's swivel
    is off the person's ("off_deg", "p90_off_deg"), joints at their stops and discomfort.
    """
    from ..evaluate.common import Progress
    from ..evaluate.elbow import evaluate_elbow
    from ..sim.icub import load_icub

    writable(json=json_file, out=save)
    figures, swivel = evaluate_elbow(load_icub(), path, poses=poses, seed=seed, progress=Progress(err))
    show("elbow", figures, json_file)
    if save is not None:
        swivel.save(save)
        wrote(save)
