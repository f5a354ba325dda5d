"""Plots as files of their own."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ArgumentError, MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = (".png", ".svg")


def check_picture(path: Path) -> None:
    """Raise now what :func:`save_picture` would raise at the end.

    Raises:
        ArgumentError: the file's name ends with something else than .png or .svg.
        MissingExtraError: matplotlib is missing.
    """
    if path.suffix.lower() not in KINDS:
        raise ArgumentError(f"picture: a file name that ends with .png or .svg expected, got {path}")
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("the picture (matplotlib)", "viz")


def save_picture(figure: Figure, path: Path) -> None:
    """Write a plot as .png or .svg.

    Raises:
        ArgumentError: the file cannot be written, or its name ends otherwise.
    """
    check_picture(path)
    metadata = {"Date": None} if path.suffix.lower() == ".svg" else {}
    try:
        figure.savefig(path, dpi=150, metadata=metadata)
    except OSError as error:
        raise ArgumentError(f"picture: cannot write {path}: {error.strerror}") from None
