"""Where eye, arm and hand are, where they are going, and the movement between."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, not_negative, rigid
from ..errors import ArgumentError
from ..rotations import ROTATION_BASIS, rotation_features, rotation_vector

EYE, ARM, HAND = slice(0, 3), slice(3, 9), 9
"""Where the three systems stand in the ten numbers of a movement relative to its goal."""
_PLACE, _TURN = slice(3, 6), slice(6, 9)
LEAST_OPEN, MOST_OPEN = -0.5, 2.0
"""Openings that are accepted: beyond is a mistake of units."""


@dataclass(frozen=True, eq=False)
class State:
    """Eye, arm and hand at one instant, in the robot's root frame.

    Attributes:
        fixation: (3,) [m] point that the eyes look at.
        palm: (4, 4) pose of the palm.
        opening: of the hand; 0 with the fingers where they are at the grasp, 1 at their widest in the
            demonstrations. From -0.5 to 2.

    Raises:
        ArgumentError: a shape, NaN, a palm that is no rigid motion, an opening outside its range.
    """

    fixation: Floats
    palm: Floats
    opening: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "fixation", _copy(fixed("fixation", self.fixation, (3,))))
        object.__setattr__(self, "palm", _copy(rigid("palm", self.palm)))
        object.__setattr__(self, "opening", _opening(self.opening))


@dataclass(frozen=True, eq=False)
class Goal:
    """Where eye, arm and hand shall come to rest, in the robot's root frame.

    Attributes:
        fixation: (3,) [m] point to look at.
        palm: (4, 4) pose of the palm. The path is learned in its axes, and so turns with it.
        opening: of the hand in the end; 0 for a grasp.
        amplitude: how wide the hand opens on its way, as a multiple of the demonstrations', >= 0; with
            ``opening`` at most 2. With 0 the hand does not wait for the arm.

    Raises:
        ArgumentError: as for :class:`State`, and an amplitude outside its range.
    """

    fixation: Floats
    palm: Floats
    opening: float = 0.0
    amplitude: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "fixation", _copy(fixed("fixation", self.fixation, (3,))))
        object.__setattr__(self, "palm", _copy(rigid("palm", self.palm)))
        object.__setattr__(self, "opening", _opening(self.opening))
        amplitude = not_negative("amplitude", self.amplitude)
        if self.opening + amplitude > MOST_OPEN:
            raise ArgumentError(
                f"amplitude: expected at most {MOST_OPEN - self.opening:.6g}, so that the hand opens to "
                f"{MOST_OPEN} at most, got {amplitude}"
            )
        object.__setattr__(self, "amplitude", amplitude)

    def relative(self, state: State) -> Floats:
        """A state as seen from the goal: (10,) of fixation, place and rotation vector of the palm, opening.

        Lengths are in the goal palm's axes [m, rad]; all is 0 at the goal.
        """
        axes, relative = self.palm[:3, :3], np.empty(10)
        relative[EYE] = (state.fixation - self.fixation) @ axes
        relative[_PLACE] = (state.palm[:3, 3] - self.palm[:3, 3]) @ axes
        relative[_TURN] = rotation_vector(axes.T @ state.palm[:3, :3])
        relative[HAND] = state.opening - self.opening
        return relative

    def absolute(self, relative: Floats) -> tuple[Floats, Floats, Floats]:
        """Fixations (N, 3), palms (N, 4, 4) and openings (N,) of what :meth:`relative` gives, (N, 10)."""
        axes = self.palm[:3, :3]
        # A palm is linear in the features of its rotation, its place and 1.
        features = np.empty((len(relative), 14))
        features[:, :10] = rotation_features(relative[:, _TURN])
        features[:, 10:13], features[:, 13] = relative[:, _PLACE], 1.0
        basis = np.zeros((14, 4, 4))
        basis[:10, :3, :3] = axes @ ROTATION_BASIS
        basis[10:13, :3, 3] = axes.T
        basis[13, :, 3] = self.palm[:, 3]
        palms: Floats = (features @ basis.reshape(14, 16)).reshape(-1, 4, 4)
        fixations: Floats = relative[:, EYE] @ axes.T + self.fixation
        openings: Floats = relative[:, HAND] + self.opening
        return fixations, palms, openings


@dataclass(frozen=True)
class Tolerance:
    """How close to the goal counts as there; with 0 a movement never ends before its time.

    Attributes:
        fixation: of the eyes [m].
        place: of the palm [m].
        turn: of the palm [rad].
        opening: of the hand.
    """

    fixation: float = 0.001
    place: float = 0.001
    turn: float = math.radians(1.0)
    opening: float = 0.01

    def __post_init__(self) -> None:
        for name in ("fixation", "place", "turn", "opening"):
            object.__setattr__(self, name, not_negative(name, getattr(self, name)))

    def array(self) -> Floats:
        """(4,) of fixation, place, turn, opening."""
        return np.array([self.fixation, self.place, self.turn, self.opening])


@dataclass(frozen=True, eq=False)
class RollOut:
    """A movement, from its start to where it was over.

    Attributes:
        times: (N,) [s] from 0.
        fixations: (N, 3) [m].
        palms: (N, 4, 4).
        openings: (N,).
        arrived: whether everything came within its tolerance in the time that was given.
    """

    times: Floats
    fixations: Floats
    palms: Floats
    openings: Floats
    arrived: bool

    def __len__(self) -> int:
        return len(self.times)

    @property
    def path(self) -> Floats:
        """(N, 3) [m] places of the palm."""
        places: Floats = self.palms[:, :3, 3]
        return places


@dataclass(frozen=True, eq=False)
class Ends:
    """How many movements ended.

    Attributes:
        relative: (N, 10) last states, as seen from the goal.
        arrived: (N,) [s] when each came within its tolerance; NaN where it did not in its time.
        closed_early: (N,) whether the hand closed while the palm was far.
    """

    relative: Floats
    arrived: Floats
    closed_early: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.arrived)


def _copy(array: Floats) -> Floats:
    copy: Floats = array.copy()
    copy.flags.writeable = False
    return copy


def _opening(value: npt.ArrayLike) -> float:
    opening = float(fixed("opening", value, ()))
    if not LEAST_OPEN <= opening <= MOST_OPEN:
        raise ArgumentError(
            f"opening: expected {LEAST_OPEN} to {MOST_OPEN}, a fraction of the widest, got {opening}"
        )
    return opening
