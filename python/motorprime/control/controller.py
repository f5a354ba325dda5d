"""From coupled dynamics to joint angles: what eyes, arm and hand are to do in the next moments.

The dynamics say where fixation point, palm and fingers shall be; inverse kinematics turns that into angles of
torso and arm, of neck and eyes, and the hand's synergy into those of the fingers.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats, fixed, integer, positive, rigid
from ..errors import StateError, UnreachableError
from .cds import CoupledDynamics
from .gaze import fixate
from .motion import Leg, Motion
from .movement import State
from .pose import PoseSolver
from .side_grasp import SIDE_GRASP, SideGrasp

JOINT_SPEED = 2.0
"""Of the fastest joint of torso and arm [rad/s]."""
LEAD = 0.05
"""So far [m] the plan may run ahead of an arm that its limits, or what it keeps off, hold back."""
THINNING = 0.6  # time in which the hand becomes slim, or itself again [s]
FOLDED = 0.1  # a hand that is slimmer than this unfolds before it goes in
STRIDE, TURN = 0.03, 0.25  # of the palm [m] and [rad], after which the arm is tried again in a rehearsal
AWRY = 0.05  # so far off [m] the palm may be on the way: what matters there is what the arm keeps off,
GRAZE = 0.004  # its margins but for so much [m],
CLOSE = 0.005  # and that the palm gets there in the end [m]
DRAWN = 1000.0  # how much more a rehearsed posture draws than a comfortable one does
CALM = 0.06  # so near [m] to the end of the leg before the last the pose counts as much as what is kept off
LEAP = 1.5  # between two tries no joint turns farther [rad]


class Controller:
    """Drives one robot by coupled dynamics. It commands; whether the robot follows is for others to see.

    Args:
        dynamics: of eye, arm and hand.
        arm: inverse kinematics, with the work surface and whatever else the arm keeps off.
        grasp: says how far the hand may be closed at a distance from its goal.

    Attributes:
        careful: inverse kinematics for the end of the leg before the last, on which the target, too, must not
            be touched; ``arm`` at first.
        wary: for all the way before that, on which it matters more to keep off things than where the palm
            is; ``arm`` at first.
        spare: how much farther [m] ``wary`` keeps off things than it must.
        state: where eyes, palm and hand are commanded to be.
        angles: of torso and arm (n,) [rad], as commanded.
        slim: how far the hand is in its slim shape, 0 to 1.
        gaze: of torso, neck and eyes (len(robot.gaze),) [rad], as commanded.
    """

    def __init__(self, dynamics: CoupledDynamics, arm: PoseSolver, grasp: SideGrasp = SIDE_GRASP) -> None:
        self.dynamics, self.arm, self.careful, self.wary = dynamics, arm, arm, arm
        self.grasp, self.robot = grasp, arm.robot
        self.spare = 0.0
        self.state: State | None = None
        self.angles: Floats = arm.rest
        self.slim = 0.0
        self._rehearsed: tuple[Floats, Floats] | None = None
        self.gaze: Floats = self.robot.resting(self.robot.gaze)

    @property
    def palm(self) -> Floats:
        """The palm's pose (4, 4) as commanded; the plan may be ahead of it."""
        return self.arm.palm(self.angles)

    def begin(
        self,
        angles: npt.ArrayLike,
        gaze: npt.ArrayLike,
        fixation: npt.ArrayLike,
        opening: float,
        *,
        slim: float = 0.0,
    ) -> None:
        """Start from where the robot is.

        Args:
            angles: of torso and arm (n,) [rad].
            gaze: posture (len(robot.gaze),) [rad].
            fixation: (3,) [m] the point that the eyes look at.
            opening: of the hand.
            slim: how far it is in its slim shape, 0 to 1.
        """
        self.slim = slim
        self.angles = fixed("angles", angles, (len(self.arm.names),))
        self.gaze = self.robot.gaze_posture(gaze)
        self._rehearsed = None
        self.state = State(fixed("fixation", fixation, (3,)), self.arm.palm(self.angles), opening)

    def advance(
        self, motion: Motion, seconds: float, *, steps: int = 4
    ) -> tuple[Motion, list[dict[str, float]]]:
        """What to command during the next ``seconds``.

        Args:
            motion: towards its first goal; via-points that are passed are dropped.
            seconds: how far to go on.
            steps: commands in that time, evenly spread.

        Returns:
            The motion that is left, and for each step the target [rad] of every variable.

        Raises:
            StateError: :meth:`begin` has not been called.
        """
        period = positive("seconds", seconds) / integer("steps", steps, at_least=1)
        parts = math.ceil(period / self.dynamics.largest_step - 1e-9)
        commands: list[dict[str, float]] = []
        for _ in range(steps):
            if not motion.legs[0].unfold or self.slim < FOLDED:
                # The arm itself must have come to the pre-grasp; a via-point only shapes the way.
                motion = motion.advance(self.palm if len(motion.legs) <= 2 else self._state().palm)
            for _ in range(parts):
                self.state = self.dynamics.step(self._state(), motion.legs[0].goal, period / parts)
            self._follow(self._arm_for(motion.legs, self.palm), period)
            commands.append(dict(zip(self.arm.names, map(float, self.angles), strict=True)))
            if self.robot.hand is not None:
                leg, change = motion.legs[0], period / THINNING
                away = float(np.linalg.norm(self.palm[:3, 3] - leg.goal.palm[:3, 3]))
                self.slim += float(np.clip((leg.slim and away > leg.unfold) - self.slim, -change, change))
                opening = self.grasp.opening(self._state().opening, self._away(motion))
                commands[-1] |= self.robot.hand.targets(opening, slim=self.slim)
        self._turn_eyes(commands)
        return motion, commands

    def track(self, palm: npt.ArrayLike, seconds: float, *, steps: int = 4) -> list[dict[str, float]]:
        """Commands that take the palm straight to a pose (4, 4) nearby, eyes and fingers staying as they are.

        Raises:
            StateError: :meth:`begin` has not been called.
        """
        goal = rigid("palm", palm)
        begun = self._state().palm
        period = positive("seconds", seconds) / integer("steps", steps, at_least=1)
        commands: list[dict[str, float]] = []
        for k in range(1, steps + 1):
            between = goal.copy()
            between[:3, 3] = begun[:3, 3] + k / steps * (goal[:3, 3] - begun[:3, 3])
            self.state = replace(self._state(), palm=between)
            self._follow(self.arm, period)
            commands.append(dict(zip(self.arm.names, map(float, self.angles), strict=True)))
        self._turn_eyes(commands)
        return commands

    def rehearse(self, motion: Motion, *, hold: npt.ArrayLike | None = None) -> bool:
        """Whether the arm can do a motion from where it is, keeping off what it shall, without a leap.

        If so, it is remembered, and :meth:`advance` prefers the rehearsed postures on the way.
        """
        palms = motion.simulated.palms
        angles, off = self.angles, np.inf
        marks, postures = _milestones(palms), []
        for k in marks:
            leg = int(np.searchsorted(motion.begins, k, side="right")) - 1
            arm = self._arm_for(motion.legs[leg:], palms[k])
            found = arm.nearest(palms[k], angles, hold=hold, restarts=0)
            leap, off = float(np.abs(found.angles - angles).max()), found.position_error
            graze = GRAZE + (self.spare if arm is self.wary else 0.0)
            if off > AWRY or found.depth > graze or leap > LEAP:
                return False
            angles = found.angles
            postures.append(angles)
        if off > CLOSE:
            return False
        self._rehearsed = palms[marks], np.array(postures)
        return True

    def _arm_for(self, legs: Sequence[Leg], palm: Floats) -> PoseSolver:
        """What is to be heeded with these legs left and the palm (4, 4) there."""
        if len(legs) == 1:
            return self.arm
        near = len(legs) == 2 and np.linalg.norm(palm[:3, 3] - legs[0].goal.palm[:3, 3]) < CALM
        return self.careful if near else self.wary

    def _preferred(self) -> Floats | None:
        """The rehearsed posture for what comes next; None where nothing has been rehearsed."""
        if self._rehearsed is None:
            return None
        palms, postures = self._rehearsed
        here = self._state().palm
        away = np.linalg.norm(palms[:, :3, 3] - here[:3, 3], axis=1) / STRIDE
        cosines = (np.einsum("nij,ij->n", palms[:, :3, :3], here[:3, :3]) - 1.0) / 2.0
        nearest = int(np.argmin(away + np.arccos(np.clip(cosines, -1.0, 1.0)) / TURN))
        preferred: Floats = postures[min(nearest + 1, len(postures) - 1)]
        return preferred

    def _away(self, motion: Motion) -> float:
        """Distance [m] of the palm from the end of a motion."""
        return float(np.linalg.norm(self.palm[:3, 3] - motion.goal.palm[:3, 3]))

    def _state(self) -> State:
        if self.state is None:
            raise StateError("controller: call begin() with the robot's posture first")
        return self.state

    def _follow(self, arm: PoseSolver, period: float) -> None:
        state = self._state()
        rehearsed = self._preferred()
        drawn = DRAWN if rehearsed is not None and arm is self.wary else 1.0
        found = arm.follow(state.palm, self.angles, step=JOINT_SPEED * period, hold=rehearsed, drawn=drawn)
        self.angles = found.angles
        if found.position_error > LEAD:
            palm, there = state.palm.copy(), self.arm.palm(self.angles)
            palm[:3, 3] = there[:3, 3] + LEAD / found.position_error * (palm[:3, 3] - there[:3, 3])
            self.state = replace(state, palm=palm)

    def _turn_eyes(self, commands: list[dict[str, float]]) -> None:
        """Add neck and eyes to commands, evenly on their way to the fixation point at the end of them."""
        robot, last = self.robot, commands[-1]
        begun = self.gaze
        posture = np.array([last.get(name, value) for name, value in zip(robot.gaze, begun, strict=True)])
        with contextlib.suppress(UnreachableError):  # as far aside as that the eyes cannot turn: they stay
            posture = fixate(robot, posture, self._state().fixation)
        for k, command in enumerate(commands, start=1):
            share = k / len(commands)
            for name, old, new in zip(robot.gaze, begun, posture, strict=True):
                command.setdefault(name, float(old + share * (new - old)))
        self.gaze = posture


def _milestones(palms: Floats) -> NDArray[np.intp]:
    """Indices into palms (N, 4, 4), ascending, between which a palm moves a stride or turns at most."""
    steps = np.linalg.norm(np.diff(palms[:, :3, 3], axis=0), axis=1) / STRIDE
    cosines = (np.einsum("nij,nij->n", palms[1:, :3, :3], palms[:-1, :3, :3]) - 1.0) / 2.0
    gone = np.cumsum([0.0, *(steps + np.arccos(np.clip(cosines, -1.0, 1.0)) / TURN)])
    marks = np.linspace(0.0, gone[-1], max(2, int(np.ceil(gone[-1])) + 1))
    return np.unique(np.minimum(np.searchsorted(gone, marks), len(palms) - 1))
