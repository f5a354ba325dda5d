"""Look for a thing, and for what may stand in the way, with the eyes alone: the first half of every task.

The task is a generator of :class:`Cycle`: whoever drives it may show, record or stop it at any cycle. It
sees and moves through :class:`Body` alone.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, generator
from ..attention import Attention, Look
from ..control.gaze import fixate
from ..control.path import PalmPath, minimum_jerk
from ..control.reaching import Bench, ReachSolver
from ..cylinder import Cylinder, Located
from ..detectors.base import Where
from ..errors import ArgumentError, NotInViewError, UnreachableError
from ..projection import Projection
from ..robot import Robot
from ..views import Views
from .belief import Belief
from .body import Body
from .cycle import Cycle, FullFrame, Settings
from .explore import Finder, Images, Target, everywhere, windows_from
from .timing import Clock, Stages

PERIOD = 0.1  # of a vision cycle [s]
GAZE_SPEED = 1.2  # of the fastest joint when the gaze turns [rad/s]
GOOD_VIEW = 0.7  # overlap of silhouettes below which something, perhaps the hand, hides the target
PLAN_POINTS = (
    50  # of the planned path that are attended to, the last BEYOND of them from its end to the target
)
BEYOND = 10
HAND_IN_THE_WAY = 3  # postures searched in vain before the hand is put aside
BLOCKED, BACK_OFF = 0.25, 6  # a joint so far [rad] behind its command has met something: so many steps back


@dataclass(frozen=True)
class Plan:
    """Where the hand is to go: points (N, 3) [m], the same in each image, and where it is to end (3,)."""

    points: Floats
    pixels: Mapping[str, Floats]
    goal: Floats | None


@dataclass
class Sought:
    """A thing that is looked for: how to find it, and where it is believed to be."""

    finder: Finder
    belief: Belief = field(default_factory=Belief)

    @property
    def shape(self) -> Cylinder:
        """Its shape."""
        return self.finder.target.shape


class Seeker:
    """Finds a target; the base of the tasks that then do something with it.

    Args:
        body: the robot.
        target: what to look for.
        attention: with the robot's projection and reach cloud.
        bench: the work surface.
        obstacles: things that may stand in the way, each looked for wherever the target is.
        settings: how to look and move.
        seed: draws windows and postures.
        clock: for the times of the stages [s].

    Attributes:
        outcome: 'running', then what the task calls its end; :attr:`reason` says why.
    """

    def __init__(
        self,
        body: Body,
        target: Target,
        attention: Attention,
        bench: Bench,
        *,
        obstacles: Sequence[Target] = (),
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
        slack = self.settings.slack
        level = bench.height + target.shape.height / 2 if slack else None
        self.sought = Sought(Finder(target, self.stages, level, slack))
        self.obstacles = tuple(
            # An obstacle stands on the bench, and of it only the place is asked.
            Sought(Finder(obstacle, self.stages, bench.height + obstacle.shape.height / 2, slack))
            for obstacle in obstacles
        )
        self.outcome, self.reason = "running", ""

    @property
    def finder(self) -> Finder:
        """Of the target."""
        return self.sought.finder

    @property
    def estimate(self) -> Floats | None:
        """Where the target is believed to be (3,) [m]; None before it was found."""
        return self.sought.belief.place

    @property
    def known_obstacles(self) -> tuple[tuple[Floats, Cylinder], ...]:
        """Centre (3,) [m] and shape of what has been seen to stand about."""
        known = ((obstacle.belief.place, obstacle.shape) for obstacle in self.obstacles)
        return tuple((place.copy(), shape) for place, shape in known if place is not None)

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
        yield from self._act()

    def _act(self) -> Iterator[Cycle]:
        """What is done with a target that has been found."""
        raise NotImplementedError

    def _end(self, outcome: str, reason: str = "") -> None:
        self.outcome, self.reason = outcome, reason

    def _angles(self) -> Floats:
        return self.body.read(self.solver.names)

    def _palm(self) -> Floats:
        return self.solver.palm(self._angles())[:3, 3]

    def _search(self) -> Iterator[Cycle]:
        """Peripersonal windows, posture by posture (section III-B)."""
        for posture in range(self.settings.postures):
            self._forget()
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
        if self.sought.belief.trust < GOOD_VIEW:
            self._put_hand_aside()
            yield from self._look_again()

    def _look_again(self) -> Iterator[Cycle]:
        self._forget()
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
        images: Images,
        views: Views,
        looks: Mapping[str, Look],
        where: Mapping[str, Where],
        before: Mapping[str, int],
        plan: Plan | None = None,
    ) -> Cycle:
        sight = self.finder.look(images, views, where)
        self._take(self.sought, sight.located)
        for obstacle in self.obstacles:
            self._take(obstacle, obstacle.finder.look(images, views, where).located)
        return Cycle(
            phase=phase,
            time=self.body.time,
            joints=joints,
            images=images,
            looks=looks,
            sight=sight,
            palm=self._palm(),
            seconds=self._since(before),
            path=None if plan is None else plan.points,
            path_pixels={} if plan is None else plan.pixels,
            estimate=None if self.estimate is None else self.estimate.copy(),
            goal=None if plan is None else plan.goal,
            obstacles=tuple(
                (o.belief.place.copy(), o.shape) for o in self.obstacles if o.belief.place is not None
            ),
            full=self._full_frame(images, views) if self.settings.compare else None,
        )

    def _take(self, sought: Sought, located: Located | None) -> None:
        """What one cycle has shown of a thing that is looked for."""
        if located is not None:
            sought.belief.update(located)

    def _to_target(self, path: Floats) -> Floats:
        """A path (N, 3), continued straight to the target: the grasp behind its end matters as much."""
        assert self.estimate is not None
        return np.vstack([path, np.linspace(path[-1], self.estimate, BEYOND + 1)[1:]])

    def _look_along(self, phase: str, points: Floats, goal: Floats, *, width: float | None = None) -> Cycle:
        """One cycle of windows along a planned path (section III-C2).

        Args:
            phase: as the cycle is to be called.
            points: (N, 3) [m] of the path.
            goal: (3,) [m] where the palm is to end.
            width: of the kernels [px]; the settings' when not given.
        """
        joints, images = self.body.read(self.body.robot.gaze), self.body.see()
        self._forget()
        before = self._mark()
        with self.stages.time("projection"):
            views = Views(self.projection, joints)
            pixels = views.project(points)
        try:
            with self.stages.time("landscape and sampling"):
                looks, where = self.attention.step(
                    pixels,
                    windows=self.settings.windows,
                    size=self.settings.size,
                    width=self.settings.width if width is None else width,
                    seed=self.generator,
                )
        except NotInViewError:
            looks, where = {}, {}
        return self._look(phase, joints, images, views, looks, where, before, Plan(points, pixels, goal))

    def _forget(self) -> None:
        """The eyes have moved: what was hit in the images counts no more."""
        for sought in (self.sought, *self.obstacles):
            sought.finder.forget()

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
        passed = [angles]
        for moment in np.arange(PERIOD, path.duration + PERIOD, PERIOD):
            share = float(minimum_jerk(moment / path.duration))
            angles = self.solver.solve(
                path.at(moment),
                between(pose[:3, 2], left, share),
                angles,
                hold=angles + share * (self.solver.rest - angles),
                facing_weight=0.5 * share,
                keep=self.body.robot.torso,
            )
            self._pose(angles)
            if np.abs(self._angles() - angles).max() > BLOCKED:
                # It has met something not seen yet: rather in the view than leaning on that.
                for earlier in passed[: -BACK_OFF - 1 : -1]:
                    self._pose(earlier)
                return
            passed.append(angles)

    def _pose(self, angles: Floats) -> None:
        self.body.move(dict(zip(self.solver.names, map(float, angles), strict=True)), PERIOD)

    def _turn_gaze(self, posture: Floats) -> None:
        robot = self.body.robot
        present = self.body.read(robot.gaze)
        names = [name for name in robot.gaze if name not in robot.torso]
        targets = {name: float(posture[robot.gaze.index(name)]) for name in names}
        turn = float(np.abs(posture - present).max())
        self.body.move(targets, max(0.15, turn / GAZE_SPEED))
        self.body.move(targets, 0.15)

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


def between(first: Floats, second: Floats, share: float) -> Floats:
    """Unit vector between two unit vectors (3,)."""
    mixed = (1.0 - share) * first + share * second
    length = float(np.linalg.norm(mixed))
    return second if length < 1e-6 else mixed / length
