"""Inverse kinematics of torso and arm for full poses of the palm, within limits and clear of obstacles.

Sought are the joints q that minimise a sum of squares within the joint limits::

    |600 / m (p(q) - p*)|^2 + |60 / rad diag(turning) log(R*^T R(q))|^2   the palm's pose
    + |comfort (q - hold)|^2 + a preference's                             if that leaves a choice
    + sum |800 / m depth(q)|^2                                            one-sided: table, obstacles

What ends outside the tolerance is tried again from other postures: the nearest of a few hundred that were
drawn once, when the solver was made.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, generator, integer, not_negative, numbers, positive, rigid
from ..errors import ArgumentError, UnreachableError
from ..robot import Robot
from .arm import Arm, Posture
from .clearance import Clearance, Obstacle
from .levenberg_marquardt import minimise
from .reaching import ABOVE, COMFORT, POSITION, STIFF_TORSO, Bench

TURN = 60.0
"""Weight of a radian of the palm's rotation, against POSITION of a metre."""
TOLERANCE = (0.002, float(np.deg2rad(2.0)))
"""Largest errors of a solved pose: position [m], rotation [rad]."""
DEEPEST = 0.005
"""Largest depth [m] in a clearance of a solved pose: the clearances have that much to spare."""
STAGES = ((0.05, 1e-3), (1.0, 0.03))
"""Firmness of the pose, and the share of the cost that a step must promise to lower. A firm pose bends the
way to a comfortable posture into a narrow valley that takes a hundred steps; a soft one takes ten, and few
firm ones mend the pose."""
ITERATIONS = 30  # of each stage; 95 of 100 searches that find the pose need fewer
LIBRARY = 512  # postures drawn as starts
RESTARTS = 12
FOLLOW_STEPS = 4  # of the search, each time a loop asks


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """Joints that bring the palm to a pose, or as near to it as they can.

    Attributes:
        angles: (n,) [rad] of the solver's ``names``.
        position_error: [m] of the palm's origin.
        rotation_error: [rad]; each axis counts as its ``turning`` asks.
        depth: the largest [m] that a clearance is missed by; 0 where all are kept.
        restarts: further starts that were needed.
        solved: whether all three are within the tolerance.
    """

    angles: Floats
    position_error: float
    rotation_error: float
    depth: float
    restarts: int
    solved: bool


Preference = Callable[[Posture], tuple[Floats, Floats]]
"""Further residuals (m,) and their derivatives (m, n) at a posture, such as an elbow's preferred swivel."""


class PoseSolver:
    """Solves poses of the palm for one robot.

    Args:
        robot: with its URDF.
        bench: the work surface that the guarded links and the hand keep above.
        obstacles: what upper arm, forearm and hand keep off.
        margin: fraction of each joint's range kept off either limit, for a joint at its stop follows no
            correction.
        torso: fraction of the torso's range, about its resting posture, that is used. One that bends and
            turns as far as it can takes the other arm along, into the bench.
        preference: further residuals that shape the posture, for example :class:`.swivel.SwivelPreference`.
        tolerance: largest errors of a solved pose, [m] and [rad].
        seed: draws the postures that further starts are taken from.

    Raises:
        ArgumentError: a margin of half the range or more, a tolerance that is not positive, a robot that
            guards a link that is not on the way to the palm.
    """

    def __init__(
        self,
        robot: Robot,
        bench: Bench | None = None,
        obstacles: Sequence[Obstacle] = (),
        *,
        margin: float = 0.02,
        torso: float = 1.0,
        preference: Preference | None = None,
        tolerance: tuple[float, float] = TOLERANCE,
        seed: int | np.random.Generator | None = 0,
    ) -> None:
        self.robot = robot
        self.arm = Arm(robot)
        self.names = self.arm.names
        if not not_negative("margin", margin) < 0.5:
            raise ArgumentError(f"margin: expected less than half of a joint's range, got {margin}")
        place, turn = fixed("tolerance", tolerance, (2,))
        self.tolerance = positive("tolerance[0]", place), positive("tolerance[1]", turn)
        if not 0.0 <= not_negative("torso", torso) <= 1.0:
            raise ArgumentError(f"torso: expected a fraction from 0 to 1, got {torso}")
        limits = _narrowed(robot, self.names, torso)
        span = limits[:, 1] - limits[:, 0]
        self.limits: Floats = limits + margin * np.column_stack([span, -span])
        self.rest = np.clip(robot.resting(self.names), self.limits[:, 0], self.limits[:, 1])
        self._comfort = COMFORT * np.array(
            [STIFF_TORSO if name in robot.torso else 1.0 for name in self.names]
        )
        self._preference = preference
        self._clearance, self._above = Clearance(self.arm, bench, obstacles), ABOVE
        self._library = generator(seed).uniform(
            self.limits[:, 0], self.limits[:, 1], size=(LIBRARY, len(self.names))
        )
        self._library_palms = self.arm.chain.forward(self._library) @ robot.palm.frame

    def over(
        self, bench: Bench | None, obstacles: Sequence[Obstacle] = (), *, wary: float = 1.0
    ) -> PoseSolver:
        """The same solver with another work surface and other obstacles.

        Args:
            bench: the work surface.
            obstacles: what the arm keeps off.
            wary: factor on what it costs to come too near to any of these. With more than 1 it rather misses
                the pose where it cannot have both, as is well on the way to somewhere else.
        """
        other = copy(self)
        other._clearance = Clearance(self.arm, bench, obstacles)
        other._above = positive("wary", wary) * ABOVE
        return other

    def palm(self, angles: Floats) -> Floats:
        """Pose (4, 4) of the palm at angles (n,) [rad]."""
        return self.arm.at(angles).palm

    def discomfort(self, angles: npt.ArrayLike, hold: npt.ArrayLike | None = None) -> float:
        """How far angles (n,) are from ``hold`` (n,), the resting posture when not given: sum of squares."""
        held = self.rest if hold is None else self._angles("hold", hold)
        away = self._comfort * (self._angles("angles", angles) - held)
        return float(away @ away)

    def solve(
        self,
        target: npt.ArrayLike,
        start: npt.ArrayLike | None = None,
        *,
        hold: npt.ArrayLike | None = None,
        turning: npt.ArrayLike = (1.0, 1.0, 1.0),
        restarts: int = RESTARTS,
    ) -> PoseSolution:
        """Joints that bring the palm to a pose.

        Args:
            target: (4, 4) of the palm in the root frame.
            start: first guess (n,) [rad]; the resting posture when not given.
            hold: angles (n,) [rad] that are preferred where the pose leaves a choice; resting when not given.
            turning: (3,) from 0 to 1, how much an error about each of the target palm's axes counts: a 0
                leaves the turn about that axis free.
            restarts: how many other starts may be tried.

        Raises:
            ArgumentError: a target that is no rigid pose, NaN, shapes that do not fit, weights beyond 0 to 1.
            UnreachableError: no start ends within the tolerance; says how near the best comes.
        """
        solution = self.nearest(target, start, hold=hold, turning=turning, restarts=restarts)
        if not solution.solved:
            place = np.round(np.asarray(target, dtype=np.float64)[:3, 3], 3)
            raise UnreachableError(
                f"target: the palm cannot be brought to {place} m and turned as asked; at best it stays "
                f"{solution.position_error * 1e3:.1f} mm and {np.rad2deg(solution.rotation_error):.1f} deg "
                f"off, {solution.depth * 1e3:.0f} mm too near to what it keeps off"
            )
        return solution

    def nearest(
        self,
        target: npt.ArrayLike,
        start: npt.ArrayLike | None = None,
        *,
        hold: npt.ArrayLike | None = None,
        turning: npt.ArrayLike = (1.0, 1.0, 1.0),
        restarts: int = RESTARTS,
    ) -> PoseSolution:
        """As :meth:`solve`, but what cannot be reached gives the best that was found, ``solved`` False."""
        goal = self._goal(target, hold, turning)
        restarts = integer("restarts", restarts, at_least=0)
        first = self.rest if start is None else self._angles("start", start)
        best = self._search(goal, first, self.limits)
        if best.solved or not restarts:
            return best
        for count, other in enumerate(self._starts(goal, restarts), start=1):
            found = replace(self._search(goal, other, self.limits), restarts=count)
            if found.solved:
                return found
            best = min(best, found, key=self._off)
        return replace(best, restarts=restarts)

    def follow(
        self,
        target: npt.ArrayLike,
        angles: npt.ArrayLike,
        *,
        step: npt.ArrayLike,
        hold: npt.ArrayLike | None = None,
        drawn: float = 1.0,
        turning: npt.ArrayLike = (1.0, 1.0, 1.0),
        iterations: int = FOLLOW_STEPS,
    ) -> PoseSolution:
        """The next angles of a control loop: a few iterations from the last ones, each joint a step at most.

        Never raises UnreachableError: the loop goes on as near as it can, and ``solved`` says whether the
        palm is there.

        Args:
            target: (4, 4) of the palm in the root frame, now.
            angles: (n,) [rad] the last ones; where they are beyond the limits, they may come back slowly.
            step: largest change [rad], of all joints or (n,) of each: the largest speed times the period.
            hold, turning: as of :meth:`solve`.
            drawn: factor on how much ``hold`` draws. With hundreds the arm rather comes to that posture than
                to the pose: a way through postures that are known to be good leads past what a search for
                each pose by itself gets stuck at.
            iterations: of the search.
        """
        goal = replace(self._goal(target, hold, turning), drawn=not_negative("drawn", drawn))
        last = self._angles("angles", angles)
        steps = numbers("step", step)
        steps = fixed("step", np.full(last.shape, steps) if steps.ndim == 0 else steps, last.shape)
        if (steps <= 0.0).any():
            raise ArgumentError(f"step: expected numbers > 0, got {steps.min()}")
        lower, upper = np.clip(self.limits.T, last - steps, last + steps)
        iterations = integer("iterations", iterations, at_least=1)
        return self._search(goal, last, np.column_stack([lower, upper]), iterations, STAGES[-1:])

    def _goal(self, target: npt.ArrayLike, hold: npt.ArrayLike | None, turning: npt.ArrayLike) -> _Goal:
        weights = fixed("turning", turning, (3,))
        if (weights < 0.0).any() or (weights > 1.0).any():
            raise ArgumentError(f"turning: expected weights from 0 to 1, got {weights.tolist()}")
        return _Goal(
            rigid("target", target), self.rest if hold is None else self._angles("hold", hold), weights
        )

    def _angles(self, name: str, value: npt.ArrayLike) -> Floats:
        return fixed(name, value, (len(self.names),))

    def _starts(self, goal: _Goal, count: int) -> Floats:
        """Those postures (count, n) of the library whose palms are nearest to the goal."""
        off = POSITION * (self._library_palms[:, :3, 3] - goal.palm[:3, 3])
        cosines = (np.einsum("kij,ij->k", self._library_palms[:, :3, :3], goal.palm[:3, :3]) - 1.0) / 2.0
        turned = TURN * np.arccos(np.clip(cosines, -1.0, 1.0)) * goal.turning.min()
        return self._library[np.argsort(np.sum(off**2, axis=1) + turned**2, kind="stable")[:count]]

    def _search(
        self,
        goal: _Goal,
        start: Floats,
        limits: Floats,
        iterations: int = ITERATIONS,
        stages: tuple[tuple[float, float], ...] = STAGES,
    ) -> PoseSolution:
        angles = start
        for firmness, slight in stages:
            angles = minimise(
                partial(self._residuals, goal, firmness), angles, limits, iterations=iterations, slight=slight
            ).x
        posture = self.arm.at(angles)
        position = float(np.linalg.norm(posture.palm[:3, 3] - goal.palm[:3, 3]))
        rotation = float(np.linalg.norm(goal.turning * _turned(goal.palm, posture.palm)))
        depth = self._clearance.worst(posture)
        solved = position <= self.tolerance[0] and rotation <= self.tolerance[1] and depth <= DEEPEST
        return PoseSolution(angles, position, rotation, depth, 0, solved)

    def _off(self, solution: PoseSolution) -> float:
        """How far a solution is from being one."""
        return float(
            np.hypot(POSITION * solution.position_error, TURN * solution.rotation_error)
            + ABOVE * max(0.0, solution.depth - DEEPEST)
        )

    def _residuals(self, goal: _Goal, firmness: float, angles: Floats) -> tuple[Floats, Floats]:
        """All residuals (m,) and their Jacobian (m, n); the pose's are weighted by ``firmness`` besides."""
        posture = self.arm.at(angles)
        linear, angular = posture.palm_jacobian
        turned = _turned(goal.palm, posture.palm)
        comfort = goal.drawn * self._comfort
        place, turning = firmness * POSITION, firmness * TURN * goal.turning
        residuals = [
            place * (posture.palm[:3, 3] - goal.palm[:3, 3]),
            turning * turned,
            comfort * (angles - goal.hold),
        ]
        rows = [
            place * linear,
            turning[:, None] * (_inverse_right_jacobian(turned) @ posture.palm[:3, :3].T @ angular),
            np.diag(comfort),
        ]
        if not self._clearance.idle:
            depths, slopes = self._clearance.depths(posture)
            residuals.append(self._above * depths)
            rows.append(self._above * slopes)
        if self._preference is not None:
            more, slopes = self._preference(posture)
            residuals.append(more)
            rows.append(slopes)
        return np.concatenate(residuals), np.concatenate(rows)


@dataclass(frozen=True, eq=False)
class _Goal:
    """What one search is after: the palm (4, 4), the preferred angles (n,), the weights of rotations (3,).

    ``drawn`` is a factor on how much the preferred angles draw.
    """

    palm: Floats
    hold: Floats
    turning: Floats
    drawn: float = 1.0


def _narrowed(robot: Robot, names: tuple[str, ...], torso: float) -> Floats:
    """Limits (n, 2) [rad] of the joints, the torso's narrowed to a fraction of its range about rest."""
    limits = robot.limits(names)
    rest = robot.resting(names)[:, None]
    shares = np.array([[torso if name in robot.torso else 1.0] for name in names])
    narrowed: Floats = rest + shares * (limits - rest)
    return narrowed


def _turned(goal: Floats, palm: Floats) -> Floats:
    """Rotation vector (3,) [rad] from one pose to another, in the first one's axes.

    OpenCV's takes 2 us, against 50 of the one that checks its arguments and serves whole arrays.
    """
    turned: Floats = cv2.Rodrigues(goal[:3, :3].T @ palm[:3, :3])[0][:, 0]
    return turned


def _inverse_right_jacobian(vector: Floats) -> Floats:
    """(3, 3) that takes a body's angular velocity to the rate of its rotation vector (3,) r::

    I + K / 2 + (1 / t^2 - cot(t / 2) / (2 t)) K^2,  K = r x,  t = |r|
    """
    x, y, z = vector
    angle = float(np.sqrt(x * x + y * y + z * z))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    factor = 1.0 / 12.0 if angle < 1e-3 else 1.0 / angle**2 - 0.5 / (angle * np.tan(angle / 2.0))
    jacobian: Floats = _IDENTITY + 0.5 * cross + factor * (cross @ cross)
    return jacobian


_IDENTITY = np.eye(3)
