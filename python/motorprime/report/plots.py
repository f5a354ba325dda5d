"""The report's plots, as SVG."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingExtraError
from ..summary import stages_of, total_ms
from .document import Shot, new_figure, plotted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#7aa6f0", "#b4d2f7", "#f2b134", "#2457c5", "#8d6fd1", "#7f8896", "#c2c8d2")
FULL, GOOD, INK, LINE = "#8b919c", "#169c52", "#1d2430", "#2457c5"
PHASES = {
    "search": "#f3f5f8",
    "fixate": "#fff3d6",
    "survey": "#f3ecfb",
    "reach": "#eaf3ff",
    "grasp": "#fde9dc",
    "lift": "#e4f6ea",
}
STYLE: dict[str, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa2af",
    "axes.labelcolor": INK,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "svg.hashsalt": "motorprime",
}


def styled() -> AbstractContextManager[None]:
    """The look of all pictures, for as long as the context lasts."""
    import matplotlib

    return matplotlib.rc_context(STYLE)  # type: ignore[arg-type]


def check_plots() -> None:
    """Raise now what :func:`plot_shots` would raise at the end of a run.

    Raises:
        MissingExtraError: matplotlib is missing.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("the report's plots (matplotlib)", "viz")


def plot_shots(data: Mapping[str, Any]) -> list[Shot]:
    """What looking cost in a run; nothing of a run without cycles.

    Args:
        data: as in result.json.

    Raises:
        MissingExtraError: matplotlib is missing.
    """
    check_plots()
    history = data["history"]
    if not history:
        return []
    with styled():
        return [_times(history), _attended(history)]


def _times(history: Sequence[Mapping[str, Any]]) -> Shot:
    figure = new_figure(4.6)
    full = [None if r["full_frame"] is None else 1e3 * r["full_frame"]["seconds"] for r in history]
    measured = [value for value in full if value is not None]
    numbers = np.arange(1, len(history) + 1)
    totals = np.array([total_ms(record) for record in history])
    if measured:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.5))
        above.plot(
            numbers,
            [np.nan if v is None else v for v in full],
            color=FULL,
            lw=2,
            label="scan of the full images",
        )
        above.plot(numbers, totals, color=LINE, lw=2, label="with attention, all stages")
        above.set_ylim(0.0, 1.15 * max(max(measured), float(totals.max())))
        above.set_ylabel("ms per cycle")
        above.set_title("With attention against the full scan")
        above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=2)
        _shade(above, history)
    else:
        below = figure.subplots()
    base = np.zeros(len(history))
    for stage, colour in zip(stages_of(history), COLOURS * 4, strict=False):
        values = np.array([1e3 * record["seconds"].get(stage, 0.0) for record in history])
        below.bar(numbers, values, bottom=base, width=0.86, color=colour, label=stage)
        base += values
    below.set_xlim(0.3, len(history) + 0.7)
    # One hiccup of the machine must not flatten all other bars; what is cut off is said.
    top = 1.35 * float(np.percentile(totals, 95)) or 1.0
    below.set_ylim(0.0, top)
    for number, total in zip(numbers, totals, strict=True):
        if total > top:
            below.annotate(
                f"{total:.0f}", (number, top), ha="center", va="bottom", fontsize=8, annotation_clip=False
            )
    below.set_ylabel("ms per cycle")
    below.set_xlabel("vision cycle")
    below.set_title("Where the time with attention goes", pad=14)
    below.legend(loc="upper center", ncol=5, bbox_to_anchor=(0.5, -0.24))
    _shade(below, history)
    return plotted(
        figure,
        "Time of every vision cycle",
        "Above: all stages with attention beside the scan of the full images. Below: the former by stage.",
        f"Time per vision cycle: median {np.median(totals):.1f} ms with attention"
        + (f", {np.median(measured):.0f} ms for the full scan." if measured else "."),
    )


def _attended(history: Sequence[Mapping[str, Any]]) -> Shot:
    figure = new_figure(2.8)
    axes = figure.subplots()
    shares = np.array([100.0 * record["attended"] for record in history])
    numbers = np.arange(1, len(history) + 1)
    axes.fill_between(numbers, shares, step="mid", color=LINE, alpha=0.25)
    axes.step(numbers, shares, where="mid", color=LINE, lw=1.8)
    axes.axhline(100.0, color=FULL, lw=2)
    axes.annotate(
        "scan of the full images", (numbers[-1], 100.0), ha="right", va="bottom", fontsize=9, color=FULL
    )
    axes.set_xlim(0.3, len(history) + 0.7)
    axes.set_ylim(0.0, 132.0)
    axes.set_yticks((0, 25, 50, 75, 100))
    axes.set_ylabel("% of the pixels")
    axes.set_xlabel("vision cycle")
    _shade(axes, history)
    return plotted(
        figure,
        "How much was looked at",
        "Pixels of both images that the detector touched; an overlap counts once.",
        f"Fraction of the pixels looked at: median {np.median(shares):.0f} %.",
    )


def _shade(axes: Axes, history: Sequence[Mapping[str, Any]]) -> None:
    """Colour the background by phase and name the phases."""
    phases = [record["phase"] for record in history]
    start = 0
    for k in range(1, len(phases) + 1):
        if k == len(phases) or phases[k] != phases[start]:
            axes.axvspan(start + 0.5, k + 0.5, color=PHASES.get(phases[start], "#f3f5f8"), zorder=-5, lw=0)
            if k - start > 0.06 * len(phases):
                place = ((start + k + 1) / 2, 0.97)
                axes.text(
                    *place,
                    phases[start],
                    transform=axes.get_xaxis_transform(),
                    ha="center",
                    va="top",
                    fontsize=8,
                )
            start = k
