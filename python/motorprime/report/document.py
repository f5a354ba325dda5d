"""What all reports are made of: a page that needs nothing else, and pictures with captions."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ICON = (
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'><rect width='32' height='32' rx='7' "
    "fill='#1d2430'/><circle cx='16' cy='16' r='9' fill='none' stroke='#e22024' stroke-width='4'/>"
    "<circle cx='16' cy='16' r='3' fill='#fff'/></svg>"
)


@dataclass(frozen=True)
class Shot:
    """A picture or plot for a report.

    Attributes:
        title: two or three words.
        caption: a sentence that explains it.
        alt: what it shows, for those who cannot see it.
        data: the encoded picture.
        kind: its media type, such as 'image/png'.
        lead: to be shown large, or before the others.
    """

    title: str
    caption: str
    alt: str
    data: bytes
    kind: str
    lead: bool = False


def document(title: str, body: Sequence[str], *, media: str = "data:") -> str:
    """A whole HTML page; empty parts of the body are left out.

    Args:
        title: of the browser's tab.
        body: HTML, part by part.
        media: where videos may come from.
    """
    policy = f"default-src 'none'; img-src data:; media-src {media}; style-src 'unsafe-inline'"
    style = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n"
        f'<link rel="icon" href="{uri(_ICON.encode(), "image/svg+xml")}">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def write_whole(path: Path, text: str) -> None:
    """Write a file that appears whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def cards(numbers: Sequence[tuple[str, str]]) -> str:
    """Large numbers side by side, each with what it is."""
    shown = "".join(
        f"<div><strong>{escape(big)}</strong><span>{escape(small)}</span></div>" for big, small in numbers
    )
    return f'<div class="numbers">{shown}</div>'


def figure(shot: Shot, kind: str = "") -> str:
    """A picture with its caption."""
    title = "" if kind == "plot" else f"<b>{escape(shot.title)}.</b> "
    return (
        f'<figure class="{kind}"><img src="{uri(shot.data, shot.kind)}" alt="{escape(shot.alt)}">'
        f"<figcaption>{title}{escape(shot.caption)}</figcaption></figure>\n"
    )


def strong(parts: Sequence[str]) -> str:
    """Text of which every second part stands out."""
    return "".join(f"<b>{escape(part)}</b>" if k % 2 else escape(part) for k, part in enumerate(parts))


def uri(data: bytes, kind: str) -> str:
    """Data as a link that holds them."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def new_figure(height: float) -> Figure:
    """An empty plot as wide as the page, ``height`` inches tall; draw it within :func:`styled`."""
    from matplotlib.figure import Figure

    return Figure(figsize=(9.0, height), layout="constrained")


def plotted(figure: Figure, title: str, caption: str, alt: str, *, lead: bool = False) -> Shot:
    """A plot as SVG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return Shot(title, caption, alt, buffer.getvalue(), "image/svg+xml", lead)
