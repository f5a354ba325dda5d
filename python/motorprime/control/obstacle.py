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
from ..errors import ArgumentError, UnreachableError
from ..kinematics import transform
from ..rotations import rotation_matrices, rotation_vectors
from .cds import CoupledDynamics
from .clearance import Obstacle
from .motion import Leg, Motion, simulate
from .movement import Goal, State

ALLOWANCE = 0.06
"""Half a hand [m]: the palm's point keeps so far off the surface of whatever stands about."""

SAFETY = 0.11
"""Distance [m] of the via-point from the obstacle's surface: the palm, and fingers that are half bent."""

PARALLEL = 0.9  # cosine from which two directions give the same via-points
CORNERS = 8  # directions all around, of which those are tried at last that are none of the others
WIDER = (1.0, 1.3, 1.6)  # times SAFETY: tried in this order
TIGHT = 0.04  # the hand's own thickness [m]: no goal may be nearer to an obstacle
MARGIN = 0.01  # an obstacle that the hand starts too close to may not come nearer than this [m]


def plan_motion(
    dynamics: CoupledDynamics,
    state: State,
    legs: Sequence[Leg],
    obstacles: Sequence[Obstacle] = (),
    *,
    target: Obstacle | None = None,
    anterior: npt.ArrayLike = (-1.0, 0.0, 0.0),
    allowance: float = ALLOWANCE,
    feasible: Callable[[Motion], bool] | None = None,
) -> Motion:
    """Plan a motion that keeps the palm off obstacles.

    Args:
        dynamics: the controller.
        state: where eyes, palm and hand are.
        legs: to the target; a via-point comes before them where one is needed.
        obstacles: what stands about.
        target: what is to be grasped: kept off like an obstacle until the last leg.
        anterior: (3,) the direction that counts as in front of an obstacle: away from the robot.
        allowance: distance [m] from the obstacles' surfaces that the palm's point keeps.
        feasible: says of a motion whether the rest of the arm can do it, too; the first such is taken.

    Raises:
        ArgumentError: no legs, NaN, a negative allowance.
        UnreachableError: start or goal are in collision, or no via-point leads past what is in the way.
    """
    allowance = not_negative("allowance", allowance)
    ahead = fixed("anterior", anterior, (3,))
    length = float(np.linalg.norm(ahead))
    if not legs or length == 0.0:
        raise ArgumentError("legs, anterior: expected at least one leg, and a direction of some length")
    barriers = [_Barrier.off(o, state, legs, allowance, whole=True) for o in obstacles]
    if (
        target is not None and len(legs) > 1 and _gap(target, state) > MARGIN
    ):  # else the hand is there already
        barriers.append(_Barrier.off(target, state, legs[:-1], allowance, whole=False))
    direct = simulate(dynamics, state, legs)
    hit = _first_hit(direct, barriers)
    if hit is None and direct.simulated.arrived and (feasible is None or feasible(direct)):
        return _judged(direct, obstacles)
    if not barriers:
        raise UnreachableError("legs: the arm cannot follow the way there")
    path = direct.simulated.path
    # What the palm hits first, then what it passes nearest; the target itself, which all ways end at, last.
    rest = sorted(barriers, key=lambda barrier: (not barrier.whole, barrier.room(path)))
    ordered = rest if hit is None else [hit, *(other for other in rest if other is not hit)]
    tried = 0
    for ways in (_beside, _between, _around):
        for barrier in ordered:
            for vias in ways(path, barrier.obstacle, state, legs[0].goal, ahead / length):
                motion = simulate(dynamics, state, (*vias, *legs))
                tried += 1
                clear = motion.simulated.arrived and _first_hit(motion, barriers) is None
                if clear and (feasible is None or feasible(motion)):
                    return _judged(motion, obstacles)
    places = [f"what stands at {np.round(b.obstacle.centre, 3)} m" for b in barriers if b.whole]
    past = " and ".join([*places, *("the target" for b in barriers if not b.whole)])
    raise UnreachableError(f"obstacle: none of {tried} ways by via-points leads past {past}")


def _judged(motion: Motion, obstacles: Sequence[Obstacle]) -> Motion:
    path = motion.simulated.path
    return replace(motion, clearance=min([float(o.gap(path)[0].min()) for o in obstacles], default=np.inf))


@dataclass(frozen=True, eq=False)
class _Barrier:
    """What the palm keeps ``limit`` [m] off, on the whole way or until its last leg."""

    obstacle: Obstacle
    limit: float
    whole: bool

    @classmethod
    def off(
        cls, obstacle: Obstacle, state: State, legs: Sequence[Leg], allowance: float, *, whole: bool
    ) -> _Barrier:
        """With the allowance, or less where the palm is so near already."""
        ends = np.array([leg.goal.palm[:3, 3] for leg in legs])
        end = float(obstacle.gap(ends)[0].min())
        if end < TIGHT:
            raise UnreachableError(
                f"goal: in collision; the palm would be {end * 100:.1f} cm from an obstacle "
                f"at {np.round(obstacle.centre, 3)} m and needs {TIGHT * 100:.1f} cm"
            )
        start = _gap(obstacle, state)
        if start < MARGIN:
            raise UnreachableError(
                f"start: in collision; the palm is {start * 100:.1f} cm from an obstacle "
                f"at {np.round(obstacle.centre, 3)} m"
            )
        return cls(obstacle, min(allowance, start - MARGIN / 2, end - MARGIN / 2), whole)

    def room(self, path: Floats) -> float:
        """Distance [m] that a path (N, 3) has to spare."""
        return float(self.obstacle.gap(path)[0].min()) - self.limit

    def hit(self, motion: Motion) -> int | None:
        """Where on its path a motion comes too close first."""
        path = motion.simulated.path
        near = np.flatnonzero(
            self.obstacle.gap(path if self.whole else path[: motion.begins[-1]])[0] < self.limit
        )
        return int(near[0]) if len(near) else None


def _gap(obstacle: Obstacle, state: State) -> float:
    """Distance [m] of the palm from an obstacle's surface."""
    return float(obstacle.gap(state.palm[None, :3, 3])[0][0])


def _first_hit(motion: Motion, barriers: Sequence[_Barrier]) -> _Barrier | None:
    """What the path comes too close to first."""
    hits = [(where, k) for k, barrier in enumerate(barriers) if (where := barrier.hit(motion)) is not None]
    return barriers[min(hits)[1]] if hits else None


def _beside(
    path: Floats, obstacle: Obstacle, state: State, goal: Goal, ahead: Floats
) -> Iterator[tuple[Leg, ...]]:
    """Via-points in front or behind, on the side where the collision is expected first; across the path, for
    one that runs from front to back; all of these farther out. At the height of the path, and last above."""
    offset = path[int(np.argmin(obstacle.gap(path)[0]))] - obstacle.centre
    vias = _Vias(path, obstacle, state, goal)
    for level in vias.levels:
        for wider in WIDER:
            for direction in _sides(offset, state, goal, ahead):
                yield (vias.at(direction, wider, level),)
    yield (vias.at(np.zeros(3), 0.0, vias.levels[1]),)


def _between(
    path: Floats, obstacle: Obstacle, state: State, goal: Goal, ahead: Floats
) -> Iterator[tuple[Leg, ...]]:
    """Via-points in the directions between those of :func:`_beside`, those on the path's side first."""
    offset = path[int(np.argmin(obstacle.gap(path)[0]))] - obstacle.centre
    sides, beside = _sides(offset, state, goal, ahead), np.array([-ahead[1], ahead[0], 0.0])
    angles = np.arange(CORNERS) * (2.0 * np.pi / CORNERS)
    others = [np.cos(angle) * ahead + np.sin(angle) * beside for angle in angles]
    corners = [one for one in others if all(float(one @ side) < PARALLEL for side in sides)]
    vias = _Vias(path, obstacle, state, goal)
    for level in vias.levels:
        for wider in WIDER:
            for direction in sorted(corners, key=lambda one: -float(one @ offset)):
                yield (vias.at(direction, wider, level),)


def _around(
    path: Floats, obstacle: Obstacle, state: State, goal: Goal, ahead: Floats
) -> Iterator[tuple[Leg, ...]]:
    """Two via-points, beside the obstacle and beyond the goal: for a goal close behind it."""
    beyond = (goal.palm[:3, 3] - obstacle.centre) * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(beyond))
    if length < 1e-9:
        return
    beyond /= length
    offset = path[int(np.argmin(obstacle.gap(path)[0]))] - obstacle.centre
    side = np.array([-beyond[1], beyond[0], 0.0])
    side *= 1.0 if float(offset @ side) >= 0.0 else -1.0
    vias = _Vias(path, obstacle, state, goal)
    for level in vias.levels:
        for wider in WIDER:
            for first in (side, -side):
                yield vias.at(first, wider, level), vias.at(beyond, wider, level)


class _Vias:
    """Makes legs to via-points around an obstacle.

    Attributes:
        levels: heights [m] at which they are: that of the path, and above the obstacle.
    """

    def __init__(self, path: Floats, obstacle: Obstacle, state: State, goal: Goal) -> None:
        self.obstacle = obstacle
        self.turn = _halfway(state.palm[:3, :3], goal.palm[:3, :3])
        above = float(obstacle.centre[2] + obstacle.shape.height / 2) + SAFETY
        nearest = path[int(np.argmin(obstacle.gap(path)[0]))]
        self.levels = (float(np.clip(nearest[2], goal.palm[2, 3], above)), above)

    def at(self, direction: Floats, wider: float, level: float) -> Leg:
        """A via-point in a level direction (3,) from the obstacle; over it for a direction of length 0."""
        obstacle = self.obstacle
        place = obstacle.centre + direction * (obstacle.shape.radius + wider * SAFETY)
        place[2] = level
        return Leg(Goal(obstacle.centre, transform(self.turn, place), 1.0, amplitude=0.0), slim=True)


def _sides(offset: Floats, state: State, goal: Goal, ahead: Floats) -> list[Floats]:
    """Level directions in front and behind and across the path; ``offset`` is where it is nearest."""
    along = goal.palm[:3, 3] - state.palm[:3, 3]
    across = np.array([-along[1], along[0], 0.0])
    across /= max(float(np.linalg.norm(across)), 1e-9)
    sides = (ahead,) if abs(float(across @ ahead)) > PARALLEL else (ahead, across)
    return [side if (offset @ side >= 0.0) == first else -side for side in sides for first in (True, False)]


def _halfway(first: Floats, second: Floats) -> Floats:
    halved: Floats = first @ rotation_matrices(0.5 * rotation_vectors(first.T @ second))
    return halved
