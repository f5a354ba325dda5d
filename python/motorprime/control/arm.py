"""Torso and arm at one posture: where each of their points is and how it moves, from one pass of the chain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..errors import ArgumentError
from ..robot import Robot

_CROSS = np.array(
    [
        [[0, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 0, -1], [0, 0, 0], [1, 0, 0]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 0]],
    ],
    dtype=np.float64,
).transpose(0, 2, 1)
"""_CROSS[i] is the cross matrix of the unit vector i, so z @ _CROSS is that of z."""


@dataclass(frozen=True, eq=False)
class Points:
    """K points fixed to parts of the arm.

    Attributes:
        carriers: (K,) index of the joint that carries each: that joint and those before it move the point.
        places: (K, 4) homogeneous [m] in the frame of what that joint carries.
    """

    carriers: NDArray[np.intp]
    places: Floats

    @cached_property
    def moved_by(self) -> Floats:
        """(K, n) 1 where a joint moves the point, else 0; n is as large as the last carrier asks."""
        joints = np.arange(int(self.carriers.max(initial=-1)) + 1)
        return np.asarray(joints[None, :] <= self.carriers[:, None], dtype=np.float64)

    @classmethod
    def carried(cls, carrier: int, places: Floats) -> Points:
        """Points (K, 3) [m] in the frame of what one joint carries."""
        return cls(np.full(len(places), carrier), np.column_stack([places, np.ones(len(places))]))

    def take(self, index: list[int]) -> Points:
        """Some of the points."""
        return Points(self.carriers[index], self.places[index])

    def joined(self, other: Points) -> Points:
        """These points, then the other's."""
        return Points(
            np.concatenate([self.carriers, other.carriers]), np.concatenate([self.places, other.places])
        )


class Arm:
    """The chain from the root to the palm of one robot."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.chain = robot, robot.reach_chain
        self.names = self.chain.names
        self.palm = self.chain.end @ robot.palm.frame

    def at(self, angles: Floats) -> Posture:
        """The arm at angles (n,) [rad]."""
        return Posture(self, self.chain.frames(angles))

    def on_link(self, link: str, places: Floats) -> Points:
        """Points (K, 3) [m] given in the frame of a link on the way to the palm.

        Raises:
            ArgumentError: the link is not on that way, or no joint moves it.
        """
        limb = self.robot.tree.chain(self.robot.root, link)
        if not limb.names or limb.names != self.names[: len(limb.names)]:
            raise ArgumentError(f"link '{link}' is not on the way to the palm")
        return Points.carried(len(limb.names) - 1, places @ limb.end[:3, :3].T + limb.end[:3, 3])

    def on_palm(self, places: Floats) -> Points:
        """Points (K, 3) [m] given in the palm's frame."""
        return Points.carried(len(self.names) - 1, places @ self.palm[:3, :3].T + self.palm[:3, 3])


class Posture:
    """The arm at one posture.

    Attributes:
        frames: (n, 4, 4) pose of what each joint carries, in the root frame.
        palm: (4, 4) pose of the palm.
    """

    def __init__(self, arm: Arm, frames: Floats) -> None:
        self.frames = frames
        self.palm: Floats = frames[-1] @ arm.palm
        self._axes = arm.chain.axes(frames)

    @cached_property
    def _twists(self) -> Floats:
        """(n, 3, 4): times a homogeneous point, its velocity z x (p - o) while one joint turns at 1 rad/s."""
        count = len(self.frames)
        twists = np.empty((count, 3, 4))
        twists[:, :, :3] = (self._axes @ _CROSS.reshape(3, 9)).reshape(count, 3, 3)
        twists[:, :, 3] = -(twists[:, :, :3] @ self.frames[:, :3, 3, None])[:, :, 0]
        return twists

    @property
    def palm_jacobian(self) -> tuple[Floats, Floats]:
        """Velocity (3, n) [m/rad] of the palm's origin and its angular velocity (3, n), root frame."""
        return (self._twists @ self.palm[:, 3]).T, self._axes.T

    def places(self, points: Points) -> Floats:
        """Where the points are: (K, 3) [m]."""
        found: Floats = (self.frames[points.carriers] @ points.places[:, :, None])[:, :3, 0]
        return found

    def velocities(self, points: Points, places: Floats) -> Floats:
        """Derivatives (K, 3, n) [m/rad] of points that are at ``places`` (K, 3)."""
        moved = points.moved_by
        count = moved.shape[1]
        homogeneous = np.column_stack([places, np.ones(len(places))])
        slopes = np.zeros((len(places), 3, len(self.frames)))
        by_joint = self._twists[:count] @ homogeneous.T  # (n, 3, K)
        slopes[:, :, :count] = by_joint.transpose(2, 1, 0) * moved[:, None, :]
        return slopes
