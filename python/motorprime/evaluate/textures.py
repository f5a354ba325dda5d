"""Textured images drawn from a seed, in whole numbers only, so that they are the same on every machine.

NumPy is all that this file needs: the recipe of the stored keypoints reads it with an old Python.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def draw_texture(seed: int, height: int, width: int) -> NDArray[np.uint8]:
    """An image (height, width) uint8 of overlapping discs and rectangles, mostly small, a little blurred."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width), 128, dtype=np.int64)
    count = 20 + height * width // 150
    # The product of two draws makes small ones frequent.
    sizes = 2 + rng.integers(0, 60, count) * rng.integers(0, 60, count) // 80
    lengths = np.maximum(2, sizes * rng.integers(30, 170, count) // 100)
    us, vs = rng.integers(0, width, count), rng.integers(0, height, count)
    greys, kinds = rng.integers(0, 256, count), rng.integers(0, 2, count)
    order = np.argsort(-sizes, kind="stable")
    for k in order:
        u, v, size, length = int(us[k]), int(vs[k]), int(sizes[k]), int(lengths[k])
        top, left = max(v - size, 0), max(u - length if kinds[k] else u - size, 0)
        part = image[top : v + size + 1, left : (u + length if kinds[k] else u + size) + 1]
        if kinds[k]:
            part[:] = greys[k]
        else:
            rows, columns = np.ogrid[top : top + part.shape[0], left : left + part.shape[1]]
            part[(columns - u) ** 2 + (rows - v) ** 2 <= size * size] = greys[k]
    padded = np.pad(image, 1, mode="edge")
    total = np.zeros_like(image)
    for at in range(9):
        total += padded[at // 3 : at // 3 + height, at % 3 : at % 3 + width]
    return ((total + 4) // 9).astype(np.uint8)
