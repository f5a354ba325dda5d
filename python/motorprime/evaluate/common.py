"""What all evaluations share: progress bars, tables, JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import cv2
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from rich.table import Table

from ..errors import ArgumentError

T = TypeVar("T")

_COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TextColumn("left"),
    TimeRemainingColumn(),
)


class Progress:
    """A progress bar on ``console``; silent without one."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console

    @contextmanager
    def counting(self, total: int, what: str) -> Iterator[Callable[[int], None]]:
        """A bar for work that tells itself how much of ``total`` is done."""
        if self._console is None:
            yield lambda done: None
            return
        with Bars(*_COLUMNS, console=self._console) as bars:
            task = bars.add_task(what, total=total)
            yield lambda done: bars.update(task, completed=done)
            bars.update(task, completed=total)

    def over(self, items: Iterable[T], what: str) -> Iterator[T]:
        """Iterate with a bar that says what is done, how far it is, and how long it will take."""
        if self._console is None:
            yield from items
            return
        with Bars(*_COLUMNS, console=self._console) as bars:
            yield from bars.track(
                items, total=len(items) if isinstance(items, Sized) else None, description=what
            )


def table(title: str, result: Mapping[str, Any]) -> Table:
    """A table of a result's figures; nested ones are shown with dotted names."""
    shown = Table(title=title, title_justify="left")
    shown.add_column("figure")
    shown.add_column("value", justify="right")
    for name, value in _flat(result):
        shown.add_row(name, _text(value))
    return shown


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return str(value)


def check_writable(path: Path, name: str = "json") -> None:
    """Make sure that a file can be written, its folder included; ``name`` is the option that asks for it.

    Raises:
        ArgumentError: it cannot.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        existed = path.exists()
        path.open("a").close()
        if not existed:
            path.unlink()
    except OSError as error:
        raise ArgumentError(f"{name}: cannot write {path}: {error.strerror}") from None


def write_json(path: Path, result: Mapping[str, Any]) -> None:
    """Write a result as JSON.

    Raises:
        ArgumentError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(result, indent=2) + "\n")
    except OSError as error:
        raise ArgumentError(f"json: cannot write {path}: {error.strerror}") from None


def _flat(result: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in result.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenCV work on one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
