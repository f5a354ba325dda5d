"""Where an upright cylinder of known size stands, from its silhouettes in two or more cameras.

The centroid of a silhouette is not the image of the cylinder's centre: the eye looks down on the top, and
the near side looks larger. So the centroids are triangulated, and the result is moved until the silhouettes
that it would have match the seen ones. Where they cannot match, because something hides a part, the position
is fitted to the outlines, and what sticks out of the predicted outline weighs more than what is missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ._arrays import Floats, positive
from .camera import PosedCamera
from .detectors.histogram import Silhouette
from .errors import ArgumentError
from .projection.triangulation import nearest_to_rays

NEAREST = 0.02  # depth at which a cylinder may stand [m]
RIM = 48  # points on each rim
ITERATIONS = 5
GOOD_OVERLAP = 0.97  # from here the centroids are trusted
MISSING_WEIGHT = 0.3  # of a predicted pixel that is not seen, against a seen one that is not predicted
FIRST_STEP, LAST_STEP = 0.03, 0.0004  # of the outline fit [m]


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


def outline(view: PosedCamera, centre: Floats, cylinder: Cylinder) -> NDArray[np.float32] | None:
    """Convex outline (M, 2) (u, v) of a cylinder, None where a part of it is behind the camera."""
    pixels = view.project(_RIMS * (cylinder.radius, cylinder.radius, cylinder.height) + centre)
    if not np.isfinite(pixels).all():
        return None
    return cv2.convexHull(pixels.astype(np.float32))[:, 0]  # type: ignore[return-value]


def locate_cylinder(
    views: Mapping[str, PosedCamera], silhouettes: Mapping[str, Silhouette], cylinder: Cylinder
) -> Located | None:
    """Locate a cylinder that stands upright in the root frame.

    Args:
        views: the cameras at the posture in which the images were taken.
        silhouettes: what was segmented in each; cameras without one do not count.
        cylinder: its size.

    Returns:
        The position, or None where the silhouettes agree on none in front of the cameras.

    Raises:
        ArgumentError: fewer than two silhouettes, or one that is empty or sticks out of its image.
    """
    names = [name for name in views if name in silhouettes]
    if len(names) < 2:
        raise ArgumentError(f"silhouettes: at least two cameras expected, got {names}")
    for name in names:
        (u0, v0, u1, v1), (height, width) = silhouettes[name].box, views[name].camera.shape
        if u0 < 0 or v0 < 0 or u1 > width or v1 > height or not silhouettes[name].area:
            raise ArgumentError(
                f"silhouettes['{name}']: some pixels within {width} x {height} expected, "
                f"got {silhouettes[name].area} in the box {(u0, v0, u1, v1)}"
            )
    seen = [_Seen(views[name], silhouettes[name], cylinder) for name in names]
    centre = _from_centroids(seen)
    if centre is not None:
        located = _judge(seen, centre)
        if located.overlap >= GOOD_OVERLAP:
            return located
    else:
        centre = _meet([s.view for s in seen], [s.silhouette.centroid for s in seen])
    if centre is None:
        return None
    return _judge(seen, _from_outlines(seen, centre))


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


class _Seen:
    """One camera's silhouette and the predictions to hold against it, both within a region of the image."""

    def __init__(self, view: PosedCamera, silhouette: Silhouette, cylinder: Cylinder) -> None:
        self.view, self.silhouette, self.cylinder = view, silhouette, cylinder
        height, width = view.camera.shape
        u0, v0, u1, v1 = silhouette.box
        # A hidden part is at most as large as the seen one or so; and nothing is seen outside the image.
        du, dv = u1 - u0 + 8, v1 - v0 + 8
        self.u0, self.v0 = max(u0 - du, 0), max(v0 - dv, 0)
        u1, v1 = min(u1 + du, width), min(v1 + dv, height)
        self.mask = silhouette.paint((height, width))[self.v0 : v1, self.u0 : u1]
        self.area = int(self.mask.sum())
        self._rows = np.arange(len(self.mask))
        self._left_of = np.pad(np.cumsum(self.mask, axis=1, dtype=np.int64), ((0, 0), (1, 0)))

    def compare(self, centre: Floats) -> tuple[int, int] | None:
        """Pixels that a cylinder there would have, and how many of them are seen."""
        polygon = outline(self.view, centre, self.cylinder)
        if polygon is None or np.abs(polygon).max() > 1e4:
            return None
        first, stop = convex_spans(polygon - (self.u0, self.v0), self.mask.shape)
        common = self._left_of[self._rows, stop] - self._left_of[self._rows, first]
        return int((stop - first).sum()), int(common.sum())

    def predicted_centroid(self, centre: Floats) -> Floats | None:
        """Centroid (2,) of the predicted outline within the image."""
        polygon = outline(self.view, centre, self.cylinder)
        if polygon is None:
            return None
        height, width = self.view.camera.shape
        frame = np.array(
            [[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]], np.float32
        )
        area, inside = cv2.intersectConvexConvex(polygon, frame)
        if area < 1.0 or inside is None:
            return None
        moments = cv2.moments(inside)
        return np.array([moments["m10"], moments["m01"]]) / moments["m00"]

    def cost(self, centre: Floats) -> float:
        compared = self.compare(centre)
        if compared is None:
            return np.inf
        predicted, common = compared
        return (self.area - common + MISSING_WEIGHT * (predicted - common)) / self.area


def _meet(views: list[PosedCamera], pixels: list[Floats]) -> Floats | None:
    """Point (3,) nearest to the rays through one pixel of each camera, None where there is none ahead."""
    points, _ = nearest_to_rays(views, np.array(pixels)[:, None, :])
    ahead = np.isfinite(points).all() and all(view.depth(points)[0] > NEAREST for view in views)
    return points[0] if ahead else None


def _from_centroids(seen: list[_Seen]) -> Floats | None:
    views = [s.view for s in seen]
    centre = _meet(views, [s.silhouette.centroid for s in seen])
    for _ in range(ITERATIONS):
        if centre is None:
            return None
        targets = []
        for s in seen:
            predicted = s.predicted_centroid(centre)
            if predicted is None:
                return None
            # Aim at the pixel of the centre that would put the centroid where it was seen.
            targets.append(s.silhouette.centroid + s.view.project(centre[None])[0] - predicted)
        centre = _meet(views, targets)
    return centre


def _from_outlines(seen: list[_Seen], start: Floats) -> Floats:
    """Compass search over the position, along and across the line of sight."""
    sight = start - np.mean([s.view.origin for s in seen], axis=0)
    sight /= np.linalg.norm(sight)
    level = np.cross(sight, [0.0, 0.0, 1.0])
    level /= max(float(np.linalg.norm(level)), 1e-9)
    axes = np.array([sight, level, np.cross(level, sight)])
    best, cost, step = start, sum(s.cost(start) for s in seen), FIRST_STEP
    while step > LAST_STEP:
        trials = [best + step * sign * axis for axis in axes for sign in (1.0, -1.0)]
        costs = [sum(s.cost(trial) for s in seen) for trial in trials]
        lowest = int(np.argmin(costs))
        if costs[lowest] < cost:
            best, cost = trials[lowest], costs[lowest]
        else:
            step /= 2.0
    return best


def _judge(seen: list[_Seen], centre: Floats) -> Located:
    overlap, explained, visible = 1.0, 1.0, 1.0
    for s in seen:
        compared = s.compare(centre)
        if compared is None:
            return Located(centre, 0.0, 0.0, 0.0)
        predicted, common = compared
        overlap = min(overlap, common / max(predicted + s.area - common, 1))
        explained = min(explained, common / s.area)
        visible = min(visible, common / max(predicted, 1))
    return Located(centre, overlap, explained, visible)
