"""Rotations as vectors: the axis times the angle, the coordinates in which dynamics of a palm are written."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, finite, numbers
from .errors import ArgumentError


def rotation_vectors(rotations: npt.ArrayLike) -> Floats:
    """Logarithms of rotations.

    Args:
        rotations: (..., 3, 3) rotation matrices, to 1e-5.

    Returns:
        (..., 3) axis times angle [rad], the angle in [0, pi]. At pi either sign of its axis is
        right, and rounding decides.

    Raises:
        ArgumentError: another shape, NaN, a matrix that is no rotation.
    """
    turns = finite("rotations", numbers("rotations", rotations))
    if turns.ndim < 2 or turns.shape[-2:] != (3, 3):
        raise ArgumentError(f"rotations: expected shape (..., 3, 3), got {turns.shape}")
    flat = turns.reshape(-1, 3, 3)
    off = np.abs(np.swapaxes(flat, 1, 2) @ flat - np.eye(3)).max(axis=(1, 2), initial=0.0)
    bad = (off > 1e-5) | (np.linalg.det(flat) < 0.0)
    if bad.any():
        k = int(np.argmax(bad))
        raise ArgumentError(f"rotations: expected rotations, got {flat[k].tolist()} in place {k}")
    scalar, vector = _quaternions(flat)
    size = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(size, scalar)
    # Where the vector vanishes the angle is twice its length.
    scale = np.divide(angle, size, out=np.full_like(size, 2.0), where=size > 1e-150)
    result: Floats = (scale[:, None] * vector).reshape(turns.shape[:-1])
    return result


def rotation_matrices(vectors: npt.ArrayLike) -> Floats:
    """Rotations of vectors, by Rodrigues' formula.

    Args:
        vectors: (..., 3) axis times angle [rad], of any length.

    Returns:
        (..., 3, 3) rotation matrices, I + sin(t)/t K + (1 - cos(t))/t^2 K^2 with K = vector x, t its length.

    Raises:
        ArgumentError: another shape, NaN.
    """
    r = finite("vectors", numbers("vectors", vectors))
    if r.ndim < 1 or r.shape[-1] != 3:
        raise ArgumentError(f"vectors: expected shape (..., 3), got {r.shape}")
    angle = np.linalg.norm(r, axis=-1)
    sine = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    cross = np.zeros((*r.shape, 3))
    x, y, z = r[..., 0], r[..., 1], r[..., 2]
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -z, y, -x
    cross[..., 1, 0], cross[..., 2, 0], cross[..., 2, 1] = z, -y, x
    result: Floats = np.eye(3) + sine[..., None, None] * cross + versine[..., None, None] * (cross @ cross)
    return result


def _quaternions(turns: Floats) -> tuple[Floats, Floats]:
    """Scalars (N,) >= 0 and vectors (N, 3) of the unit quaternions of rotations (N, 3, 3).

    Of the four ways to read a quaternion off a matrix the one with the largest divisor is taken, so that
    neither small angles nor half turns lose digits.
    """
    a, b, c = turns[:, 0, 0], turns[:, 1, 1], turns[:, 2, 2]
    away = np.stack(
        [
            turns[:, 2, 1] - turns[:, 1, 2],
            turns[:, 0, 2] - turns[:, 2, 0],
            turns[:, 1, 0] - turns[:, 0, 1],
        ],
        axis=1,
    )
    both = turns + np.swapaxes(turns, 1, 2)
    table = np.empty((len(turns), 4, 4))  # row k: the quaternion (vector, scalar) times 4 of its k-th part
    table[:, :3, :3], table[:, :3, 3], table[:, 3, :3] = both, away, away
    table[:, 0, 0], table[:, 1, 1], table[:, 2, 2] = 1 + a - b - c, 1 - a + b - c, 1 - a - b + c
    table[:, 3, 3] = 1 + a + b + c
    best = np.argmax(np.diagonal(table, axis1=1, axis2=2), axis=1)
    chosen = table[np.arange(len(turns)), best]
    chosen /= np.linalg.norm(chosen, axis=1, keepdims=True)
    chosen[chosen[:, 3] < 0.0] *= -1.0
    return chosen[:, 3], chosen[:, :3]
