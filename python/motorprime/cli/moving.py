"""``motorprime evaluate obstacle``, ``evaluate grasp`` and ``evaluate stand``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import measure, show, writable
from .options import JsonFile, Seed, err


def register(evaluate: typer.Typer) -> None:
    """Add the commands to ``motorprime evaluate``."""
    evaluate.command("obstacle", short_help="Planned paths past something in the way: are they clear?")(
        _obstacle
    )
    evaluate.command("grasp", short_help="How often the glass is found, grasped and lifted.")(_grasp)
    evaluate.command("stand", short_help="The grasp alone, without eyes: how often is the glass lifted?")(
        _stand
    )


def _obstacle(
    scenes: Annotated[int, typer.Option(min=1, help="Scenes in which the way is blocked.")] = 500,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Paths of the palm, planned past an upright cylinder that stands in the way straight ahead.

    A scene is a goal over the table, a start 0.25 to 0.5 m from it, and a cylinder of 2 to 4.5 cm radius and
    8 to 20 cm height that the path without it would come too close to. "clear" are paths whose point, the
    middle of the palm, keeps half a hand (6 cm) off it; "minimum_distance_m" is the least distance from that
    enclosing cylinder. The dynamics are the shipped ones.
    """
    from .. import shipped
    from ..evaluate.common import Progress
    from ..evaluate.obstacle import evaluate_obstacle

    writable(json=json_file)
    dynamics = shipped.coupled_dynamics()
    show("obstacle", evaluate_obstacle(dynamics, scenes=scenes, seed=seed, progress=Progress(err)), json_file)


def _grasp(
    trials: Annotated[int, typer.Option(min=1, help="Trials that are not refused.")] = 100,
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
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Find a glass, look for what is in the way, plan, reach, close the hand, lift: by what the eyes see.

    Glasses of 80 to 300 g, 60 to 75 mm wide, held by friction alone (at most 0.8 on both sides, none against
    rolling and spinning) with fingers of 0.3 N m. "lifted": for a whole second the bottom stays 5 cm over the
    table and nothing but the robot touches the glass. What the robot refuses before it moves the arm is
    counted apart and replaced. The JSON file tells of every trial, with the glass that was drawn.
    """
    from ..evaluate.grasp import evaluate_grasp

    measure(
        "grasp",
        evaluate_grasp,
        json_file,
        trials=trials,
        seed=seed,
        obstacle=obstacle,
        perturb=perturb,
        workers=workers,
    )


def _stand(
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

    measure("stand", evaluate_stand, json_file, trials=trials, seed=seed)
