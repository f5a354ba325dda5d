"""Recordings of markers on a person's body, as optical motion capture exports them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from .._arrays import Floats, fixed, positive
from ..errors import ArgumentError

LARGEST = 20.0
"""No capture volume spans more [m]: beyond it the numbers are taken for another unit."""


@dataclass(frozen=True, eq=False)
class MotionCapture:
    """Markers over time.

    Attributes:
        times: (N,) [s], evenly spaced.
        markers: {name: (N, 3)} [m], NaN where the cameras did not see the marker.
    """

    times: Floats
    markers: Mapping[str, Floats]

    def __len__(self) -> int:
        return len(self.times)

    @property
    def period(self) -> float:
        """Between two samples [s]."""
        return float(self.times[-1] - self.times[0]) / (len(self.times) - 1)

    def marker(self, name: str) -> Floats:
        """Places (N, 3) [m] of a marker.

        Raises:
            ArgumentError: there is no such marker.
        """
        if name not in self.markers:
            raise ArgumentError(f"marker: no '{name}' among {', '.join(self.markers)}")
        return self.markers[name]


def read_motion_capture(path: str | Path, *, unit: float = 0.001) -> MotionCapture:
    """Read the table that Qualisys Track Manager exports (.tsv).

    Its first lines hold a key and its values, separated by tabs; of these MARKER_NAMES and FREQUENCY [Hz]
    count. Then comes a row of column titles, ``Frame``, ``Time`` and X, Y, Z of each marker, and one row for
    each sample. An empty cell, NaN, or three zeros mean that a marker was hidden.

    Args:
        path: the file.
        unit: of its coordinates [m]; they are millimetres as a rule.

    Raises:
        ArgumentError: no such file, not such a table, a row of another length, a value that is no number,
            fewer than two samples, uneven times, or markers that lie farther apart than a room is wide.
    """
    path, unit = Path(path), positive("unit", unit)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise ArgumentError(f"path: cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ArgumentError(f"path: {path} is no text; a motion capture table (.tsv) expected") from None
    start = next((i for i, line in enumerate(lines) if line.startswith("Frame\t")), None)
    head = dict(line.partition("\t")[::2] for line in lines[:start])
    if start is None or "MARKER_NAMES" not in head:
        raise ArgumentError(f"path: {path} has no line MARKER_NAMES or no row of titles from 'Frame' on")
    names = head["MARKER_NAMES"].split("\t")
    columns = 2 + 3 * len(names)
    cells = np.array(
        [
            _cells(line, columns, f"path: {path}, line {number}")
            for number, line in enumerate(lines[start + 1 :], start=start + 2)
            if line.strip()
        ]
    ).reshape(-1, columns)
    times = _times(path, cells[:, 1], head.get("FREQUENCY", ""))
    markers = {}
    for k, name in enumerate(names):
        places = cells[:, 2 + 3 * k : 5 + 3 * k] * unit
        hidden = np.isnan(places).any(axis=1) | (places == 0.0).all(axis=1)
        markers[name] = np.where(np.expand_dims(hidden, 1), np.nan, places)
    spans = {name: float(np.ptp(seen, axis=0).max()) for name in names if len(seen := _seen(markers[name]))}
    for name, span in spans.items():
        if span > LARGEST:
            raise ArgumentError(
                f"path: {path}: marker '{name}' moves over {span:.6g} m, at most {LARGEST:g} expected; is a "
                f"unit of {unit:g} m right?"
            )
    return MotionCapture(times, markers)


def fill_gaps(times: Floats, places: Floats, *, longest: float = 0.1) -> Floats:
    """Bridge gaps of a marker by straight lines; gaps at the ends and longer ones stay NaN.

    Args:
        times: (N,) [s].
        places: (N, d), rows of NaN where it is hidden.
        longest: gap [s] between the samples on its two sides that is still bridged.
    """
    times = fixed("times", times, (len(places),))
    filled: Floats = places.copy()
    hidden = np.isnan(places).any(axis=1)
    seen = np.flatnonzero(~hidden)
    for before, after in pairwise(seen):
        gap = slice(before + 1, after)
        if after - before > 1 and times[after] - times[before] <= longest + 1e-9:
            share = ((times[gap] - times[before]) / (times[after] - times[before]))[:, None]
            filled[gap] = (1.0 - share) * places[before] + share * places[after]
    return filled


def _seen(places: Floats) -> Floats:
    seen: Floats = places[~np.isnan(places).any(axis=1)]
    return seen


def _cells(line: str, columns: int, where: str) -> list[float]:
    cells = line.rstrip("\r\n").split("\t")
    if len(cells) == columns + 1 and not cells[-1]:  # some versions end each row by a tab
        cells.pop()
    if len(cells) != columns:
        raise ArgumentError(f"{where}: {columns} values expected, got {len(cells)}")
    try:
        values = [float(cell) if cell.strip() else np.nan for cell in cells]
    except ValueError as error:
        raise ArgumentError(f"{where}: {error}") from None
    if np.isinf(values).any():
        raise ArgumentError(f"{where}: infinity in it")
    return values


def _times(path: Path, times: Floats, frequency: str) -> Floats:
    if len(times) < 2:
        raise ArgumentError(f"path: {path} has {len(times)} samples; at least 2 expected")
    try:
        period = 1.0 / float(frequency)
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(f"path: {path} has no FREQUENCY > 0, got '{frequency}'") from None
    # Written times are rounded, and some exports leave them out. Frames are counted by the camera's clock.
    even: Floats = np.arange(len(times), dtype=np.float64) * period
    if not np.isnan(times).all() and not np.allclose(times - times[0], even, atol=0.5 * abs(period)):
        raise ArgumentError(f"path: {path}: its times are not {period:g} s apart, as FREQUENCY says")
    return even
