"""Images drawn from a seed, with much to find in them: textures, printed labels, faces."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats

WORDS = (
    *("MILK", "JUICE", "WATER", "COFFEE", "SUGAR", "SALT", "RICE", "FLOUR", "OIL", "TEA", "HONEY", "BEANS"),
    *("PASTA", "SOUP", "CORN", "BREAD"),
)
FONTS = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX)
GAP = 12
"""Labels are so far apart [px], at least."""


def textured(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Leaves over leaves, under uneven light and a little noise.

    Their sizes are drawn with a density that falls with the third power, from 2 to 100 px: then an image has
    about the same detail at every scale, as pictures of the world have.
    """
    height, width = shape
    picture = np.full((height, width, 3), 128.0, dtype=np.float32)
    count = height * width // 60
    sizes = 2.0 / np.sqrt(rng.uniform(4e-4, 1.0, count))
    centres = rng.integers(0, (width, height), (count, 2)).tolist()
    sides = sizes[:, None] * rng.uniform(0.5, 1.0, (count, 2))
    colours = rng.uniform(20.0, 235.0, (count, 1)) + rng.uniform(-30.0, 30.0, (count, 3))
    turns = rng.uniform(0.0, 180.0, count).tolist()
    for k, (centre, turn) in enumerate(zip(centres, turns, strict=True)):
        colour = tuple(colours[k].tolist())
        if k % 2:
            axes = np.maximum(sides[k], 1.0).astype(int).tolist()
            cv2.ellipse(picture, centre, axes, turn, 0, 360, colour, -1, cv2.LINE_AA)
        else:
            box = cv2.boxPoints((centre, (2.0 * sides[k]).tolist(), turn))
            cv2.fillConvexPoly(picture, np.rint(box).astype(np.int32), colour)
    picture += (_noise(rng, shape, 40) * 15)[..., None]
    picture[:] = cv2.GaussianBlur(picture, (0, 0), 0.6)
    picture += rng.normal(0.0, 2.0, (height, width, 1)).astype(np.float32)
    return np.clip(picture, 0, 255).astype(np.uint8)


def labelled(
    rng: np.random.Generator, shape: tuple[int, int], labels: int = 14
) -> tuple[NDArray[np.uint8], Floats]:
    """Printed labels on a surface under uneven light, and their boxes (N, 4).

    The labels are at least :data:`GAP` px apart.
    """
    height, width = shape
    picture = np.empty((height, width, 3), dtype=np.float32)
    picture[:] = rng.uniform(110, 220, 3)
    picture += (_noise(rng, shape, 40) * 14)[..., None]
    printed = np.clip(picture, 0, 255).astype(np.uint8)  # OpenCV 5 writes on nothing else
    boxes: list[tuple[int, int, int, int]] = []
    for _ in range(20 * labels):
        box = _label(rng, printed, boxes)
        if box is not None:
            boxes.append(box)
        if len(boxes) == labels:
            break
    noisy = printed + rng.normal(0.0, 2.5, (height, width, 1))
    return np.clip(noisy, 0, 255).astype(np.uint8), np.array(boxes, dtype=np.float64)


def faces(
    rng: np.random.Generator, shape: tuple[int, int], count: int = 12
) -> tuple[NDArray[np.uint8], Floats]:
    """Faces, as plain as a cascade classifier sees them, none over another, and (u, v, height) of each."""
    height, width = shape
    picture = np.full((height, width, 3), rng.uniform(90, 130), dtype=np.float32)
    drawn: list[Floats] = []
    for _ in range(20 * count):
        size = rng.uniform(50.0, 110.0)
        centre = rng.uniform(0.6 * size, (width - 0.6 * size, height - 0.6 * size))
        if all(np.abs(centre - other[:2]).max() > 0.6 * (size + other[2]) for other in drawn):
            drawn.append(np.append(centre, size))
            _face(picture, centre, size)
        if len(drawn) == count:
            break
    picture[:] = cv2.GaussianBlur(picture, (0, 0), 1.2)
    picture += rng.normal(0.0, 3.0, (height, width, 1)).astype(np.float32)
    return np.clip(picture, 0, 255).astype(np.uint8), np.array(drawn).reshape(-1, 3)


def _face(picture: NDArray[np.float32], centre: Floats, size: float) -> None:
    """Ellipses: (u, v, half width, half height) in heads, and grey."""
    parts = [(0.0, 0.0, 0.38, 0.5, 200.0)]
    for side in (-0.17, 0.17):
        parts += [(side, -0.12, 0.1, 0.05, 60.0), (side, -0.22, 0.12, 0.025, 90.0)]
    parts += [(0.0, 0.02, 0.045, 0.14, 225.0), (0.0, 0.15, 0.08, 0.02, 120.0), (0.0, 0.26, 0.16, 0.04, 90.0)]
    for u, v, wide, high, grey in parts:
        place, axes = np.rint(centre + np.multiply((u, v), size)), np.multiply((wide, high), size)
        cv2.ellipse(
            picture,
            place.astype(int).tolist(),
            axes.astype(int).tolist(),
            0,
            0,
            360,
            (grey,) * 3,
            -1,
            cv2.LINE_AA,
        )


def _label(
    rng: np.random.Generator, picture: NDArray[np.uint8], others: list[tuple[int, int, int, int]]
) -> tuple[int, int, int, int] | None:
    """Print a word on a plate somewhere, unless that is too near to another."""
    word, font = WORDS[rng.integers(len(WORDS))], FONTS[rng.integers(len(FONTS))]
    scale, thickness = float(rng.uniform(0.5, 1.1)), int(rng.integers(1, 3))
    (wide, tall), below = cv2.getTextSize(word, font, scale, thickness)
    across, high = wide + 16, tall + below + 12
    u = int(rng.integers(0, picture.shape[1] - across))
    v = int(rng.integers(0, picture.shape[0] - high))
    for u0, v0, u1, v1 in others:
        if u < u1 + GAP and u + across > u0 - GAP and v < v1 + GAP and v + high > v0 - GAP:
            return None
    plate, ink = (tuple(float(c) for c in rng.uniform(low, high_, 3)) for low, high_ in ((195, 255), (0, 90)))
    cv2.rectangle(picture, (u, v), (u + across - 1, v + high - 1), plate, -1)
    cv2.putText(picture, word, (u + 8, v + 6 + tall), font, scale, ink, thickness, cv2.LINE_AA)
    return u, v, u + across, v + high


def _noise(rng: np.random.Generator, shape: tuple[int, int], sigma: float) -> NDArray[np.float32]:
    """Smooth noise of mean 0 and deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), sigma)
    return np.asarray((noise - noise.mean()) / noise.std(), dtype=np.float32)
