"""Landscapes in NumPy and OpenCV."""

from __future__ import annotations

import math

import cv2
import numpy as np

from ..scene import Floats, Floats32

Shape = tuple[int, int]


class Matmul:
    """Eq. 7 as a product of matrices, profiles down times profiles across.

    Points that follow each other lie together, so with ``groups > 1`` each group fills a rectangle only.
    """

    def __init__(self, count: int, shape: Shape, width: tuple[float, float], groups: int = 1) -> None:
        self.shape, self.width = shape, width
        self.size = -(-count // groups)
        self.starts = np.arange(0, count, self.size)
        height, wide = shape
        self.columns = np.arange(wide, dtype=np.float32)
        self.rows = np.arange(height, dtype=np.float32)
        self.across, self.down = (np.empty(self.size * side, np.float32) for side in (wide, height))
        self.part = np.empty(height * wide, np.float32)
        self.out = np.zeros(shape, np.float32)

    def __call__(self, points: Floats | Floats32) -> Floats32:
        """The landscape of (N, 2) points; valid until the next call."""
        points = points.astype(np.float32)
        slopes = np.float32(self.width[0] ** -2), np.float32(self.width[1] ** -2 / len(points))
        if len(self.starts) == 1:
            height, wide = self.shape
            across = self.across[: len(points) * wide].reshape(-1, wide)
            down = self.down[: len(points) * height].reshape(-1, height)
            _triangles(self.columns, points[:, :1], self.width[0], slopes[0], across)
            _triangles(self.rows, points[:, 1:], self.width[1], slopes[1], down)
            return np.matmul(down.T, across, out=self.out)
        self.out.fill(0.0)
        low = np.ceil(np.minimum.reduceat(points, self.starts) - self.width).astype(int)
        high = np.floor(np.maximum.reduceat(points, self.starts) + self.width).astype(int) + 1
        lows = np.maximum(low, 0).tolist()
        highs = np.minimum(high, self.shape[::-1]).tolist()
        for start, (left, top), (right, bottom) in zip(self.starts.tolist(), lows, highs, strict=True):
            if left >= right or top >= bottom:
                continue
            group = points[start : start + self.size]
            wide, height, n = right - left, bottom - top, len(group)
            across, down = (
                self.across[: n * wide].reshape(n, wide),
                self.down[: n * height].reshape(n, height),
            )
            _triangles(self.columns[left:right], group[:, :1], self.width[0], slopes[0], across)
            _triangles(self.rows[top:bottom], group[:, 1:], self.width[1], slopes[1], down)
            part = np.matmul(down.T, across, out=self.part[: height * wide].reshape(height, wide))
            place = self.out[top:bottom, left:right]
            np.add(place, part, out=place)
        return self.out


def _triangles(places: Floats32, centres: Floats32, width: float, slope: np.float32, out: Floats32) -> None:
    """``max(width - |p - c|, 0) * slope`` for every centre and place."""
    np.subtract(places, centres, out=out)
    np.abs(out, out=out)
    np.subtract(np.float32(width), out, out=out)
    np.maximum(out, np.float32(0.0), out=out)
    np.multiply(out, slope, out=out)


class Boxes:
    """Eq. 7 as two box filters over points that are spread bilinearly; exact for whole widths only.

    A triangle of whole width is a box convolved with itself, and between whole positions it is linear. Its
    cost does not grow with the number of points.
    """

    def __init__(self, shape: Shape, width: tuple[float, float]) -> None:
        self.shape = shape
        self.wide, self.high = int(width[0]), int(width[1])
        padded = (shape[0] + 2 * self.high, shape[1] + 2 * self.wide)
        self.spread, self.once, self.twice = (np.zeros(padded, np.float32) for _ in range(3))
        self.out = np.empty(shape, np.float32)

    def __call__(self, points: Floats) -> Floats32:
        """The landscape of (N, 2) points inside the image; valid until the next call."""
        wide, high = self.wide, self.high
        places = np.add(points, (wide, high))
        whole = places.astype(np.intp)
        right, down = (places - whole).T
        stride = self.spread.shape[1]
        corner = whole[:, 1] * stride + whole[:, 0]
        corners = np.concatenate([corner, corner + 1, corner + stride, corner + stride + 1])
        shares = ((1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down)
        self.spread.fill(0.0)
        np.add.at(self.spread.reshape(-1), corners, (np.concatenate(shares) / len(points)).astype(np.float32))
        box, zero, middle = (wide, high), cv2.BORDER_CONSTANT, (wide // 2, high // 2)
        other = (wide - 1 - middle[0], high - 1 - middle[1])
        cv2.boxFilter(self.spread, -1, box, self.once, middle, True, zero)
        cv2.boxFilter(self.once, -1, box, self.twice, other, True, zero)
        np.copyto(self.out, self.twice[high : high + self.shape[0], wide : wide + self.shape[1]])
        return self.out


class Gaussian:
    """The Gaussian's exponent as a product of rank 3, inside the bounding box of the ellipse."""

    def __init__(self, shape: Shape, cutoff: float, *, opencv: bool) -> None:
        self.shape, self.cutoff, self.opencv = shape, cutoff, opencv
        height, wide = shape
        self.columns, self.rows = np.arange(wide, dtype=np.float64), np.arange(height, dtype=np.float64)
        self.left, self.right = np.ones((height, 3), np.float32), np.ones((3, wide), np.float32)
        self.exponent = np.empty(height * wide, np.float32)
        self.inside = np.empty(height * wide, np.bool_)
        self.out = np.zeros(shape, np.float32)

    def __call__(self, mean: tuple[float, float], chol: tuple[float, float, float]) -> Floats32:
        """The landscape; valid until the next call."""
        reach = self.cutoff * chol[0], self.cutoff * math.hypot(chol[1], chol[2])
        first = [max(math.ceil(m - r), 0) for m, r in zip(mean, reach, strict=True)]
        last = [math.floor(m + r) + 1 for m, r in zip(mean, reach, strict=True)]
        columns, rows = self.columns[first[0] : last[0]], self.rows[first[1] : last[1]]
        u, v = (columns - mean[0]) / chol[0], (rows - mean[1]) / chol[2]
        tilt = u * (chol[1] / chol[2])
        left, right = self.left[: len(v)], self.right[:, : len(u)]
        left[:, 0], left[:, 1] = -0.5 * v * v, v
        right[1], right[2] = tilt, -0.5 * (u * u + tilt * tilt)
        size = len(v) * len(u)
        exponent = np.matmul(left, right, out=self.exponent[:size].reshape(len(v), len(u)))
        self.out.fill(0.0)
        place = self.out[first[1] : last[1], first[0] : last[0]]
        least = -0.5 * self.cutoff**2
        if self.opencv:
            cv2.exp(exponent, place)
            cv2.threshold(place, math.exp(least) * (1.0 - 1e-7), 0.0, cv2.THRESH_TOZERO, place)
        else:
            inside = self.inside[:size].reshape(exponent.shape)
            np.greater_equal(exponent, np.float32(least), out=inside)
            np.exp(exponent, out=exponent)
            np.multiply(exponent, inside, out=place)
        return self.out
