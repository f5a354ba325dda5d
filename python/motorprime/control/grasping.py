"""From which side to grasp an upright object: the most comfortable of those that arm and obstacles allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, not_negative, numbers, rigid
from ..errors import ArgumentError, UnreachableError
from .pose import PoseSolution, PoseSolver
from .reaching import AZIMUTHS

RESTARTS = 1  # for each side without its obstacles
REFINEMENTS = 2  # times that the sides halfway to the best one's neighbours are tried
FARTHEST = 0.8
"""Largest change [rad] of a joint from pre-grasp to grasp: more is another posture, not an approach."""

PoseOf = Callable[[float], npt.ArrayLike]


@dataclass(frozen=True, eq=False)
class Grasp:
    """How an object is grasped.

    Attributes:
        azimuth: [rad] the side, as the poses were asked for.
        palm: (4, 4) pose of the palm at the grasp; ``palm_before`` that of the pre-grasp.
        grasp: its joints and errors; ``pregrasp`` those of the pre-grasp.
        discomfort: of both, see :meth:`.pose.PoseSolver.discomfort`.
    """

    azimuth: float
    palm: Floats
    palm_before: Floats
    grasp: PoseSolution
    pregrasp: PoseSolution
    discomfort: float

    @property
    def feasible(self) -> bool:
        """Whether both are solved, and the one is an approach to the other."""
        change = float(np.abs(self.grasp.angles - self.pregrasp.angles).max())
        return self.grasp.solved and self.pregrasp.solved and change <= FARTHEST


def choose_grasp(
    solver: PoseSolver,
    pose: PoseOf,
    *,
    distance: float = 0.08,
    backwards: npt.ArrayLike = (0.0, 0.0, -1.0),
    azimuths: npt.ArrayLike = AZIMUTHS,
    start: npt.ArrayLike | None = None,
    hold: npt.ArrayLike | None = None,
    turning: npt.ArrayLike = (1.0, 1.0, 1.0),
) -> Grasp:
    """The most comfortable azimuth whose grasp and pre-grasp are both within reach, clear of everything.

    Args:
        solver: with the bench and the obstacles; the object itself is none of them.
        pose: azimuth [rad] -> pose (4, 4) of the palm at the grasp, in the root frame.
        distance: how far [m] the palm is backed off at the pre-grasp.
        backwards: (3,) the direction of that, in the palm's axes; its length does not matter.
        azimuths: (K,) [rad] the sides to try, ascending; the best is refined between its neighbours.
        start: first guess (n,) [rad] of the first side; every other starts from its neighbour.
        hold, turning: as of :meth:`.pose.PoseSolver.solve`.

    Raises:
        ArgumentError: no azimuths or descending ones, a direction of length 0, poses that are none.
        UnreachableError: no side is within reach; says how near the best comes.
    """
    sides = _ascending(azimuths)
    back = fixed("backwards", backwards, (3,))
    length = float(np.linalg.norm(back))
    if length == 0.0:
        raise ArgumentError("backwards: expected a direction, got one of length 0")
    away = np.eye(4)
    away[:3, 3] = not_negative("distance", distance) / length * back
    free = solver.over(None)

    def solve(by: PoseSolver, azimuth: float, guess: npt.ArrayLike | None) -> Grasp:
        palm = rigid("pose", pose(azimuth))
        restarts = RESTARTS if by is free else 0  # the other has a good start, and other sides to try
        grasp = before = by.nearest(palm, guess, hold=hold, turning=turning, restarts=restarts)
        if grasp.solved:
            before = by.nearest(palm @ away, grasp.angles, hold=hold, turning=turning, restarts=0)
        cost = by.discomfort(grasp.angles, hold) + by.discomfort(before.angles, hold)
        return Grasp(azimuth, palm, palm @ away, grasp, before, cost)

    # What keeps off the arm only takes comfort away. So a side is as good as without it at best, which is
    # found in a third of the time, and most sides need no more than that.
    hopes: list[Grasp] = []
    guess: npt.ArrayLike | None = start
    for azimuth in sides:
        hopes.append(solve(free, float(azimuth), guess))
        guess = hopes[-1].grasp.angles if hopes[-1].feasible else guess
    missed = [hope for hope in hopes if not hope.feasible]
    best: Grasp | None = None

    def attempt(hope: Grasp) -> None:
        nonlocal best
        if not hope.feasible or (best is not None and hope.discomfort >= best.discomfort):
            return
        side = solve(solver, hope.azimuth, hope.grasp.angles)
        if not side.feasible:
            missed.append(side)
        elif best is None or side.discomfort < best.discomfort:
            best = side

    for hope in sorted(hopes, key=lambda hope: hope.discomfort):
        attempt(hope)
    if best is None:
        raise UnreachableError(_why(missed))
    step = float(np.diff(sides).max(initial=0.0)) / 2.0
    for _ in range(REFINEMENTS):
        middle = best
        for azimuth in (middle.azimuth - step, middle.azimuth + step):
            if sides[0] <= azimuth <= sides[-1]:
                attempt(solve(free, azimuth, middle.grasp.angles))
        step /= 2.0
    return best


def _ascending(azimuths: npt.ArrayLike) -> Floats:
    values = numbers("azimuths", azimuths)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all() or (np.diff(values) <= 0.0).any():
        raise ArgumentError(f"azimuths: expected one or more ascending angles, got {values.tolist()}")
    return values


def _why(missed: list[Grasp]) -> str:
    """What keeps from the side that lacks the least, in words."""

    def worse(side: Grasp) -> PoseSolution:
        return max(side.grasp, side.pregrasp, key=lambda found: (not found.solved, found.position_error))

    nearest = min(map(worse, missed), key=lambda found: (found.solved, found.position_error + found.depth))
    if nearest.solved:
        return "pose: no side of the object can be grasped: from no pre-grasp an approach leads to its grasp"
    return (
        f"pose: no side of the object can be grasped; the best of {len(missed)} leaves the palm "
        f"{nearest.position_error * 1e3:.1f} mm and {np.rad2deg(nearest.rotation_error):.1f} deg off, "
        f"{nearest.depth * 1e3:.0f} mm too near to what it keeps off"
    )
