"""Pictures that tests draw themselves: integers only, the same on every machine."""

import numpy as np


def shapes(seed, height=120, width=160, count=12):
    """Discs and bars (H, W, 3) uint8 of random colours before a slope of grey, with a little noise."""
    draws = np.random.default_rng(seed)
    v, u = np.mgrid[:height, :width]
    image = np.empty((height, width, 3), np.int64)
    image[:] = draws.integers(60, 200, 3)
    image += (u[..., None] * draws.integers(-40, 40, 3)) // width
    for _ in range(count):
        at_u, at_v, size = draws.integers(0, width), draws.integers(0, height), draws.integers(4, 28)
        colour = draws.integers(0, 256, 3)
        disc = (u - at_u) ** 2 + (v - at_v) ** 2 < size * size
        bar = (abs(u - at_u) < size) & (abs(v - at_v) < size // 2 + 1)
        image[disc if draws.integers(2) else bar] = colour
    image += draws.integers(-6, 7, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)
