"""Find the reaches in a motion capture of somebody who grasps an object again and again.

Markers: hand_top, hand_left, hand_right on the back of the right hand (the left one on the side of the
thumb), the tips and middles of the fingers (index_tip, thumb_middle, ...). The palm's frame has x along the
stretched fingers and z out of the palm, as a robot's has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .._arrays import Floats
from ..control.demonstrations import check_extent
from ..errors import ArgumentError, StateError
from .motion_capture import MotionCapture, fill_gaps

DEPTH = 0.025
"""From the markers on the back of the hand to its palm [m]."""
LONGEST_GAP = 0.1
"""A marker may be hidden for so long [s] within a reach."""
SMOOTHED = 0.11
"""Span [s] of the parabola that is fitted round each sample; 10 Hz of movement pass, jitter does not."""
CLOSED = 0.02
"""The grasp is the first sample at which the hand has closed but for this share of its opening."""
SETTING_OFF = 0.1
"""A reach begins when the palm has this share of the reach's greatest speed."""
SHORTEST, LEAST_WAY = 0.5, 0.05  # a reach that takes less [s] or leads less far [m] is none


@dataclass(frozen=True, eq=False)
class Reach:
    """One reach, from setting off to the grasp.

    Attributes:
        times: (N,) [s] of the recording.
        palms: (N, 4, 4) pose of the palm [m]; its place is under hand_top, ``DEPTH`` through the hand.
        openings: (N,), from the thumb's tip to the middle of index's and middle finger's; 0 at the grasp, 1
            at the mean of all reaches' widest.
    """

    times: Floats
    palms: Floats
    openings: Floats


@dataclass(frozen=True, eq=False)
class Reaches:
    """What :func:`find_reaches` found.

    Attributes:
        reaches: in order of time.
        dropped: how many were left out, by the reason.
        aperture: (closed, widest) [m], means over the reaches.
    """

    reaches: tuple[Reach, ...]
    dropped: Mapping[str, int]
    aperture: tuple[float, float]

    def __len__(self) -> int:
        return len(self.reaches)


def find_reaches(capture: MotionCapture) -> Reaches:
    """The reaches of a recording.

    Each time that the hand closes to less than half of its range is a grasp, at the first sample at which it
    has closed but for a tenth. Before it, back to the last grasp, the palm was farthest away somewhere; the
    reach begins after that, where the palm's speed was last below a tenth of the reach's greatest.

    A reach in which a marker is hidden for longer than 0.1 s is dropped and counted. The thumb's tip is an
    exception, it is hidden at most grasps: there the opening follows the thumb's middle, see
    :func:`apertures`.

    Raises:
        ArgumentError: a marker is missing, or a reach is longer than any arm: another unit.
        StateError: no reach is found, or none without long gaps.
    """
    palms, aperture = palm_poses(capture), apertures(capture)
    places = palms[:, :3, 3]
    kept: list[slice] = []
    dropped = {"marker hidden too long": 0, "no movement": 0}
    previous = 0
    for grasp in _grasps(aperture):
        part = _reach(capture.times, places, previous, grasp)
        previous = grasp
        if part is None:
            dropped["no movement"] += 1
        elif np.isnan(places[part]).any() or np.isnan(aperture[part]).any():
            dropped["marker hidden too long"] += 1
        else:
            check_extent(places[part])
            kept.append(part)
    if not kept:
        raise StateError(f"recording: no reach found; left out: {dropped}")
    closed = float(np.mean([aperture[part][-1] for part in kept]))
    widest = float(np.mean([aperture[part].max() for part in kept]))
    reaches = tuple(
        Reach(
            capture.times[part],
            palms[part],
            (aperture[part] - aperture[part][-1]) / (widest - closed),
        )
        for part in kept
    )
    return Reaches(reaches, dropped, (closed, widest))


def palm_poses(capture: MotionCapture) -> Floats:
    """Poses (N, 4, 4) [m] of the palm, NaN where a marker of the hand is hidden for long.

    Raises:
        ArgumentError: a marker is missing.
    """
    top, left, right = (
        smooth(capture, fill_gaps(capture.times, capture.marker(name), longest=LONGEST_GAP))
        for name in ("hand_top", "hand_left", "hand_right")
    )
    forward = _unit(top - (left + right) / 2)
    # hand_left is on the thumb's side: right minus left is the palm's y, and x cross y is out of the palm.
    out = _unit(np.cross(forward, right - left))
    poses = np.tile(np.eye(4), (len(capture), 1, 1))
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = forward, np.cross(out, forward), out
    poses[:, :3, 3] = top + DEPTH * out
    return poses


def apertures(capture: MotionCapture) -> Floats:
    """Distance (N,) [m] from the thumb's tip to the middle between the tips of index and middle finger.

    Where one of the three is hidden, a line through a distance that was seen, fitted where both were, takes
    its place: from the middle of the thumb to the same point, else to the index's tip. What the line errs on
    the two sides of the gap is faded over it, so that the opening does not jump.

    Raises:
        ArgumentError: a marker is missing.
        StateError: the tips are never seen together.
    """
    seen = {name: capture.marker(name) for name in ("thumb_tip", "thumb_middle", "index_tip", "middle_tip")}
    between = (seen["index_tip"] + seen["middle_tip"]) / 2
    aperture = np.linalg.norm(seen["thumb_tip"] - between, axis=1)
    if np.isnan(aperture).all():
        raise StateError("recording: thumb, index and middle finger are never seen together")
    for point in (between, seen["index_tip"]):
        aperture = _follow(aperture, np.linalg.norm(seen["thumb_middle"] - point, axis=1))
    bridged = fill_gaps(capture.times, aperture[:, None], longest=LONGEST_GAP)
    smoothed: Floats = smooth(capture, bridged)[:, 0]
    return smoothed


def smooth(capture: MotionCapture, values: Floats) -> Floats:
    """Values (N, d) without jitter: the middle of a parabola fitted to ``SMOOTHED`` seconds round each.

    NaN spreads by half that span; the ends are continued through their point, as if the movement went on.
    """
    half = max(1, round(SMOOTHED / capture.period / 2))
    if len(values) <= half:
        return np.array(values)
    offsets = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(offsets, 3))[2]
    before, after = 2 * values[0] - values[half:0:-1], 2 * values[-1] - values[-2 : -half - 2 : -1]
    longer = np.concatenate([before, values, after])
    smoothed: Floats = np.stack([np.convolve(c, weights[::-1], mode="valid") for c in longer.T], axis=1)
    return smoothed


def _follow(aperture: Floats, other: Floats) -> Floats:
    """``aperture`` (N,) with its gaps filled by a line through ``other``, corrected at the gaps' ends."""
    both = ~np.isnan(aperture) & ~np.isnan(other)
    gaps = np.isnan(aperture) & ~np.isnan(other)
    if both.sum() < 2 or not gaps.any():
        return aperture
    slope, offset = np.polyfit(other[both], aperture[both], 1)
    line = slope * other + offset
    error = np.interp(np.flatnonzero(gaps), np.flatnonzero(both), (aperture - line)[both])
    filled: Floats = aperture.copy()
    filled[gaps] = line[gaps] + error
    return filled


def _grasps(aperture: Floats) -> list[int]:
    """The first sample of each closure at which it is all but complete."""
    seen = aperture[~np.isnan(aperture)]
    low, high = np.quantile(seen, [0.02, 0.98])
    closed = aperture < (low + high) / 2
    edges = np.flatnonzero(np.diff(np.concatenate([[False], closed, [False]]).astype(np.int8)))
    found = []
    for begin, end in edges.reshape(-1, 2):
        limit = aperture[begin:end].min() + CLOSED * (high - low)
        found.append(int(begin + np.argmax(aperture[begin:end] <= limit)))
    return found


def _reach(times: Floats, places: Floats, previous: int, grasp: int) -> slice | None:
    """From setting off to the grasp; None where the palm has not come from elsewhere."""
    way = np.linalg.norm(places[previous : grasp + 1] - places[grasp], axis=1)
    if np.isnan(way).all():
        return None
    farthest = previous + int(np.nanargmax(way))
    if np.nanmax(way) < LEAST_WAY or times[grasp] - times[farthest] < SHORTEST:
        return None
    speeds = np.linalg.norm(
        np.gradient(places[farthest : grasp + 1], times[farthest : grasp + 1], axis=0), axis=1
    )
    if np.isnan(speeds).all():
        return None
    fastest = int(np.nanargmax(speeds))
    slow = np.flatnonzero(speeds[: fastest + 1] < SETTING_OFF * speeds[fastest])
    begin = farthest + (int(slow[-1]) if len(slow) else 0)
    return slice(begin, grasp + 1) if times[grasp] - times[begin] >= SHORTEST else None


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if (lengths < 1e-6).any():
        raise ArgumentError("markers: the hand's three lie on one line or at one point")
    units: Floats = vectors / lengths
    return units
