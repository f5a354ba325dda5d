"""The command line: ``motorprime reach`` does the main job, ``motorprime evaluate NAME`` measures it."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from .. import __version__
from ..errors import Error
from .dynamics_learning import learn
from .evaluating import evaluate
from .learning import babble, train
from .options import err, out
from .running import bench, reach

app = typer.Typer(
    help="Motor-primed visual attention: look only where the robot is going to move.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command(short_help="Let the simulated iCub find a glass and lift it.")(reach)
app.command(short_help="Collect samples to learn from: random postures and a ball.")(babble)
app.add_typer(train, name="train")
app.add_typer(learn, name="learn")
app.command(short_help="Time the kernels beside their best exact peers.")(bench)
app.add_typer(evaluate, name="evaluate")


def main() -> None:
    """Run the command line; errors of the library are one line on stderr and exit code 2."""
    try:
        app()
    except Error as error:
        err.print(f"motorprime: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)


def _version(value: bool) -> None:
    if value:
        out.print(f"motorprime {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
