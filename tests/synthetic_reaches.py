"""A motion capture that nobody made: a hand that reaches, closes, opens and goes back, again and again."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from motorprime.control.path import minimum_jerk
from motorprime.recordings.motion_capture import MotionCapture

RATE = 100.0
REACH, CLOSE, BACK, REST = 1.0, 0.4, 1.0, 0.3
"""How long [s] each part of a cycle lasts. The hand opens on the way back."""
WAY = 0.25
OPEN, SHUT = 0.16, 0.10
GRASP = np.array([0.4, 0.1, 0.2])
HAND = {"hand_top": (0.0, 0.0), "hand_left": (-0.05, 0.016), "hand_right": (-0.05, -0.016)}
"""Marker: how far along the fingers and to the thumb's side of hand_top [m]; fingers point along x."""


def capture(reaches: int = 4, *, seed: int = 0) -> MotionCapture:
    """Palm down, fingers along x, thumb to +y; from another start each time."""
    draws = np.random.default_rng(seed)
    places, apertures = [], []
    starts = _starts(draws, reaches + 1)
    for start, following in pairwise(starts):
        go, shut, back, rest = (np.arange(0.0, 1.0, 1.0 / (RATE * s)) for s in (REACH, CLOSE, BACK, REST))
        places += [start + np.outer(minimum_jerk(t), GRASP - start) for t in (rest * 0.0, go)]
        places += [np.tile(GRASP, (len(shut), 1)), GRASP + np.outer(minimum_jerk(back), following - GRASP)]
        apertures += [np.full(len(rest) + len(go), OPEN), OPEN + (SHUT - OPEN) * minimum_jerk(shut)]
        apertures += [SHUT + (OPEN - SHUT) * minimum_jerk(3.0 * back)]
    return markers(np.concatenate(places), np.concatenate(apertures))


def markers(places, apertures) -> MotionCapture:
    """Markers of a hand whose hand_top is at places (N, 3) and which is so wide open (N,)."""
    forward, thumb = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    found = {name: places + a * forward + b * thumb for name, (a, b) in HAND.items()}
    fingers = places + 0.1 * forward
    found["index_tip"], found["middle_tip"] = fingers + 0.01 * thumb, fingers - 0.01 * thumb
    down = np.array([0.0, 0.0, -1.0])
    found["thumb_tip"] = fingers + np.outer(apertures, down)
    found["thumb_middle"] = fingers + np.outer(0.5 * apertures + 0.02, down)
    return MotionCapture(np.arange(len(places)) / RATE, found)


def text(recording: MotionCapture, unit: float = 0.001) -> str:
    """The recording as Qualisys Track Manager exports it."""
    names = list(recording.markers)
    lines = [
        f"NO_OF_FRAMES\t{len(recording)}",
        f"FREQUENCY\t{RATE:g}",
        "\t".join(["MARKER_NAMES", *names]),
        "\t".join(["Frame", "Time", *(f"{name} {c}" for name in names for c in "XYZ")]),
    ]
    for k, time in enumerate(recording.times):
        row = np.concatenate([recording.markers[name][k] for name in names]) / unit
        cells = ["" if np.isnan(value) else f"{value:.3f}" for value in row]
        lines.append("\t".join([str(k + 1), f"{time:.5f}", *cells]))
    return "\n".join(lines) + "\n"


def _starts(draws, count):
    away = draws.normal(size=(count, 3)) * 0.3 + [-1.0, 0.3, 0.5]
    return GRASP + WAY * away / np.linalg.norm(away, axis=1, keepdims=True)
