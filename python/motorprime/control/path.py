"""A smooth path of the palm to the pre-grasp: up, over, and in along the palm's facing."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, integer, positive
from ..cylinder import Cylinder
from ..errors import ArgumentError


def minimum_jerk(phase: Floats | float) -> Floats:
    """Fraction of the way at a fraction t of the time: 10 t^3 - 15 t^4 + 6 t^5 (Flash and Hogan, 1985)."""
    t = np.clip(phase, 0.0, 1.0)
    return np.asarray(t**3 * (10.0 + t * (6.0 * t - 15.0)))


@dataclass(frozen=True)
class PalmPath:
    """A cubic Bezier curve that minimum-jerk timing runs along.

    Args:
        start: (3,) [m].
        goal: (3,) [m], the pre-grasp point.
        facing: (3,) unit vector; the curve arrives along it.
        duration: [s].
        bulge: (3,) [m], how far the first half of the curve is pulled off the straight way.
        run_up: length of the final stretch along ``facing`` [m].
    """

    start: Floats
    goal: Floats
    facing: Floats
    duration: float
    bulge: npt.ArrayLike = (0.0, 0.0, 0.08)
    run_up: float = 0.12

    def __post_init__(self) -> None:
        for name in ("start", "goal", "facing", "bulge"):
            object.__setattr__(self, name, fixed(name, getattr(self, name), (3,)))
        length = float(np.linalg.norm(self.facing))
        if abs(length - 1.0) > 1e-6:
            raise ArgumentError(f"facing: expected a unit vector, got one of length {length:.6g}")
        positive("duration", self.duration)

    def at(self, time: Floats | float) -> Floats:
        """Places (..., 3) [m] at times [s] since the start; before and after it rests at the ends."""
        s = minimum_jerk(np.asarray(time, dtype=np.float64) / self.duration)[..., None]
        bulge = np.asarray(self.bulge)
        leave = self.start + 0.25 * (self.goal - self.start) + bulge
        arrive = self.goal - self.run_up * self.facing + 0.5 * bulge
        places: Floats = (
            (1 - s) ** 3 * self.start
            + 3 * s * (1 - s) ** 2 * leave
            + 3 * s**2 * (1 - s) * arrive
            + s**3 * self.goal
        )
        return places

    def ahead(self, time: float, count: int = 50) -> Floats:
        """The way that is left after ``time`` [s]: (count, 3) [m], evenly spread in time."""
        count = integer("count", count, at_least=0)
        return self.at(np.linspace(min(time, self.duration), self.duration, count))


LIFTS, DETOURS = (0.10, 0.15, 0.20), (0.0, 0.06, 0.12, 0.18)
CLEARANCE = 0.06
"""Between the palm's origin and the target's surface [m] until the run-up: half a hand and a little more."""


def plan_path(
    start: Floats, goal: Floats, facing: Floats, *, keep_off: Cylinder, centre: Floats, duration: float
) -> PalmPath:
    """The least detour among a few curves that keeps the hand off the target until it faces it.

    Args:
        start: the palm's place (3,) [m].
        goal: the pre-grasp point (3,) [m].
        facing: (3,) unit vector out of the palm at the goal.
        keep_off: the target's shape, and ``centre`` (3,) [m] its place.
        duration: [s].

    Returns:
        The first clear curve in order of detour; where none is clear, the one that stays farthest off.
    """
    curves = [
        PalmPath(start, goal, facing, duration, bulge=(-detour * facing[0], -detour * facing[1], lift))
        for lift, detour in sorted(product(LIFTS, DETOURS), key=lambda pair: pair[0] ** 2 + pair[1] ** 2)
    ]
    clearances = [_clearance(curve, keep_off, centre) for curve in curves]
    for curve, clearance in zip(curves, clearances, strict=True):
        if clearance >= CLEARANCE:
            return curve
    return curves[int(np.argmax(clearances))]


def _clearance(curve: PalmPath, cylinder: Cylinder, centre: Floats) -> float:
    """Least distance [m] between the curve before its last 3 cm and the cylinder's surface."""
    places = curve.ahead(0.0, 80)
    places = places[np.linalg.norm(places - curve.goal, axis=1) > 0.03] - centre
    if not len(places):
        return np.inf
    return float(cylinder.distance(places).min())
