"""Checks of the arrays that users pass, with errors that name the argument and the index."""

from __future__ import annotations

import operator

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError, ArgumentTypeError

Floats = npt.NDArray[np.float64]


def numbers(name: str, value: npt.ArrayLike) -> Floats:
    """Convert ``value`` to float64; anything but integers and floats is an :class:`ArgumentTypeError`."""
    try:
        array = np.asarray(value)
    except ValueError as error:  # ragged nested lists
        raise ArgumentError(f"{name}: expected a rectangular array of numbers: {error}") from None
    if array.dtype.kind not in "fiu":
        raise ArgumentTypeError(f"{name}: expected real numbers, got dtype {array.dtype}")
    return array.astype(np.float64, copy=False)


def finite(name: str, array: Floats) -> Floats:
    """Return ``array``, or raise an :class:`ArgumentError` that names the first NaN or infinity in it."""
    bad = ~np.isfinite(array)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        where = ", ".join(str(i) for i in index)
        raise ArgumentError(f"{name}: expected finite numbers, got {array[index]} at [{where}]")
    return array


def rows(name: str, value: npt.ArrayLike, columns: int, *, nan: bool = False) -> Floats:
    """Return ``value`` as (N, columns) float64; N may be 0.

    Raises :class:`ArgumentError` for another shape and for infinities and (unless ``nan``) NaN.
    """
    array = numbers(name, value)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ArgumentError(f"{name}: expected shape (N, {columns}), got {array.shape}")
    if nan:
        finite(name, np.where(np.isnan(array), 0.0, array))
    else:
        finite(name, array)
    return array


def image_shape(name: str, value: object) -> tuple[int, int]:
    """Return ``value`` as (height, width); only the pair is checked here, the sizes where they are used."""
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise ArgumentError(f"{name}: expected (height, width), got {value!r}")
    return value[0], value[1]


def fixed(name: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return ``value`` as finite float64 of exactly this shape."""
    array = numbers(name, value)
    if array.shape != shape:
        raise ArgumentError(f"{name}: expected shape {shape}, got {array.shape}")
    return finite(name, array)


def rigid(name: str, value: npt.ArrayLike) -> Floats:
    """Return ``value`` as a rigid motion (4, 4), to 1e-5."""
    pose = fixed(name, value, (4, 4))
    turn = pose[:3, :3]
    if not np.array_equal(pose[3], (0.0, 0.0, 0.0, 1.0)):
        raise ArgumentError(f"{name}: expected the last row 0, 0, 0, 1, got {pose[3].tolist()}")
    if np.abs(turn.T @ turn - np.eye(3)).max() > 1e-5 or np.linalg.det(turn) < 0.0:
        raise ArgumentError(f"{name}: expected a rotation in {name}[:3, :3], got {turn.tolist()}")
    return pose


def integer(name: str, value: object, *, at_least: int) -> int:
    """Return ``value`` as an int; a bool or a float is an :class:`ArgumentTypeError`."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise ArgumentTypeError(f"{name}: expected an integer, got {value!r}")
    number = operator.index(value)
    if number < at_least:
        raise ArgumentError(f"{name}: expected an integer >= {at_least}, got {number}")
    return number


def positive(name: str, value: npt.ArrayLike) -> float:
    """Return ``value`` as a finite float > 0."""
    number = float(fixed(name, value, ()))
    if number <= 0.0:
        raise ArgumentError(f"{name}: expected a number > 0, got {number}")
    return number


def not_negative(name: str, value: npt.ArrayLike) -> float:
    """Return ``value`` as a finite float >= 0."""
    number = float(fixed(name, value, ()))
    if number < 0.0:
        raise ArgumentError(f"{name}: expected a number >= 0, got {number}")
    return number


def generator(seed: int | np.random.Generator | None) -> np.random.Generator:
    """NumPy's generator of a seed: an int >= 0, a generator, which is used as it is, or None."""
    if seed is not None and not isinstance(seed, np.random.Generator):
        seed = integer("seed", seed, at_least=0)
    return np.random.default_rng(seed)
