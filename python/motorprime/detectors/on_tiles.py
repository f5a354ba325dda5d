"""A detector of one's own, a function of an image, made to look only where it is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..errors import ArgumentTypeError
from ..tiling import reading
from ..where import Where
from .base import Detections, check_image
from .merging import collect


@dataclass(frozen=True)
class OnTiles:
    """Run a function on the tiles that cover what is attended::

        def slow(image):
            return mp.Detections(*my_network(image))

        found = mp.OnTiles(slow, halo=32).detect(image, look.mask(fraction=0.1))

    A tile is smaller than the image, and the function is called once for each: it saves time when its time
    grows with the pixels.

    Args:
        function: from a part (h, w, 3) uint8 RGB of an image to Detections in pixels of that part.
        halo: pixels that the function needs to see around what it finds, half the size of the largest object.
        align: tiles begin and end at multiples of this, or at the image's border: the stride of a network.
    """

    function: Callable[[NDArray[np.uint8]], Detections]
    halo: int = 0
    align: int = 1

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ArgumentTypeError(f"function: a function expected, got {type(self.function).__name__}")
        integer("halo", self.halo, at_least=0)
        integer("align", self.align, at_least=1)

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect in ``image`` (H, W, 3) uint8 RGB; findings in its pixels, duplicates over borders merged.

        Raises:
            ArgumentError: ``where`` does not fit the image, or the function returned something else than
                boxes, scores and labels.
            ArgumentTypeError: the image or ``where`` has the wrong type.
        """
        check_image(image)
        tiles = reading(where, image.shape[:2], halo=self.halo, align=self.align)
        found = [
            self.function(np.ascontiguousarray(image[v0:v1, u0:u1]))
            for u0, v0, u1, v1 in tiles.boxes.tolist()
        ]
        return collect(found, tiles, where, image.shape[:2])
