"""A report of figures: headline, numbers, plots and tables on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from ..errors import ArgumentError
from .document import Shot, cards, document, figure, strong, write_whole
from .plots import check_plots


@dataclass(frozen=True)
class Section:
    """One part of a sheet.

    Attributes:
        title: its heading.
        text: a paragraph; empty for none.
        shots: plots.
        header: of a table; empty for none.
        rows: of the table, as text.
    """

    title: str
    text: str = ""
    shots: Sequence[Shot] = ()
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


@dataclass(frozen=True)
class Sheet:
    """A report.

    Attributes:
        title: what it is about.
        headline: the result in a sentence, in parts of which every second one stands out.
        numbers: (number, what it is).
        sections: the rest.
        footer: how it was made.
    """

    title: str
    headline: Sequence[str]
    numbers: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    footer: str


def check_report(path: Path) -> None:
    """Raise now what :func:`write_sheet` and the plots would raise at the end.

    Raises:
        ArgumentError: the file's name does not end with .html.
        MissingExtraError: matplotlib is missing.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"report: a file name that ends with .html expected, got {path}")
    check_plots()


def write_sheet(path: Path, sheet: Sheet) -> None:
    """Write the sheet as one HTML file that needs nothing else; it appears whole or not at all.

    Raises:
        ArgumentError: it cannot be written.
    """
    body = [
        '<p class="kicker">motorprime · motor-primed visual attention</p>\n'
        f"<h1>{escape(sheet.title)}</h1>\n"
        f'<p class="headline">{strong(sheet.headline)}</p>\n{cards(sheet.numbers)}',
        *(_section(section) for section in sheet.sections),
        f"<footer>{escape(sheet.footer)}</footer>",
    ]
    try:
        write_whole(path, document(sheet.title, body))
    except OSError as error:
        raise ArgumentError(f"report: cannot write {path}: {error.strerror}") from None


def _section(section: Section) -> str:
    text = f"<p>{escape(section.text)}</p>\n" if section.text else ""
    shots = "".join(figure(shot, "plot") for shot in section.shots)
    return f"<h2>{escape(section.title)}</h2>\n{text}{shots}{_table(section)}"


def _table(section: Section) -> str:
    if not section.header:
        return ""
    head = "".join(_cell("th", k, text) for k, text in enumerate(section.header))
    lines = "".join(
        f"<tr>{''.join(_cell('td', k, text) for k, text in enumerate(row))}</tr>\n" for row in section.rows
    )
    return (
        f'<div class="scroll"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>{lines}</tbody></table></div>\n'
    )


def _cell(tag: str, column: int, text: str) -> str:
    """The first column holds names, the others numbers."""
    kind = "" if column == 0 else ' class="n"'
    return f"<{tag}{kind}>{escape(text)}</{tag}>"
