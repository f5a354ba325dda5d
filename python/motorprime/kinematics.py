"""Forward kinematics of the serial chains in a URDF file, in plain NumPy.

Only what vision needs is read: joints, their origins, axes and limits. Shapes, masses and meshes belong to
the simulator. Everything is batched over postures, because a reach cloud is ten thousand of them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Floats, finite, fixed, numbers
from .errors import ArgumentError


def rotation_from_rpy(rpy: ArrayLike) -> Floats:
    """Rotation matrix (3, 3) of URDF's roll, pitch, yaw [rad]: R_z(yaw) R_y(pitch) R_x(roll)."""
    angles = fixed("rpy", rpy, (3,))
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: ArrayLike) -> Floats:
    """URDF's roll, pitch, yaw (3,) [rad] of a rotation (3, 3), exact at a pitch of 90 degrees too.

    There only yaw - roll or yaw + roll is determined; yaw is what rounding says, and roll follows from it.
    """
    matrix = fixed("rotation", rotation, (3, 3))
    yaw = float(np.arctan2(matrix[1, 0], matrix[0, 0]))
    left = rotation_from_rpy((0.0, 0.0, -yaw)) @ matrix
    return np.array([np.arctan2(-left[1, 2], left[1, 1]), np.arctan2(-left[2, 0], left[0, 0]), yaw])


def transform(rotation: ArrayLike, translation: ArrayLike) -> Floats:
    """Homogeneous matrix (4, 4) of a rotation (3, 3) and a translation (3,) [m]."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def apply(pose: Floats, points: Floats) -> Floats:
    """Points (N, 3) [m] of the frame ``pose`` (4, 4), in the frame that ``pose`` is given in: (N, 3)."""
    moved: Floats = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def invert(pose: Floats) -> Floats:
    """Inverse (4, 4) of a rigid transform (4, 4)."""
    rotation = pose[:3, :3].T
    return transform(rotation, -rotation @ pose[:3, 3])


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of a URDF tree: ``origin`` (4, 4) of the child's frame in the parent's at angle zero."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Floats
    axis: Floats
    lower: float
    upper: float

    @property
    def moves(self) -> bool:
        """Whether it has an angle."""
        return self.kind != "fixed"

    def turn(self, angle: Floats) -> Floats:
        """Rotation about its axis: angles (...) [rad] -> (..., 4, 4)."""
        return _Turn(self.axis).by(angle)


class KinematicTree:
    """The joints of one URDF file.

    Args:
        path: a URDF file. Chains run over its revolute, continuous and fixed joints; others may be in it,
            a gripper's sliding fingers for example.

    Raises:
        ArgumentError: the file is missing or is no URDF; the message names the joint.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            root = ET.parse(self.path).getroot()
        except FileNotFoundError:
            raise ArgumentError(f"urdf: no such file: {self.path}") from None
        except ET.ParseError as error:
            raise ArgumentError(f"urdf: {self.path} is not XML: {error}") from None
        except OSError as error:
            raise ArgumentError(f"urdf: cannot read {self.path}: {error.strerror}") from None
        if root.tag != "robot":
            raise ArgumentError(f"urdf: {self.path} holds a <{root.tag}>, a <robot> expected")
        self.joints: dict[str, Joint] = {}
        self._above: dict[str, Joint] = {}
        for joint in map(self._joint, root.findall("joint")):
            if joint.name in self.joints or joint.child in self._above:
                raise ArgumentError(
                    f"urdf: joint '{joint.name}' or its child '{joint.child}' comes twice in {self.path}"
                )
            self.joints[joint.name] = self._above[joint.child] = joint
        self.links: tuple[str, ...] = tuple(link.get("name", "") for link in root.findall("link"))

    def _joint(self, element: ET.Element) -> Joint:
        name = element.get("name", "")

        def read(tag: str, key: str, default: str) -> Floats:
            part = element.find(tag)
            text = default if part is None else part.get(key, default)
            try:
                values = np.array([float(word) for word in text.split()])
            except ValueError:
                values = np.array([np.nan])
            if len(values) != len(default.split()) or not np.isfinite(values).all():
                raise ArgumentError(
                    f"urdf: joint '{name}' of {self.path} has {tag} {key}=\"{text}\"; "
                    f'finite numbers as in "{default}" expected'
                )
            return values

        direction = read("axis", "xyz", "1 0 0")
        length = float(np.linalg.norm(direction))
        if length == 0.0 and element.get("type") != "fixed":  # some exporters write 0 0 0 for fixed ones
            raise ArgumentError(f"urdf: joint '{name}' of {self.path} has an axis of length 0")
        parent, child = element.find("parent"), element.find("child")
        if parent is None or child is None:
            raise ArgumentError(f"urdf: joint '{name}' of {self.path} has no parent or no child")
        return Joint(
            name=name,
            kind=element.get("type", ""),
            parent=parent.get("link", ""),
            child=child.get("link", ""),
            origin=transform(
                rotation_from_rpy(read("origin", "rpy", "0 0 0")), read("origin", "xyz", "0 0 0")
            ),
            axis=direction / (length or 1.0),
            lower=float(read("limit", "lower", f"{-np.pi}")[0]),
            upper=float(read("limit", "upper", f"{np.pi}")[0]),
        )

    def chain(self, base: str, tip: str) -> Chain:
        """The chain from link ``base`` to link ``tip``, which must lie below it."""
        for link in (base, tip):
            if link not in self.links:
                raise ArgumentError(f"link '{link}' is not in {self.path.name}; it has {sorted(self.links)}")
        path: list[Joint] = []
        link = tip
        while link != base:
            if link not in self._above:
                raise ArgumentError(f"link '{tip}' does not hang below '{base}' in {self.path.name}")
            joint = self._above[link]
            if joint.kind not in ("revolute", "continuous", "fixed"):
                raise ArgumentError(
                    f"urdf: joint '{joint.name}' between '{base}' and '{tip}' in {self.path.name} is "
                    f"'{joint.kind}'; known: revolute, continuous, fixed"
                )
            if joint in path:
                raise ArgumentError(f"urdf: joint '{joint.name}' in {self.path.name} closes a loop")
            path.append(joint)
            link = joint.parent
        return Chain(tuple(reversed(path)))


class Chain:
    """A serial chain; its variables are the angles [rad] of its moving joints, from base to tip.

    Args:
        joints: moving and fixed ones, from base to tip, each on the child of the one before.
    """

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self.joints = joints
        self.names: tuple[str, ...] = tuple(joint.name for joint in joints if joint.moves)
        self.limits: Floats = np.array([(j.lower, j.upper) for j in joints if j.moves]).reshape(-1, 2)
        # Fixed joints fold into the origin of the next moving one, so a pose costs one product per variable.
        origins: list[Floats] = []
        axes: list[Floats] = []
        turns: list[_Turn] = []
        pending = np.eye(4)
        for joint in joints:
            pending = pending @ joint.origin
            if joint.moves:
                origins.append(pending)
                axes.append(joint.axis)
                turns.append(_Turn(joint.axis))
                pending = np.eye(4)
        self._end = pending
        self._axes: Floats = np.reshape(axes, (-1, 3))
        # Origin times turn is linear in sine and versine: all joints' products in a few operations.
        self._plain = np.reshape(origins, (-1, 4, 4))
        self._sine = self._plain @ np.reshape([turn.cross for turn in turns], (-1, 4, 4))
        self._versine = self._plain @ np.reshape([turn.square for turn in turns], (-1, 4, 4))

    def forward(self, angles: ArrayLike) -> Floats:
        """Pose of the tip in the base frame: angles (..., n) [rad] -> (..., 4, 4)."""
        q = self._checked(angles)
        steps = self._steps(q)
        pose: Floats = np.broadcast_to(_IDENTITY, (*q.shape[:-1], 4, 4))
        for k in range(len(self.names)):
            pose = pose @ steps[..., k, :, :]
        return pose @ self._end

    def jacobian(self, angles: ArrayLike) -> tuple[Floats, Floats]:
        """Pose of the tip (4, 4) and its geometric Jacobian (6, n): linear rows [m/rad], then angular.

        Column k is (z_k x (p - p_k), z_k), z_k the joint's axis and p_k its place in the base frame.
        """
        frames = self.frames(angles)
        pose = frames[-1] @ self._end if len(frames) else self._end.copy()
        z, (lx, ly, lz) = self.axes(frames), (pose[:3, 3] - frames[:, :3, 3]).T
        x, y, _ = z.T
        linear = [y * lz - z[:, 2] * ly, z[:, 2] * lx - x * lz, x * ly - y * lx]
        return pose, np.vstack([*linear, z.T])

    def frames(self, angles: ArrayLike) -> Floats:
        """Pose (n, 4, 4) in the base frame of what each moving joint carries, at one posture (n,) [rad]."""
        q = self._checked(angles)
        if q.ndim != 1:
            raise ArgumentError(f"angles: one posture of shape ({len(self.names)},) expected, got {q.shape}")
        poses = self._steps(q)
        for k in range(1, len(poses)):
            poses[k] = poses[k - 1].dot(poses[k])
        return poses

    def axes(self, frames: Floats) -> Floats:
        """Unit axes (n, 3) of the moving joints in the base frame; a joint's turn leaves its own axis."""
        directions: Floats = (frames[:, :3, :3] @ self._axes[:, :, None])[:, :, 0]
        return directions

    @property
    def end(self) -> Floats:
        """Pose (4, 4) of the tip in the last moving joint's frame."""
        return self._end.copy()

    def _steps(self, q: Floats) -> Floats:
        """Each joint's origin times its turn: angles (..., n) [rad] -> (..., n, 4, 4)."""
        sine, versine = np.sin(q)[..., None, None], (1.0 - np.cos(q))[..., None, None]
        steps: Floats = self._plain + sine * self._sine + versine * self._versine
        return steps

    def _checked(self, angles: ArrayLike) -> Floats:
        q = numbers("angles", angles)
        if q.ndim == 0 or q.shape[-1] != len(self.names):
            raise ArgumentError(
                f"angles: last axis of {len(self.names)} {self.names} expected, got shape {q.shape}"
            )
        return finite("angles", q)


class _Turn:
    """Rotation about a unit axis (3,) by Rodrigues' formula, I + sin K + (1 - cos) K^2, K = axis x."""

    def __init__(self, axis: Floats) -> None:
        x, y, z = axis
        self.cross = np.zeros((4, 4))
        self.cross[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        self.square = self.cross @ self.cross

    def by(self, angle: Floats) -> Floats:
        """Angles (...) [rad] -> homogeneous matrices (..., 4, 4)."""
        sine, versine = np.sin(angle)[..., None, None], (1.0 - np.cos(angle))[..., None, None]
        return _IDENTITY + sine * self.cross + versine * self.square


_IDENTITY = np.eye(4)
