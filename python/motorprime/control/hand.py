"""The hand's synergy: one number, its opening, for all its motors.

Most of what a grasping hand does lies along one line: from wide open through the places where the fingers
meet the object to a fist. The opening runs along it: 1 is open, 0 has the fingers at their places round an
object of middle size, below 0 the motors' targets lie behind the object's surface and squeeze, by their
torque limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._arrays import fixed
from ..errors import ArgumentError


@dataclass(frozen=True)
class Hand:
    """A hand's motors and named shapes of it.

    Args:
        motors: variables of the robot that move the fingers.
        shapes: name -> target (n,) [rad] of each motor.
        path: (opening, name of a shape) along the synergy, openings descending.
        slim: the name of the shape that passes obstacles.
    """

    motors: tuple[str, ...]
    shapes: Mapping[str, tuple[float, ...]]
    path: tuple[tuple[float, str], ...]
    slim: str

    def __post_init__(self) -> None:
        for name, shape in self.shapes.items():
            fixed(f"shapes['{name}']", shape, (len(self.motors),))
        for name in (*(name for _, name in self.path), self.slim):
            if name not in self.shapes:
                raise ArgumentError(f"path: no shape '{name}'; there are {sorted(self.shapes)}")
        fixed("path", [opening for opening, _ in self.path], (len(self.path),))
        if len(self.path) < 2 or any(a <= b for (a, _), (b, _) in pairwise(self.path)):
            raise ArgumentError(f"path: expected two or more descending openings, got {self.path}")

    @property
    def widest(self) -> float:
        """Largest opening."""
        return self.path[0][0]

    @property
    def tightest(self) -> float:
        """Smallest opening: a full squeeze."""
        return self.path[-1][0]

    def shape(self, name: str) -> dict[str, float]:
        """Motor targets [rad] of a named shape."""
        if name not in self.shapes:
            raise ArgumentError(f"name: the hand has no shape '{name}'; it has {sorted(self.shapes)}")
        return dict(zip(self.motors, self.shapes[name], strict=True))

    def targets(self, opening: float, *, slim: float = 0.0) -> dict[str, float]:
        """Motor targets [rad] of an opening, linear between the shapes of the path.

        Args:
            opening: 1 open, 0 at the grasp, below 0 squeezing. One beyond the path's ends is taken as the
                end: a dynamical system that drives the hand may overshoot a little.
            slim: from 0, the opening's own shape, to 1, the slim one.

        Raises:
            ArgumentError: an opening that is not finite, a ``slim`` beyond 0 to 1.
        """
        opening, slim = float(fixed("opening", opening, ())), float(fixed("slim", slim, ()))
        if not 0.0 <= slim <= 1.0:
            raise ArgumentError(f"slim: expected a number from 0 to 1, got {slim}")
        knots = np.array([knot for knot, _ in self.path])[::-1]
        shapes = np.array([self.shapes[name] for _, name in self.path])[::-1]
        thin = self.shapes[self.slim]
        return {
            motor: (1.0 - slim) * float(np.interp(opening, knots, shapes[:, k])) + slim * thin[k]
            for k, motor in enumerate(self.motors)
        }
