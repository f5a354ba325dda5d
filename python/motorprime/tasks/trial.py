"""One seeded trial of the reach, staged and judged: what the demo shows once and the evaluation counts."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any, TypeVar

import numpy as np

from ..attention import Attention
from ..control.reaching import Bench
from ..peripersonal import ReachCloud
from ..peripersonal_model import PeripersonalModel
from ..projection import Projection
from ..robot import Robot
from ..sim.glass import Glass
from ..sim.scene import TABLE_HEIGHT, TABLE_X, draw_layout
from .cycle import Settings
from .explore import Target
from .reach import Reach
from .simulated import SimulatedBody
from .staging import Stage, strike_start, target_of

BENCH = Bench(height=TABLE_HEIGHT, edge=TABLE_X[1])
TOLERANCE = 0.01
"""A reach succeeds when the palm ends within this of the true pre-grasp point [m]."""


@dataclass(frozen=True)
class Verdict:
    """A trial judged by the simulator's truth.

    Attributes:
        outcome: what the task said of itself: 'reached', 'not found', 'refused' or 'missed'.
        reached: it said 'reached', and the palm is within 1 cm of the true pre-grasp point: 8 cm from the
            true axis of the glass at half its height, on the side that the palm came from.
        palm_error_m: distance from that point; None when there was no plan.
        glass_error_m: error of the last estimate of the glass's centre; None when it was never found.
        touched: names of what the robot touched.
    """

    outcome: str
    reason: str
    reached: bool
    palm_error_m: float | None
    glass_error_m: float | None
    touched: tuple[str, ...]


T = TypeVar("T", bound="Staged")


class Staged:
    """A robot in a random start before a random scene; a context manager. What it is to do, others say.

    Args:
        robot: with its URDF.
        seed: of everything: scene, start, noise, windows. A sequence of integers names a trial of a series.
        projection: by which the robot sees; its kinematics when not given.
        cloud: the reachable space; drawn when not given.
        peripersonal: what the robot learned of it, to use instead of fits to the cloud.
        glass: whether a glass stands there at all.
        glass_at: its x and y [m] in the root frame; drawn within reach when not given.
        clutter: pieces of other kitchenware.
        noise: of the eyes' sensors [grey levels].
        gui: open pybullet's window.

    Attributes:
        stage: world, scene and eyes.
        body: what a task may know of them.
        attention: of the robot.
        generator: that drew the scene, for the task to go on with.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int | list[int],
        *,
        projection: Projection | None = None,
        cloud: ReachCloud | None = None,
        peripersonal: PeripersonalModel | None = None,
        glass: bool = True,
        glass_at: tuple[float, float] | None = None,
        clutter: int = 4,
        noise: float = 2.0,
        gui: bool = False,
    ) -> None:
        self.generator = np.random.default_rng(seed)
        layout = draw_layout(self.generator, glass=self._draw_glass(), at=glass_at, clutter=clutter)
        stage = Stage(robot, layout, noise=noise, seed=int(self.generator.integers(2**31)), gui=gui)
        with ExitStack() as unwinding:  # closes the simulator when no start is found
            self.stage = unwinding.enter_context(stage)
            if not glass:
                self.stage.scene.remove_glass()
            self._strike()
            self.body = SimulatedBody(self.stage.world, self.stage.eyes)
            self.attention = Attention(
                projection or self.stage.projection,
                cloud=cloud or ReachCloud(robot),
                peripersonal=peripersonal,
            )
            self._closing = unwinding.pop_all()

    def __enter__(self: T) -> T:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    def _draw_glass(self) -> Glass:
        """The glass of this trial."""
        return Glass()

    def _strike(self) -> None:
        """Put the robot into a start."""
        strike_start(self.stage, self.generator)

    def touched(self) -> tuple[str, ...]:
        """Names of what the robot has touched."""
        return tuple(sorted(self.stage.scene.name_of(body) for body in self.body.touched))


class Trial(Staged):
    """A trial of the reach.

    Args:
        robot: with its URDF.
        seed: of everything, see :class:`Staged`.
        settings: of the task.
        target: what the robot is told of the glass; shown to it when not given.
        others: as of :class:`Staged`.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int | list[int],
        *,
        settings: Settings | None = None,
        target: Target | None = None,
        **others: Any,
    ) -> None:
        super().__init__(robot, seed, **others)
        self.task = Reach(
            self.body,
            target or target_of(Glass()),
            self.attention,
            BENCH,
            settings=settings,
            seed=self.generator,
        )

    def judge(self) -> Verdict:
        """Hold what the task achieved against the truth."""
        task, scene = self.task, self.stage.scene
        palm_error = glass_error = None
        if scene.glass is not None and task.estimate is not None:
            centre = scene.glass_pose()[0]
            glass_error = float(np.linalg.norm(task.estimate - centre))
            if task.pregrasp is not None:
                palm = self.stage.world.palm_pose()[:3, 3]
                palm_error = float(np.linalg.norm(palm - task.pregrasp.point(centre)))
        return Verdict(
            outcome=task.outcome,
            reason=task.reason,
            reached=task.outcome == "reached" and palm_error is not None and palm_error < TOLERANCE,
            palm_error_m=palm_error,
            glass_error_m=glass_error,
            touched=self.touched(),
        )
