"""The :class:`Body` of a simulated robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..sim.cameras import Eyes, Frame
from ..sim.world import STEP, World


class SimulatedBody:
    """The robot of a simulated world.

    Attributes:
        frames: the last pictures with the simulator's truth; for those who judge, not for the task.
        touched: bodies that the robot has touched so far.
        watchers: called after every step of the physics; for those who judge.
    """

    def __init__(self, world: World, eyes: Eyes) -> None:
        self.world, self.eyes, self.robot = world, eyes, world.robot
        self.frames: Mapping[str, Frame] = {}
        self.touched: set[int] = set()
        self.watchers: list[Callable[[], None]] = []
        self._commanded: dict[str, float] = {}

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.world.time

    def see(self) -> Mapping[str, NDArray[np.uint8]]:
        """One picture of every camera."""
        self.frames = self.eyes.capture()
        return {camera: frame.rgb for camera, frame in self.frames.items()}

    def read(self, variables: tuple[str, ...]) -> Floats:
        """Encoders (n,) [rad]."""
        return self.world.read(variables)

    def move(self, targets: Mapping[str, float], seconds: float) -> None:
        """Move by position control through physics."""
        present = dict(zip(targets, self.world.read(targets), strict=True))
        start = {name: self._commanded.get(name, present[name]) for name in targets}
        steps = max(1, round(seconds / STEP))
        for k in range(1, steps + 1):
            share = k / steps
            self.world.command(
                {name: start[name] + share * (target - start[name]) for name, target in targets.items()}
            )
            self.world.step()
            self.touched |= self.world.touching()
            for watch in self.watchers:
                watch()
        self._commanded.update(targets)
