"""The picture of ``motorprime evaluate attention``: recall curves, and what a method looks at first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..landscape import threshold
from ..report.picture import save_picture
from ..report.plots import INK, styled
from .attention import RECALL
from .attention_moments import METHODS, Moment

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = {
    "uniform": "anywhere",
    "center": "spotlight, middle of the image",
    "zoom_lens": "zoom lens, palm to target",
    "spectral_residual": "saliency, spectral residual",
    "fine_grained": "saliency, fine-grained",
    "peripersonal": "reachable space",
    "palm_path": "path of the palm alone",
    "motorplan": "motor plan",
    "motorplan_saliency": "motor plan x saliency",
}
COLOURS = {
    "uniform": "#c2c8d2",
    "center": "#8b919c",
    "zoom_lens": "#4b5563",
    "spectral_residual": "#f2b134",
    "fine_grained": "#d9480f",
    "peripersonal": "#16a37b",
    "palm_path": "#7aa6f0",
    "motorplan": "#2457c5",
    "motorplan_saliency": "#8d6fd1",
}
SHOWN = ("fine_grained", "zoom_lens", "peripersonal", "motorplan")
FIRST = 0.2
"""The part of the image that the examples show."""


def draw_attention(result: Mapping[str, Any], example: Moment, path: Path) -> None:
    """Write the picture as .png or .svg.

    Args:
        result: of :func:`evaluate_attention`.
        example: what an eye saw in one of the scenes.
        path: of the file.

    Raises:
        ArgumentError: the file cannot be written, or another kind is asked for.
    """
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(11.5, 7.6), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.3, 1.0))
        _curves(figure.add_subfigure(grid[0]).subplots(), result)
        below = figure.add_subfigure(grid[1])
        below.suptitle(
            f"One scene: outlined what the task needs, lit the first {FIRST:.0%} that each method looks at",
            x=0.01,
            ha="left",
            fontsize=11,
        )
        for axes, method in zip(below.subplots(1, len(SHOWN)), SHOWN, strict=True):
            _example(axes, example, method)
        save_picture(figure, path)


def _curves(axes: Axes, result: Mapping[str, Any]) -> None:
    for method in METHODS:
        curve = np.array(result["details"][method])
        parts = np.linspace(0.0, 100.0, len(curve))
        needed = 100.0 * result[method]["pixels_for_95"]
        label = f"{NAMES[method]}: {needed:.0f} %"
        axes.plot(
            parts, 100.0 * curve, color=COLOURS[method], lw=2.4 if "motor" in method else 1.6, label=label
        )
        axes.plot(needed, 100.0 * RECALL, "o", ms=5, color=COLOURS[method])
    axes.axhline(100.0 * RECALL, color=INK, lw=0.8, ls=":")
    axes.set(xlim=(0, 100), ylim=(0, 101), xlabel="part of the image looked at [%]")
    axes.set_ylabel("of the relevant pixels seen [%]")
    axes.set_title(
        f"Glass, obstacle, own hand: how much must be looked at to see 95 % of them "
        f"({result['scenes']} reaches under way)"
    )
    axes.legend(loc="lower right", title="pixels for 95 %", title_fontsize=9)


def _example(axes: Axes, example: Moment, method: str) -> None:
    lit = first_pixels(example.maps[method], FIRST)
    shade = np.where(lit[..., None], 1.0, 0.3)
    axes.imshow((example.image * shade).astype(np.uint8))
    axes.contour(example.relevant, levels=[0.5], colors="#37f07a", linewidths=1.2)
    seen = (lit & example.relevant).sum() / max(1, example.relevant.sum())
    axes.set_title(f"{NAMES[method]}\n{seen:.0%} of it seen", fontsize=10)
    axes.set_axis_off()


def first_pixels(values: NDArray[np.float32], part: float) -> NDArray[np.bool_]:
    """The pixels (H, W) with the largest values; fewer than the part asked for where the others have none."""
    positive = values - values.min() if values.min() < 0.0 else values
    if not positive.any():
        return np.zeros(values.shape, np.bool_)
    mask: NDArray[np.bool_] = (positive >= threshold(positive, fraction=part)) & (positive > 0.0)
    return mask
