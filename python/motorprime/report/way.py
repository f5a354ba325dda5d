"""Plots of how eye, palm and hand went to the target: over time, and from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from .._arrays import Floats
from .document import Shot, new_figure, plotted
from .plots import FULL, GOOD, INK, LINE, PHASES, check_plots, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WRONG, OBSTACLE, GLASS = "#c2571a", "#b32aa3", "#d1382f"


def movement_shots(data: Mapping[str, Any]) -> list[Shot]:
    """The plots of a run's movement; none where the hand did not set out.

    Args:
        data: as in result.json.

    Raises:
        MissingExtraError: matplotlib is missing.
    """
    check_plots()
    planned = [record for record in data["history"] if record["goal"] is not None]
    moving = [record for record in planned if record["phase"] != "survey"]
    if len(moving) < 2:
        return []
    with styled():
        return [_over_time(planned), _from_outside(moving, data["judged"].get("width_m"))]


def _over_time(history: Sequence[Mapping[str, Any]]) -> Shot:
    figure = new_figure(4.8)
    times = np.array([record["time"] for record in history])
    away = np.array([100.0 * _distance(record["palm"], record["goal"]) for record in history])
    openings = np.array([_number(record["opening"]) for record in history])
    opened = bool(np.isfinite(openings).any())
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1.0)) if opened else [figure.subplots()]
    above = panels[0]
    above.plot(times, away, color=LINE, lw=2, label="palm from the grasp")
    seen = np.array([bool(record["located"]) for record in history])
    above.plot(times[seen], away[seen], "o", ms=4, color=GOOD, label="target located in this cycle")
    above.plot(times[~seen], away[~seen], "o", ms=4, mfc="white", mec=FULL, label="not located")
    above.set_ylabel("distance [cm]")
    above.set_ylim(0.0, 1.12 * float(away.max()))
    caption = "The palm's distance from where it grasps, and the cycles in which both eyes gave a position. "
    caption += _errors(above, history)
    above.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2)
    if opened:
        below = panels[1]
        below.plot(times, 100.0 * openings, color=INK, lw=2)
        below.axhline(0.0, color=FULL, lw=1, ls=":")
        below.set_ylabel("hand open [%]")
        caption += (
            "Below: how far the hand is told to be open. It waits for the palm, as the coupling says, and "
            "closes when that has arrived; below 0 the fingers squeeze. "
        )
    for axes in panels:
        _shade(axes, history, named=axes is above)
        _mark(axes, history, named=axes is above)
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(times[0], times[-1])
    return plotted(
        figure,
        "The movement",
        caption.strip(),
        f"The palm's distance from the grasp falls from {away[0]:.0f} cm to {away.min():.1f} cm.",
        lead=True,
    )


def _errors(axes: Axes, history: Sequence[Mapping[str, Any]]) -> str:
    """The estimate's error where there is a truth to compare with, until the hand moves the target."""
    wrong = [
        (record["time"], 1e3 * _distance(record["estimate"], record["truth"]))
        for record in history
        if record["truth"] and record["estimate"] and record["phase"] in ("survey", "reach")
    ]
    if not wrong:
        return ""
    twin = axes.twinx()
    twin.plot(*zip(*wrong, strict=True), color=WRONG, lw=1.5, ls="--")
    twin.set_ylabel("error of the estimate [mm]", color=WRONG)
    twin.spines["right"].set_visible(True)
    twin.set_ylim(0.0, max(5.0, 1.2 * max(error for _, error in wrong)))
    axes.plot([], [], color=WRONG, lw=1.5, ls="--", label="error of the estimate (right)")
    return (
        "Dashed: how far the estimated place of the target is from the true one; at the end of the reach the "
        "closing fingers move it. "
    )


def _from_outside(moving: Sequence[Mapping[str, Any]], width: float | None) -> Shot:
    """The palm's path from above, the robot standing below, and from where the robot faces."""
    reach = [record for record in moving if record["phase"] == "reach"] or moving
    palms = np.array([record["palm"] for record in moving])
    straight = np.array([moving[0]["palm"], reach[-1]["goal"]])
    via = next((record["legs"][0] for record in moving if len(record["legs"]) > 2), None)
    things = [(thing, OBSTACLE, "obstacle, as seen") for thing in moving[-1]["obstacles"]]
    if (place := reach[-1]["truth"] or reach[-1]["estimate"]) is not None:
        glass = {"centre": place, "radius": (width or 0.065) / 2, "height": None}
        things.append((glass, GLASS, "glass"))
    figure = new_figure(3.6)
    above, ahead = figure.subplots(1, 2)
    for axes, upwards in ((above, False), (ahead, True)):
        for thing, colour, label in things:
            _thing(axes, thing, colour, label, upwards=upwards)
        axes.plot(*_seen(straight, upwards), ":", color=FULL, lw=1.4, label="straight way")
        axes.plot(*_seen(palms, upwards), color=LINE, lw=2.2, label="way of the palm")
        (u, *_), (v, *_) = _seen(palms, upwards)
        axes.plot(u, v, "o", ms=7, color=LINE)
        axes.annotate("start", (u, v), textcoords="offset points", xytext=(6, 6), fontsize=9)
        if via is not None:
            (u,), (v,) = _seen(np.array([via]), upwards)
            axes.plot(u, v, "D", ms=7, mfc="white", mec=LINE, ls="", label="via-point")
        axes.set_aspect("equal")
        axes.margins(0.1)
        axes.set_xlabel("to the robot's right [cm]")
    above.set_title("from above")
    above.set_ylabel("ahead [cm]")
    ahead.set_title("from where the robot looks")
    ahead.set_ylabel("height [cm]")
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return plotted(
        figure,
        "The way of the hand",
        "The middle of the palm on its way, by the encoders, in the robot's frame; the robot stands "
        "below the left picture. The hand is larger than the line: half a hand must pass the obstacle.",
        "The path of the palm to the glass, from above and from the robot"
        + (", past an obstacle" if moving[-1]["obstacles"] else ""),
        lead=True,
    )


def _seen(places: Floats, upwards: bool) -> Floats:
    """Places (N, 3) [m], x backwards and y right, as (2, N) [cm]: to the right, and ahead or upwards."""
    seen: Floats = 100.0 * np.array([places[:, 1], places[:, 2] if upwards else -places[:, 0]])
    return seen


def _thing(axes: Axes, thing: Mapping[str, Any], colour: str, label: str, *, upwards: bool) -> None:
    """An upright cylinder from above, or from the side; its foot is as far below its centre as its top."""
    from matplotlib.patches import Circle, Patch, Rectangle

    (u,), (v,) = _seen(np.array([thing["centre"]]), upwards)
    radius = 100.0 * thing["radius"]
    half = 100.0 * (thing["height"] or 0.10) / 2 if upwards else radius
    patch: Patch = Circle((u, v), radius)
    if upwards:
        patch = Rectangle((u - radius, v - half), 2 * radius, 2 * half)
    patch.set(facecolor=colour, alpha=0.7, lw=0, label=label)
    axes.add_patch(patch)
    axes.update_datalim([(u - radius, v - half), (u + radius, v + half)])


def _shade(axes: Axes, history: Sequence[Mapping[str, Any]], *, named: bool) -> None:
    """Colour the background by phase, over time, and name the phases."""
    times = [record["time"] for record in history]
    changes = [k for k in range(1, len(history)) if history[k]["phase"] != history[k - 1]["phase"]]
    for first, last in pairwise([0, *changes, len(history)]):
        begin, end = times[first], times[min(last, len(times) - 1)]
        phase = str(history[first]["phase"])
        axes.axvspan(begin, end, color=PHASES.get(phase, "#f3f5f8"), zorder=-5, lw=0)
        if named and end - begin > 0.05 * (times[-1] - times[0]):
            _word(axes, (begin + end) / 2, phase)


def _mark(axes: Axes, history: Sequence[Mapping[str, Any]], *, named: bool) -> None:
    """Where the via-point is passed, and where something happened to the scene."""
    for before, record in pairwise(history):
        passed = before["phase"] == record["phase"] == "reach" and len(before["legs"]) > 2 == len(
            record["legs"]
        )
        for said in ("via-point" if passed else "", record["event"]):
            if said:
                axes.axvline(
                    record["time"], color=OBSTACLE, lw=1, ls="-." if said == record["event"] else ":"
                )
            if said and named:
                _word(axes, record["time"], said, height=0.88, colour=OBSTACLE)


def _word(axes: Axes, time: float, word: str, *, height: float = 0.97, colour: str = INK) -> None:
    place = axes.get_xaxis_transform()
    axes.text(time, height, word, transform=place, ha="center", va="top", fontsize=8, color=colour)


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return float(np.linalg.norm(np.subtract(a, b)))


def _number(value: float | None) -> float:
    return np.nan if value is None else value
