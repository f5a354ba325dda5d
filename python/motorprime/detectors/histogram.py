"""The hue-saturation histogram detector (section V), built on OpenCV.

A window counts as a hit when its histogram shares enough with the target's. A hit seeds a local
segmentation: the target's back-projection, grown from that window only, so that the silhouette is found
without a look at the rest of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import fixed, integer
from ..errors import ArgumentError, ArgumentTypeError, StateError
from .base import Detections, Everywhere, Mask, Tiles, Where, Windows, check_image

BINS = (30, 16)
RANGES = [0.0, 180.0, 0.0, 256.0]
MIN_SATURATION, MIN_VALUE = 70, 25  # below, a hue means nothing
GROW = 24  # pixels by which a segmentation's region grows where the silhouette touches its border


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A connected region of the target's colour.

    Attributes:
        mask: (h, w) bool, the region in its own box.
        corner: (u, v) of the box's upper left pixel in the full image.
        centroid: (2,) (u, v) of the region in the full image, float64.
        score: intersection of the best window that hit it, 0 to 1.
    """

    mask: NDArray[np.bool_]
    corner: tuple[int, int]
    centroid: NDArray[np.float64]
    score: float

    @property
    def area(self) -> int:
        """Pixels of the region."""
        return int(np.count_nonzero(self.mask))

    @property
    def box(self) -> tuple[int, int, int, int]:
        """(u0, v0, u1, v1), half-open."""
        (u, v), (height, width) = self.corner, self.mask.shape
        return (u, v, u + width, v + height)

    def paint(self, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """The region as a mask of the full image."""
        full = np.zeros(shape, dtype=np.bool_)
        u0, v0, u1, v1 = self.box
        full[v0:v1, u0:u1] = self.mask
        return full


def merge(pieces: Sequence[Silhouette], *, gap: float = 0.5) -> Silhouette:
    """One silhouette of the largest piece and those near it: something in front may split an object.

    Args:
        pieces: at least one.
        gap: largest distance between the boxes of the largest and of another piece, in sizes of the former.

    Raises:
        ArgumentError: no pieces.
    """
    if not pieces:
        raise ArgumentError("pieces: at least one silhouette expected, got none")
    largest = max(pieces, key=lambda piece: piece.area)
    u0, v0, u1, v1 = largest.box
    reach = gap * max(u1 - u0, v1 - v0)
    near = [
        piece
        for piece in pieces
        if piece.box[0] < u1 + reach
        and piece.box[2] > u0 - reach
        and piece.box[1] < v1 + reach
        and piece.box[3] > v0 - reach
    ]
    if len(near) == 1:
        return largest
    boxes = np.array([piece.box for piece in near])
    (left, top), (right, bottom) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    mask = np.zeros((bottom - top, right - left), dtype=np.bool_)
    for piece in near:
        u, v, u1, v1 = piece.box
        mask[v - top : v1 - top, u - left : u1 - left] |= piece.mask
    areas = np.array([[piece.area] for piece in near], dtype=np.float64)
    centroid = (areas * np.array([piece.centroid for piece in near])).sum(axis=0) / areas.sum()
    return Silhouette(mask, (int(left), int(top)), centroid, largest.score)


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

    Args:
        target: (N, 3) uint8 RGB pixels of the target, from one or more views of it.
        label: name of what is found.
        window: width and height of the scanning window [px].
        stride: step of the window over the whole image [px].
        hit: intersection of a window's histogram with the target's from which it hits, 0 to 1.
        min_area: smaller regions [px] are ignored.

    Raises:
        ArgumentError: too few coloured pixels in ``target``, or a number outside its domain.
        ArgumentTypeError: ``target`` is not uint8, or a number has the wrong type.
    """

    target: NDArray[np.uint8]
    label: str = "target"
    window: int = 20
    stride: int = 4
    hit: float = 0.08
    min_area: int = 24
    model: NDArray[np.float32] = field(init=False, repr=False)
    _lookup: NDArray[np.uint8] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        pixels = self.target
        if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8:
            kind = getattr(pixels, "dtype", type(pixels).__name__)
            raise ArgumentTypeError(f"target: a uint8 array (N, 3) expected, got {kind}")
        if pixels.ndim != 2 or pixels.shape[1] != 3:
            raise ArgumentError(f"target: shape (N, 3) expected, got {pixels.shape}")
        for name, least in (("window", 1), ("stride", 1), ("min_area", 0)):
            integer(name, getattr(self, name), at_least=least)
        if not 0.0 < float(fixed("hit", self.hit, ())) <= 1.0:
            raise ArgumentError(f"hit: a share in (0, 1] expected, got {self.hit}")
        if not len(pixels):
            raise ArgumentError("target: at least 50 coloured pixels expected, got none")
        histogram = _histogram(_hsv(np.ascontiguousarray(pixels)[:, None, :]))
        coloured = float(histogram.sum())
        if coloured < 50:
            raise ArgumentError(f"target: at least 50 coloured pixels expected, {coloured:.0f} have a hue")
        # Neighbouring bins count a little: the light moves a colour by about one.
        model = cv2.GaussianBlur(np.vstack([histogram] * 3), (3, 3), 0.5)[BINS[0] : 2 * BINS[0]]
        self.model = (model / model.sum()).astype(np.float32)
        self._lookup = ((self.model > 0.002 * self.model.max()) * 255).astype(np.uint8)

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect the target in ``image`` (H, W, 3) uint8 RGB.

        Raises:
            ArgumentError: the image is smaller than the window, or ``where`` has the wrong shape.
            StateError: ``where`` is Tiles, which windows do not scan.
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
        size = where.size if isinstance(where, Windows) else self.window
        corners = self._corners(image.shape[:2], where)
        attended = np.zeros(image.shape[:2], dtype=np.bool_)
        if isinstance(where, Everywhere):
            hsv = _hsv(image)
            patches = [hsv[v : v + size, u : u + size] for u, v in corners]
            attended[:] = True
        else:
            patches = []
            for u, v in corners:
                patches.append(_hsv(image[v : v + size, u : u + size]))
                attended[v : v + size, u : u + size] = True
        scores = np.array([self._intersection(patch) for patch in patches])
        hitting = np.flatnonzero(scores >= self.hit)
        silhouettes = self._grow_all(image, corners[hitting], scores[hitting], size, attended)
        return Search(silhouettes, corners[hitting], attended)

    def back_project(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Pixels (H, W) of the target's colours: 255, others 0. The cheap way to do a full frame."""
        return self._back_project(_hsv(check_image(image)))

    def largest_region(self, image: NDArray[np.uint8]) -> tuple[int, int, int, int] | None:
        """Box (u0, v0, u1, v1) of the largest region of the target's colours: a short cut for full frames."""
        count, _, stats, _ = cv2.connectedComponentsWithStats(self.back_project(image), connectivity=4)
        if count < 2:
            return None
        left, top, width, height, area = (int(x) for x in stats[1 + int(stats[1:, 4].argmax())])
        return (left, top, left + width, top + height) if area >= self.min_area else None

    def _corners(self, shape: tuple[int, ...], where: Where) -> NDArray[np.intp]:
        height, width = shape[:2]
        if isinstance(where, Windows):
            return where.corners((height, width))
        if min(height, width) < self.window:
            raise ArgumentError(f"image: {width} x {height} is smaller than the window of {self.window} px")
        us, vs = (_steps(length - self.window, self.stride) for length in (width, height))
        grid = np.stack(np.meshgrid(us, vs), axis=-1).reshape(-1, 2)
        if isinstance(where, Everywhere):
            return grid
        if isinstance(where, Mask):
            if where.mask.shape != (height, width):
                raise ArgumentError(f"mask: shape ({height}, {width}) expected, got {where.mask.shape}")
            half = self.window // 2
            return grid[where.mask[grid[:, 1] + half, grid[:, 0] + half]]
        if isinstance(where, Tiles):
            raise StateError(
                "where: the histogram detector looks at Everywhere, Mask or Windows, not at Tiles"
            )
        raise ArgumentTypeError(f"where: Everywhere, Mask or Windows expected, got {type(where).__name__}")

    def _intersection(self, patch: NDArray[np.uint8]) -> float:
        """Sum over bins of min(window, target), both normalised by the window's pixels: 0 to 1."""
        histogram = _histogram(patch) / np.float32(patch.shape[0] * patch.shape[1])
        return float(cv2.compareHist(histogram, self.model, cv2.HISTCMP_INTERSECT))

    def _back_project(self, hsv: NDArray[np.uint8]) -> NDArray[np.uint8]:
        hue = hsv[..., 0].astype(np.intp) * BINS[0] // 180
        saturation = hsv[..., 1].astype(np.intp) * BINS[1] // 256
        coloured = (hsv[..., 1] >= MIN_SATURATION) & (hsv[..., 2] >= MIN_VALUE)
        return self._lookup[hue, saturation] * coloured

    def _grow_all(
        self,
        image: NDArray[np.uint8],
        corners: NDArray[np.intp],
        scores: NDArray[np.float64],
        size: int,
        attended: NDArray[np.bool_],
    ) -> tuple[Silhouette, ...]:
        """Grow a silhouette from each hit that no earlier one explains, the best hits first."""
        height, width = image.shape[:2]
        claimed = np.zeros((height, width), dtype=np.bool_)
        found: list[Silhouette] = []
        for k in np.argsort(-scores, kind="stable"):
            u, v = (int(x) for x in corners[k])
            if claimed[v : v + size, u : u + size].any():
                continue
            silhouette = self._grow(image, (u, v), size, float(scores[k]), attended)
            if silhouette is not None and silhouette.area >= self.min_area:
                claimed |= silhouette.paint((height, width))
                found.append(silhouette)
        return tuple(sorted(found, key=lambda s: -s.area))

    def _grow(
        self,
        image: NDArray[np.uint8],
        corner: tuple[int, int],
        size: int,
        score: float,
        attended: NDArray[np.bool_],
    ) -> Silhouette | None:
        height, width = image.shape[:2]
        u0, v0 = (max(c - GROW, 0) for c in corner)
        u1, v1 = min(corner[0] + size + GROW, width), min(corner[1] + size + GROW, height)
        while True:
            region = self._back_project(_hsv(image[v0:v1, u0:u1]))
            _, labels, stats, centroids = cv2.connectedComponentsWithStats(region, connectivity=4)
            inside = labels[corner[1] - v0 : corner[1] - v0 + size, corner[0] - u0 : corner[0] - u0 + size]
            counts = np.bincount(inside.ravel(), minlength=len(stats))
            counts[0] = 0
            if not counts.any():
                attended[v0:v1, u0:u1] = True
                return None
            best = int(counts.argmax())
            left, top, w, h, _ = (int(x) for x in stats[best])
            grown = (
                u0 - GROW * (left == 0),
                v0 - GROW * (top == 0),
                u1 + GROW * (u0 + left + w == u1),
                v1 + GROW * (v0 + top + h == v1),
            )
            grown = (max(grown[0], 0), max(grown[1], 0), min(grown[2], width), min(grown[3], height))
            if grown == (u0, v0, u1, v1):
                break
            u0, v0, u1, v1 = grown
        attended[v0:v1, u0:u1] = True
        return Silhouette(
            mask=labels[top : top + h, left : left + w] == best,
            corner=(u0 + left, v0 + top),
            centroid=np.add(centroids[best], (u0, v0)),
            score=score,
        )


def _steps(last: int, stride: int) -> NDArray[np.intp]:
    """0, stride, ... and ``last``, so that the far border is scanned too."""
    return np.unique(np.append(np.arange(0, last + 1, stride), last))


def _hsv(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    converted: NDArray[np.uint8] = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)  # type: ignore[assignment]
    return converted


def _histogram(hsv: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Counts (30, 16) of hue and saturation over the pixels that have a hue."""
    coloured = cv2.inRange(hsv, (0, MIN_SATURATION, MIN_VALUE), (180, 255, 255))
    histogram: NDArray[np.float32] = cv2.calcHist([hsv], [0, 1], coloured, list(BINS), RANGES)  # type: ignore[assignment]
    return histogram
