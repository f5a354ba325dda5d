"""Pick a thing up: plan with coupled dynamics, get around what stands in the way, close the hand, lift.

What the robot knows of target and obstacles comes from its eyes alone, and at every vision cycle it looks
again along what it is going to do: the mental simulation of the rest of the movement (section III-C).
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from .._arrays import Floats
from ..attention import Attention
from ..control.cds import CoupledDynamics
from ..control.clearance import Obstacle
from ..control.controller import Controller
from ..control.gaze import fixate
from ..control.grasping import Grasp, choose_grasp
from ..control.motion import Leg, Motion, simulate
from ..control.movement import Goal
from ..control.obstacle import plan_motion
from ..control.path import minimum_jerk
from ..control.pose import PoseSolver
from ..control.reaching import Bench
from ..control.side_grasp import SIDE_GRASP
from ..cylinder import Located
from ..errors import ArgumentError, UnreachableError
from ..motorplan import default_width
from .belief import Belief
from .body import Body
from .cycle import Cycle, Settings
from .explore import Target
from .seeker import BEYOND, PERIOD, PLAN_POINTS, Seeker, Sought
from .timing import Clock

SURVEYS = 4  # cycles that the way is looked at before the arm moves
BACK = 0.10  # from the grasp to the pre-grasp [m]: there the thumb is not beside the target yet
UNFOLD = 0.08  # from here to the pre-grasp [m] the thumb comes out
BEFORE, BEFORE_TURNED = 0.008, float(np.deg2rad(6.0))  # of the palm from the pre-grasp [m], [rad]
TORSO = 0.5  # of the torso's range: beyond, the other arm would come over the bench
ARRIVED = 0.004  # of the palm from the grasp [m]
# Or as far, once it has come no closer by so much [m] in so many cycles.
NEARLY, CREEP, SETTLED = 0.010, 0.0005, 4
TURNED = float(np.deg2rad(3.0))
PATIENCE = 15.0  # a movement that takes longer has failed [s]
NEAR = 0.06  # from here [m] the hand hides the target, and what is known of it stays
SIDES = 3  # of the target to which a way is sought, the most comfortable first,
WARY = 3.0  # how much more the arm heeds what stands about while it is on its way
APART = float(np.deg2rad(25.0))  # so far apart
SPARE = 0.004  # so much farther [m] the arm keeps off things on its way: it lags behind its commands
SHIFTED = 0.015  # an obstacle that is so far [m] from where it was asks for a new plan
STARTLED = 1.0  # so long [s] after a jump or a loss attention is wider,
WIDER = 2.0  # this many times
LOST = 8  # cycles without the target until it is searched again
OPENING = 0.5  # time in which the hand opens [s]
SECOND_THOUGHTS = 10  # cycles in which no way is found, on the way, until that is the end of it
STUCK, STIRRED = 1.0, 0.01  # an arm that turned no joint so far [rad] in so long [s] is stuck
CLOSING = 1.0  # time in which the hand closes [s]
LIFTING, HOLDING = 1.5, 1.2  # time to lift and to hold [s]


class Pick(Seeker):
    """Find a target, grasp it and lift it.

    Args:
        body: the robot.
        target: what to pick up.
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
        grasp: how the target is to be grasped; None before that is chosen.
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
        if body.robot.hand is None:
            raise ArgumentError(f"body: a robot with a hand expected, '{body.robot.name}' has none")
        self.bench, self.hand = bench, body.robot.hand
        self.controller = Controller(dynamics, PoseSolver(body.robot, bench, torso=TORSO))
        self.grasp: Grasp | None = None
        self.motion: Motion | None = None
        self._chosen_for = np.zeros(3)
        self._avoided: list[Obstacle] = []
        self._least, self._still = np.inf, 0
        self._last, self._stirred = self.controller.angles, 0.0
        self._wide_until, self._unseen, self._stale = -np.inf, 0, False

    def _act(self) -> Iterator[Cycle]:
        try:
            self._choose()
            yield from self._survey()
            self._find_way()
        except UnreachableError as error:
            self._end("refused", str(error))
            return
        yield from self._approach()
        if self.outcome == "running":
            yield from self._close()
            yield from self._lift()

    def _choose(self, but: Sequence[float] = ()) -> None:
        """Choose how to grasp the target where it is believed to be, among what is known to stand about.

        Not from a side near those in ``but`` [rad].
        """
        assert self.estimate is not None
        centre = self.estimate.copy()
        self._avoid()
        sides = [a for a in SIDE_GRASP.azimuths if all(abs(a - other) >= APART for other in but)]
        if not sides:
            raise UnreachableError("target: no other side of it is left to be tried")
        radius, start = self.target.shape.radius, self._angles()
        self.grasp = choose(self.controller.arm, centre, radius, start=start, azimuths=sides)
        self._chosen_for = centre

    def _avoid(self) -> None:
        """Let the arm keep off what is known to stand about, and off the target until the last leg."""
        assert self.estimate is not None
        self._avoided = [Obstacle(shape, place) for place, shape in self.known_obstacles]
        self._target = Obstacle(self.target.shape, self.estimate)
        arm = self.controller.arm
        self.controller.arm = arm.over(self.bench, self._avoided)
        self.controller.careful = arm.over(self.bench, [*self._avoided, self._target])
        farther = [replace(obstacle, distance=obstacle.distance + SPARE) for obstacle in self._avoided]
        self.controller.wary = arm.over(self.bench, [*farther, self._target], wary=WARY)
        self.controller.spare = SPARE

    def _legs(self) -> tuple[Leg, Leg]:
        """To pre-grasp and grasp, moved with the target by what little it has since the grasp was chosen."""
        assert self.grasp is not None and self.estimate is not None
        before, palm = self.grasp.palm_before.copy(), self.grasp.palm.copy()
        for pose in (before, palm):
            pose[:3, 3] += self.estimate - self._chosen_for
        return (
            Leg(Goal(self.estimate, before, 1.0, 0.0), BEFORE, BEFORE_TURNED, slim=True, unfold=UNFOLD),
            Leg(Goal(self.estimate, palm)),
        )

    def _begin(self, fixation: Floats) -> None:
        gaze, slim = self.body.read(self.body.robot.gaze), self.controller.slim
        self.controller.begin(self._angles(), gaze, fixation, self.hand.widest, slim=slim)

    def _survey(self) -> Iterator[Cycle]:
        """Look along the way that the hand would take: what is on it?"""
        assert self.estimate is not None
        legs = self._legs()
        middle = (self._palm() + self.estimate) / 2.0
        try:
            self._turn_gaze(fixate(self.body.robot, self.body.read(self.body.robot.gaze), middle))
        except UnreachableError:
            middle = self.estimate
        # The thumb stays folded: swung out here, it might hit what has not been seen yet.
        self.body.move(self.hand.targets(self.hand.widest, slim=1.0), OPENING)
        self.controller.slim = 1.0
        self._begin(middle)
        state = self.controller.state
        assert state is not None
        way = simulate(self.controller.dynamics, state, legs).simulated.path
        for _ in range(SURVEYS):
            yield self._look_along("survey", self._to_target(_spread(way)), legs[-1].goal.palm[:3, 3])

    def _find_way(self) -> None:
        """Choose a grasp and plan the way to it; where none leads there, from another side."""
        tried: list[float] = []
        refusals: list[str] = []
        while len(tried) < SIDES:
            try:
                self._choose(but=tried)
            except UnreachableError as error:
                refusals.append(str(error))
                break
            assert self.grasp is not None
            tried.append(self.grasp.azimuth)
            try:
                self._plan()
                return
            except UnreachableError as error:
                refusals.append(str(error))
        raise UnreachableError(f"{refusals[0]} (sides tried: {len(tried)})" if tried else refusals[0])

    def _plan(self) -> None:
        """Plan from where the arm is commanded to be; an older plan may have run ahead of it."""
        assert self.grasp is not None and self.controller.state is not None
        self.controller.state = replace(self.controller.state, palm=self.controller.palm)
        self._avoid()
        legs = self._legs()
        last = self.grasp.grasp.angles
        self.motion = plan_motion(
            self.controller.dynamics,
            self.controller.state,
            legs,
            self._avoided,
            target=self._target,
            feasible=lambda motion: self.controller.rehearse(motion, hold=last),
        )
        self._stale = False

    def _approach(self) -> Iterator[Cycle]:
        start, failed = self.body.time, 0
        self._stirred = start
        while True:
            assert self.motion is not None and self.controller.state is not None
            ahead = simulate(self.controller.dynamics, self.controller.state, self.motion.legs).simulated
            points, end = self._to_target(_spread(ahead.path)), self.motion.goal.palm[:3, 3]
            yield self._look_along("reach", points, end, width=self._width())
            if self._unseen >= LOST:
                yield from self._search_again()
                if self.outcome != "running":
                    return
                start = self._stirred = self.body.time
            try:
                self._revise()
                failed = 0
            except UnreachableError as error:
                # What was seen just now may be seen better in a moment; until then the hand stays.
                failed += 1
                if failed > SECOND_THOUGHTS:
                    self._end("missed", str(error))
                    return
                self._stale = True
                self.body.move({}, PERIOD)
                continue
            if self._there():
                return
            if self.body.time - start > PATIENCE:
                self._end("missed", f"the palm stopped {self._left() * 1e3:.0f} mm from the grasp")
                return
            if self._stuck():
                with contextlib.suppress(UnreachableError):  # then the old plan may still lead on
                    self._find_way()
            self._advance(PERIOD)

    def _stuck(self) -> bool:
        """Whether the arm has stood still for a while, short of the grasp: then another way is planned."""
        if np.abs(self.controller.angles - self._last).max() > STIRRED:
            self._last, self._stirred = self.controller.angles, self.body.time
        if self.body.time - self._stirred < STUCK:
            return False
        self._stirred = self.body.time
        return True

    def _search_again(self) -> Iterator[Cycle]:
        """The target is not where it was, nor on the way: look for it in all the space in reach."""
        self.sought.belief, self._unseen = Belief(), 0
        yield from self._search()
        if self.estimate is None:
            self._end("missed", f"the {self.target.detector.label} was lost on the way")
            return
        yield from self._fixate()
        self._begin(self.estimate)
        self._stale = True

    def _revise(self) -> None:
        """Take up what was seen: a target elsewhere asks for another grasp, an obstacle for another way."""
        assert self.motion is not None
        if self._stale:
            self._find_way()
            return
        self.motion = self.motion.shifted([leg.goal for leg in self._legs()])
        known = self.known_obstacles
        moved = len(known) != len(self._avoided) or any(
            np.linalg.norm(place - avoided.centre) > SHIFTED
            for (place, _), avoided in zip(known, self._avoided, strict=False)
        )
        if moved:
            self._find_way()

    def _take(self, sought: Sought, located: Located | None) -> None:
        """Near the end the hand hides the target: what is seen then is worth less than what is known."""
        if sought is not self.sought or self.motion is None:
            super()._take(sought, located)
        elif self._left() < NEAR:
            self._unseen = 0
        elif located is None:
            self._unseen += 1
            if self._unseen == LOST // 2:
                self._startle()
        else:
            self._unseen = 0
            if sought.belief.update(located):
                self._startle()
                self._stale = True

    def _startle(self) -> None:
        self._wide_until = self.body.time + STARTLED

    def _width(self) -> float | None:
        if self.body.time >= self._wide_until:
            return None
        shape = next(iter(self.projection.shapes.values()))
        return WIDER * (self.settings.width or default_width(shape))

    def _left(self) -> float:
        """Distance [m] of the palm from the grasp, by the encoders."""
        assert self.motion is not None
        return float(np.linalg.norm(self._palm() - self.motion.goal.palm[:3, 3]))

    def _there(self) -> bool:
        assert self.motion is not None
        left = self._left()
        closer = left < self._least - CREEP
        self._least = left if closer or len(self.motion.legs) > 1 else self._least
        self._still = 0 if closer or len(self.motion.legs) > 1 else self._still + 1
        if len(self.motion.legs) > 1 or left > (NEARLY if self._still >= SETTLED else ARRIVED):
            return False
        turned = self.controller.arm.palm(self._angles())[:3, :3].T @ self.motion.goal.palm[:3, :3]
        return bool(np.trace(turned) > 1.0 + 2.0 * np.cos(TURNED))

    def _advance(self, seconds: float) -> None:
        """Command the next moments: eyes, arm and hand, each by its dynamics."""
        assert self.motion is not None
        self.motion, commands = self.controller.advance(self.motion, seconds)
        self._carry_out(commands, seconds)

    def _carry_out(self, commands: Sequence[Mapping[str, float]], seconds: float) -> None:
        for command in commands:
            self.body.move(command, seconds / len(commands))

    def _close(self) -> Iterator[Cycle]:
        """Close the hand around the target until the fingers press."""
        assert self.motion is not None
        tight = replace(self.motion.goal, opening=self.hand.tightest, amplitude=0.0)
        self.motion = replace(self.motion, legs=(Leg(tight),), begins=(0,))
        end = self.body.time + CLOSING
        while self.body.time < end:
            yield self._look_still("grasp")
            self._advance(PERIOD)

    def _lift(self) -> Iterator[Cycle]:
        """Lift straight up, and hold."""
        assert self.motion is not None
        start, bottom = self.body.time, self.motion.goal.palm
        while self.body.time - start < LIFTING + HOLDING:
            yield self._look_still("lift")
            share = float(minimum_jerk((self.body.time - start + PERIOD) / LIFTING))
            self._carry_out(self.controller.track(SIDE_GRASP.lifted(bottom, share), PERIOD), PERIOD)
        self._end("lifted")

    def _look_still(self, phase: str) -> Cycle:
        """Look where the hand is: around the target."""
        assert self.motion is not None and self.estimate is not None
        palm = self._palm()
        points = np.linspace(palm, self.estimate, PLAN_POINTS)
        return self._look_along(phase, points, self.motion.goal.palm[:3, 3])


def choose(
    arm: PoseSolver,
    centre: Floats,
    radius: float,
    *,
    start: Floats | None = None,
    azimuths: Sequence[float] = SIDE_GRASP.azimuths,
) -> Grasp:
    """The most comfortable grasp from the side of something upright, centred at ``centre`` (3,) [m].

    Raises:
        UnreachableError: there is none.
    """
    return choose_grasp(
        arm,
        lambda azimuth: SIDE_GRASP.pose(centre, azimuth, radius),
        distance=BACK,
        azimuths=azimuths,
        start=start,
    )


def _spread(path: Floats) -> Floats:
    """So many places (N, 3) of a path, evenly in time."""
    places: Floats = path[np.linspace(0, len(path) - 1, PLAN_POINTS - BEYOND).round().astype(int)]
    return places
