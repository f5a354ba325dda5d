"""A movement of several legs, each to an attractor of its own, and its mental simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, not_negative, positive
from ..errors import ArgumentError
from .cds import CoupledDynamics
from .movement import Goal, RollOut, State

TOO_LONG = 12.0  # a leg that takes longer leads nowhere [s]


@dataclass(frozen=True, eq=False)
class Leg:
    """A part of a movement.

    Attributes:
        goal: its attractor.
        near: distance [m] of the palm from it at which the next leg begins.
        turned: angle [rad] between the palm and the goal's below which it does.
        slim: whether the hand is to be slim on it, as when it passes an obstacle,
        unfold: until so near [m] to the goal, where not 0; such a leg ends with the hand unfolded.
    """

    goal: Goal
    near: float = 0.03
    turned: float = math.inf
    slim: bool = False
    unfold: float = 0.0

    def __post_init__(self) -> None:
        positive("near", self.near)
        not_negative("unfold", self.unfold)
        if not self.turned > 0.0:
            raise ArgumentError(f"turned: expected an angle > 0, got {self.turned}")

    def done(self, palms: Floats) -> NDArray[np.bool_]:
        """Whether (N,) palms (N, 4, 4) have come near enough."""
        near = np.linalg.norm(palms[:, :3, 3] - self.goal.palm[:3, 3], axis=1) < self.near
        if math.isinf(self.turned):
            return np.asarray(near)
        cosines = (np.einsum("nij,ij->n", palms[:, :3, :3], self.goal.palm[:3, :3]) - 1.0) / 2.0
        done: NDArray[np.bool_] = near & (cosines > math.cos(self.turned))
        return done


@dataclass(frozen=True, eq=False)
class Motion:
    """A planned movement.

    Attributes:
        legs: what is left of it; the last one leads to the target.
        simulated: the mental simulation of all of it.
        begins: (len(legs),) index into the simulation at which each leg begins.
        clearance: least distance [m] of the palm's point from an obstacle; infinite without one.
    """

    legs: tuple[Leg, ...]
    simulated: RollOut
    begins: tuple[int, ...]
    clearance: float = math.inf

    @property
    def goal(self) -> Goal:
        """Where it leads in the end."""
        return self.legs[-1].goal

    def advance(self, palm: Floats) -> Motion:
        """What is left of it when the palm is at a pose (4, 4): without legs that are done."""
        legs, begins = self.legs, self.begins
        while len(legs) > 1 and legs[0].done(palm[None])[0]:
            legs, begins = legs[1:], begins[1:]
        return self if len(legs) == len(self.legs) else replace(self, legs=legs, begins=begins)

    def shifted(self, goals: Sequence[Goal]) -> Motion:
        """The same motion with other goals for its last legs; its simulation is still the old one."""
        if not goals:
            return self
        count = min(len(goals), len(self.legs))
        pairs = zip(self.legs[-count:], goals[-count:], strict=True)
        moved = tuple(replace(leg, goal=goal) for leg, goal in pairs)
        return replace(self, legs=(*self.legs[:-count], *moved))


def simulate(dynamics: CoupledDynamics, state: State, legs: Sequence[Leg], *, dt: float = 0.01) -> Motion:
    """Mental simulation through all legs; it has arrived when everything rests at the last goal.

    A leg but the last ends when it is done, and where it never is, the simulation ends with it.
    """
    parts: list[RollOut] = []
    for leg in legs[:-1]:
        part = dynamics.roll_out(state, leg.goal, dt=dt, seconds=TOO_LONG)
        done = np.flatnonzero(leg.done(part.palms))
        if not len(done):
            return _motion(legs, [*parts, part], arrived=False)
        parts.append(_first(part, int(done[0]) + 1))
        state = State(parts[-1].fixations[-1], parts[-1].palms[-1], float(parts[-1].openings[-1]))
    last = dynamics.roll_out(state, legs[-1].goal, dt=dt, seconds=TOO_LONG)
    return _motion(legs, [*parts, last], arrived=last.arrived)


def _first(part: RollOut, count: int) -> RollOut:
    return RollOut(
        part.times[:count], part.fixations[:count], part.palms[:count], part.openings[:count], part.arrived
    )


def _motion(legs: Sequence[Leg], parts: Sequence[RollOut], *, arrived: bool) -> Motion:
    """Parts one after the other; each begins where the last ended, and that instant is kept once."""
    ends = np.cumsum([0.0, *(part.times[-1] for part in parts)])
    cut = [slice(1 if k else 0, None) for k in range(len(parts))]
    simulated = RollOut(
        np.concatenate([part.times[c] + end for part, c, end in zip(parts, cut, ends, strict=False)]),
        np.concatenate([part.fixations[c] for part, c in zip(parts, cut, strict=True)]),
        np.concatenate([part.palms[c] for part, c in zip(parts, cut, strict=True)]),
        np.concatenate([part.openings[c] for part, c in zip(parts, cut, strict=True)]),
        arrived,
    )
    begins = np.cumsum([0, *(len(part) - 1 for part in parts[:-1])])
    whole = [int(begins[min(k, len(begins) - 1)]) for k in range(len(legs))]
    return Motion(tuple(legs), simulated, tuple(whole))
