"""Which image shows which posture: encoders and images have clocks of their own, and images come late.

A posture counts only while the encoders held it. An image that came at time t shows what the encoders said at
t - lag; whoever pairs them at the same time takes the posture before for the new one after every change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats
from ..errors import ArgumentError

LAGS = np.arange(0.0, 0.1001, 0.002)
"""Lags [s] that :func:`estimate_lag` tries."""
_MOVED = 1.0  # [px], an image that differs so much from the others of its posture shows another one


@dataclass(frozen=True, eq=False)
class Holds:
    """Postures that were held.

    Attributes:
        start, stop: (N,) first and last time stamp [s] at which the encoders said so.
        values: (N, K) what they said.
    """

    start: Floats
    stop: Floats
    values: Floats

    def __len__(self) -> int:
        return len(self.start)

    def longer_than(self, duration: float) -> Holds:
        """Those that were held at least ``duration`` [s]."""
        kept = self.stop - self.start >= duration
        return Holds(self.start[kept], self.stop[kept], self.values[kept])

    def at(self, times: Floats, guard: float = 0.0) -> npt.NDArray[np.intp]:
        """The posture (M,) that was held at each time (M,) [s]; -1 where none was.

        A time within ``guard`` [s] of the posture's first or last time stamp is not believed.
        """
        index = np.searchsorted(self.start, times, side="right") - 1
        safe = np.maximum(index, 0)
        inside = (index >= 0) & (times >= self.start[safe] + guard) & (times <= self.stop[safe] - guard)
        return np.where(inside, index, -1)


def find_holds(streams: Sequence[tuple[Floats, Floats]], *, still: float, gap: float) -> Holds:
    """Cut encoders into held postures.

    Args:
        streams: (times (N,) ascending [s], values (N, K)) of each; their columns will follow each other.
        still: a change of any value by no more than this is noise, in the values' unit.
        gap: a posture ends where a stream says nothing for longer than this [s].

    Raises:
        ArgumentError: the streams have no time in common.
    """
    begin = max(float(times[0]) for times, _ in streams)
    end = min(float(times[-1]) for times, _ in streams)
    if begin > end:
        raise ArgumentError("recording: the streams of encoders have no time in common")
    clock = np.unique(np.concatenate([times for times, _ in streams]))
    clock = clock[(clock >= begin) & (clock <= end)]
    parts, pieces, known = [], [], np.ones(len(clock), dtype=bool)
    for times, values in streams:
        last = np.searchsorted(times, clock, side="right") - 1
        parts.append(values[last])
        after_gap = np.r_[False, np.diff(times) > gap]
        pieces.append(np.cumsum(after_gap)[last])
        # Between a stream's last word and the next after a gap nobody knows.
        known &= ~(np.r_[after_gap[1:], False][last] & (clock > times[last]))
    return _runs(clock, np.hstack(parts), np.column_stack(pieces), known, still)


def _runs(
    clock: Floats, values: Floats, pieces: npt.NDArray[np.intp], known: npt.NDArray[np.bool_], still: float
) -> Holds:
    """Runs of equal values, each within one piece of every stream; a drift ends a run as a jump does."""
    start, stop, held = [], [], []
    first = 0
    for k in range(1, len(clock) + 1):
        goes_on = (
            k < len(clock)
            and known[k] == known[first]
            and bool((pieces[k] == pieces[first]).all())
            and bool((np.abs(values[k] - values[first]) <= still).all())
        )
        if goes_on:
            continue
        if known[first]:
            start.append(clock[first])
            stop.append(clock[k - 1])
            held.append(np.median(values[first:k], axis=0))
        first = k
    return Holds(np.array(start), np.array(stop), np.reshape(held, (-1, values.shape[1])))


def estimate_lag(
    holds: Holds, times: Mapping[str, Floats], pixels: Mapping[str, Floats], lags: Floats = LAGS
) -> float:
    """How long images come after the encoders that they show [s].

    With the right lag all images of a held posture show the same; with a wrong one those next to a change
    belong to the neighbour. The middle of the lags with the fewest images out of place.

    Args:
        holds: postures.
        times: {camera: (N,)} time stamps of the images [s].
        pixels: {camera: (N, 2)} where a point of the hand appears in them, NaN rows where it does not.
        lags: to try, ascending [s].

    Raises:
        ArgumentError: all lags explain the images equally well.
    """
    wrong = np.array([_out_of_place(holds, times, pixels, float(lag)) for lag in lags])
    if wrong.min() == wrong.max():
        raise ArgumentError(
            f"lag: images of {len(holds)} postures do not tell it, all of {lags[0]:g} to {lags[-1]:g} s fit "
            "equally well; give lag"
        )
    best = np.flatnonzero(wrong == wrong.min())
    runs = np.split(best, np.flatnonzero(np.diff(best) > 1) + 1)
    longest = max(runs, key=len)
    return float((lags[longest[0]] + lags[longest[-1]]) / 2.0)


def _out_of_place(holds: Holds, times: Mapping[str, Floats], pixels: Mapping[str, Floats], lag: float) -> int:
    count = 0
    for camera, stamps in times.items():
        index = holds.at(stamps - lag)
        there = (index >= 0) & ~np.isnan(pixels[camera][:, 0])
        for k in np.unique(index[there]):
            mine = pixels[camera][there & (index == k)]
            count += int((np.linalg.norm(mine - np.median(mine, axis=0), axis=1) > _MOVED).sum())
    return count


def merge(index: npt.NDArray[np.intp], pixels: Floats, count: int) -> Floats:
    """Median pixel (count, 2) of the images of each posture; NaN where none shows the point.

    Args:
        index: (M,) posture of each image, -1 for none.
        pixels: (M, 2), NaN rows where the point was not found.
        count: of the postures.
    """
    merged = np.full((count, 2), np.nan)
    there = (index >= 0) & ~np.isnan(pixels[:, 0])
    for k in np.unique(index[there]):
        merged[k] = np.median(pixels[there & (index == k)], axis=0)
    return merged
