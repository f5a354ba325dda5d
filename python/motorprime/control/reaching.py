"""Inverse kinematics of torso and arm for a pre-grasp of an upright object, and of the way there.

The palm's frame has x along the stretched fingers and z out of the palm. At the pre-grasp the palm faces the
object's axis from ``STANDOFF`` away, its fingers level; from which side is the solver's choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._arrays import Floats, fixed, positive
from ..errors import ArgumentError, UnreachableError
from ..kinematics import Chain, apply
from ..robot import Robot
from .solver import solve_bounded

STANDOFF = 0.08
"""Distance [m] of the palm's origin from the object's axis at the pre-grasp point."""

POSITION, FACING, LEVEL, COMFORT = 600.0, 4.0, 1.5, 0.12  # weights: per m, per unit of direction, per rad
STIFF_TORSO = 5.0  # a radian of the torso weighs so much more than one of the arm
HAND = np.array(
    [
        [0.11, -0.03, -0.01], [0.11, 0.035, -0.01], [0.03, 0.035, -0.01], [-0.04, 0.03, -0.02],
        [0.0, 0.0, -0.04], [-0.01, -0.06, 0.0], [-0.01, -0.09, 0.045], [-0.04, -0.03, -0.02],
    ]
)  # fmt: skip
"""Fingertips, edges, back and thumb in the palm's frame [m]: HAND_CLEARANCE above the bench."""
HAND_CLEARANCE = 0.01
ABOVE = 800.0  # per metre that a point of the arm dips below its clearance over the table
AZIMUTHS = np.deg2rad(np.arange(-20.0, 101.0, 15.0))  # of the palm's facing: 0 to the left, 90 straight ahead


@dataclass(frozen=True)
class Bench:
    """The work surface before the robot: a level one, whose place the robot has been told.

    Attributes:
        height: of its top in the root frame [m].
        edge: x of its near edge [m] (the root's x points backwards).
    """

    height: float
    edge: float

    def __post_init__(self) -> None:
        fixed("height", self.height, ())
        fixed("edge", self.edge, ())


@dataclass(frozen=True)
class Pregrasp:
    """A posture before the grasp.

    Attributes:
        angles: (n,) [rad] of ``robot.reach_chain``'s joints.
        facing: (3,) level unit vector out of the palm, from the palm to the object's axis.
    """

    angles: Floats
    facing: Floats

    def point(self, centre: Floats) -> Floats:
        """The palm's place (3,) [m] before an object whose centre is there."""
        return centre - STANDOFF * self.facing


class ReachSolver:
    """Solves postures of torso and arm for one robot over one bench."""

    def __init__(self, robot: Robot, bench: Bench | None = None) -> None:
        self.robot, self.bench = robot, bench
        self.chain = robot.reach_chain
        self.names = self.chain.names
        self.limits = robot.limits(self.names)
        span = self.limits[:, 1] - self.limits[:, 0]
        # Keep a little off the limits: a joint at its stop cannot follow a correction.
        self.limits = self.limits + np.column_stack([0.02 * span, -0.02 * span])
        self.rest = np.clip(robot.resting(self.names), self.limits[:, 0], self.limits[:, 1])
        stiff = np.array([STIFF_TORSO if name in robot.torso else 1.0 for name in self.names])
        self.comfort = COMFORT * stiff
        self._limbs = [robot.tree.chain(robot.root, link) for link in robot.guarded]
        for link, limb in zip(robot.guarded, self._limbs, strict=True):
            if limb.names != self.names[: len(limb.names)]:
                raise ArgumentError(f"guarded: link '{link}' is not on the way to the palm")
        self._guards = [] if bench is None else self._guard(bench)

    def palm(self, angles: Floats) -> Floats:
        """Pose (4, 4) of the palm."""
        return self.chain.forward(angles) @ self.robot.palm.frame

    def forearm(self, angles: Floats) -> Floats:
        """Points (N, K, 3) [m] along the guarded links at postures (N, n) [rad]: elbow, wrist, between."""
        joints = [limb.forward(angles[:, : len(limb.names)])[:, :3, 3] for limb in self._limbs]
        middles = [(a + b) / 2 for a, b in pairwise(joints)]
        return np.stack([*joints, *middles], axis=1) if joints else np.zeros((len(angles), 0, 3))

    def pregrasp(self, centre: Floats, start: Floats, *, tolerance: float = 0.004) -> Pregrasp:
        """The most comfortable pre-grasp of an object centred at ``centre`` (3,) [m].

        Args:
            centre: middle of the object's axis.
            start: present angles (n,) [rad].
            tolerance: largest error of the palm's place [m].

        Raises:
            UnreachableError: no posture within the joint limits gets there with the palm facing the object.
        """
        centre, start = fixed("centre", centre, (3,)), fixed("start", start, (len(self.names),))
        tolerance = positive("tolerance", tolerance)
        best: tuple[float, Pregrasp] | None = None
        nearest = np.inf
        for azimuth in AZIMUTHS:
            facing = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
            for seed in (self.rest, start):
                if best is not None and seed is start:
                    continue  # a second start only helps where the first has found nothing
                angles = self.solve(centre - STANDOFF * facing, facing, seed, hold=self.rest)
                pose = self.palm(angles)
                error = float(np.linalg.norm(pose[:3, 3] - (centre - STANDOFF * facing)))
                turned = float(pose[:3, 2] @ facing)
                nearest = min(nearest, error)
                if error > tolerance or turned < np.cos(np.deg2rad(15.0)) or self._sinks(angles) > 0.02:
                    continue
                cost = float(np.sum((self.comfort * (angles - self.rest)) ** 2))
                cost += (
                    (LEVEL * pose[2, 0]) ** 2 + (FACING * (1.0 - turned)) ** 2 + 25.0 * self._sinks(angles)
                )
                if best is None or cost < best[0]:
                    best = (cost, Pregrasp(angles, facing))
        if best is None:
            raise UnreachableError(
                f"target: out of reach at {np.round(centre, 3)} m; the palm comes within "
                f"{nearest * 100:.1f} cm of a pre-grasp at best, or cannot face the object from there"
            )
        return best[1]

    def solve(
        self,
        place: Floats,
        facing: Floats,
        start: Floats,
        *,
        hold: Floats,
        facing_weight: float = 1.0,
        firmness: float = 1.0,
        keep: tuple[str, ...] = (),
    ) -> Floats:
        """Angles (n,) that bring the palm to ``place`` (3,), facing ``facing`` (3,), fingers level.

        Args:
            place: of the palm's origin [m].
            facing: desired unit z of the palm.
            start: first guess [rad].
            hold: angles that are preferred where the task leaves a choice [rad].
            facing_weight: 0 to 1, how much the palm's direction counts.
            firmness: how much ``hold`` counts, against its weight in the search for a pre-grasp.
            keep: joints that stay as in ``start``.
        """
        count = len(self.names)
        place, facing = fixed("place", place, (3,)), fixed("facing", facing, (3,))
        start, hold = fixed("start", start, (count,)), fixed("hold", hold, (count,))
        unknown = [name for name in keep if name not in self.names]
        if unknown:
            raise ArgumentError(
                f"keep: no joint '{unknown[0]}' on the way to the palm; there are {self.names}"
            )
        frame, weight = self.robot.palm.frame, facing_weight
        comfort = firmness * self.comfort

        def residuals(angles: Floats) -> Floats:
            pose = self.chain.forward(angles) @ frame
            return np.concatenate(
                [
                    POSITION * (pose[:3, 3] - place),
                    weight * FACING * (pose[:3, 2] - facing),
                    [weight * LEVEL * pose[2, 0]],
                    comfort * (angles - hold),
                    [ABOVE * max(0.0, depth) for depth in self._dips(angles)],
                ]
            )

        def jacobian(angles: Floats) -> Floats:
            tip, geometric = self.chain.jacobian(angles)
            linear, angular = geometric[:3], geometric[3:]
            lever = tip[:3, :3] @ frame[:3, 3]
            pose = tip @ frame
            # d(R a)/dq = w x (R a) for the palm's axes and for its lever from the link
            turning = [np.cross(angular.T, vector).T for vector in (lever, pose[:3, 2], pose[:3, 0])]
            rows = [
                POSITION * (linear + turning[0]),
                weight * FACING * turning[1],
                weight * LEVEL * turning[2][2:3],
                np.diag(comfort),
                *self._dip_rows(angles),
            ]
            return np.vstack(rows)

        limits = self.limits.copy()
        for k in [self.names.index(name) for name in keep]:
            limits[k] = start[k] - 1e-6, start[k] + 1e-6
        return solve_bounded(residuals, start, limits, jacobian=jacobian)

    def _guard(self, bench: Bench) -> list[_Guard]:
        """The points of the arm that must stay above the bench."""
        guards = [
            _Guard(limb, np.zeros((1, 3)), bench, clearance)
            for limb, clearance in zip(self._limbs, self.robot.guarded.values(), strict=True)
        ]
        return [*guards, _Guard(self.chain, apply(self.robot.palm.frame, HAND), bench, HAND_CLEARANCE)]

    def _dips(self, angles: Floats) -> list[float]:
        """How far each guarded point of the arm lies below its clearance over the bench [m]."""
        return [dip for guard in self._guards for dip in guard.dips(angles)]

    def _sinks(self, angles: Floats) -> float:
        return max([0.0, *self._dips(angles)])

    def _dip_rows(self, angles: Floats) -> list[Floats]:
        return [-ABOVE * guard.gradient(angles) for guard in self._guards]


@dataclass(frozen=True)
class _Guard:
    """Points (N, 3) on the tip of a chain that are to stay ``clearance`` above a bench."""

    chain: Chain
    points: Floats
    bench: Bench
    clearance: float

    def dips(self, angles: Floats) -> Floats:
        """Depth (N,) [m] of each point below its clearance, negative above; 0 in front of the bench."""
        places = apply(self.chain.forward(angles[: len(self.chain.names)]), self.points)
        over = places[:, 0] < self.bench.edge + 0.06
        return np.where(over, self.bench.height + self.clearance - places[:, 2], 0.0)

    def gradient(self, angles: Floats) -> Floats:
        """Derivative (N, n) of the points' heights where they dip, else 0."""
        count = len(self.chain.names)
        tip, geometric = self.chain.jacobian(angles[:count])
        levers = self.points @ tip[:3, :3].T
        rows = np.zeros((len(self.points), len(angles)))
        for k in np.flatnonzero(self.dips(angles) > 0.0):
            rows[k, :count] = (geometric[:3] + np.cross(geometric[3:].T, levers[k]).T)[2]
        return rows
