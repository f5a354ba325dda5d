"""What a report says about a run, in words; nothing here knows HTML."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

OUTCOMES = {
    "lifted": "The robot lifted the target.",
    "reached": "The hand reached its place before the target.",
    "missed": "The hand did not get to its place at the target.",
    "not found": "The target was not found.",
    "refused": "The target was found, but the robot sees no way to it and does not try.",
    "interrupted": "Interrupted.",
    "failed": "Failed.",
    "running": "Still running, or killed.",
}

CLAIMS = {
    "lifted": "The robot takes the target to be lifted",
    "reached": "The robot takes its hand to be in place",
}
"""What a robot may say of itself, and a judge deny."""

UNITS = ("m", "mm", "px", "rad", "s", "ms", "kg")


def is_contradicted(data: Mapping[str, Any]) -> bool:
    """Whether the robot believes that it succeeded and the outside judge does not."""
    outcome = data["outcome"]
    return outcome in CLAIMS and data["judged"].get(outcome) is False


def outcome_line(data: Mapping[str, Any]) -> str:
    """A run's outcome as a sentence; unknown ones as they are."""
    if is_contradicted(data):
        return f"{CLAIMS[data['outcome']]}; judged from outside it is not."
    return OUTCOMES.get(data["outcome"], str(data["outcome"]))


def outcome_class(data: Mapping[str, Any]) -> str:
    """'good', 'bad' or '' for anything between."""
    outcome = "missed" if is_contradicted(data) else str(data["outcome"])
    return {"lifted": "good", "reached": "good", "failed": "bad", "missed": "bad"}.get(outcome, "")


def headline(data: Mapping[str, Any]) -> list[str]:
    """The one sentence to remember; every second part of it is to stand out."""
    attended, full, share = data["attended_ms"], data["full_frame_ms"], data["attended_fraction"]
    if attended is None or share is None:
        return ["No vision cycle was recorded."]
    *before, last = _lifted(data)
    looked = [*before, f"{last}The robot looked at ", f"{share['median']:.0%} of the pixels", ""]
    if full is None or data["speed_up"] is None:
        return [*looked[:-1], "; a vision cycle took ", milliseconds(attended["median"]), "."]
    return [
        *looked[:-1],
        "; a vision cycle took ",
        milliseconds(attended["median"]),
        f" instead of the {milliseconds(full['median'])} of a full scan: ",
        factor(data["speed_up"]),
        ".",
    ]


def _lifted(data: Mapping[str, Any]) -> list[str]:
    """That a glass was lifted, if it was; every second part is to stand out, the last one never."""
    judged = data["judged"]
    if not judged.get("lifted"):
        return [""]
    said = ["The hand lifted a glass of ", f"{1e3 * judged['mass_kg']:.0f} g", " by "]
    said.append(f"{100 * judged['height_m']:.1f} cm")
    if data["history"] and data["history"][-1].get("obstacles"):
        touched = judged["touched_obstacle"]
        said.append(", and touched " if touched else ", past an obstacle that it did not touch")
        return [*said, "the obstacle", ". "] if touched else [*said[:-1], f"{said[-1]}. "]
    return [*said, ". "]


def numbers(data: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The main figures, each with what it is."""
    judged = data["judged"]
    cards: list[tuple[str, str]] = []
    if judged.get("lifted"):
        cards += [
            (f"{100 * judged['height_m']:.1f} cm", "over the table for a second: the bottom of the glass"),
            (
                f"{1e3 * judged['mass_kg']:.0f} g",
                f"weighs the glass, {1e3 * judged['width_m']:.0f} mm wide; friction alone holds it",
            ),
            (f"{data['history'][-1]['time']:.1f} s", "from the first look to the end"),
        ]
        if (error := _error_on_the_way(data["history"])) is not None:
            cards.append(
                (f"{1e3 * error:.1f} mm", "error of the glass's place, as estimated on the way (median)")
            )
    if data["attended_fraction"] is not None:
        cards.append(
            (f"{data['attended_fraction']['median']:.0%}", "of the pixels looked at per cycle (median)")
        )
    if data["attended_ms"] is not None:
        cards.append(
            (milliseconds(data["attended_ms"]["median"]), "vision cycle with attention, both eyes (median)")
        )
    if data["full_frame_ms"] is not None:
        cards.append(
            (milliseconds(data["full_frame_ms"]["median"]), "scan of the full images, both eyes (median)")
        )
    if data["cycles"]["total"]:
        told = f"{data['located']['attended']} of {data['cycles']['total']}"
        beside = data["located"]["full_frame"]
        words = "cycles in which the target was located"
        cards.append((told, words if beside is None else f"{words}; full scan: {beside}"))
    return cards


def _error_on_the_way(history: Sequence[Mapping[str, Any]]) -> float | None:
    """Median distance [m] of the target's estimated place from the true one while the hand reaches."""
    errors = [
        math.dist(record["estimate"], record["truth"])
        for record in history
        if record["phase"] == "reach" and record["estimate"] and record["truth"]
    ]
    return statistics.median(errors) if errors else None


def explanation() -> str:
    """What motor-primed attention is, for a stranger."""
    return (
        "A robot that is about to grasp something does not need to examine everything that its cameras "
        "show. Motor-primed attention turns what the robot can do, and what it plans to do, into a map over "
        "each image: first the space that its arm can reach, and once it has a plan, the path that its hand "
        "will take, as coupled dynamical systems of eye, arm and hand simulate it. The object detector then "
        "runs only in windows sampled from that map, fresh ones every "
        "cycle: all over the reachable space while it searches, and along the path once it moves. The same "
        "detector over the full images, run beside it and not used by the robot, shows what that saves."
    )


def convergence() -> str:
    """Why the planned movement comes to rest at its goal, for an engineer."""
    return (
        "The plan is no stored path. Eye, arm and hand follow one dynamical system each, learned from "
        "recorded human reaches: linear systems, mixed by where the state x is, relative to the goal. All "
        "of a mixture share one matrix P, and for each of them the distance |x|, measured by P, shrinks all "
        "the time; so it does for every mixture. The table says how fast, and that an Euler step as "
        "the controller takes it shrinks it too. The couplings hold the arm back until the eye is there, and "
        "the hand until the arm is; they end at the goal. So a movement comes to rest there from everywhere, "
        "and when the target moves, or a via-point stands in for it, only the goal changes. This was checked "
        "once more before the run. It is about the plan; joint limits and contacts are not covered."
    )


def note(data: Mapping[str, Any]) -> list[str]:
    """What must be said about the times to be fair."""
    full, cheap, attended = data["full_frame_ms"], data["back_projection_ms"], data["attended_ms"]
    if full is None or attended is None:
        return [
            "The scan of the full images was not run beside this run, so there is nothing to compare with."
        ]
    lines = [
        "The comparison leans to the safe side: the time with attention counts every stage up to the "
        "position in space, and the search for obstacles; that of the full scan only its windows. Times are "
        "from this machine and this run."
    ]
    if cheap is not None:
        better = cheap["median"] < attended["median"]
        verdict = "would beat both" if better else "is another way to look everywhere"
        lines.append(
            "In fairness: looking for a colour has a short cut that needs no windows. Back-projection of the "
            f"full images, with its largest region, takes {cheap['median']:.1f} ms and {verdict} "
            "for this very cheap detector. Attention pays for detectors that cost much per window or per "
            "pixel and have no such short cut."
        )
    return lines


def pairs(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Names and values as text; nested names are joined by dots, 'error_mm' becomes 'error [mm]'."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from pairs(value, f"{prefix}{name}.")
        else:
            yield prefix + _with_unit(str(name)), plain_text(value)


def _with_unit(name: str) -> str:
    words, _, last = name.rpartition("_")
    said = words.replace("_", " ")
    return f"{said} [{last}]" if said and last in UNITS else name.replace("_", " ")


def plain_text(value: Any) -> str:
    """A value as people write it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(plain_text(each) for each in value)
    return str(value)


def milliseconds(value: float) -> str:
    """A time [ms] with its unit, two or three digits."""
    return f"{value:.1f} ms" if value < 20 else f"{value:.0f} ms"


def factor(value: float) -> str:
    """How many times faster, or slower, said honestly."""
    if value >= 1.05:
        return f"{value:.0f} times faster" if value >= 9.5 else f"{value:.1f} times faster"
    return f"{1 / value:.1f} times slower" if value <= 0.95 else "no faster"
