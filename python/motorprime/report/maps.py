"""Plots of learned maps: what was learned, where it errs, and what a few samples changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._arrays import Floats
from .document import Shot, new_figure, plotted
from .plots import FULL, GOOD, INK, LINE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 250  # samples in the plot of what was learned
CELL = 20  # of the plot of where it errs [px]
FEW = 5  # a cell with fewer samples is left blank
_RED = "#d1382f"


def learned_shot(
    labels: Mapping[str, Floats], predicted: Mapping[str, Floats], shapes: Mapping[str, tuple[int, int]]
) -> Shot:
    """Held-out labels {camera: (N, 2)} and where the network puts them."""
    with styled():
        figure = new_figure(3.9)
        axes = _eyes(figure, shapes)
        for camera, panel in axes.items():
            seen, told = labels[camera][:SHOWN], predicted[camera][:SHOWN]
            ends = np.stack([seen, told], axis=2)
            panel.plot(ends[:, 0].T, ends[:, 1].T, color=LINE, lw=0.9, alpha=0.8)
            panel.plot(*seen.T, "o", ms=2.6, color=INK, label="segmented")
            panel.plot([], [], color=LINE, lw=1.2, label="from there to the prediction")
        next(iter(axes.values())).legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2)
        return plotted(
            figure,
            "What the network learned",
            f"Up to {SHOWN} samples an eye that it was not trained on, each at another posture: a dot where "
            "the ball was segmented, a line to where the network put it from the ball's place and the joint "
            "angles alone. The shorter the lines, the better.",
            "Dots in both images with short lines to the predictions",
        )


def errors_shot(
    labels: Mapping[str, Floats], errors: Mapping[str, Floats], shapes: Mapping[str, tuple[int, int]]
) -> Shot:
    """Where in the images the errors {camera: (N,)} [px] of held-out labels are."""
    with styled():
        figure = new_figure(3.9)
        axes = _eyes(figure, shapes)
        maps = {camera: _cells(labels[camera], errors[camera], shapes[camera]) for camera in axes}
        filled = np.concatenate([cells[~np.isnan(cells)] for cells in maps.values()])
        top = float(np.percentile(filled, 95)) if filled.size else 1.0
        for camera, panel in axes.items():
            height, width = shapes[camera]
            image = panel.imshow(
                maps[camera],
                extent=(-0.5, width - 0.5, height - 0.5, -0.5),
                cmap="YlOrRd",
                vmin=0.0,
                vmax=top,
            )
        figure.colorbar(image, ax=list(axes.values()), label="median error [px]", shrink=0.8)
        return plotted(
            figure,
            "Where it errs",
            f"Median error of held-out samples in cells of {CELL} px; blank where fewer than {FEW} fell. "
            "Near the borders the network has neighbours on one side only.",
            "Heat maps of the error over both images",
        )


def training_shot(histories: Mapping[str, Floats]) -> Shot:
    """Mean squared errors {camera: (iterations + 1, 2)} in training and validation."""
    with styled():
        figure = new_figure(2.9)
        panel = figure.add_subplot()
        for (camera, history), style in zip(histories.items(), ("-", "--", ":", "-."), strict=False):
            panel.plot(history[:, 0], style, color=FULL, lw=1.3, label=f"{camera}: training")
            panel.plot(history[:, 1], style, color=LINE, lw=1.6, label=f"{camera}: validation")
            best = int(np.argmin(history[:, 1]))
            panel.plot(best, history[best, 1], "o", color=GOOD, ms=6)
        panel.set_yscale("log")
        panel.set_xlabel("iteration")
        panel.set_ylabel("mean squared error, normalised")
        panel.legend(ncols=2)
        return plotted(
            figure,
            "How training went",
            "Levenberg-Marquardt. The weights are those of the lowest validation error (green).",
            "Error curves over the iterations",
        )


def grid_shot(rows: Sequence[Mapping[str, Any]], outcomes: Mapping[str, Sequence[float]]) -> Shot:
    """The search over architectures: {architecture: median errors [px] of its runs}, in the order of rows."""
    with styled():
        figure = new_figure(0.9 + 0.33 * len(rows))
        panel = figure.add_subplot()
        names = list(outcomes)
        for k, name in enumerate(names):
            values = np.asarray(outcomes[name])
            panel.plot(values, np.full(len(values), k), "o", color=LINE, ms=4, alpha=0.55)
            panel.plot(np.median(values), k, "|", color=INK, ms=15, mew=2)
        labels = [f"{name}   ({row['weights']} weights)" for name, row in zip(names, rows, strict=True)]
        panel.set_yticks(range(len(names)), labels)
        panel.invert_yaxis()
        panel.set_xlabel("median test error of a run [px]")
        panel.grid(axis="x", alpha=0.3)
        return plotted(
            figure,
            "Which architecture",
            "Every dot is a network from other random weights and another partition of the data, every bar "
            "an architecture's median. The best test error by mean square is on top.",
            "Test errors of all runs by architecture",
        )


def adapted_shot(
    robots: Mapping[str, Mapping[str, Sequence[float]]], curve: Mapping[str, Mapping[int, float]], own: float
) -> Shot:
    """What samples of another robot changed.

    Args:
        robots: {model: {'before': median error [px] of each robot, 'after': the same}}.
        curve: {model: {samples: median over the robots [px]}}.
        own: the network's median error [px] on its own robot.
    """
    with styled():
        figure = new_figure(3.6)
        before, after = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
        colours = dict(zip(robots, (LINE, GOOD, "#8d6fd1"), strict=False))
        for k, (model, errors) in enumerate(robots.items()):
            for start, end in zip(errors["before"], errors["after"], strict=True):
                before.plot([k - 0.17, k + 0.17], [start, end], "-o", color=colours[model], ms=4, lw=1)
        before.set_xticks(range(len(robots)), list(robots))
        before.set_yscale("log")
        before.set_ylabel("median error [px]")
        before.set_title("each robot: before and after 100 samples")
        for (model, points), style in zip(curve.items(), ("-o", "-o", "--o"), strict=False):
            # The hybrid is dashed: it is the calibrated kinematics where no network helps.
            after.plot(list(points), list(points.values()), style, ms=4, color=colours[model], label=model)
        after.axhline(own, color=FULL, lw=1, ls="--")
        after.annotate(
            "the network on its own robot",
            (1, own),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="top",
            xytext=(0, -3),
            textcoords="offset points",
            fontsize=8,
            color=FULL,
        )
        after.set_yscale("log")
        after.set_xlabel("samples of the other robot")
        after.set_title("median over the robots")
        after.legend()
        for panel in (before, after):
            panel.yaxis.set_major_formatter("{x:g}")
            panel.grid(axis="y", which="both", alpha=0.2)
        return plotted(
            figure,
            "What 100 samples changed",
            "Robots whose joints are off by up to 3 degrees, links by up to 5 mm and focal lengths by up to "
            "3 %, with lenses that distort; tested on samples that were not used to adapt.",
            "Errors before and after adapting, and over the number of samples",
        )


def _eyes(figure: Any, shapes: Mapping[str, tuple[int, int]]) -> dict[str, Axes]:
    """One panel per camera, with the image's frame."""
    axes = dict(zip(shapes, figure.subplots(1, len(shapes), squeeze=False)[0], strict=True))
    for camera, panel in axes.items():
        height, width = shapes[camera]
        panel.set_xlim(-0.5, width - 0.5)
        panel.set_ylim(height - 0.5, -0.5)
        panel.set_aspect("equal")
        panel.set_title(f"{camera} eye [px]")
    return axes


def _cells(labels: Floats, errors: Floats, shape: tuple[int, int]) -> Floats:
    """Median of the errors (N,) in cells of the image (height, width), NaN where there are few."""
    rows, columns = -(-shape[0] // CELL), -(-shape[1] // CELL)
    at = np.clip((labels + 0.5) // CELL, 0, (columns - 1, rows - 1)).astype(int)
    cells = np.full((rows, columns), np.nan)
    for row in range(rows):
        for column in range(columns):
            here = errors[(at[:, 0] == column) & (at[:, 1] == row)]
            if len(here) >= FEW:
                cells[row, column] = np.median(here)
    return cells
