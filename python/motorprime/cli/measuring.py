"""What the commands that measure share: they refuse a bad file at once, print a table, and write JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from .options import err, out


def writable(**files: Path | None) -> None:
    """Make sure, before an hour of measuring, that the files of these options can be written."""
    from ..evaluate.common import check_writable

    for option, path in files.items():
        if path is not None:
            check_writable(path, option)


def show(name: str, result: Mapping[str, Any], json_file: Path | None) -> None:
    """Print what ``motorprime evaluate NAME`` found, but for its details, and write all of it as JSON."""
    from ..evaluate.common import table, write_json

    out.print(table(f"evaluate {name}", {k: v for k, v in result.items() if k != "details"}))
    if json_file is not None:
        write_json(json_file, result)
        wrote(json_file)


def wrote(path: Path, what: str = "wrote") -> None:
    """Say where something was written."""
    err.print(f"{what} {path}", markup=False, highlight=False, soft_wrap=True)


def measure(
    name: str, evaluation: Callable[..., dict[str, Any]], json_file: Path | None, **options: Any
) -> dict[str, Any]:
    """Run an evaluation of the simulated iCub, with a progress bar; returns what it found."""
    from ..evaluate.common import Progress
    from ..sim.icub import load_icub

    writable(json=json_file)
    result = evaluation(load_icub(), progress=Progress(err), **options)
    show(name, result, json_file)
    return result
