"""Shoulder, elbow and wrist in the reaches of a motion capture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed
from ..errors import ArgumentError, StateError
from .motion_capture import MotionCapture, fill_gaps
from .reaches import LONGEST_GAP, find_reaches, smooth

WRIST = ("hand_top", "hand_left", "hand_right")
"""The markers on the back of the hand, whose mean is taken for the wrist."""


def arms_in_reaches(
    capture: MotionCapture, *, forward: npt.ArrayLike = (1.0, 0.0, 0.0)
) -> list[tuple[Floats, Floats, Floats]]:
    """Places (N, 3) [m] of right shoulder, elbow and wrist in each reach: forward, to the left and up.

    Args:
        capture: with markers right_shoulder, right_elbow and those of the hand; its third axis points up.
        forward: (3,) level unit vector of the recording, the way the person faces.

    Raises:
        ArgumentError: a marker is missing, a direction that is not level or no unit vector.
        StateError: no reach is found, or none in which shoulder and elbow are seen all the time.
    """
    ahead = fixed("forward", forward, (3,))
    if ahead[2] != 0.0 or abs(float(np.linalg.norm(ahead)) - 1.0) > 1e-6:
        raise ArgumentError(f"forward: expected a level unit vector, got {ahead.tolist()}")
    axes = np.array([ahead, np.cross([0.0, 0.0, 1.0], ahead), [0.0, 0.0, 1.0]])

    def seen(name: str) -> Floats:
        filled = fill_gaps(capture.times, capture.marker(name), longest=LONGEST_GAP)
        places: Floats = smooth(capture, filled) @ axes.T
        return places

    shoulder, elbow = seen("right_shoulder"), seen("right_elbow")
    wrist: Floats = np.mean([seen(name) for name in WRIST], axis=0)
    arms = []
    for reach in find_reaches(capture).reaches:
        part = (capture.times >= reach.times[0]) & (capture.times <= reach.times[-1])
        parts = shoulder[part], elbow[part], wrist[part]
        if not any(np.isnan(places).any() for places in parts):
            arms.append(parts)
    if not arms:
        raise StateError("recording: shoulder or elbow is hidden for long in every reach")
    return arms
