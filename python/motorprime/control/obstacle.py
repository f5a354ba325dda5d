"""Past an obstacle: does the planned path collide, and by which via-point does it get around?

The hand is a point that moves along the mentally simulated path; what stands about is a cylinder that
encloses the thing and allows for the hand's size. Where the path enters it, a via-point beside the obstacle,
in front of it or behind, on the side where the collision is expected, becomes the first attractor; the hand
passes it in its passing shape, and the target follows (section III-C1; Lukic, Santos-Victor, Billard, 2014).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, not_negative
from ..errors import UnreachableError
from ..kinematics import transform
from ..rotations import rotation_matrices, rotation_vectors
from .cds import CoupledDynamics
from .clearance import Obstacle
from .movement import Goal, RollOut, State

ALLOWANCE = 0.06
"""Half a hand [m]: the palm's point keeps so far off the surface of whatever stands about."""

SAFETY = 0.11
"""Distance [m] of the via-point from the obstacle's surface: the palm, and fingers that are half bent."""

WIDER = (1.0, 1.3, 1.6)  # times SAFETY: tried in this order
PASSED = 0.03  # so near [m] the via-point has done its work
MARGIN = 0.01  # an obstacle that the hand starts too close to may not come nearer than this [m]
TOO_LONG = 12.0  # a path that takes longer is none [s]


@dataclass(frozen=True, eq=False)
class Motion:
    """A planned motion: attractors one after the other.

    Attributes:
        goals: via-points, if any, then the target.
        simulated: the mental simulation through all of them.
        clearance: least distance [m] of the palm's point to an obstacle on it; infinite without one.
        passing: the obstacle that each via-point is for, an index into the obstacles; one less than goals.
    """

    goals: tuple[Goal, ...]
    simulated: RollOut
    clearance: float
    passing: tuple[int, ...] = ()

    def advance(self, state: State) -> Motion:
        """The motion that is left: without a via-point that the palm has come to."""
        if len(self.goals) > 1 and _apart(state, self.goals[0]) < PASSED:
            return replace(self, goals=self.goals[1:], passing=self.passing[1:])
        return self

    def towards(self, goal: Goal) -> Motion:
        """The same motion to a target that is now elsewhere; its simulation is the old one's still."""
        return replace(self, goals=(*self.goals[:-1], goal))


def simulate(dynamics: CoupledDynamics, state: State, goals: Sequence[Goal], *, dt: float = 0.01) -> RollOut:
    """Mental simulation through via-points to the last goal.

    Each via-point is left when the palm is :data:`PASSED` from it; ``arrived`` says whether the end was
    got to.
    """
    parts: list[RollOut] = []
    for goal in goals[:-1]:
        part = dynamics.roll_out(state, goal, dt=dt, seconds=TOO_LONG)
        near = np.flatnonzero(np.linalg.norm(part.path - goal.palm[:3, 3], axis=1) < PASSED)
        if not len(near):
            return _joined([*parts, part], arrived=False)
        parts.append(_first(part, int(near[0]) + 1))
        state = _end(parts[-1])
    last = dynamics.roll_out(state, goals[-1], dt=dt, seconds=TOO_LONG)
    return _joined([*parts, last], arrived=last.arrived)


def plan_motion(
    dynamics: CoupledDynamics,
    state: State,
    goal: Goal,
    obstacles: Sequence[Obstacle] = (),
    *,
    passing: float = 1.0,
    anterior: npt.ArrayLike = (-1.0, 0.0, 0.0),
    allowance: float = ALLOWANCE,
    feasible: Callable[[Motion], bool] | None = None,
    dt: float = 0.01,
) -> Motion:
    """Plan a motion to a goal that keeps the palm off obstacles.

    Args:
        dynamics: the controller.
        state: where eyes, palm and hand are.
        goal: where they are to be.
        obstacles: what stands about.
        passing: opening of the hand while it passes an obstacle.
        anterior: (3,) the direction that counts as in front of an obstacle: away from the robot.
        allowance: distance [m] from the obstacles' surfaces that the palm's point keeps.
        feasible: says of a motion whether the rest of the arm can do it, too; the first such is taken.
        dt: time step of the simulation [s].

    Raises:
        UnreachableError: start or goal are in collision, or no via-point leads past what is in the way.
    """
    allowance = not_negative("allowance", allowance)
    ahead = fixed("anterior", anterior, (3,))
    ahead = ahead / np.linalg.norm(ahead)
    limits = [_limit(o, state, goal, allowance) for o in obstacles]
    direct = _motion(dynamics, state, (goal,), obstacles, (), dt)
    blocking = _first_hit(direct.simulated, obstacles, limits)
    if blocking is None:
        if direct.simulated.arrived and (feasible is None or feasible(direct)):
            return direct
        if not obstacles:
            raise UnreachableError("goal: the arm cannot follow the way there")
        places = direct.simulated.path
        blocking = int(np.argmin([_off(o, places).min() for o in obstacles]))
    tried = 0
    for via in _via_points(direct.simulated, obstacles[blocking], state, goal, passing, ahead):
        motion = _motion(dynamics, state, (via, goal), obstacles, (blocking,), dt)
        tried += 1
        if not motion.simulated.arrived or _first_hit(motion.simulated, obstacles, limits) is not None:
            continue
        if feasible is None or feasible(motion):
            return motion
    raise UnreachableError(
        f"obstacle: none of {tried} via-points leads past the one at "
        f"{np.round(obstacles[blocking].centre, 3)} m"
    )


def _limit(obstacle: Obstacle, state: State, goal: Goal, allowance: float) -> float:
    """The least distance that the path must keep; less where it starts so near already."""
    end = float(_off(obstacle, goal.palm[None, :3, 3])[0])
    if end < allowance:
        raise UnreachableError(
            f"goal: in collision; the palm would be {end * 100:.1f} cm from an obstacle "
            f"at {np.round(obstacle.centre, 3)} m and needs {allowance * 100:.1f} cm"
        )
    start = float(_off(obstacle, state.palm[None, :3, 3])[0])
    if start < MARGIN:
        raise UnreachableError(
            f"start: in collision; the palm is {start * 100:.1f} cm from an obstacle "
            f"at {np.round(obstacle.centre, 3)} m"
        )
    return min(allowance, start - MARGIN / 2)


def _first_hit(simulated: RollOut, obstacles: Sequence[Obstacle], limits: Sequence[float]) -> int | None:
    """The obstacle that the path comes too close to first."""
    places = simulated.path
    hits = [np.flatnonzero(_off(o, places) < limit) for o, limit in zip(obstacles, limits, strict=True)]
    first = {int(hit[0]): k for k, hit in reversed(list(enumerate(hits))) if len(hit)}
    return first[min(first)] if first else None


def _via_points(
    simulated: RollOut, obstacle: Obstacle, state: State, goal: Goal, passing: float, ahead: Floats
) -> Iterator[Goal]:
    """Via-points in the order in which they are tried.

    In front or behind, on the side where the collision is expected first; across the path, for a path that
    runs from front to back; and all of these farther out. At the height of the path, and last above.
    """
    places = simulated.path
    nearest = int(np.argmin(_off(obstacle, places)))
    offset = places[nearest] - obstacle.centre
    along = goal.palm[:3, 3] - state.palm[:3, 3]
    across = np.array([-along[1], along[0], 0.0])
    across /= max(float(np.linalg.norm(across)), 1e-9)
    directions = [
        sign * side
        for side in (ahead, across)
        for sign in ((1.0, -1.0) if offset @ side >= 0.0 else (-1.0, 1.0))
    ]
    turn = _halfway(state.palm[:3, :3], goal.palm[:3, :3])
    top = obstacle.centre[2] + obstacle.shape.height / 2
    beside = float(np.clip(places[nearest, 2], goal.palm[2, 3], top + SAFETY))
    for level in (beside, top + SAFETY):
        for wider in WIDER:
            for direction in directions:
                place = obstacle.centre + direction * (obstacle.shape.radius + wider * SAFETY)
                place[2] = level
                yield Goal(obstacle.centre, transform(turn, place), passing, amplitude=0.0)
    over = obstacle.centre.copy()
    over[2] = top + SAFETY
    yield Goal(obstacle.centre, transform(turn, over), passing, amplitude=0.0)


def _halfway(first: Floats, second: Floats) -> Floats:
    return first @ rotation_matrices(0.5 * rotation_vectors(first.T @ second))


def _motion(
    dynamics: CoupledDynamics,
    state: State,
    goals: tuple[Goal, ...],
    obstacles: Sequence[Obstacle],
    passing: tuple[int, ...],
    dt: float,
) -> Motion:
    simulated = simulate(dynamics, state, goals, dt=dt)
    places = simulated.path
    clearance = min([float(_off(o, places).min()) for o in obstacles], default=np.inf)
    return Motion(goals, simulated, clearance, passing)


def _off(obstacle: Obstacle, points: Floats) -> Floats:
    """Distance (N,) [m] of points (N, 3) to an obstacle's surface; negative inside."""
    return obstacle.gap(points)[0]


def _apart(state: State, goal: Goal) -> float:
    return float(np.linalg.norm(state.palm[:3, 3] - goal.palm[:3, 3]))


def _first(part: RollOut, count: int) -> RollOut:
    return RollOut(
        part.times[:count], part.fixations[:count], part.palms[:count], part.openings[:count], part.arrived
    )


def _end(part: RollOut) -> State:
    return State(part.fixations[-1], part.palms[-1], float(part.openings[-1]))


def _joined(parts: Sequence[RollOut], *, arrived: bool) -> RollOut:
    """One movement after the other; each begins where the last ended, and that instant is kept once."""
    ends = np.cumsum([0.0, *(part.times[-1] for part in parts)])
    cut = [slice(None) if k == 0 else slice(1, None) for k in range(len(parts))]
    return RollOut(
        np.concatenate([part.times[c] + end for part, c, end in zip(parts, cut, ends[:-1], strict=True)]),
        np.concatenate([part.fixations[c] for part, c in zip(parts, cut, strict=True)]),
        np.concatenate([part.palms[c] for part, c in zip(parts, cut, strict=True)]),
        np.concatenate([part.openings[c] for part, c in zip(parts, cut, strict=True)]),
        arrived,
    )
