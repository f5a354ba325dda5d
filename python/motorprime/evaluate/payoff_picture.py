"""The picture of ``motorprime evaluate payoff``: speed-up by part attended, and by a detector's price."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..report.picture import save_picture
from ..report.plots import INK, styled
from .payoff import USUAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = {
    "back_projection": "back-projection",
    "histogram_scan": "histogram, every window",
    "orb": "ORB",
    "surf": "SURF",
    "sift": "SIFT",
    "text": "text network",
}
COLOURS = {
    "back_projection": "#d9480f",
    "histogram_scan": "#f2b134",
    "orb": "#8b919c",
    "surf": "#16a37b",
    "sift": "#2457c5",
    "text": "#8d6fd1",
}
MARKERS = ("o", "s", "^", "D", "v", "P")
LOSS = "#fdecea"


def draw_payoff(result: Mapping[str, Any], path: Path) -> None:
    """Write the picture as .png or .svg.

    Args:
        result: of :func:`evaluate_payoff`.
        path: of the file.

    Raises:
        ArgumentError: the file cannot be written, or another kind is asked for.
    """
    from matplotlib.figure import Figure

    sizes: Mapping[str, Any] = result["sizes"]
    with styled():
        figure = Figure(figsize=(11.5, 7.8), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.15))
        panels = figure.add_subfigure(grid[0]).subplots(1, len(sizes), sharey=True, squeeze=False)[0]
        for axes, (size, row) in zip(panels, sizes.items(), strict=True):
            _by_part(axes, size.replace("x", " x "), row)
        panels[0].set_ylabel("speed-up")
        panels[0].legend(loc="upper right", fontsize=8)
        _by_price(figure.add_subfigure(grid[1]).subplots(), sizes)
        save_picture(figure, path)


def _scale(axes: Axes, most: float) -> None:
    axes.set_yscale("log")
    axes.set_yticks([0.3, 0.5, 1, 2, 5, 10, 20], ["0.3", "0.5", "1", "2", "5", "10", "20"])
    axes.minorticks_off()
    axes.axhspan(1e-3, 1.0, color=LOSS, zorder=0)
    axes.axhline(1.0, color=INK, lw=0.8)
    axes.set_ylim(0.3, most)


def _by_part(axes: Axes, title: str, row: Mapping[str, Any]) -> None:
    for name, figures in _measured(row):
        parts = [100.0 * float(part) for part in figures["speedup"]]
        axes.plot(parts, list(figures["speedup"].values()), color=COLOURS[name], lw=1.8, label=NAMES[name])
        if 0.0 < figures["pays_up_to"] < 1.0:
            axes.plot(100.0 * figures["pays_up_to"], 1.0, "o", ms=5, color=COLOURS[name])
    _scale(axes, 30.0)
    axes.set(xlim=(0, 100), xlabel="part attended [%]")
    axes.set_title(title)


def _by_price(axes: Axes, sizes: Mapping[str, Any]) -> None:
    """Speed-ups at the usual part over the detectors' price of full frames."""
    prices = np.logspace(0.0, 3.5, 200)
    for marker, (size, row) in zip(MARKERS, sizes.items(), strict=False):
        # Of a detector whose time is proportional to its pixels.
        own = row["break_even_ns_per_pixel"] * (1.0 - USUAL)
        axes.plot(prices, prices / (own + USUAL * prices), color="#c2c8d2", lw=1.0, zorder=1)
        for name, figures in _measured(row):
            speedup = figures["speedup"][str(USUAL)]
            price = figures["full_ns_per_pixel"]
            axes.plot(price, speedup, marker, ms=7, color=COLOURS[name], zorder=3)
        axes.plot([], [], marker, color="#8b919c", label=size.replace("x", " x "))
    for name, _ in _measured(next(iter(sizes.values()))):
        speedups = [row[name]["speedup"][str(USUAL)] for row in sizes.values()]
        prices_of = [row[name]["full_ns_per_pixel"] for row in sizes.values()]
        low = name == "histogram_scan"  # beside it there is back-projection
        axes.annotate(
            NAMES[name],
            (float(np.exp(np.mean(np.log(prices_of)))), min(speedups) if low else max(speedups)),
            (0, -18 if low else 9),
            textcoords="offset points",
            color=COLOURS[name],
            ha="center",
            fontsize=9,
        )
    _scale(axes, 9.0)
    axes.set_xscale("log")
    axes.set(xlim=(prices[0], prices[-1]), xlabel="time of the full frame [ns per pixel]")
    axes.set_ylabel(f"speed-up at {USUAL:.0%} of the pixels")
    axes.set_title(
        "The more a detector costs, the more attention saves; grey: if time were proportional to pixels"
    )
    axes.text(
        prices[-1] * 0.97, 0.62, "attention costs more than it saves", ha="right", fontsize=9, color=INK
    )
    axes.legend(loc="upper left", title="image", title_fontsize=9)


def _measured(row: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    return [(name, row[name]) for name in NAMES if "speedup" in row.get(name, {})]
