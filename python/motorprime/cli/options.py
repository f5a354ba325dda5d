"""What the commands share: where they print, and options that mean the same everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

out = Console()
err = Console(stderr=True)

Seed = Annotated[int, typer.Option(min=0, help="Draws everything; the same seed gives the same result.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", help="Write the figures to this file as JSON.", dir_okay=False)
]
PictureFile = Annotated[
    Path | None, typer.Option(help="Draw the figures to this .png or .svg (extra viz).", dir_okay=False)
]
TextModel = Annotated[
    Path | None,
    typer.Option(help="The text detector's .onnx; not given, the one fetched at set-up.", dir_okay=False),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON on stdout, everything else on stderr.")
]
