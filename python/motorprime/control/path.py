"""A smooth path of the palm to the pre-grasp: up, over, and in along the palm's facing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError
from ..kinematics import Floats


def minimum_jerk(phase: Floats | float) -> Floats:
    """Fraction of the way at a fraction ``phase`` of the time: 10 t^3 - 15 t^4 + 6 t^5 (Flash and Hogan, 1985)."""
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
        lift: how far above the straight way the curve bulges [m].
        run_up: length of the final stretch along ``facing`` [m].
    """

    start: Floats
    goal: Floats
    facing: Floats
    duration: float
    lift: float = 0.08
    run_up: float = 0.12

    def __post_init__(self) -> None:
        if not self.duration > 0.0:
            raise ArgumentError(f"duration: a positive time expected, got {self.duration} s")

    def at(self, time: Floats | float) -> Floats:
        """Places (..., 3) [m] at times [s] since the start; before and after it rests at the ends."""
        s = minimum_jerk(np.asarray(time, dtype=np.float64) / self.duration)[..., None]
        up = np.array([0.0, 0.0, self.lift])
        leave = self.start + 0.25 * (self.goal - self.start) + up
        arrive = self.goal - self.run_up * self.facing + 0.5 * up
        return (
            (1 - s) ** 3 * self.start
            + 3 * s * (1 - s) ** 2 * leave
            + 3 * s**2 * (1 - s) * arrive
            + s**3 * self.goal
        )

    def ahead(self, time: float, count: int = 50) -> Floats:
        """The way that is left after ``time`` [s]: (count, 3) [m], evenly spread in time."""
        return self.at(np.linspace(min(time, self.duration), self.duration, count))
