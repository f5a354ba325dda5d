"""The figures as a picture: how long the kernels and their best peers take, on an axis of microseconds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..report.picture import check_picture, save_picture
from ..report.plots import INK, LINE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COPIES = (1, 10, 100, 1000)
PEER, FLOOR = "#c2571a", "#9aa2af"
TITLES = {
    "triangular": "plan, 100 points, width 40",
    "triangular_wide": "plan, 100 points, width 120",
    "triangular_400": "plan, 400 points, width 40",
    "gaussian": "Gaussian ellipse, 1/3 of the image",
    "gibbs": "50 windows, Gibbs sampling",
    "sample": "50 windows, independent",
    "threshold": "threshold, top 30 %",
    "threshold_quicksort_4800": "threshold, quicksort of 4,800",
    "threshold_select_4800": "threshold, selection of 4,800",
    "mlp": "network 12-25-25-2, 50 points",
    "attention_step": "whole step, both eyes",
}


def draw(result: Mapping[str, Any], path: Path) -> None:
    """Draw a result of the bench to a PNG or an SVG.

    Raises:
        ArgumentError: the file cannot be written.
        MissingExtraError: matplotlib is missing.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    with styled():
        kernels = result["kernels"]
        figure = Figure(figsize=(10.5, 2.1 + 0.42 * len(kernels)), layout="constrained")
        _figure(figure, kernels, result["memcpy_us"])
        save_picture(figure, path)


def _figure(figure: Figure, kernels: Mapping[str, Any], copy: float) -> None:
    axes = figure.subplots()
    low = min([0.35 * copy, *(0.7 * t for seen in kernels.values() for t in _times(seen))])
    high = max([20 * copy, *(18.0 * t for seen in kernels.values() for t in _times(seen))])
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(len(kernels) - 0.4, -0.75)
    for copies in COPIES:
        if low < copies * copy < high:
            axes.axvline(copies * copy, color="#d6dae1", lw=1.2, zorder=0)
            label = f"{copies} copy" if copies == 1 else f"{copies:,} copies"
            axes.annotate(
                label,
                (copies * copy, 1.0),
                xycoords=axes.get_xaxis_transform(),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=9,
                color="#6a7280",
            )
    for row, seen in enumerate(kernels.values()):
        _row(axes, row, seen)
    axes.set_yticks(range(len(kernels)), [TITLES[name] for name in kernels])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("microseconds per call, seen from Python (logarithmic; further left is faster)")
    figure.suptitle(
        "Kernels of motorprime and their fastest exact peers, 320 x 240, one thread", x=0.01, ha="left"
    )
    dots: dict[str, Any] = {"ls": "", "marker": "o", "ms": 8}
    axes.plot([], [], color=LINE, label="motorprime", **dots)
    axes.plot([], [], color=PEER, label="fastest exact peer, named beside it", **dots)
    axes.plot(
        [],
        [],
        color=FLOOR,
        ls="",
        marker="|",
        ms=11,
        mew=2,
        label="floor: memory and arithmetic of a direct evaluation",
    )
    figure.legend(loc="outside lower center", ncol=3)


def _row(axes: Axes, row: int, seen: Mapping[str, Any]) -> None:
    ours, peer = seen["ours_us"], seen["best_peer_us"]
    if axes.get_xlim()[0] < seen["bound"]["us"]:
        axes.plot(seen["bound"]["us"], row, color=FLOOR, marker="|", ms=11, mew=2, zorder=1)
    if ours is not None:
        axes.plot([ours, peer], [row, row], color="#e3e6eb", lw=3, zorder=1, solid_capstyle="round")
        axes.plot(ours, row, "o", ms=8, color=LINE, zorder=3)
    axes.plot(peer, row, "o", ms=8, color=PEER, zorder=2)
    axes.annotate(
        _note(seen),
        (max(ours or 0.0, peer), row),
        xytext=(9, 0),
        textcoords="offset points",
        va="center",
        fontsize=8.5,
        color=INK if (seen["speedup"] or 1.0) >= 1.0 else PEER,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        zorder=1.5,
    )


def _note(seen: Mapping[str, Any]) -> str:
    """Who is faster, and how much."""
    peer, speedup = seen["best_peer"], seen["speedup"]
    if speedup is None:
        return f"{peer} (motorprime: none yet)"
    word = "faster" if speedup >= 1.0 else "slower"
    return f"{max(speedup, 1.0 / speedup):.1f}x {word} than {peer}"


def _times(seen: Mapping[str, Any]) -> list[float]:
    return [time for time in (seen["ours_us"], seen["best_peer_us"]) if time is not None]
