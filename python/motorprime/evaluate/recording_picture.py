"""The picture of ``motorprime evaluate recording``: predicted thumbs over an image, and their errors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..report.picture import save_picture
from ..report.plots import INK, styled
from .recording import Measured, Prediction, errors

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

SEEN, BEFORE, AFTER = "#ffd60a", "#e2502a", "#28c76f"
_MARGIN = 25.0  # [px] around what is shown of an image


def draw_recording(measured: Measured, path: Path) -> None:
    """Write the picture as .png or .svg.

    Raises:
        ArgumentError: the file cannot be written, or another kind is asked for.
    """
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(10.0, 8.6), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.25, 1.0))
        above = figure.add_subfigure(grid[0])
        below = figure.add_subfigure(grid[1])
        cameras = measured.recording.samples.cameras
        for camera, axes in zip(cameras, above.subplots(1, len(cameras), squeeze=False)[0], strict=True):
            _places(axes, measured, camera)
        above.legend(*_legend(), loc="outside lower center", ncol=3, fontsize=9)
        _over_time(below.subplots(), measured)
        save_picture(figure, path)


def _places(axes: Axes, measured: Measured, camera: str) -> None:
    """Tips of the first 30 % of the time over one of their images, in grey."""
    samples, rows = measured.recording.samples, measured.wide
    seen = samples.pixels[camera][rows]
    before, after = (p.wide[camera][rows] for p in (measured.before, measured.after))
    image = _image(measured, camera)
    if image is not None:
        axes.imshow(image, cmap="gray", vmin=-80, vmax=330)
    for start, end in zip(seen, before, strict=True):
        axes.plot(*zip(start, end, strict=True), color=BEFORE, lw=0.9, alpha=0.7)
    axes.plot(*seen.T, "o", ms=9, mfc="none", mec=SEEN, mew=1.8)
    axes.plot(*before.T, "x", ms=6, color=BEFORE, mew=1.6)
    axes.plot(*after.T, "+", ms=8, color=AFTER, mew=1.8)
    both = np.vstack([seen, before, after])
    low, high = np.nanmin(both, axis=0) - _MARGIN, np.nanmax(both, axis=0) + _MARGIN
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(f"{camera} eye: thumb's tip in {len(seen)} postures never trained on")


def _image(measured: Measured, camera: str) -> NDArray[np.uint8] | None:
    paths = measured.recording.images[camera]
    files = [paths[int(k)] for k in np.flatnonzero(measured.wide) if paths[int(k)] is not None]
    image = cv2.imread(str(files[len(files) // 2]), cv2.IMREAD_GRAYSCALE) if files else None
    return None if image is None else np.asarray(image, dtype=np.uint8)


def _legend() -> tuple[list[Artist], list[str]]:
    from matplotlib.lines import Line2D

    marks = (("o", SEEN, "none"), ("x", BEFORE, BEFORE), ("+", AFTER, AFTER))
    handles: list[Artist] = [
        Line2D([], [], ls="", marker=mark, ms=8, mec=colour, mfc=face, mew=1.8)
        for mark, colour, face in marks
    ]
    return handles, [
        "where the camera saw it",
        "predicted from the joints, robot's model as it is",
        "predicted from the joints, model adapted",
    ]


def _over_time(axes: Axes, measured: Measured) -> None:
    times, figures = measured.recording.times, measured.figures["recording"]
    parts = ((measured.wide, "wide", "wide_"), (measured.late, "late", ""))
    for rows, attribute, prefix in parts:
        for name, colour, prediction in (
            ("before", BEFORE, measured.before),
            ("after", AFTER, measured.after),
        ):
            off = _worst(measured, prediction, attribute, rows)
            median = figures[f"{prefix}{name}_px"]
            axes.plot(times[rows], off, "o-", ms=4, lw=1.2, color=colour)
            axes.plot(times[rows][[0, -1]], [median, median], color=colour, lw=1.0, ls=":")
            axes.annotate(
                f"median of both\neyes {median:.2g} px",
                (times[rows][-1], median),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
                color=INK,
                annotation_clip=False,
            )
    middle = ~(measured.late | measured.wide)
    if middle.any():
        axes.axvspan(times[middle][0], times[middle][-1], color="#eef1f5", zorder=-5, lw=0)
        axes.text(
            float(times[middle].mean()), 0.96, "only trained on", transform=axes.get_xaxis_transform(),
            ha="center", va="top", fontsize=9,
        )  # fmt: skip
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("time in the recording [s]")
    axes.set_ylabel("error in the worse eye [px]")
    axes.set_title("Error of every posture, predicted from what was learned in the other 70 % of the time")


def _worst(measured: Measured, prediction: Prediction, part: str, rows: NDArray[np.bool_]) -> Floats:
    off = errors(measured.recording.samples, getattr(prediction, part), rows)
    return np.asarray(np.fmax.reduce(list(off.values())))
