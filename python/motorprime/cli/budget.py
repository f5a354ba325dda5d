"""``motorprime evaluate budget``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import show, writable
from .options import JsonFile, Seed, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("budget", short_help="A detector within a budget of time: does it end, is it used?")(
        _budget
    )


def _budget(
    cycles: Annotated[int, typer.Option(min=1, help="Cycles, each with a budget of its own.")] = 2000,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Histogram windows of 20 x 20 from drawn scenes, as many as fit into 2 to 50 ms, for 2,000 cycles.

    "overshoot_p99" is the 99th percentile of (t - b) / max(b, 10 ms), "used_median" the median of t / b where
    there was more to look at, in wall-clock time. Other programs that take the processor away make cycles end
    late: "own_time" are the figures of some more cycles on a clock that stands still meanwhile. Then a table
    of what the ways to find a target by its histogram take, in milliseconds.
    """
    from ..evaluate.budget import evaluate_budget
    from ..evaluate.common import Progress

    writable(json=json_file)
    show("budget", evaluate_budget(cycles=cycles, seed=seed, progress=Progress(err)), json_file)
