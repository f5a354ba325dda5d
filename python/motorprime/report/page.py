"""The report as one HTML page: pictures, plots and video are inside it, there is no script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from ..viz import LEGEND
from .document import Shot, cards, document, figure, strong, uri, write_whole
from .text import (
    convergence,
    explanation,
    headline,
    note,
    numbers,
    outcome_class,
    outcome_line,
    pairs,
)

EMBED_LIMIT = 20_000_000  # a larger video is linked instead [bytes]


def write_report(
    path: Path,
    data: Mapping[str, Any],
    *,
    pictures: Sequence[Shot] = (),
    outside: Sequence[Shot] = (),
    plots: Sequence[Shot] = (),
    video: Path | None = None,
    poster: bytes | None = None,
) -> None:
    """Write a report, see :func:`page`; the file appears whole or not at all.

    Raises:
        OSError: it cannot be written, or the video cannot be read.
    """
    text = page(data, pictures=pictures, outside=outside, plots=plots, video=video, poster=poster)
    write_whole(path, text)


def page(
    data: Mapping[str, Any],
    *,
    pictures: Sequence[Shot] = (),
    outside: Sequence[Shot] = (),
    plots: Sequence[Shot] = (),
    video: Path | None = None,
    poster: bytes | None = None,
) -> str:
    """A report as HTML.

    Args:
        data: as in result.json.
        pictures: what the robot saw, in order.
        outside: what a bystander saw, in order.
        plots: of the run.
        video: a WebM file; inside the page up to :data:`EMBED_LIMIT`, else linked by its name.
        poster: JPEG shown before the video plays.
    """
    title = f"{data['title']}: {data['outcome']}"
    linked = video is not None and video.stat().st_size >= EMBED_LIMIT
    media = "data: file: 'self'" if linked else "data:"
    body = [
        _head(data),
        _film(video, poster, linked),
        _outside(outside),
        _story(pictures),
        _plots([plot for plot in plots if plot.lead]),
        _convergence(data),
        _table(data),
        _plots([plot for plot in plots if not plot.lead]),
        _details(data),
    ]
    return document(title, body, media=media)


def _head(data: Mapping[str, Any]) -> str:
    outcome, reason = str(data["outcome"]), str(data["reason"])
    kind = outcome_class(data)
    banner = ""
    if outcome in ("interrupted", "failed", "running"):
        said = f"<b>This run was not completed.</b> {escape(outcome_line(data))}"
        said += f" {escape(reason[:1].upper() + reason[1:])}." if reason else ""
        banner = f'<div class="banner {kind}"><p>{said} The figures cover the cycles until then.</p></div>\n'
    why = f'<span class="reason">{escape(reason)}</span>' if reason and not banner else ""
    return (
        f'{banner}<p class="kicker">motorprime · motor-primed visual attention</p>\n'
        f"<h1>{escape(str(data['title']))}</h1>\n"
        f'<p><span class="outcome {kind}">{escape(outcome_line(data))}</span>{why}</p>\n'
        f'<p class="headline">{strong(headline(data))}</p>\n'
        f"{cards(numbers(data))}\n"
        f"<p>{escape(explanation())}</p>"
    )


def _film(video: Path | None, poster: bytes | None, linked: bool) -> str:
    if video is None:
        return ""
    source = escape(video.name) if linked else uri(video.read_bytes(), "video/webm")
    still = f' poster="{uri(poster, "image/jpeg")}"' if poster else ""
    beside = (
        f" The video is too large for this page and lies beside it: {escape(video.name)}." if linked else ""
    )
    return (
        "<h2>The run</h2>\n<figure>"
        f'<video controls muted preload="metadata"{still} src="{source}" '
        'aria-label="The run: both eyes with attention, a bystander\'s view, and what looking cost"></video>'
        "<figcaption>One frame per vision cycle, ten per second. Above: what both eyes see, and where "
        f"attention is. Below: a bystander's view and what looking cost.{beside}</figcaption></figure>"
    )


def _outside(pictures: Sequence[Shot]) -> str:
    shown = "".join(figure(shot) for shot in pictures)
    return f'<div class="grid three">{shown}</div>' if pictures else ""


def _story(pictures: Sequence[Shot]) -> str:
    if not pictures:
        return ""
    swatches = "".join(
        f'<li><i style="background:rgb({r},{g},{b})"></i>{escape(meaning)}</li>'
        for (r, g, b), meaning in LEGEND
    )
    lead = next((shot for shot in pictures if shot.lead), pictures[0])
    shown = "".join(figure(shot) for shot in pictures if shot is not lead)
    return (
        "<h2>What the robot looked at</h2>\n"
        "<p>Left and right eye, side by side. The redder, the more relevant to the motion.</p>\n"
        f'<ul class="legend">{swatches}</ul>\n{figure(lead)}<div class="grid">{shown}</div>'
    )


def _plots(plots: Sequence[Shot]) -> str:
    return "".join(f"<h2>{escape(shot.title)}</h2>\n{figure(shot, 'plot')}" for shot in plots)


def _convergence(data: Mapping[str, Any]) -> str:
    certificates = data["certificates"]
    if not certificates:
        return ""
    rows = "".join(
        f'<tr><td>{escape(name)}</td><td class="n">{-each["continuous"]:.3g}</td>'
        f'<td class="n">{each["discrete"]:.6f}</td><td class="n">{1e3 * each["step"]:g}</td></tr>\n'
        for name, each in certificates.items()
    )
    return (
        f"<h2>Why it must converge</h2>\n<p>{escape(convergence())}</p>\n"
        '<table><thead><tr><th>system</th><th class="n">distance shrinks by at least [1/s]</th>'
        '<th class="n">factor of an Euler step, at most</th><th class="n">largest such step [ms]</th></tr>'
        f"</thead>\n<tbody>{rows}</tbody></table>\n"
    )


def _table(data: Mapping[str, Any]) -> str:
    attended, full, cheap = data["attended_ms"], data["full_frame_ms"], data["back_projection_ms"]
    if attended is None:
        return ""
    rows = [("", name, figures) for name, figures in data["stages_ms"].items()]
    rows.append(("total", "with attention, all stages", attended))
    if full is not None:
        rows.append(("full", "scan of the full images", full))
    if cheap is not None:
        rows.append(("other", "for comparison: back-projection of the full images", cheap))
    longest = max(figures["median"] for _, _, figures in rows) or 1.0
    lines = "".join(
        f'<tr class="{kind}"><td>{escape(name)}</td><td class="n">{figures["median"]:.2f}</td>'
        f'<td class="n">{figures["lower_quartile"]:.2f} to {figures["upper_quartile"]:.2f}</td>'
        f'<td class="scale"><span class="bar" style="width:{100 * figures["median"] / longest:.2f}%"></span>'
        "</td></tr>\n"
        for kind, name, figures in rows
    )
    said = "".join(f'<p class="note">{escape(line)}</p>\n' for line in note(data))
    return (
        "<h2>What a vision cycle costs</h2>\n<table>\n<thead><tr><th>both eyes, per cycle</th>"
        '<th class="n">median [ms]</th><th class="n">quartiles [ms]</th>'
        "<th>median, to scale</th></tr></thead>\n"
        f"<tbody>{lines}</tbody></table>\n{said}"
    )


def _details(data: Mapping[str, Any]) -> str:
    tables = "".join(
        f'<h2>{title}</h2>\n<table class="pairs">{rows}</table>\n'
        for title, rows in (
            ("As judged from outside", _pair_rows(data["judged"])),
            ("The run's settings", _pair_rows(data["meta"])),
        )
        if rows
    )
    versions = ", ".join(f"{name} {version}" for name, version in data["versions"].items())
    made = f"Made by {escape(versions)}. All figures are in result.json."
    return f"{tables}{_cycles(data['history'])}\n<footer>{made}</footer>"


def _pair_rows(values: Mapping[str, Any]) -> str:
    return "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in pairs(values)
    )


def _cycles(history: Sequence[Mapping[str, Any]]) -> str:
    if not history:
        return ""
    lines = "".join(
        f'<tr><td class="n">{k}</td><td>{escape(str(r["phase"]))}</td><td class="n">{r["time"]:.2f}</td>'
        f'<td class="n">{r["attended"]:.1%}</td><td class="n">{1e3 * sum(r["seconds"].values()):.1f}</td>'
        f"<td>{'yes' if r['located'] else 'no'}</td>{_full_cells(r['full_frame'])}</tr>\n"
        for k, r in enumerate(history, start=1)
    )
    return (
        '<details><summary>Every cycle</summary><div class="scroll"><table class="small"><thead><tr>'
        '<th class="n">cycle</th><th>phase</th><th class="n">time [s]</th><th class="n">looked at</th>'
        '<th class="n">with attention [ms]</th><th>located</th><th class="n">full scan [ms]</th>'
        f"<th>full scan located</th></tr></thead><tbody>{lines}</tbody></table></div></details>"
    )


def _full_cells(full: Mapping[str, Any] | None) -> str:
    if full is None:
        return '<td class="n">–</td><td>–</td>'
    return f'<td class="n">{1e3 * full["seconds"]:.1f}</td><td>{"yes" if full["located"] else "no"}</td>'
