"""What a task may know of a robot: its pictures and encoders in, joint targets out. No object poses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..robot import Robot


class Body(Protocol):
    """A robot's senses and motors."""

    robot: Robot

    @property
    def time(self) -> float:
        """Seconds since the start."""
        ...

    def see(self) -> Mapping[str, NDArray[np.uint8]]:
        """One picture (H, W, 3) uint8 RGB of every camera."""
        ...

    def read(self, variables: tuple[str, ...]) -> Floats:
        """Encoders (n,) [rad]."""
        ...

    def move(self, targets: Mapping[str, float], seconds: float) -> None:
        """Move variables to targets [rad] at even speed, in so many seconds, by the motors."""
        ...
