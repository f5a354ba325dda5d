"""What the arm keeps off: a work surface, and upright cylinders that stand on it.

The arm is a row of balls along upper arm, forearm and hand. A ball that comes too near gives a residual of
its depth, and one that does not gives zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._arrays import Floats, fixed, not_negative
from ..cylinder import Cylinder
from ..errors import ArgumentTypeError
from ..kinematics import apply, invert
from .arm import Arm, Points, Posture
from .reaching import HAND, HAND_CLEARANCE, Bench

OVERHANG = 0.06
"""How far before the near edge [m] of a work surface the arm keeps above it already."""
SPACING = 0.035
"""Largest distance [m] between two balls of a limb."""
HAND_BAR = np.array([[-0.03, 0.0, -0.01], [0.10, 0.0, -0.01]])
HAND_RADIUS = 0.035
THUMB_BAR = np.array([[-0.024, -0.008, 0.015], [-0.020, -0.006, 0.084]])
THUMB_RADIUS = 0.0075
"""Back of the palm to the fingertips, and the opposed thumb, in the palm's frame [m]; their radii [m]."""


HAND_POINTS, THUMB_POINTS = 6, 4  # along the bars, for :func:`hand_points`


def hand_points(palm: Floats) -> Floats:
    """Places (K, 3) [m] along hand and opposed thumb while the palm is at a pose (4, 4)."""
    hand = np.linspace(HAND_BAR[0], HAND_BAR[1], HAND_POINTS)
    bars = np.vstack([hand, np.linspace(THUMB_BAR[0], THUMB_BAR[1], THUMB_POINTS)])
    return apply(palm, bars)


@dataclass(frozen=True, eq=False)
class Obstacle:
    """An upright cylinder that the arm keeps off.

    Args:
        shape: its radius and height.
        centre: (3,) [m] the middle of its axis in the root frame.
        distance: how far [m] the arm's surface stays off it.

    Raises:
        ArgumentError: a centre that is no place, a negative distance.
    """

    shape: Cylinder
    centre: Floats
    distance: float = 0.01

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Cylinder):
            raise ArgumentTypeError(f"shape: expected a Cylinder, got {type(self.shape).__name__}")
        object.__setattr__(self, "centre", fixed("centre", self.centre, (3,)))
        not_negative("distance", self.distance)

    def gap(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (K,) [m] of points (K, 3) to the surface, negative inside, and their gradients.

        Outside, hypot(max(d_r, 0), max(d_z, 0)) with d_r, d_z the distances beside and above; inside, the
        larger of the two, so that what is in it is pushed out the shortest way.
        """
        offset = points - self.centre
        beside = np.hypot(offset[:, 0], offset[:, 1])
        depth = np.column_stack([beside - self.shape.radius, np.abs(offset[:, 2]) - self.shape.height / 2])
        out = np.maximum(depth, 0.0)
        away = np.hypot(out[:, 0], out[:, 1])
        inside = away == 0.0
        shares = out / np.where(inside, 1.0, away)[:, None]
        shares[inside] = depth[inside] >= depth[inside].max(axis=1, keepdims=True)
        shares[inside, 1] *= shares[inside, 0] == 0.0  # where both are equal, to the side
        axis = beside[:, None] < 1e-12  # on the axis every side is as near: towards x
        radial = np.where(axis, (1.0, 0.0), offset[:, :2] / np.where(axis, 1.0, beside[:, None]))
        gradients = np.column_stack([shares[:, :1] * radial, shares[:, 1] * np.sign(offset[:, 2])])
        return np.where(inside, depth.max(axis=1), away), gradients


class Clearance:
    """How deep the balls of an arm are where they ought not to be.

    Args:
        arm: whose.
        bench: the work surface; guarded links and the hand keep above it.
        obstacles: what upper arm, forearm and hand keep off.

    Raises:
        ArgumentError: the robot guards a link that is not on the way to the palm.
    """

    def __init__(self, arm: Arm, bench: Bench | None = None, obstacles: Sequence[Obstacle] = ()) -> None:
        self.bench, self.obstacles = bench, tuple(obstacles)
        for obstacle in self.obstacles:
            if not isinstance(obstacle, Obstacle):
                raise ArgumentTypeError(f"obstacles: expected Obstacle, got {type(obstacle).__name__}")
        above, heights = _over_the_bench(arm)
        limbs, self._radii = _limbs(arm)
        self._above = len(heights) if bench is not None else 0
        self._heights = heights
        if bench is None:
            self._points = limbs
        else:
            self._points = above.joined(limbs) if self.obstacles else above
        self.idle = bench is None and not self.obstacles

    def depths(self, posture: Posture) -> tuple[Floats, Floats]:
        """Depths (M,) [m] below what is asked for, 0 where it is kept, and their derivatives (M, n)."""
        places = posture.places(self._points)
        depths: list[Floats] = []
        rows: list[tuple[int, int, Floats]] = []  # of what is too near: row, point, direction to the worse
        if self.bench is not None:
            over = places[: self._above, 0] < self.bench.edge + OVERHANG
            dips = np.where(over, self.bench.height + self._heights - places[: self._above, 2], 0.0)
            rows += [(int(k), int(k), _DOWN) for k in np.flatnonzero(dips > 0.0)]
            depths.append(np.maximum(dips, 0.0))
        balls = places[self._above :]
        for i, obstacle in enumerate(self.obstacles):
            gaps, gradients = obstacle.gap(balls)
            near = np.maximum(self._radii + obstacle.distance - gaps, 0.0)
            first = self._above + i * len(balls)
            rows += [(first + int(k), self._above + int(k), -gradients[k]) for k in np.flatnonzero(near)]
            depths.append(near)
        found = np.concatenate(depths) if depths else np.zeros(0)
        slopes = np.zeros((len(found), len(posture.frames)))
        if rows:
            which, points, directions = (list(column) for column in zip(*rows, strict=True))
            velocities = posture.velocities(self._points.take(points), places[points])
            slopes[which] = (np.array(directions)[:, None] @ velocities)[:, 0]
        return found, slopes

    def worst(self, posture: Posture) -> float:
        """The largest depth [m]; 0 where everything is kept."""
        return 0.0 if self.idle else float(self.depths(posture)[0].max(initial=0.0))


_DOWN = np.array([0.0, 0.0, -1.0])


def _over_the_bench(arm: Arm) -> tuple[Points, Floats]:
    """Points that stay above a bench, and how high [m]: the guarded links' origins and the hand."""
    points = arm.on_palm(HAND)
    heights = [np.full(len(HAND), HAND_CLEARANCE)]
    for link, height in arm.robot.guarded.items():
        points = points.joined(arm.on_link(link, np.zeros((1, 3))))
        heights.append(np.array([height]))
    return points, np.concatenate(heights)


def _limbs(arm: Arm) -> tuple[Points, Floats]:
    """Balls along the hand, the thumb and the limbs that end at guarded links, with their radii [m].

    Such a limb begins at the origin of the joint before the link's and is carried by it. Its radius is what
    the link keeps over a work surface.
    """
    last = len(arm.names) - 1
    bars = [(last, *arm.on_palm(bar).places[:, :3]) for bar in (HAND_BAR, THUMB_BAR)]
    radii = [HAND_RADIUS, THUMB_RADIUS]
    frames = arm.chain.frames(np.zeros(len(arm.names)))
    for link, radius in arm.robot.guarded.items():
        joint = int(arm.on_link(link, np.zeros((1, 3))).carriers[0])
        if joint == 0:
            continue  # nothing before it moves
        origin = (invert(frames[joint - 1]) @ frames[joint])[:3, 3]
        bars.append((joint - 1, np.zeros(3), origin))
        radii.append(radius)
    limbs = [_along(*bar) for bar in bars]
    points = limbs[0]
    for limb in limbs[1:]:
        points = points.joined(limb)
    return points, np.repeat(radii, [len(limb.carriers) for limb in limbs])


def _along(carrier: int, begin: Floats, end: Floats) -> Points:
    """Points from ``begin`` to ``end`` (3,) [m], at most SPACING apart."""
    count = 1 + int(np.ceil(np.linalg.norm(end - begin) / SPACING))
    places = np.linspace(begin, end, max(count, 2))
    return Points.carried(carrier, places)
