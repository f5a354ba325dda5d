"""The picture of ``motorprime evaluate paper``: where the time goes, how much is saved, what is found."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..report.picture import save_picture
from ..report.plots import COLOURS, FULL, INK, LINE, styled
from .paper import PAPER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = {
    "histogram_peripersonal": "histogram,\nreachable space",
    "histogram_motorplan": "histogram,\nmotor plan",
    "surf_peripersonal": "SURF,\nreachable space",
    "surf_motorplan": "SURF,\nmotor plan",
}
PUBLISHED = "#f2b134"


def draw_paper(result: Mapping[str, Any], path: Path) -> None:
    """Write the picture as .png or .svg.

    Args:
        result: of :func:`evaluate_paper`.
        path: of the file.

    Raises:
        ArgumentError: the file cannot be written, or another kind is asked for.
    """
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(11.5, 8.0), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.25, 1.0))
        _stages(figure.add_subfigure(grid[0]).subplots(), result)
        below = figure.add_subfigure(grid[1]).subplots(1, 3)
        _speedups(below[0], result)
        _pairs(below[1], result, "found", "eyes in which the target is found [%]", 100.0)
        _pairs(below[2], result, "false_positives", "false positives for a stereo pair", 1.0)
        save_picture(figure, path)


def _stages(axes: Axes, result: Mapping[str, Any]) -> None:
    """Bars of the stages of both sides, as shares of the full frame's time."""
    places, labels = [], []
    for k, name in enumerate(PAPER):
        figures = result[name]
        whole = figures["full_ms"]
        for j, side in enumerate(("full", "attended")):
            at, start = 2.6 * k + j, 0.0
            stages = {
                stage.removeprefix(f"{side}: "): time
                for stage, time in figures["stages_ms"].items()
                if stage.startswith(f"{side}: ")
            }
            for colour, (stage, time) in zip(_colours(stages), stages.items(), strict=True):
                width = 100.0 * time / whole
                axes.barh(at, width, left=start, color=colour, height=0.85)
                if width > 1.0 * len(stage):
                    axes.text(start + width / 2, at, stage, ha="center", va="center", fontsize=8, color=INK)
                start += width
            text = f"{figures[f'{side}_ms']:.2f} ms"
            if side == "attended":
                text += ": " + ", ".join(stages)
            axes.text(start + 0.6, at, text, va="center", fontsize=9)
            places.append(at)
            labels.append(
                ("full frame: " if side == "full" else "attended: ") + NAMES[name].replace("\n", " ")
            )
    axes.set_yticks(places, labels)
    axes.invert_yaxis()
    axes.set(xlim=(0, 112), xlabel="time for a stereo pair [% of the full frame's]")
    axes.set_title("Where the time goes, on one thread (medians)")


def _colours(stages: Mapping[str, float]) -> list[str]:
    # What is done to know where to look has a colour of its own.
    detecting = iter((COLOURS[0], COLOURS[1], COLOURS[5]))
    return [PUBLISHED if "choice" in stage else next(detecting) for stage in stages]


def _speedups(axes: Axes, result: Mapping[str, Any]) -> None:
    at = np.arange(len(PAPER))
    measured, published = [result[name]["speedup"] for name in PAPER], list(PAPER.values())
    axes.bar(at - 0.2, published, 0.38, color=PUBLISHED, label="published, 2016")
    bars = axes.bar(at + 0.2, measured, 0.38, color=LINE, label="measured here")
    axes.bar_label(bars, [f"{value:.2f}" for value in measured], fontsize=9)
    for k, name in enumerate(PAPER):
        bare = result[name].get("speedup_in_bare_room")
        if bare is not None:
            axes.plot([k + 0.01, k + 0.39], [bare, bare], color="white", lw=1.6)
    axes.axhline(1.0, color=INK, lw=0.8)
    axes.set_xticks(at, [NAMES[name] for name in PAPER], fontsize=7.5)
    axes.set_title("speed-up (white: in a bare room)")
    axes.legend(loc="upper right", fontsize=8)
    axes.set_ylim(0, 1.3 * max(measured + published))


def _pairs(axes: Axes, result: Mapping[str, Any], figure: str, title: str, scale: float) -> None:
    at = np.arange(len(PAPER))
    for offset, suffix, colour, label in (
        (-0.2, "_full", FULL, "full frame"),
        (0.2, "", LINE, "attended"),
    ):
        values = [scale * result[name][figure + suffix] for name in PAPER]
        bars = axes.bar(at + offset, values, 0.38, color=colour, label=label)
        axes.bar_label(bars, [f"{value:.3g}" for value in values], fontsize=8)
    axes.set_xticks(at, [NAMES[name] for name in PAPER], fontsize=7.5)
    axes.set_title(title)
    low, high = axes.get_ylim()
    axes.set_ylim(low, 1.25 * high)
    axes.legend(loc="upper right", fontsize=8, ncols=2)
