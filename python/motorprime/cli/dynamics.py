"""``motorprime evaluate rollout`` and ``stability``: the coupled dynamics of eye, arm and hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .measuring import show, writable
from .options import JsonFile, Seed, err

if TYPE_CHECKING:
    from ..control.cds import CoupledDynamics

Model = Annotated[
    Path | None,
    typer.Option(
        "--model", help="A model that learn cds wrote; the shipped one if not given.", dir_okay=False
    ),
]


def register(evaluate: typer.Typer) -> None:
    """Add the commands to ``motorprime evaluate``."""
    evaluate.command("rollout", short_help="Time to imagine a movement, beside plain NumPy.")(_rollout)
    evaluate.command("stability", short_help="From where eye, arm and hand come to rest.")(_stability)


def _rollout(
    steps: Annotated[int, typer.Option(min=1, max=1_000_000, help="Steps of the movement.")] = 200,
    model: Model = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """How long it takes to imagine a movement of eye, arm and hand, from one random start.

    rust_us is the public call CoupledDynamics.roll_out with its changes of frames, kernel_us the kernel
    alone, numpy_us the same movement in plain NumPy with everything prepared that can be: medians of calls in
    turn, in microseconds of processor time. ratio is numpy_us over rust_us, kernel_ratio over kernel_us.
    max_difference is the largest distance of the two movements, as a part of how far each of eye, place,
    rotation and hand was.
    """
    from ..evaluate.common import Progress
    from ..evaluate.rollout import evaluate_rollout

    writable(json=json_file)
    show("rollout", evaluate_rollout(_load(model), steps=steps, seed=seed, progress=Progress(err)), json_file)


def _stability(
    starts: Annotated[int, typer.Option(min=1, help="Random starts.")] = 10_000,
    model: Model = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Roll out from random starts: does everything come to rest at its goal, and the hand not before the arm?

    Palm and fixation point start anywhere in a cube of 1 m around the goal, the palm turned by up to half a
    turn, the hand 0.2 to 1.2 open. Converged is what within 60 s of model time has its fixation within 1 mm,
    its palm within 1 mm and 1 degree, and its hand within 1 % of the opening. For converged_after_jump the
    goal moves within the first 5 s to another place in the cube, turned by up to half a turn; the 60 s go on.

    A hand closed early if it was less than 0.1 open while the palm was farther than 2 cm:
    closed_early_coupled with the hand coupled to the arm, closed_early_uncoupled with the same dynamics and
    an expected opening of 0. The far starts are 1 km and 1,000 km away, where all densities underflow:
    far_finite counts those without NaN or infinity, far_nearer those whose eye and arm have come nearer in
    the metric of their certificates.
    """
    from ..evaluate.common import Progress
    from ..evaluate.stability import evaluate_stability

    writable(json=json_file)
    result = evaluate_stability(_load(model), starts=starts, seed=seed, progress=Progress(err))
    show("stability", result, json_file)


def _load(path: Path | None) -> CoupledDynamics:
    from ..control.cds import CoupledDynamics
    from ..shipped import coupled_dynamics

    return coupled_dynamics() if path is None else CoupledDynamics.load(path)
