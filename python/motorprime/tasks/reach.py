"""The reach: bring the palm before the target, looking only where it matters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .._arrays import Floats
from ..control.gaze import fixate
from ..control.path import PalmPath, minimum_jerk, plan_path
from ..control.reaching import Pregrasp
from ..errors import UnreachableError
from .cycle import Cycle
from .seeker import BEYOND, PERIOD, PLAN_POINTS, Seeker, between

FIRMNESS = 6.0
"""On the way the posture blends from the start's to the pre-grasp's. Held so firmly it bends off the path by
millimetres, where it would otherwise follow it into a dead end of the joint limits."""
JOINT_SPEED = 2.0  # of the fastest joint of arm and torso [rad/s]
PALM_SPEED = 0.16  # mean speed of the palm on its way [m/s]
ARM_RADIUS = 0.05  # of the forearm, and a little [m]
ARRIVED = 0.002  # the palm's distance from its goal, by the encoders [m]


class Reach(Seeker):
    """Find a target and bring the palm before it.

    Attributes:
        outcome: 'running', then 'reached', 'not found', 'refused' or 'missed'; :attr:`reason` says why.
        pregrasp: the chosen posture before the grasp; None before the plan.
    """

    pregrasp: Pregrasp | None = None

    def _act(self) -> Iterator[Cycle]:
        assert self.estimate is not None
        try:
            self.pregrasp = self.solver.pregrasp(self.estimate, self._angles())
            if self._arm_would_sweep_target():
                self._put_hand_aside()
        except UnreachableError as error:
            self._end("refused", str(error))
            return
        yield from self._move()

    def _arm_would_sweep_target(self) -> bool:
        """Whether forearm or elbow would brush the target on the straight way from here to the pre-grasp."""
        assert self.pregrasp is not None and self.estimate is not None
        shares = np.linspace(0.0, 1.0, 25)[:, None]
        angles = (1.0 - shares) * self._angles() + shares * self.pregrasp.angles
        places = self.solver.forearm(angles).reshape(-1, 3)
        return bool((self.target.shape.distance(places - self.estimate) < ARM_RADIUS).any())

    def _move(self) -> Iterator[Cycle]:
        """Move, with a look at every cycle where the plan leads (section III-C2)."""
        assert self.pregrasp is not None and self.estimate is not None
        solver, pregrasp = self.solver, self.pregrasp
        begin, start = self._angles(), self.body.time
        place = solver.palm(begin)[:3, 3]
        facing = solver.palm(begin)[:3, 2]
        goal = pregrasp.point(self.estimate)
        duration = max(1.5, float(np.linalg.norm(goal - place)) / PALM_SPEED)
        path = plan_path(
            place, goal, pregrasp.facing, keep_off=self.target.shape, centre=self.estimate, duration=duration
        )
        commanded = begin
        while True:
            elapsed = self.body.time - start
            yield self._reach_cycle(path, elapsed)
            path = replace(path, goal=pregrasp.point(self.estimate))
            distance = float(np.linalg.norm(self._palm() - path.goal))
            if elapsed >= duration and (distance < ARRIVED or elapsed > duration + 2.0):
                break
            share = float(minimum_jerk((elapsed + PERIOD) / duration))
            target = solver.solve(
                path.at(elapsed + PERIOD),
                between(facing, pregrasp.facing, share),
                commanded,
                hold=begin + share * (pregrasp.angles - begin),
                facing_weight=0.25 + 0.75 * share,
                firmness=FIRMNESS,
            )
            turn = float(np.abs(target - commanded).max())
            commanded = target
            self.body.move(self._with_gaze(commanded), max(PERIOD, turn / JOINT_SPEED))
        if distance < ARRIVED:
            self._end("reached")
        else:
            self._end("missed", f"the palm stopped {distance * 1e3:.0f} mm from its goal")

    def _with_gaze(self, commanded: Floats) -> dict[str, float]:
        """Targets of arm and torso, and of neck and eyes such that they stay on the glass."""
        assert self.estimate is not None
        robot = self.body.robot
        targets = {name: float(value) for name, value in zip(self.solver.names, commanded, strict=True)}
        joints = self.body.read(robot.gaze)
        for k, name in enumerate(robot.gaze):
            joints[k] = targets.get(name, joints[k])
        try:
            posture = fixate(robot, joints, self.estimate)
        except UnreachableError:
            return targets
        return targets | {
            name: float(posture[k]) for k, name in enumerate(robot.gaze) if name not in robot.torso
        }

    def _reach_cycle(self, path: PalmPath, elapsed: float) -> Cycle:
        ahead = path.ahead(elapsed, PLAN_POINTS - BEYOND)
        return self._look_along("reach", self._to_target(ahead), path.goal)
