"""The grasp: plan with coupled dynamics, get around what stands in the way, close the hand, lift.

What the robot knows of target and obstacles comes from its eyes alone, and at every vision cycle it looks
again along what it is going to do: the mental simulation of the rest of the movement (section III-C).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import Floats
from ..attention import Attention
from ..control.cds import CoupledDynamics
from ..control.clearance import Obstacle
from ..control.gaze import fixate
from ..control.movement import Goal, State
from ..control.obstacle import Motion, plan_motion, simulate
from ..control.path import minimum_jerk
from ..control.pose import PoseSolver
from ..control.reaching import Bench
from ..errors import UnreachableError
from .body import Body
from .cycle import Cycle, Settings
from .explore import Target
from .seeker import BEYOND, PERIOD, PLAN_POINTS, Seeker
from .timing import Clock

INNER = 4  # steps of the controller in a vision cycle
SURVEYS = 3  # cycles that the way is looked at before the arm moves
JOINT_SPEED = 2.0  # of the fastest joint of arm and torso [rad/s]
ARRIVED, TURNED = 0.004, float(np.deg2rad(3.0))  # of the palm from the grasp, by the plan
PATIENCE = 12.0  # a movement that takes longer has failed [s]
NEAR = 0.07  # from here [m] the hand hides the target, and what is known of it stays
MOVED = 0.01  # a known obstacle that is now so far off [m] asks for a new plan
STARTLED = 1.0  # so long [s] after a jump or a loss attention is wider,
WIDER = 2.0  # this many times
LOST = 8  # cycles without the target until it is searched again
CLOSING, SQUEEZE = 1.0, -0.4  # time [s] in which the hand closes, and the opening that it presses towards
LIFT, LIFTING, HOLDING = 0.06, 1.5, 1.2  # height [m], its time and the time to hold it [s]


class Grasp(Seeker):
    """Find a target, grasp it and lift it.

    Args:
        body: the robot.
        target: what to grasp.
        attention: with the robot's projection and reach cloud.
        bench: the work surface.
        dynamics: of eye, arm and hand.
        obstacles: what may stand in the way.
        settings: how to look and move.
        seed: draws windows and postures.
        clock: for the times of the stages [s].

    Attributes:
        outcome: 'running', then 'lifted' as far as the robot can tell, 'not found', 'refused' or 'missed';
            :attr:`reason` says why.
        motion: the present plan; None before there is one.
    """

    def __init__(
        self,
        body: Body,
        target: Target,
        attention: Attention,
        bench: Bench,
        dynamics: CoupledDynamics,
        *,
        obstacles: Sequence[Target] = (),
        settings: Settings | None = None,
        seed: int | np.random.Generator | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        super().__init__(
            body, target, attention, bench, obstacles=obstacles, settings=settings, seed=seed, clock=clock
        )
        self.dynamics = dynamics
        self.motion: Motion | None = None
