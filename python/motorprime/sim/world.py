"""The one owner of pybullet: a physics world with one robot in it.

Everything that touches the simulator goes through here or through the other files of this folder; above
it there are only poses, images and joint angles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed
from ..errors import ArgumentError, MissingExtraError, StateError
from ..kinematics import transform
from ..robot import Robot
from ..silence import silenced

try:
    with silenced(1, 2):  # it announces its build time
        import pybullet
        from pybullet_utils.bullet_client import BulletClient
except ImportError:  # pragma: no cover - tested in an environment without the extra
    raise MissingExtraError("the simulator (pybullet has wheels for CPython 3.10 and 3.11)", "sim") from None

__all__ = ["FRICTION", "STEP", "Contact", "World", "connect", "pybullet", "rub"]

STEP = 1.0 / 240.0
POSITION_GAIN = 0.25
FRICTION = 0.8
"""Lateral friction of every surface that the hand may hold by, its own too; pybullet multiplies the two."""
SOLVER_ITERATIONS = 300
"""Fingers of grams press a glass against each other on an arm of kilogrammes: with pybullet's 50 rounds they
are a millimetre inside it. A held glass creeps through the hand by up to 1 mm a second with 200 rounds, by
0.6 with 300, by 0.1 with 500; each has its price in time."""


@dataclass(frozen=True, eq=False)
class Contact:
    """Where a link of the robot touches a body.

    Attributes:
        link: of the robot.
        place: (3,) [m] on the body's surface, in the root frame.
        normal: (3,) unit vector out of the body.
        pressure: force along the normal [N].
        friction: force along the surface [N].
        depth: how far the two are inside each other [m]; negative when they are that far apart.
    """

    link: str
    place: Floats
    normal: Floats
    pressure: float
    friction: float
    depth: float


def connect(*, gui: bool = False) -> Any:
    """A new pybullet client; pybullet's own words on standard output are swallowed."""
    with silenced(1):
        return BulletClient(pybullet.GUI if gui else pybullet.DIRECT)


def rub(bullet: Any, body: int, link: int = -1) -> None:
    """Give a link the friction that things are held by, and none against rolling or spinning."""
    bullet.changeDynamics(body, link, lateralFriction=FRICTION, rollingFriction=0.0, spinningFriction=0.0)


class World:
    """A pybullet world with the robot's root frame as its own.

    Args:
        robot: the robot, with its URDF.
        gui: open pybullet's window instead of running headless.

    Raises:
        StateError: pybullet cannot load the URDF.
    """

    def __init__(self, robot: Robot, *, gui: bool = False) -> None:
        self.robot = robot
        self.bullet = connect(gui=gui)
        self.time = 0.0
        self.bullet.setGravity(0, 0, -9.81)
        self.bullet.setTimeStep(STEP)
        # With split impulses pybullet never brings back a joint that was pressed through its limit.
        self.bullet.setPhysicsEngineParameter(numSolverIterations=SOLVER_ITERATIONS, useSplitImpulse=0)
        if gui:
            self.bullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0)
            self.bullet.resetDebugVisualizerCamera(1.1, 230, -25, [-0.2, 0.0, 0.1])
        try:
            with silenced(1):
                # Without the flag pybullet makes up inertias from the shapes.
                self.body: int = self.bullet.loadURDF(
                    str(robot.urdf), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
                )
        except pybullet.error:
            self.close()
            raise StateError(f"robot: pybullet cannot load {robot.urdf}, or a mesh of it") from None
        self.joint_index: dict[str, int] = {}
        self.link_index: dict[str, int] = {robot.root: -1}
        for k in range(self.bullet.getNumJoints(self.body)):
            info = self.bullet.getJointInfo(self.body, k)
            self.link_index[info[12].decode()] = k
            if info[2] == pybullet.JOINT_REVOLUTE:
                self.joint_index[info[1].decode()] = k
        self._effort = {
            name: self.bullet.getJointInfo(self.body, k)[10] for name, k in self.joint_index.items()
        }
        # URDF poses are of link frames, pybullet's base pose is of the centre of mass.
        place, turn = self.bullet.getDynamicsInfo(self.body, -1)[3:5]
        self.bullet.resetBasePositionAndOrientation(self.body, place, turn)
        for k in self.link_index.values():
            rub(self.bullet, self.body, k)
        self._park()

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect from pybullet; a second call does nothing."""
        if self.bullet.isConnected():
            self.bullet.disconnect()

    def variables_to_joints(self, variables: Mapping[str, float]) -> dict[str, float]:
        """URDF joint angles [rad] of robot variables, couplings resolved.

        A joint coupled to several variables needs them all.
        """
        angles = {name: value for name, value in variables.items() if name in self.joint_index}
        for joint, terms in self.robot.couplings.items():
            if all(name in variables for name in terms):
                angles[joint] = sum(factor * variables[name] for name, factor in terms.items())
        unknown = [
            name
            for name in variables
            if name not in self.joint_index and not any(name in t for t in self.robot.couplings.values())
        ]
        if unknown:
            raise ArgumentError(f"variables: the robot has no {unknown}; it has {sorted(self.joint_index)}")
        return angles

    def place(self, variables: Mapping[str, float]) -> None:
        """Put joints at angles [rad] at once, at rest: for the start of a run, never during a motion."""
        for name, angle in self.variables_to_joints(variables).items():
            self.bullet.resetJointState(self.body, self.joint_index[name], angle, 0.0)
        self.hold()

    def _park(self) -> None:
        for name, k in self.joint_index.items():
            low, high = self.bullet.getJointInfo(self.body, k)[8:10]
            angle = float(np.clip(self.robot.parked.get(name, 0.0), low, high))
            self.bullet.resetJointState(self.body, k, angle, 0.0)
        self.hold()

    def hold(self) -> None:
        """Command every joint to stay where it is."""
        self._command({name: self.angle(name) for name in self.joint_index})

    def command(self, variables: Mapping[str, float]) -> None:
        """Set position targets [rad] of joints; the motors move them as the world steps."""
        self._command(self.variables_to_joints(variables))

    def _command(self, angles: Mapping[str, float]) -> None:
        names = list(angles)
        self.bullet.setJointMotorControlArray(
            self.body,
            [self.joint_index[name] for name in names],
            pybullet.POSITION_CONTROL,
            targetPositions=[angles[name] for name in names],
            forces=[self._effort[name] for name in names],
            positionGains=[POSITION_GAIN] * len(names),
        )

    def step(self, count: int = 1) -> None:
        """Advance the physics by ``count`` steps of 1/240 s."""
        for _ in range(count):
            self.bullet.stepSimulation()
        self.time += count * STEP

    def angle(self, joint: str) -> float:
        """Angle [rad] of a URDF joint: the encoder."""
        return float(self.bullet.getJointState(self.body, self.joint_index[joint])[0])

    def read(self, variables: Iterable[str]) -> Floats:
        """Encoder values [rad] of robot variables, couplings inverted by least squares."""
        return np.array([self._read_one(name) for name in variables])

    def _read_one(self, name: str) -> float:
        if name in self.joint_index:
            return self.angle(name)
        joints = [joint for joint, terms in self.robot.couplings.items() if name in terms]
        if not joints:
            raise ArgumentError(f"variables: the robot has no '{name}'; it has {sorted(self.joint_index)}")
        unknowns = sorted({term for joint in joints for term in self.robot.couplings[joint]})
        mixing = [[self.robot.couplings[joint].get(term, 0.0) for term in unknowns] for joint in joints]
        solved, *_ = np.linalg.lstsq(np.array(mixing), [self.angle(joint) for joint in joints], rcond=None)
        return float(solved[unknowns.index(name)])

    def gaze(self) -> Floats:
        """Encoder values of the gaze variables (len(robot.gaze),) [rad]."""
        return self.read(self.robot.gaze)

    def link_pose(self, link: str) -> Floats:
        """True pose (4, 4) of a link's frame in the root frame."""
        index = self.link_index[link]
        if index < 0:
            place, turn = self.bullet.getBasePositionAndOrientation(self.body)
            inertial = self.bullet.getDynamicsInfo(self.body, -1)[3:5]
            place, turn = self.bullet.multiplyTransforms(place, turn, *self.bullet.invertTransform(*inertial))
        else:
            state = self.bullet.getLinkState(self.body, index, computeForwardKinematics=1)
            place, turn = state[4], state[5]
        return transform(np.reshape(self.bullet.getMatrixFromQuaternion(turn), (3, 3)), place)

    def palm_pose(self) -> Floats:
        """True pose (4, 4) of the palm's frame in the root frame."""
        return self.link_pose(self.robot.palm.link) @ self.robot.palm.frame

    def clear_of(self, bodies: Iterable[int], distance: float) -> bool:
        """Whether every link of the robot keeps ``distance`` [m] off all these bodies."""
        return not any(self.bullet.getClosestPoints(self.body, other, distance) for other in bodies)

    @contextmanager
    def hidden(self, links: Iterable[str]) -> Iterator[None]:
        """Leave links of the robot out of the pictures taken within the block."""
        indices = {self.link_index[link] for link in links}
        colours = [(s[1], s[7]) for s in self.bullet.getVisualShapeData(self.body) if s[1] in indices]
        for link, colour in colours:
            self.bullet.changeVisualShape(self.body, link, rgbaColor=[*colour[:3], 0.0])
        try:
            yield
        finally:
            for link, colour in colours:
                self.bullet.changeVisualShape(self.body, link, rgbaColor=colour)

    def add_marker(self, mesh: Path, colour: Sequence[float]) -> int:
        """Add a body that is seen and touches nothing, far below the scene; returns its number.

        Args:
            mesh: Wavefront file.
            colour: red, green, blue and opacity, 0 to 1.
        """
        shape = self.bullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=list(colour))
        return int(self.bullet.createMultiBody(baseVisualShapeIndex=shape, basePosition=(0, 0, -50)))

    def put(self, body: int, place: npt.ArrayLike) -> None:
        """Put a body's origin at ``place`` (3,) [m] in the root frame, upright."""
        self.bullet.resetBasePositionAndOrientation(body, fixed("place", place, (3,)).tolist(), (0, 0, 0, 1))

    def remove(self, body: int) -> None:
        """Take a body away."""
        self.bullet.removeBody(body)

    def torque(self, joint: str) -> float:
        """Torque [N m] that the motor of a URDF joint applied in the last step."""
        return float(self.bullet.getJointState(self.body, self.joint_index[joint])[3])

    def effort(self, joint: str) -> float:
        """Largest torque [N m] of the motor of a URDF joint."""
        return float(self._effort[joint])

    def contacts(self, body: int) -> list[Contact]:
        """Where the robot and a body touched in the last step."""
        names = {index: name for name, index in self.link_index.items()}
        return [
            Contact(
                link=names[point[3]],
                place=np.array(point[6]),
                normal=np.array(point[7]),
                pressure=float(point[9]),
                friction=float(np.hypot(point[10], point[12])),
                depth=-float(point[8]),
            )
            for point in self.bullet.getContactPoints(bodyA=self.body, bodyB=body)
        ]

    def touching(self, body: int | None = None) -> set[int]:
        """Bodies that touch a body, the robot if none is named, now; those that press on it or overlap it.

        Bullet's contact points also tell of surfaces that are still up to 2 cm apart.
        """
        own = self.body if body is None else body
        points = self.bullet.getContactPoints(bodyA=own)
        return {int(p[2]) for p in points if p[2] != own and (p[8] <= 0.0 or p[9] > 0.0)}
