"""A test stand for grasps: a table, a glass and the arm, no cameras. How often is the glass lifted?

One trial draws a glass, its place, and how far off the palm comes: what eyes and arm do to a grasp. The hand
comes in from the pre-grasp, closes, lifts and holds; nothing but friction carries the glass.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from .._arrays import Floats, generator
from ..control.grasping import choose_grasp
from ..control.path import minimum_jerk
from ..control.pose import PoseSolver
from ..control.reaching import Bench
from ..control.side_grasp import SIDE_GRASP, SideGrasp
from ..errors import StateError, UnreachableError
from ..kinematics import transform
from ..robot import Robot
from ..sim.glass import Glass, StandingGlass, add_table, draw_glass
from ..sim.scene import REGION, TABLE_HEIGHT, TABLE_X, TABLE_Y
from ..sim.world import STEP, World

OFF, TURNED = (
    0.004,
    float(np.deg2rad(2.0)),
)  # largest errors of the palm [m] along each axis, [rad]
LIFTED = 0.05  # of the glass's lowest point over the table [m]
APPROACH, CLOSE, SETTLE, LIFT, HOLD = 1.5, 0.8, 0.2, 1.2, 1.0  # [s]
WAYPOINTS = 8
LOOK_EVERY = 4  # steps from one look at torques and contacts to the next


@dataclass(frozen=True, eq=False)
class GraspTrial:
    """What is drawn for one trial.

    Attributes:
        glass: what stands there.
        xy: (2,) of its axis [m] in the root frame.
        off: (3,) [m] of the palm from where it ought to be, in the root frame.
        turned: (3,) rotation vector [rad] of the palm from how it ought to be turned.
    """

    glass: Glass = field(default_factory=Glass)
    xy: tuple[float, float] = (-0.28, 0.10)
    off: Floats = field(default_factory=lambda: np.zeros(3))
    turned: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def centre(self) -> Floats:
        """Middle (3,) of the glass's axis [m]."""
        return np.array([*self.xy, TABLE_HEIGHT + self.glass.height / 2])


def draw_grasp_trial(seed: int | np.random.Generator | None = None) -> GraspTrial:
    """A glass within the limits, within the arm's reach, and a palm up to 4 mm and 2 degrees off."""
    drawn = generator(seed)
    glass = draw_glass(drawn)
    x, y = (float(drawn.uniform(*bounds)) for bounds in REGION)
    axis = drawn.normal(size=3)
    turned = drawn.uniform(0.0, TURNED) * axis / np.linalg.norm(axis)
    return GraspTrial(glass, (x, y), drawn.uniform(-OFF, OFF, 3), turned)


@dataclass
class GraspVerdict:
    """What became of a trial; lengths in metres, angles in radians, forces in N, torques in N m.

    Attributes:
        lifted: the glass was held LIFTED high for the whole last second, and only the hand touched it.
        reason: why not.
        azimuth: of the palm's facing.
        pushed: how far the glass stood off its place when the hand began to close; ``dragged`` when it had.
        toppled: largest tilt of the glass.
        lowest: least height over the table during the last second.
        slipped: how far the glass moved in the hand during the last second.
        torque: largest of the fingers' motors; ``arm_torque`` and ``torso_torque`` of those.
        pressure: sum of the hand's normal forces at the end; ``friction`` of those along the surface.
        deepest: how far hand and glass were inside each other at most.
        table_touched: whether hand or arm touched the table.
    """

    lifted: bool = False
    reason: str = ""
    azimuth: float = float("nan")
    pushed: float = float("nan")
    dragged: float = float("nan")
    toppled: float = 0.0
    lowest: float = float("nan")
    slipped: float = float("nan")
    torque: float = 0.0
    arm_torque: float = 0.0
    torso_torque: float = 0.0
    pressure: float = float("nan")
    friction: float = float("nan")
    deepest: float = 0.0
    table_touched: bool = False


class GraspStand:
    """A world with a robot, a table and the glass of a trial; a context manager.

    Args:
        robot: with its URDF and a hand.
        trial: what is drawn.
        grasp: where the palm goes.
        solver: of the robot over this table, when there is one already: making it takes a while.
        gui: open pybullet's window.

    Attributes:
        verdict: so far.
        stage: 'before', 'approach', 'close', 'lift', 'hold', 'done'.
    """

    def __init__(
        self,
        robot: Robot,
        trial: GraspTrial,
        *,
        grasp: SideGrasp = SIDE_GRASP,
        solver: PoseSolver | None = None,
        gui: bool = False,
    ) -> None:
        if robot.hand is None:
            raise StateError(f"robot '{robot.name}' has no hand")
        self.robot, self.hand, self.trial, self.grasp = robot, robot.hand, trial, grasp
        self.solver = solver or stand_solver(robot)
        self.verdict, self.stage = GraspVerdict(), "before"
        self._opening = self.hand.widest
        with ExitStack() as unwinding:
            folder = unwinding.enter_context(tempfile.TemporaryDirectory(prefix="motorprime-"))
            self.world = unwinding.enter_context(World(robot, gui=gui))
            self.table = add_table(self.world, TABLE_HEIGHT, TABLE_X, TABLE_Y)
            self.glass = StandingGlass(
                self.world, trial.glass, trial.xy, TABLE_HEIGHT, Path(folder) / "glass.obj"
            )
            self._closing = unwinding.pop_all()
        self._groups: Mapping[str, Sequence[str]] = {
            "torque": [j for j, terms in robot.couplings.items() if set(terms) & set(self.hand.motors)],
            "arm_torque": robot.arm,
            "torso_torque": robot.torso,
        }

    def __enter__(self) -> GraspStand:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    def run(self, watch: Callable[[GraspStand], None] | None = None) -> GraspVerdict:
        """Approach, close, lift, hold; ``watch`` is called after each stage."""
        watch = watch or (lambda stand: None)
        verdict, hand = self.verdict, self.hand
        try:
            approach, lift = self._plan()
        except UnreachableError as error:
            verdict.reason = str(error)
            return verdict
        self.world.place(dict(zip(self.solver.names, map(float, approach[0]), strict=True)))
        self.world.place(hand.targets(hand.widest))
        self.world.step(round(0.1 / STEP))
        self._travel("approach", approach, APPROACH, hand.widest)
        verdict.pushed = self._moved()
        watch(self)
        self._travel("close", approach[-1:], CLOSE, hand.tightest)
        self._travel("close", approach[-1:], SETTLE, hand.tightest)
        verdict.dragged = self._moved()
        watch(self)
        self._travel("lift", lift, LIFT, hand.tightest)
        watch(self)
        before = self._in_palm()
        lowest, touched = self._travel("hold", lift[-1:], HOLD, hand.tightest)
        verdict.lowest = lowest
        verdict.slipped = float(np.linalg.norm(self._in_palm() - before))
        verdict.lifted, verdict.reason = self._judge(lowest, touched)
        self.stage = "done"
        watch(self)
        return verdict

    def _plan(self) -> tuple[Floats, Floats]:
        """Joints (WAYPOINTS, n) of the approach and of the lift, with the palm off as the trial has it."""
        grasp, trial, solver = self.grasp, self.trial, self.solver
        radius = trial.glass.radius
        chosen = choose_grasp(
            solver,
            lambda azimuth: grasp.pose(trial.centre, azimuth, radius),
            distance=grasp.retreat,
            azimuths=grasp.azimuths,
        )
        self.verdict.azimuth = chosen.azimuth
        palm = chosen.palm @ transform(cv2.Rodrigues(trial.turned)[0], (0.0, 0.0, 0.0))
        palm[:3, 3] += trial.off
        shares = np.linspace(0.0, 1.0, WAYPOINTS)
        approach = self._follow([grasp.pregrasp(palm, 1.0 - s) for s in shares], chosen.pregrasp.angles)
        return approach, self._follow([grasp.lifted(palm, s) for s in shares], approach[-1])

    def _follow(self, poses: Sequence[Floats], start: Floats) -> Floats:
        angles = [start]
        for pose in poses:
            # As near as the arm comes: so does a controller that follows a palm which is a little off.
            angles.append(self.solver.nearest(pose, angles[-1], hold=angles[-1], restarts=0).angles)
        return np.array(angles[1:])

    def _travel(
        self, stage: str, waypoints: Floats, seconds: float, opening: float
    ) -> tuple[float, set[str]]:
        """Follow waypoints (K, n) while the hand goes to an opening.

        Returns:
            The glass's least height over the table [m], and what touched it: links of the robot, and 'table'.
        """
        self.stage, start = stage, self._opening
        steps, last = round(seconds / STEP), len(waypoints) - 1
        lowest, touched = np.inf, set[str]()
        for k in range(1, steps + 1):
            knot = last * float(minimum_jerk(k / steps))
            low = min(int(knot), max(last - 1, 0))
            angles = waypoints[low] + (knot - low) * (waypoints[min(low + 1, last)] - waypoints[low])
            targets = dict(zip(self.solver.names, map(float, angles), strict=True))
            self.world.command(targets | self.hand.targets(start + k / steps * (opening - start)))
            self.world.step()
            lowest = min(lowest, self.glass.clearance())
            if k % LOOK_EVERY == 0:
                touched |= self._look()
        self._opening = opening
        return lowest, touched

    def _look(self) -> set[str]:
        """Note torques, forces and depths; returns what touches the glass."""
        verdict, world = self.verdict, self.world
        for name, joints in self._groups.items():
            peak = max(abs(world.torque(joint)) for joint in joints)
            setattr(verdict, name, max(getattr(verdict, name), peak))
        contacts = world.contacts(self.glass.body)
        verdict.pressure = sum(contact.pressure for contact in contacts)
        verdict.friction = sum(contact.friction for contact in contacts)
        verdict.deepest = max([verdict.deepest, *(contact.depth for contact in contacts)])
        verdict.toppled = max(verdict.toppled, self.glass.tilt())
        verdict.table_touched |= self.table in world.touching()
        others = self.glass.touched_by() - {world.body}
        return {contact.link for contact in contacts} | ({"table"} if others else set())

    def _judge(self, lowest: float, touched: set[str]) -> tuple[bool, str]:
        palm = self.robot.palm.link
        hand = {palm} | {self.robot.tree.joints[joint].child for joint in self._groups["torque"]}
        if touched - hand:
            return False, f"touched by {', '.join(sorted(touched - hand))}"
        if lowest < LIFTED:
            return False, f"{lowest * 1e3:.0f} mm over the table"
        return True, ""

    def _moved(self) -> float:
        """How far the glass stands off its first place [m], along the table."""
        return float(np.linalg.norm(self.glass.pose()[0][:2] - self.trial.xy))

    def _in_palm(self) -> Floats:
        palm = self.world.palm_pose()
        place: Floats = palm[:3, :3].T @ (self.glass.pose()[0] - palm[:3, 3])
        return place


def stand_solver(robot: Robot) -> PoseSolver:
    """Inverse kinematics over the stand's table."""
    return PoseSolver(robot, Bench(TABLE_HEIGHT, TABLE_X[1]))
