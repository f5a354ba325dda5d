"""Rotations as vectors: the axis times the angle, the coordinates in which dynamics of a palm are written."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, finite, numbers
from .errors import ArgumentError

_NEXT = np.array([1, 2, 0])


def _basis() -> Floats:
    basis = np.zeros((10, 3, 3))
    basis[0] = np.eye(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        basis[1 + k, j, i], basis[1 + k, i, j] = 1.0, -1.0
        basis[4 + k, k, k] = 1.0
        basis[7 + k, k, i] = basis[7 + k, i, k] = 1.0
    basis.flags.writeable = False
    return basis


ROTATION_BASIS = _basis()
"""(10, 3, 3): I; the three cross products; the squares xx, yy, zz; the mixed products xy, yz, zx."""


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
        (..., 3, 3) rotation matrices, cos(t) I + sin(t)/t K + (1 - cos(t))/t^2 r r^T for a vector r of length
        t, K = r x.

    Raises:
        ArgumentError: another shape, NaN.
    """
    r = finite("vectors", numbers("vectors", vectors))
    if r.ndim < 1 or r.shape[-1] != 3:
        raise ArgumentError(f"vectors: expected shape (..., 3), got {r.shape}")
    features = rotation_features(r.reshape(-1, 3))
    result: Floats = (features @ ROTATION_BASIS.reshape(10, 9)).reshape(*r.shape, 3)
    return result


def rotation_features(vectors: Floats) -> Floats:
    """Numbers (N, 10) in which the rotations of vectors (N, 3) are linear, see :data:`ROTATION_BASIS`.

    The rotation is cos(t) I + sin(t)/t K + (1 - cos(t))/t^2 r r^T, and so in whatever frame it is wanted it
    is one product of all features with ten matrices. Nothing is checked: this is for the control loop.
    """
    features = np.empty((len(vectors), 10))
    angle = np.maximum(np.sqrt((vectors * vectors).sum(axis=1)), 1e-150)  # at 0 the quotients are 1
    half = np.sin(0.5 * angle) / angle
    np.cos(angle, out=features[:, 0])
    np.multiply((np.sin(angle) / angle)[:, None], vectors, out=features[:, 1:4])
    scaled = (2.0 * half * half)[:, None] * vectors
    np.multiply(scaled, vectors, out=features[:, 4:7])
    np.multiply(scaled, vectors[:, _NEXT], out=features[:, 7:])
    return features


def rotation_vector(turn: Floats) -> tuple[float, float, float]:
    """Logarithm of one rotation (3, 3), as :func:`rotation_vectors` without its checks, for the control loop.

    Plain Python is five times faster than NumPy on so few numbers.
    """
    (a, ab, ac), (ba, b, bc), (ca, cb, c) = turn.tolist()
    candidates = (
        (1.0 + a - b - c, ab + ba, ac + ca, cb - bc),
        (ab + ba, 1.0 - a + b - c, bc + cb, ac - ca),
        (ac + ca, bc + cb, 1.0 - a - b + c, ba - ab),
        (cb - bc, ac - ca, ba - ab, 1.0 + a + b + c),
    )
    best = max(range(4), key=lambda k: candidates[k][k])
    x, y, z, scalar = candidates[best]
    if scalar < 0.0:
        x, y, z, scalar = -x, -y, -z, -scalar
    length = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(length, scalar) / length if length > 1e-150 else 2.0 / scalar
    return scale * x, scale * y, scale * z


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
