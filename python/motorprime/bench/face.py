"""What ``motorprime bench`` shows and writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import ArgumentError
from ..evaluate.common import check_writable, write_json
from ..report.picture import check_picture
from . import suite
from .child import measure_in_child
from .picture import draw
from .table import STAR, disturbed, markdown, missed, sizes_table, table, two_threads

BEGIN, END = "<!-- motorprime bench: begin -->", "<!-- motorprime bench: end -->"


def bench(
    kernels: Sequence[str],
    seed: int,
    quick: bool,
    json_file: Path | None,
    picture: Path | None,
    markdown_file: Path | None,
    out: Console,
    err: Console,
) -> None:
    """Measure, print the tables, write what was asked for.

    Raises:
        ArgumentError: an unknown kernel, or a file that cannot be written; noticed before the measuring.
        MissingExtraError: a picture is asked for and matplotlib is missing.
        StateError: a peer is not exact, or the measuring process ended early.
    """
    suite.chosen(kernels)
    files = {"json": json_file, "picture": picture, "markdown": markdown_file}
    if picture is not None:
        check_picture(picture)
    for name, path in files.items():
        if path is not None:
            check_writable(path, name)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True) as bars:
        task = bars.add_task("starting", total=None)

        def report(done: int, of: int, what: str) -> None:
            bars.update(task, completed=done, total=of, description=f"measuring {what}" if what else "done")

        result = measure_in_child(kernels, seed, quick, report)
    out.print(table(result, out.width))
    if words := two_threads(result):
        out.print(words, highlight=False)
    if (larger := sizes_table(result)) is not None:
        out.print(larger)
    if disturbed(result):
        out.print(STAR, highlight=False)
    names = missed(result)
    out.print(
        f"Targets missed: {', '.join(names)}." if names else "Every target that was measured is met.",
        highlight=False,
    )
    if json_file is not None:
        write_json(json_file, result)
    if picture is not None:
        draw(result, picture)
    if markdown_file is not None:
        _write(markdown_file, markdown(result))
    for path in filter(None, files.values()):
        err.print(f"wrote {path}", markup=False, highlight=False, soft_wrap=True)


def _write(path: Path, text: str) -> None:
    """Write a file, or only the part of it between the marks if it has them."""
    try:
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        before, begin, rest = old.partition(BEGIN)
        _, end, after = rest.partition(END)
        if end:
            text = f"{before}{begin}\n\n{text}\n{end}{after}"
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ArgumentError(f"markdown: cannot write {path}: {error.strerror}") from None
