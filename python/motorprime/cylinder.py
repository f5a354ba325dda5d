"""Where an upright cylinder of known size stands, from its silhouettes in two or more cameras.

The centroid of a silhouette is not the image of the cylinder's centre: the eye looks down on the top, and
the near side looks larger. So the centroids are triangulated, and the result is moved until the silhouettes
that it would have match the seen ones. Where they cannot match, because something hides a part, the position
is fitted to the outlines, and what sticks out of the predicted outline weighs more than what is missing.

Of the projection nothing is asked but pixels of points: a cylinder's outline is the convex hull of its rims'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ._arrays import Floats, fixed, not_negative, positive
from .camera import PosedCamera
from .detectors.silhouettes import Silhouette
from .errors import ArgumentError
from .views import Views

RIM = 48  # points on each rim
ITERATIONS = 12  # at most, until a step is shorter than
STILL = 1e-4  # [m]
GOOD_OVERLAP = 0.97  # from here the centroids are trusted
MISSING_WEIGHT = 0.3  # of a predicted pixel that is not seen, against a seen one that is not predicted
FIRST_STEP, LAST_STEP = 0.03, 0.0004  # of the outline fit [m]

Polygon = NDArray[np.float32]
"""Convex outline (M, 2) (u, v)."""


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder: radius and height [m]."""

    radius: float
    height: float

    def __post_init__(self) -> None:
        positive("radius", self.radius)
        positive("height", self.height)

    def distance(self, points: Floats) -> Floats:
        """Distance (N,) [m] of points (N, 3), given from the cylinder's centre, to its surface; 0 inside."""
        beside = np.maximum(np.hypot(points[:, 0], points[:, 1]) - self.radius, 0.0)
        above = np.maximum(np.abs(points[:, 2]) - self.height / 2, 0.0)
        return np.hypot(beside, above)

    @property
    def rims(self) -> Floats:
        """Points (96, 3) [m] on the two rims, from the cylinder's centre."""
        return _RIMS * (self.radius, self.radius, self.height)

    @property
    def axis(self) -> Floats:
        """Points (4, 3) [m] along its axis, from the cylinder's centre."""
        return np.outer(np.linspace(-0.45, 0.45, 4), (0.0, 0.0, self.height))


@dataclass(frozen=True, eq=False)
class Located:
    """A cylinder's position.

    Attributes:
        centre: (3,) [m], the middle of its axis, in the root frame.
        overlap: smallest intersection over union of predicted and seen silhouette over the cameras, 0 to 1.
        explained: smallest fraction of a seen silhouette that the prediction covers, 0 to 1.
        visible: smallest fraction of a predicted silhouette that is seen, 0 to 1.
    """

    centre: Floats
    overlap: float
    explained: float
    visible: float


def outline(view: PosedCamera, centre: Floats, cylinder: Cylinder) -> Polygon | None:
    """Convex outline (M, 2) (u, v) of a cylinder, None where a part of it is behind the camera."""
    return _hull(view.project(cylinder.rims + centre))


def outlines(views: Views, centre: Floats, cylinder: Cylinder) -> dict[str, Polygon]:
    """Convex outlines (M, 2) (u, v) of a cylinder in the cameras that have it in front of them."""
    hulls = {name: _hull(pixels) for name, pixels in views.project(cylinder.rims + centre).items()}
    return {name: hull for name, hull in hulls.items() if hull is not None}


def locate_cylinder(
    views: Views,
    silhouettes: Mapping[str, Silhouette],
    cylinder: Cylinder,
    *,
    level: float | None = None,
    slack: float = 0.0,
) -> Located | None:
    """Locate a cylinder that stands upright in the root frame.

    Args:
        views: the cameras at the posture in which the images were taken.
        silhouettes: what was segmented in each; cameras without one do not count.
        cylinder: its size.
        level: z [m] of its centre where that is known, as on a table; then only x and y are sought. A pixel
            of disparity, which is a centimetre of depth at arm's length, then costs a few millimetres.
        slack: how far [px] the projection may be off; what differs by less counts as equal.

    Returns:
        The position, or None where the silhouettes agree on none in view of the cameras.

    Raises:
        ArgumentError: fewer than two silhouettes, or one that is empty or sticks out of its image; a level
            or slack that is no number.
    """
    if level is not None:
        level = float(fixed("level", level, ()))
    slack = not_negative("slack", slack)
    names = [name for name in views.cameras if name in silhouettes]
    if len(names) < 2:
        raise ArgumentError(f"silhouettes: at least two cameras expected, got {names}")
    shapes = views.shapes
    for name in names:
        (u0, v0, u1, v1), (height, width) = silhouettes[name].box, shapes[name]
        if u0 < 0 or v0 < 0 or u1 > width or v1 > height or not silhouettes[name].area:
            raise ArgumentError(
                f"silhouettes['{name}']: some pixels within {width} x {height} expected, "
                f"got {silhouettes[name].area} in the box {(u0, v0, u1, v1)}"
            )
    start = views.triangulate({name: silhouettes[name].centroid[None] for name in names})[0]
    if level is not None:
        start[2] = level
    if not _in_view(views, start, names):
        return None
    seen = {name: _Seen(shapes[name], silhouettes[name], slack) for name in names}
    fit = _Fit(views, seen, cylinder, free=3 if level is None else 2)
    centre = fit.from_centroids(start)
    if centre is not None:
        located = fit.judge(centre)
        if located.overlap >= GOOD_OVERLAP:
            return located
    return fit.judge(fit.from_outlines(start if centre is None else centre))


def convex_spans(
    polygon: NDArray[np.floating], shape: tuple[int, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns [first, stop) of each row of ``shape`` whose pixel centres lie in a convex polygon (M, 2).

    OpenCV's filling draws the border too, half a pixel wider: at arm's length that moves a fit by 4 mm.
    """
    height, width = shape
    corners = np.roll(polygon, -int(polygon[:, 1].argmin()), axis=0)
    bottom = int(corners[:, 1].argmax())
    rows = np.arange(height)
    one = np.interp(rows, corners[: bottom + 1, 1], corners[: bottom + 1, 0])
    back = np.append(corners[bottom:], corners[:1], axis=0)[::-1]
    other = np.interp(rows, back[:, 1], back[:, 0])
    first = np.clip(np.ceil(np.minimum(one, other)), 0, width).astype(np.intp)
    stop = np.clip(np.floor(np.maximum(one, other)) + 1, 0, width).astype(np.intp)
    crossed = (rows >= corners[0, 1]) & (rows <= corners[bottom, 1])
    return first, np.where(crossed, np.maximum(first, stop), first)


_ANGLES = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_RIMS = np.vstack([np.column_stack([_CIRCLE, np.full(RIM, side)]) for side in (-0.5, 0.5)])


def _hull(pixels: Floats) -> Polygon | None:
    """Convex hull (M, 2) of pixels; None where one of the points has none."""
    if not np.isfinite(pixels).all():
        return None
    return cv2.convexHull(pixels.astype(np.float32))[:, 0]  # type: ignore[return-value]


def _grow(polygon: Polygon, pixels: float) -> Polygon:
    """A convex outline stretched such that its box grows by so many pixels on each side, or shrinks."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-6)
    return np.asarray(middle + (polygon - middle) * np.maximum(1.0 + pixels / half, 0.0), np.float32)


def _in_view(views: Views, centre: Floats, names: Sequence[str]) -> bool:
    if not np.isfinite(centre).all():
        return False
    pixels = views.project(centre[None])
    return all(np.isfinite(pixels[name]).all() for name in names)


class _Seen:
    """One camera's silhouette, to hold predicted outlines against, within a region of the image."""

    def __init__(self, shape: tuple[int, int], silhouette: Silhouette, slack: float) -> None:
        self.silhouette, self.slack = silhouette, slack
        self._image = height, width = shape
        u0, v0, u1, v1 = silhouette.box
        # A hidden part is at most as large as the seen one or so; and nothing is seen outside the image.
        du, dv = u1 - u0 + 8, v1 - v0 + 8
        self.u0, self.v0 = max(u0 - du, 0), max(v0 - dv, 0)
        u1, v1 = min(u1 + du, width), min(v1 + dv, height)
        self.mask = silhouette.paint(shape)[self.v0 : v1, self.u0 : u1]
        self.area = int(self.mask.sum())
        self._rows = np.arange(len(self.mask))
        self._left_of = np.pad(np.cumsum(self.mask, axis=1, dtype=np.int64), ((0, 0), (1, 0)))

    def compare(self, polygon: Polygon | None, grown: float = 0.0) -> tuple[int, int] | None:
        """Pixels of a predicted outline, grown by so many, and how many of them are seen."""
        if polygon is None or np.abs(polygon).max() > 1e4:
            return None
        if grown:
            polygon = _grow(polygon, grown)
        first, stop = convex_spans(polygon - (self.u0, self.v0), self.mask.shape)
        common = self._left_of[self._rows, stop] - self._left_of[self._rows, first]
        return int((stop - first).sum()), int(common.sum())

    def centroid_of(self, polygon: Polygon | None) -> Floats | None:
        """Centroid (2,) of a predicted outline within the image."""
        if polygon is None:
            return None
        height, width = self._image
        frame = np.array(
            [[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]], np.float32
        )
        area, inside = cv2.intersectConvexConvex(polygon, frame)
        if area < 1.0 or inside is None:
            return None
        moments = cv2.moments(inside)
        return np.array([moments["m10"], moments["m01"]]) / moments["m00"]

    def agreement(self, polygon: Polygon | None) -> tuple[float, float]:
        """Fraction of the seen that a predicted outline explains, and of the outline that is seen.

        Slack grants a larger outline to explain, and a smaller one to be seen.
        """
        larger = self.compare(polygon, self.slack)
        smaller = self.compare(polygon, -self.slack) if self.slack else larger
        if larger is None or smaller is None:
            return 0.0, 0.0
        return larger[1] / self.area, smaller[1] / max(smaller[0], 1)

    def cost(self, polygon: Polygon | None) -> float:
        """How badly a predicted outline explains the silhouette; 0 if it matches."""
        compared = self.compare(polygon)
        if compared is None:
            return np.inf
        predicted, common = compared
        return (self.area - common + MISSING_WEIGHT * (predicted - common)) / self.area


class _Fit:
    """A cylinder to be placed so that its outlines match what the cameras have seen."""

    def __init__(self, views: Views, seen: Mapping[str, _Seen], cylinder: Cylinder, free: int) -> None:
        self.views, self.seen, self.rims = views, seen, cylinder.rims
        self.free = free  # coordinates that are sought: the first two, or all three

    def outlines(self, centres: Floats) -> list[dict[str, Polygon | None]]:
        """The outlines of cylinders at centres (N, 3), all projected in one go."""
        pixels = self.views.project((centres[:, None] + self.rims).reshape(-1, 3))
        rims = {name: pixels[name].reshape(len(centres), -1, 2) for name in self.seen}
        return [{name: _hull(rims[name][k]) for name in self.seen} for k in range(len(centres))]

    def from_centroids(self, start: Floats) -> Floats | None:
        """Move the centre until the outlines' centroids are where the silhouettes' are.

        Gauss-Newton steps, in which an outline's centroid is taken to move as the centre's pixel does.
        """
        centre = start
        for _ in range(ITERATIONS):
            (polygons,) = self.outlines(centre[None])
            missing = []
            for name, s in self.seen.items():
                predicted = s.centroid_of(polygons[name])
                if predicted is None:
                    return None
                missing.append(s.silhouette.centroid - predicted)
            step = np.zeros(3)
            slope = self._slope(centre)[:, : self.free]
            step[: self.free] = np.linalg.lstsq(slope, np.concatenate(missing), rcond=None)[0]
            centre = centre + step
            if np.abs(step).max() < STILL:
                break
        return centre if _in_view(self.views, centre, list(self.seen)) else None

    def from_outlines(self, start: Floats) -> Floats:
        """Compass search over the position, along and across the line of sight."""
        # Along the line of sight the pixels change least.
        sight = np.linalg.svd(self._slope(start))[2][-1]
        level = np.cross(sight, [0.0, 0.0, 1.0])
        level /= max(float(np.linalg.norm(level)), 1e-9)
        axes = np.array([sight, level, np.cross(level, sight)])
        if self.free == 2:
            axes = np.array([np.cross([0.0, 0.0, 1.0], level), level])
        compass = np.vstack([axes, -axes])
        best, cost, step = start, self._costs(start[None])[0], FIRST_STEP
        while step > LAST_STEP:
            trials = best + step * compass
            costs = self._costs(trials)
            lowest = int(np.argmin(costs))
            if costs[lowest] < cost:
                best, cost = trials[lowest], costs[lowest]
            else:
                step /= 2.0
        return best

    def judge(self, centre: Floats) -> Located:
        """How well a cylinder there explains the silhouettes."""
        (polygons,) = self.outlines(centre[None])
        pairs = [s.agreement(polygons[name]) for name, s in self.seen.items()]
        # Of A and B, |A and B| / |A or B| = 1 / (|A| / |A and B| + |B| / |A and B| - 1).
        overlaps = [1.0 / (1.0 / a + 1.0 / b - 1.0) if a and b else 0.0 for a, b in pairs]
        explained, visible = (min(values) for values in zip(*pairs, strict=True))
        return Located(centre, min(overlaps), explained, visible)

    def _slope(self, centre: Floats) -> Floats:
        """Derivatives (2 C, 3) [px / m] of the centre's pixels."""
        slopes = self.views.jacobian(centre[None])
        return np.vstack([slopes[name][0] for name in self.seen])

    def _costs(self, centres: Floats) -> list[float]:
        return [
            sum(s.cost(polygons[name]) for name, s in self.seen.items())
            for polygons in self.outlines(centres)
        ]
