"""Streams that yarpdatadumper wrote: a folder with data.log and, where they are images, the files it names.

A line of data.log is a counter, a time stamp [s], and then the values or the name of a file::

    -1 1512784563.506169 -10.0 0.0 0.0 -10.0 0.0 0.0
    -1 1512784563.547172 00000000.ppm

A few bad lines are normal, the last one above all, which is cut off when the dumper is stopped: they are
left out and counted. Many are an error that names the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..errors import ArgumentError

LOG, INFO = "data.log", "info.log"
FEW, SHARE = 3, 0.01
"""Bad lines that are left out without an error: this many, or this share of the log."""


@dataclass(frozen=True, eq=False)
class Encoders:
    """A stream of numbers.

    Attributes:
        times: (N,) time stamps [s], ascending; equal ones are samples that came together.
        values: (N, K), in the unit of the log.
        skipped: lines that were left out.
    """

    times: Floats
    values: Floats
    skipped: int


class Frames(Protocol):
    """Images one after the other, (H, W, 3) uint8 RGB: a list of them, or :class:`Images`."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> NDArray[np.uint8]: ...


@dataclass(frozen=True, eq=False)
class Images:
    """A stream of images, (H, W, 3) uint8 RGB, read from their files when they are asked for.

    Attributes:
        times: (N,) time stamps [s], ascending.
        paths: of the files.
        skipped: lines that were left out.
    """

    times: Floats
    paths: tuple[Path, ...]
    skipped: int

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int, /) -> NDArray[np.uint8]:
        image = cv2.imread(str(self.paths[index]), cv2.IMREAD_COLOR)
        if image is None:
            raise ArgumentError(f"recording: cannot read the image {self.paths[index]}")
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def read_encoders(folder: Path, columns: int) -> Encoders:
    """Read a stream of numbers.

    Args:
        folder: of the stream.
        columns: values that every line has after counter and time stamp.

    Raises:
        ArgumentError: no such stream, an empty log, or more than a few lines that are cut off, hold no finite
            numbers or go back in time; the message names file and line.
    """
    bad = _Bad(folder / LOG)
    times: list[float] = []
    values: list[list[float]] = []
    for number, time, words in _lines(folder, bad):
        if len(words) != columns:
            bad.add(number, f"{columns} values expected after counter and time stamp, got {len(words)}")
            continue
        row = [_number(word) for word in words]
        wrong = [word for word, value in zip(words, row, strict=True) if not np.isfinite(value)]
        if wrong:
            bad.add(number, f"a finite number expected, got '{wrong[0]}'")
        elif times and time < times[-1]:
            bad.add(number, f"the time goes back from {times[-1]:.6f} to {time:.6f} s")
        else:
            times.append(time)
            values.append(row)
    bad.judge(len(times))
    return Encoders(np.array(times), np.array(values), bad.count)


def read_images(folder: Path) -> Images:
    """Read a stream of images, of which each is opened once now, so that none is missing later.

    Raises:
        ArgumentError: as :func:`read_encoders`; a file that is missing or no image counts as a bad line, and
            so does an image of another size than the first.
    """
    bad = _Bad(folder / LOG)
    times: list[float] = []
    paths: list[Path] = []
    shape: tuple[int, ...] | None = None
    for number, time, words in _lines(folder, bad):
        if not words:
            bad.add(number, "the name of an image expected after counter and time stamp, got nothing")
            continue
        path = folder / words[0]
        if not path.is_file():
            bad.add(number, f"there is no image '{words[0]}'")
            continue
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            bad.add(number, f"'{words[0]}' is no image that can be read")
        elif shape is not None and image.shape != shape:
            bad.add(number, f"'{words[0]}' has shape {image.shape[:2]}, the first image {shape[:2]}")
        elif times and time < times[-1]:
            bad.add(number, f"the time goes back from {times[-1]:.6f} to {time:.6f} s")
        else:
            shape = image.shape
            times.append(time)
            paths.append(path)
    bad.judge(len(times))
    return Images(np.array(times), tuple(paths), bad.count)


def streams(folder: Path) -> tuple[str, ...]:
    """Names of the streams in a recording, relative to its folder."""
    return tuple(sorted(str(log.parent.relative_to(folder)) for log in folder.rglob(LOG)))


def check_recording(folder: str | Path, wanted: Sequence[str]) -> Path:
    """The folder, if it holds a recording with these streams.

    Raises:
        ArgumentError: it does not; the message says which stream is missing and which there are.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ArgumentError(f"recording: no such folder: {folder}")
    there = streams(folder)
    if not there:
        raise ArgumentError(f"recording: {folder} is no recording: no folder in it has a {LOG}")
    missing = [name for name in wanted if not (folder / name / LOG).is_file()]
    if missing:
        raise ArgumentError(f"recording: {folder} has no stream '{missing[0]}'; there are {', '.join(there)}")
    return folder


class _Bad:
    """Lines that cannot be used, and when they are too many."""

    def __init__(self, path: Path) -> None:
        self.path, self.count, self.first = path, 0, ""

    def add(self, number: int, reason: str) -> None:
        self.first = self.first or f"{self.path}, line {number}: {reason}"
        self.count += 1

    def judge(self, good: int) -> None:
        if good == 0 and self.count == 0:
            raise ArgumentError(f"recording: {self.path} is empty")
        if good == 0 or self.count > max(FEW, SHARE * (good + self.count)):
            raise ArgumentError(f"recording: {self.first} ({self.count} bad lines of {good + self.count})")


def _lines(folder: Path, bad: _Bad) -> Iterator[tuple[int, float, list[str]]]:
    """Number from 1, time stamp and the words after it of every line that has a time stamp."""
    try:
        text = (folder / LOG).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(f"recording: cannot read {folder / LOG}: {error}") from None
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        time = _number(words[1]) if len(words) > 1 else np.nan
        if np.isfinite(time):
            yield number, time, words[2:]
        else:
            bad.add(number, f"a counter and a time stamp [s] expected, got '{' '.join(words[:2])}'")


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan
