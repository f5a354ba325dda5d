"""One seeded trial of picking up, staged, disturbed and judged."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Floats
from ..control.cds import CoupledDynamics
from ..control.clearance import Obstacle
from ..control.pose import PoseSolver
from ..errors import StateError, UnreachableError
from ..robot import Robot
from ..sim.glass import Glass, draw_glass
from ..sim.scene import CANISTER, TABLE_HEIGHT
from ..sim.world import STEP
from .cycle import Cycle, Settings
from .disturbance import Disturbance, spot_anywhere, spot_between
from .pick import TORSO, Pick, choose
from .staging import cylinder_of, strike_start, target_of
from .trial import BENCH, Staged

LIFTED, HELD = 0.05, 1.0
"""The glass counts as lifted when its bottom stays so high over the table [m] for so long [s]."""

AWAY = 0.26  # of the palm's start from the glass when something is to stand between [m],
FARTHER = 0.33  # and when it is to appear there
STARTS, STARTS_A_PLACE = 80, 5  # until there is room for an obstacle, and with the glass at one place
APPEARING, JUMPING = (0.0, 0.3), (0.2, 0.8)  # when that happens, after the hand has set out [s]


@dataclass(frozen=True)
class PickVerdict:
    """A trial judged by the simulator's truth.

    Attributes:
        outcome: what the task said of itself: 'lifted', 'not found', 'refused' or 'missed'.
        lifted: for the whole last second the glass's bottom was 5 cm over the table, and nothing but the
            robot touched it.
        touched_obstacle: whether any part of the robot ever touched the obstacle.
        height_m: the lowest of the glass's bottom over the table in that second.
        glass_error_m: error of the estimate of the glass's place when the hand began to close.
        mass_kg, width_m: of the glass.
        disturbed: whether what was to happen on the way did.
        touched: names of what the robot touched.
    """

    outcome: str
    reason: str
    lifted: bool
    touched_obstacle: bool
    height_m: float | None
    glass_error_m: float | None
    mass_kg: float
    width_m: float
    disturbed: bool
    touched: tuple[str, ...]


class PickTrial(Staged):
    """A trial of picking up a glass.

    Args:
        robot: with its URDF.
        seed: of everything, see :class:`.trial.Staged`.
        dynamics: of eye, arm and hand.
        obstacle: let something stand between hand and glass.
        perturb: let the glass jump 10 cm while the hand is on its way; with ``obstacle``, let that appear
            only then, and the glass stay.
        settings: of the task.
        others: as of :class:`.trial.Staged`.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int | list[int],
        dynamics: CoupledDynamics,
        *,
        obstacle: bool = False,
        perturb: bool = False,
        settings: Settings | None = None,
        **others: Any,
    ) -> None:
        self._obstacle, self._perturb = obstacle, perturb
        self._arm = PoseSolver(robot, BENCH, torso=TORSO)
        super().__init__(robot, seed, **others)
        self.disturbance = None
        if perturb:
            own = self.generator.spawn(1)[0]
            self.disturbance = (
                Disturbance(own, float(own.uniform(*APPEARING)), CANISTER, self._leaves_room)
                if obstacle
                else Disturbance(own, float(own.uniform(*JUMPING)), None, self._may_stand)
            )
        self.task = Pick(
            self.body,
            target_of(self.stage.layout.glass),
            self.attention,
            BENCH,
            dynamics,
            obstacles=(target_of(CANISTER),),
            settings=settings,
            seed=self.generator,
        )
        self._heights: deque[float] = deque(maxlen=round(HELD / STEP))
        self._glass_error: float | None = None
        self.body.watchers.append(self._watch)

    def run(self) -> Iterator[Cycle]:
        """The task's cycles, with what happens meanwhile."""
        scene = self.stage.scene
        for cycle in self.task.run():
            if cycle.phase == "grasp" and self._glass_error is None and cycle.estimate is not None:
                self._glass_error = float(np.linalg.norm(cycle.estimate - scene.glass_pose()[0]))
            yield cycle
            if self.disturbance is not None:
                self.disturbance.watch(cycle, scene, self.stage.world.palm_pose()[:3, 3])

    def judge(self) -> PickVerdict:
        """Hold what the task achieved against the truth."""
        scene, glass = self.stage.scene, self.stage.layout.glass
        height = min(self._heights) if len(self._heights) == self._heights.maxlen else None
        alone = scene.glass is not None and not scene.touching_glass()
        touched = self.touched()
        return PickVerdict(
            outcome=self.task.outcome,
            reason=self.task.reason,
            lifted=height is not None and height >= LIFTED and alone,
            touched_obstacle="obstacle" in touched,
            height_m=height,
            glass_error_m=self._glass_error,
            mass_kg=glass.mass,
            width_m=2.0 * glass.radius,
            disturbed=self.disturbance is not None and self.disturbance.happened,
            touched=touched,
        )

    def _draw_glass(self) -> Glass:
        return draw_glass(self.generator)

    def _strike(self) -> None:
        if not self._obstacle:
            strike_start(self.stage, self.generator)
            return
        away = FARTHER if self._perturb else AWAY
        tried = 0  # with the glass where it is
        for _ in range(STARTS):
            if tried == STARTS_A_PLACE:
                self.stage.scene.move_glass(spot_anywhere(self.stage.scene, self.generator, self._may_stand))
                tried = 0
            tried += 1
            try:
                strike_start(self.stage, self.generator, away=away)
            except StateError:
                tried = STARTS_A_PLACE  # the hand cannot start so far from there
                continue
            palm = self.stage.world.palm_pose()[:3, 3]
            try:
                spot = spot_between(self.stage.scene, CANISTER, palm, self.generator, self._leaves_room)
            except StateError:
                continue
            if self._perturb:
                return  # there is room; it appears later
            self.stage.scene.stand_obstacle(CANISTER, spot)
            standing = self.stage.scene.obstacle
            if standing is not None and self.stage.world.clear_of([standing], 0.02):
                return
            self.stage.scene.remove_obstacle()
        raise StateError(f"obstacle: after {STARTS} starts there is no room for one between hand and glass")

    def _leaves_room(self, spot: tuple[float, float]) -> bool:
        """Whether the glass can be grasped from some side while an obstacle stands at a place.

        One that stands where the forearm has to be is none that there is a way past.
        """
        centre = np.array([*spot, TABLE_HEIGHT + CANISTER.height / 2])
        arm = self._arm.over(BENCH, [Obstacle(cylinder_of(CANISTER), centre)])
        return self._graspable(arm, self.stage.scene.glass_pose()[0])

    def _may_stand(self, spot: tuple[float, float]) -> bool:
        """Whether the glass can be grasped when it stands at a place."""
        glass = self.stage.layout.glass
        return self._graspable(self._arm, np.array([*spot, TABLE_HEIGHT + glass.height / 2]))

    def _graspable(self, arm: PoseSolver, centre: Floats) -> bool:
        try:
            choose(arm, centre, self.stage.layout.glass.radius)
        except UnreachableError:
            return False
        return True

    def _watch(self) -> None:
        scene = self.stage.scene
        if scene.glass is not None:
            bottom = scene.glass_pose()[0][2] - self.stage.layout.glass.height / 2 - TABLE_HEIGHT
            self._heights.append(float(bottom))
