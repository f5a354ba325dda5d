"""The main job: find the glass, plan, and bring the palm before it, looking only where it matters.

The task is a generator of :class:`Cycle`: whoever drives it may show, record or stop it at any cycle. It
sees and moves through :class:`Body` alone.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, generator
from ..attention import Attention, Look
from ..control.gaze import fixate
from ..control.path import PalmPath, minimum_jerk, plan_path
from ..control.reaching import Bench, Pregrasp, ReachSolver
from ..cylinder import Located
from ..detectors.base import Where
from ..errors import ArgumentError, NotInViewError, UnreachableError
from ..projection import Projection
from ..robot import Robot
from ..views import Views
from .body import Body
from .cycle import Cycle, FullFrame, Settings
from .explore import Finder, Target, everywhere, windows_from
from .timing import Clock, Stages

PERIOD = 0.1  # of a vision cycle [s]
GAZE_SPEED = 1.2  # of the fastest joint when the gaze turns [rad/s]
FIRMNESS = 6.0
"""On the way the posture blends from the start's to the pre-grasp's. Held so firmly it bends off the path by
millimetres, where it would otherwise follow it into a dead end of the joint limits."""
JOINT_SPEED = 2.0  # of the fastest joint of arm and torso [rad/s]
PALM_SPEED = 0.16  # mean speed of the palm on its way [m/s]
ARM_RADIUS = 0.05  # of the forearm, and a little [m]
ARRIVED = 0.002  # the palm's distance from its goal, by the encoders [m]
FADING = 0.98  # of the trust in an old estimate, per sighting
BETTER = 0.1  # silhouettes that overlap so much more with the prediction are seen better
JUMP = 0.03  # a larger change of the estimate is a new place, not noise [m]
PLAN_POINTS = 50
GOOD_VIEW = 0.7  # overlap of silhouettes below which something, perhaps the hand, hides the target
HAND_IN_THE_WAY = 3  # postures searched in vain before the hand is put aside


class Reach:
    """Find a target and bring the palm before it.

    Args:
        body: the robot.
        target: what to look for.
        attention: with the robot's projection and reach cloud.
        bench: the work surface.
        settings: how to look and move.
        seed: draws windows and postures.
        clock: for the times of the stages [s].

    Attributes:
        outcome: 'running', then 'reached', 'not found', 'refused' or 'missed'; :attr:`reason` says why.
        estimate: where the target is believed to be (3,) [m]; None before it was found.
        pregrasp: the chosen posture before the grasp; None before the plan.
    """

    def __init__(
        self,
        body: Body,
        target: Target,
        attention: Attention,
        bench: Bench,
        *,
        settings: Settings | None = None,
        seed: int | np.random.Generator | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.body, self.target, self.attention = body, target, attention
        self.projection = attention.projection
        _check_images(body.robot, self.projection)
        self.settings = settings or Settings()
        self.solver = ReachSolver(body.robot, bench)
        self.generator = generator(seed)
        self.clock = clock
        self.stages = Stages(clock)
        level = bench.height + target.shape.height / 2 if self.settings.slack else None
        self.finder = Finder(target, self.stages, level, self.settings.slack)
        self.outcome, self.reason = "running", ""
        self.pregrasp: Pregrasp | None = None
        self.estimate: Floats | None = None
        self._trust = 0.0

    def run(self) -> Iterator[Cycle]:
        """The cycles, until :attr:`outcome` is known."""
        yield from self._search()
        if self.estimate is None:
            self._end(
                "not found",
                f"no {self.target.detector.label} in {self.settings.postures} postures "
                f"of {self.settings.patience} cycles",
            )
            return
        yield from self._fixate()
        try:
            self.pregrasp = self.solver.pregrasp(self.estimate, self._angles())
            if self._arm_would_sweep_target():
                self._put_hand_aside()
        except UnreachableError as error:
            self._end("refused", str(error))
            return
        yield from self._move()

    def _end(self, outcome: str, reason: str = "") -> None:
        self.outcome, self.reason = outcome, reason

    def _angles(self) -> Floats:
        return self.body.read(self.solver.names)

    def _palm(self) -> Floats:
        return self.solver.palm(self._angles())[:3, 3]

    def _search(self) -> Iterator[Cycle]:
        """Peripersonal windows, posture by posture (section III-B)."""
        for posture in range(self.settings.postures):
            self.finder.forget()
            if posture == HAND_IN_THE_WAY:
                self._put_hand_aside()
            for _ in range(self.settings.patience):
                cycle = self._peripersonal_cycle("search")
                if cycle is None:
                    break
                yield cycle
                if self.estimate is not None:
                    return
            self._look_elsewhere()

    def _fixate(self) -> Iterator[Cycle]:
        """Turn the gaze to the target and look again from there, where it is seen best."""
        assert self.estimate is not None
        try:
            self._turn_gaze(fixate(self.body.robot, self.body.read(self.body.robot.gaze), self.estimate))
        except UnreachableError:
            return  # seen, but too far aside to look at straight
        yield from self._look_again()
        if self._trust < GOOD_VIEW:
            self._put_hand_aside()
            yield from self._look_again()

    def _look_again(self) -> Iterator[Cycle]:
        self.finder.forget()
        for _ in range(self.settings.patience):
            cycle = self._peripersonal_cycle("fixate")
            if cycle is None:
                return
            yield cycle
            if cycle.sight.located is not None:
                return

    def _peripersonal_cycle(self, phase: str) -> Cycle | None:
        """One cycle of peripersonal windows; None when the reachable space is not in view."""
        joints, images = self.body.read(self.body.robot.gaze), self.body.see()
        before = self._mark()
        try:
            with self.stages.time("projection"):
                views = Views(self.projection, joints)
                fits = self.attention.gaussians(joints)
            with self.stages.time("landscape"):
                looks = self.attention.peripersonal_from(fits, mixing=self.settings.mixing)
                looks = self.finder.complete(looks, views, lambda: self._reachable(joints))
        except NotInViewError:
            return None
        with self.stages.time("sampling"):
            where = windows_from(looks, self.settings.windows, self.settings.size, self.generator)
        return self._look(phase, joints, images, views, looks, where, before)

    def _look(
        self,
        phase: str,
        joints: Floats,
        images: Mapping[str, NDArray[np.uint8]],
        views: Views,
        looks: Mapping[str, Look],
        where: Mapping[str, Where],
        before: Mapping[str, int],
        path: Floats | None = None,
        path_pixels: Mapping[str, Floats] | None = None,
    ) -> Cycle:
        sight = self.finder.look(images, views, where)
        if sight.located is not None:
            self._believe(sight.located)
        return Cycle(
            phase=phase,
            time=self.body.time,
            joints=joints,
            images=images,
            looks=looks,
            sight=sight,
            palm=self._palm(),
            seconds=self._since(before),
            path=path,
            path_pixels=path_pixels or {},
            estimate=None if self.estimate is None else self.estimate.copy(),
            goal=self.pregrasp.point(self.estimate) if self.pregrasp and self.estimate is not None else None,
            full=self._full_frame(images, views) if self.settings.compare else None,
        )

    def _believe(self, located: Located) -> None:
        """Average a place with the last ones nearby; take it as it is when seen better, or after a jump."""
        self._trust *= FADING
        jumped = self.estimate is None or np.linalg.norm(located.centre - self.estimate) > JUMP
        if jumped or located.overlap > self._trust + BETTER:
            self.estimate, self._trust = located.centre, located.overlap
            return
        assert self.estimate is not None
        share = 0.5 if located.overlap > self._trust - BETTER else 0.1
        self.estimate = (1.0 - share) * self.estimate + share * located.centre
        self._trust = max(self._trust, located.overlap)

    def _full_frame(self, images: Mapping[str, NDArray[np.uint8]], views: Views) -> FullFrame:
        beside = replace(self.finder, stages=Stages(self.clock), memory={}, reported={})
        start = self.clock()
        for image in images.values():
            self.target.detector.largest_region(image)
        cheap = self.clock() - start
        sight = beside.look(images, views, everywhere(self.projection.shapes))
        return FullFrame(beside.stages.seconds["detection"][0], cheap, sight.located)

    def _look_elsewhere(self) -> None:
        """Turn the gaze to a random reachable place in front."""
        robot, joints = self.body.robot, self.body.read(self.body.robot.gaze)
        reachable = self._reachable(joints)
        bench = self.solver.bench
        if bench is not None:
            above = reachable[:, 2] - bench.height
            reachable = reachable[(reachable[:, 0] < bench.edge) & (above > 0.0) & (above < 0.2)]
        for _ in range(50 if len(reachable) else 0):  # a torso far aside has nothing to reach over the bench
            place = reachable[self.generator.integers(len(reachable))]
            try:
                self._turn_gaze(fixate(robot, joints, place))
                return
            except UnreachableError:
                continue

    def _reachable(self, joints: Floats) -> Floats:
        """Places (N, 3) [m] that the palm can reach."""
        assert self.attention.cloud is not None
        return self.attention.cloud.in_root(joints)

    def _arm_would_sweep_target(self) -> bool:
        """Whether forearm or elbow would brush the target on the straight way from here to the pre-grasp."""
        assert self.pregrasp is not None and self.estimate is not None
        shares = np.linspace(0.0, 1.0, 25)[:, None]
        angles = (1.0 - shares) * self._angles() + shares * self.pregrasp.angles
        places = self.solver.forearm(angles).reshape(-1, 3)
        return bool((self.target.shape.distance(places - self.estimate) < ARM_RADIUS).any())

    def _put_hand_aside(self) -> None:
        """Move the hand out of the view: it may hide what is searched."""
        place = self.body.robot.aside
        if place is None:
            return
        # Up, over and down: what stands on the table has not been seen yet.
        angles = self._angles()
        pose = self.solver.palm(angles)
        left = np.array([0.0, -1.0, 0.0])
        path = PalmPath(pose[:3, 3], np.array(place), left, duration=2.0, bulge=(0.06, 0.0, 0.2), run_up=0.0)
        for moment in np.arange(PERIOD, path.duration + PERIOD, PERIOD):
            share = float(minimum_jerk(moment / path.duration))
            angles = self.solver.solve(
                path.at(moment),
                _between(pose[:3, 2], left, share),
                angles,
                hold=angles + share * (self.solver.rest - angles),
                facing_weight=0.5 * share,
                keep=self.body.robot.torso,
            )
            self.body.move(dict(zip(self.solver.names, map(float, angles), strict=True)), PERIOD)

    def _turn_gaze(self, posture: Floats) -> None:
        robot = self.body.robot
        present = self.body.read(robot.gaze)
        names = [name for name in robot.gaze if name not in robot.torso]
        targets = {name: float(posture[robot.gaze.index(name)]) for name in names}
        turn = float(np.abs(posture - present).max())
        self.body.move(targets, max(0.15, turn / GAZE_SPEED))
        self.body.move(targets, 0.15)

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
                _between(facing, pregrasp.facing, share),
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
        assert self.estimate is not None
        joints, images = self.body.read(self.body.robot.gaze), self.body.see()
        self.finder.forget()
        # The plan ends at the pre-grasp; the intended grasp behind it matters as much.
        ahead = path.ahead(elapsed, PLAN_POINTS - 10)
        grasp = np.linspace(ahead[-1], self.estimate, 11)[1:]
        plan = np.vstack([ahead, grasp])
        before = self._mark()
        with self.stages.time("projection"):
            views = Views(self.projection, joints)
            pixels = views.project(plan)
        try:
            with self.stages.time("landscape and sampling"):
                looks, where = self.attention.step(
                    pixels,
                    windows=self.settings.windows,
                    size=self.settings.size,
                    width=self.settings.width,
                    seed=self.generator,
                )
        except NotInViewError:
            looks, where = {}, {}
        return self._look("reach", joints, images, views, looks, where, before, plan, pixels)

    def _mark(self) -> dict[str, int]:
        return {stage: len(values) for stage, values in self.stages.seconds.items()}

    def _since(self, before: Mapping[str, int]) -> dict[str, float]:
        return {
            stage: float(sum(values[before.get(stage, 0) :]))
            for stage, values in self.stages.seconds.items()
            if len(values) > before.get(stage, 0)
        }


def _check_images(robot: Robot, projection: Projection) -> None:
    """Raise an :class:`ArgumentError` where a projection is not one to the robot's cameras."""
    images = {name: mount.camera.shape for name, mount in robot.cameras.items()}
    shapes = projection.shapes
    if shapes != images:
        raise ArgumentError(
            f"attention: a projection into images {images} (height, width) of robot '{robot.name}' "
            f"expected, got one into {shapes}"
        )


def _between(first: Floats, second: Floats, share: float) -> Floats:
    """Unit vector between two unit vectors (3,)."""
    mixed = (1.0 - share) * first + share * second
    length = float(np.linalg.norm(mixed))
    return second if length < 1e-6 else mixed / length
