"""Tables of joint states and pixels, as anybody can write them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from .._arrays import Floats
from ..errors import ArgumentError
from ..samples import Samples


def read_table(path: str | Path) -> Samples:
    """Read a table of joint states and where a point of the hand appeared in cameras.

    A CSV file (commas, semicolons or tabs) whose first row names the columns: joints [rad], then
    ``<camera>_u`` and ``<camera>_v`` [px] of each camera, both empty where it did not see the point::

        shoulder,elbow,left_u,left_v,right_u,right_v
        0.31,-1.20,160.5,98.2,,

    Or a NumPy file (.npy) of a structured array with such names, NaN where it is empty in the other.

    Raises:
        ArgumentError: no such file, no rows, no joints or no camera, a name twice, half a pixel, a value that
            is missing or no finite number; the message names the row and the column.
    """
    path = Path(path)
    names, cells = read_columns(path)
    cameras = _cameras(path, names)
    pixels = {camera: cells[:, [names.index(f"{camera}_{c}") for c in "uv"]] for camera in cameras}
    of_cameras = {f"{camera}_{c}" for camera in cameras for c in "uv"}
    joints = [name for name in names if name not in of_cameras]
    if not joints:
        raise ArgumentError(f"path: {path} has no column of a joint; its columns are {', '.join(names)}")
    for k, name in enumerate(names):
        empty = np.isnan(cells[:, k])
        if name in joints and empty.any():
            raise ArgumentError(f"path: {path}, row {_row(empty)}: joint '{name}' has no value")
    for camera, value in pixels.items():
        half = np.isnan(value).sum(axis=1) == 1
        if half.any():
            raise ArgumentError(
                f"path: {path}, row {_row(half)}: '{camera}_u' and '{camera}_v' expected both or neither"
            )
    return Samples(tuple(joints), cells[:, [names.index(name) for name in joints]], pixels)


def read_columns(path: str | Path) -> tuple[list[str], Floats]:
    """Names of the columns of a CSV file or a structured .npy, and its numbers (N, columns), NaN where empty.

    Raises:
        ArgumentError: no such file, no rows, a name twice or missing, or a value that is no finite number.
    """
    path = Path(path)
    try:
        names, cells = _numpy(path) if path.suffix == ".npy" else _text(path)
    except OSError as error:
        raise ArgumentError(f"path: cannot read {path}: {error.strerror}") from None
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ArgumentError(f"path: {path} has the column '{twice}' twice")
    if not len(cells):
        raise ArgumentError(f"path: {path} has no rows below its header")
    return names, cells


def _cameras(path: Path, names: list[str]) -> list[str]:
    cameras: list[str] = []
    for name in names:
        stem, _, coordinate = name.rpartition("_")
        if not stem or coordinate not in ("u", "v"):
            continue
        other = f"{stem}_{'v' if coordinate == 'u' else 'u'}"
        if other not in names:
            raise ArgumentError(f"path: {path} has a column '{name}' and no '{other}'")
        if stem not in cameras:
            cameras.append(stem)
    if not cameras:
        raise ArgumentError(
            f"path: {path} has no camera: columns named <camera>_u and <camera>_v expected, "
            f"got {', '.join(names)}"
        )
    return cameras


def _text(path: Path) -> tuple[list[str], Floats]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ArgumentError(f"path: {path} is no text; a CSV or a .npy file expected") from None
    header = text.partition("\n")[0]
    comma = max(",;\t", key=header.count)
    lines = [
        (number, [cell.strip() for cell in row])
        for number, row in enumerate(csv.reader(io.StringIO(text), delimiter=comma), start=1)
        if any(cell.strip() for cell in row)
    ]
    if not lines:
        raise ArgumentError(f"path: {path} is empty")
    (_, names), *rest = lines
    if "" in names:
        raise ArgumentError(f"path: {path} has a column without a name; it is number {names.index('') + 1}")
    table = np.full((len(rest), len(names)), np.nan)
    for k, (number, row) in enumerate(rest):
        if len(row) != len(names):
            raise ArgumentError(f"path: {path}, row {number}: {len(names)} values expected, got {len(row)}")
        for j, cell in enumerate(row):
            if cell:
                table[k, j] = _value(cell, f"path: {path}, row {number}, column '{names[j]}'")
    return names, table


def _value(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ArgumentError(f"{where}: a finite number expected, got '{cell}'")
    return value


def _numpy(path: Path) -> tuple[list[str], Floats]:
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise ArgumentError(f"path: {path} is no NumPy file: {error}") from None
    if array.dtype.names is None or array.ndim != 1:
        raise ArgumentError(
            f"path: {path} holds an array of dtype {array.dtype} and shape {array.shape}; a structured array "
            "(N,) with the columns' names expected"
        )
    wrong = [name for name in array.dtype.names if array.dtype[name].kind not in "fiu"]
    if wrong:
        raise ArgumentError(f"path: {path}: numbers expected in '{wrong[0]}', got {array.dtype[wrong[0]]}")
    table = np.column_stack([array[name].astype(np.float64) for name in array.dtype.names])
    infinite = np.isinf(table).any(axis=1)
    if infinite.any():
        raise ArgumentError(f"path: {path}, row {int(np.argmax(infinite)) + 1}: infinity in it")
    return list(array.dtype.names), table


def _row(flags: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> int:
    """The first row below the header, counted as in an editor where no line is empty."""
    return int(np.argmax(flags)) + 2
