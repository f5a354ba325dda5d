"""The hue-saturation histogram detector (section V), three ways.

A window counts as a hit when its histogram shares enough with the target's. A hit seeds a local
segmentation: the target's back-projection, grown from that window only, so that the silhouette is found
without a look at the rest of the image.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import fixed, integer
from ..errors import ArgumentError, ArgumentTypeError
from ..intersections import intersections
from ..where import paint
from .base import Detections, Everywhere, Where, Windows, check_image
from .colours import BINS, back_project, bin_indices, histogram, hsv, window_scores
from .positions import pixels_of, positions
from .silhouettes import GROW, Segment, Silhouette, grow_all, merge

__all__ = ["GROW", "HistogramDetector", "Search", "Silhouette", "Way", "merge"]

Way: TypeAlias = Literal["windows", "scan", "back-projection"]
"""How a whole region is searched: each window counted by OpenCV, as in the paper; all of them by
:func:`motorprime.intersections`, with the same scores to 1e-6; or by the share of pixels of the target's
colours, which is cheaper still and knows nothing of how often each should occur."""


@dataclass(frozen=True, eq=False)
class Search:
    """Silhouettes that windows hit, the largest first, and what looking cost.

    Attributes:
        silhouettes: disjoint regions.
        hits: (K, 2) corners (u, v) of the windows that hit.
        attended: (H, W) bool, the pixels looked at.
    """

    silhouettes: tuple[Silhouette, ...]
    hits: NDArray[np.intp]
    attended: NDArray[np.bool_]


@dataclass(eq=False)
class HistogramDetector:
    """Find a target by its hues and saturations.

    A mask is looked at by the windows whose centres it holds; a tile by the windows inside it, or by one
    around its middle where it is smaller than a window. Windows that are named are counted one by one, or by
    'scan' in one call.

    Args:
        target: (N, 3) uint8 RGB pixels of the target, from one or more views of it.
        label: name of what is found.
        window: width and height of the scanning window [px].
        stride: step of the window [px]; None: 4 for 'windows', else 1.
        hit: intersection of a window's histogram with the target's from which it hits, 0 to 1.
        min_area: smaller regions [px] are ignored.
        way: 'windows', 'scan' or 'back-projection', see :data:`Way`.

    Raises:
        ArgumentError: too few coloured pixels in ``target``, or a number outside its domain.
        ArgumentTypeError: ``target`` is not uint8, or a number has the wrong type.
    """

    target: NDArray[np.uint8]
    label: str = "target"
    window: int = 20
    stride: int | None = None
    hit: float = 0.08
    min_area: int = 24
    way: Way = "windows"
    model: NDArray[np.float32] = field(init=False, repr=False)
    _lookup: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        pixels = self.target
        if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8:
            kind = getattr(pixels, "dtype", type(pixels).__name__)
            raise ArgumentTypeError(f"target: a uint8 array (N, 3) expected, got {kind}")
        if pixels.ndim != 2 or pixels.shape[1] != 3:
            raise ArgumentError(f"target: shape (N, 3) expected, got {pixels.shape}")
        if self.way not in get_args(Way):
            raise ArgumentError(f"way: one of {', '.join(get_args(Way))} expected, got {self.way!r}")
        if self.stride is None:
            self.stride = 4 if self.way == "windows" else 1
        for name, least in (("window", 1), ("stride", 1), ("min_area", 0)):
            integer(name, getattr(self, name), at_least=least)
        if not 0.0 < float(fixed("hit", self.hit, ())) <= 1.0:
            raise ArgumentError(f"hit: a share in (0, 1] expected, got {self.hit}")
        if not len(pixels):
            raise ArgumentError("target: at least 50 coloured pixels expected, got none")
        counts = histogram(hsv(np.ascontiguousarray(pixels)[:, None, :]))
        coloured = float(counts.sum())
        if coloured < 50:
            raise ArgumentError(f"target: at least 50 coloured pixels expected, {coloured:.0f} have a hue")
        # Neighbouring bins count a little: the light moves a colour by about one.
        model = cv2.GaussianBlur(np.vstack([counts] * 3), (3, 3), 0.5)[BINS[0] : 2 * BINS[0]]
        self.model = (model / model.sum()).astype(np.float32)
        self._lookup = np.where(self.model > 0.002 * self.model.max(), 255.0, 0.0).astype(np.float32)

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect the target in ``image`` (H, W, 3) uint8 RGB.

        Raises:
            ArgumentError: the image is smaller than the window, or ``where`` has the wrong shape or a tile
                that is empty or not inside the image.
        """
        found = self.search(image, where)
        return Detections(
            boxes=np.array([s.box for s in found.silhouettes], dtype=np.float32).reshape(-1, 4),
            scores=np.array([s.score for s in found.silhouettes], dtype=np.float32),
            labels=(self.label,) * len(found.silhouettes),
            attended=int(np.count_nonzero(found.attended)),
        )

    def search(self, image: NDArray[np.uint8], where: Where) -> Search:
        """Like :meth:`detect`, with the silhouettes themselves."""
        image = np.ascontiguousarray(check_image(image))
        one_by_one = isinstance(where, Windows) or self.way == "windows"
        size = where.size if isinstance(where, Windows) else self.window
        if one_by_one:
            corners, scores, attended = self._count(image, where, size)
        else:
            wanted = self._positions(image, where)
            field = self._map(image, wanted)
            corners = np.argwhere(field >= self.hit)[:, ::-1]
            scores = field[corners[:, 1], corners[:, 0]]
            full = isinstance(where, Everywhere)
            attended = np.ones(image.shape[:2], np.bool_) if full else pixels_of(wanted, size)
        hitting = np.flatnonzero(scores >= self.hit)
        corners, scores = corners[hitting], scores[hitting]
        silhouettes = grow_all(
            image,
            corners,
            scores,
            size,
            self._segment,
            attended,
            min_area=self.min_area,
            apart=0 if one_by_one else size // 2,
        )
        return Search(silhouettes, corners, attended)

    def scores(self, image: NDArray[np.uint8], where: Where | None = None) -> NDArray[np.float32]:
        """Scores (H - window + 1, W - window + 1) of the windows, each at its upper left pixel.

        By :func:`motorprime.intersections`, or from the back-projection where that is the way. ``where`` is
        Everywhere by default; windows that it does not hold score 0.

        Raises:
            ArgumentError, ArgumentTypeError: as for :meth:`detect`, and for Windows.
        """
        image = np.ascontiguousarray(check_image(image))
        return self._map(image, self._positions(image, where or Everywhere()))

    def back_project(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Pixels (H, W) of the target's colours: 255, others 0. The cheap way to do a full frame."""
        return self._segment(np.ascontiguousarray(check_image(image)))

    def largest_region(self, image: NDArray[np.uint8]) -> tuple[int, int, int, int] | None:
        """Box (u0, v0, u1, v1) of the largest region of the target's colours: a short cut for full frames."""
        count, _, stats, _ = cv2.connectedComponentsWithStats(self.back_project(image), connectivity=4)
        if count < 2:
            return None
        left, top, width, height, area = (int(x) for x in stats[1 + int(stats[1:, 4].argmax())])
        return (left, top, left + width, top + height) if area >= self.min_area else None

    def _positions(self, image: NDArray[np.uint8], where: Where) -> NDArray[np.bool_]:
        return positions((image.shape[0], image.shape[1]), where, self.window, self.stride or 1)

    def _count(
        self, image: NDArray[np.uint8], where: Where, size: int
    ) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.bool_]]:
        """Corners (N, 2) and scores (N,) of windows, counted one by one, and the pixels (H, W) in them."""
        if isinstance(where, Windows):
            corners = where.corners((image.shape[0], image.shape[1]))
        else:
            corners = np.argwhere(self._positions(image, where))[:, ::-1]
        whole = hsv(image) if isinstance(where, Everywhere) else None
        if self.way == "scan":
            scores = window_scores(image, corners, size, self.model.ravel())
            return corners, scores, paint(np.hstack([corners, corners + size]), image.shape[:2])
        attended = np.zeros(image.shape[:2], dtype=np.bool_)
        scores = np.empty(len(corners), dtype=np.float32)
        for k, (u, v) in enumerate(corners.tolist()):
            window = np.s_[v : v + size, u : u + size]
            scores[k] = self._score(hsv(image[window]) if whole is None else whole[window])
            attended[window] = True
        return corners, scores, attended | isinstance(where, Everywhere)

    def _score(self, window: NDArray[np.uint8]) -> float:
        """Sum over bins of min(window, target), both normalised by the window's pixels: 0 to 1."""
        pixels = window.shape[0] * window.shape[1]
        if self.way == "back-projection":
            return float(np.count_nonzero(back_project(window, self._lookup)) / pixels)
        shares = histogram(window) / np.float32(pixels)
        return float(cv2.compareHist(shares, self.model, cv2.HISTCMP_INTERSECT))

    def _map(self, image: NDArray[np.uint8], wanted: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Scores of the wanted windows, 0 for the others; pixels far from all of them are not looked at."""
        size, scores = self.window, np.zeros(wanted.shape, dtype=np.float32)
        rows, columns = (np.flatnonzero(wanted.any(axis=axis)) for axis in (1, 0))
        if not rows.size:
            return scores
        top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        seen = image[top : bottom + size - 1, left : right + size - 1]
        there = wanted[top:bottom, left:right]
        if self.way == "back-projection":
            share = cv2.boxFilter(
                back_project(hsv(seen), self._lookup), cv2.CV_32F, (size, size), anchor=(0, 0), normalize=True
            )
            scores[top:bottom, left:right] = share[: bottom - top, : right - left] / 255.0 * there
        else:
            found = intersections(
                bin_indices(seen), self.model.ravel(), (size, size), wanted=None if there.all() else there
            )
            scores[top:bottom, left:right] = found
        return scores

    @property
    def _segment(self) -> Segment:
        return lambda patch: back_project(hsv(patch), self._lookup)
