"""A robot as data: which joints move the eyes, which move the hand, where the cameras and the palm sit.

Another arm with another camera is another value of :class:`Robot`, not another class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Floats, fixed
from .camera import Camera
from .control.hand import Hand
from .errors import ArgumentError, StateError
from .kinematics import Chain, KinematicTree, rotation_from_rpy, transform


@dataclass(frozen=True)
class CameraMount:
    """A camera on a link; the link's frame is the camera's (x right, y down, z forward)."""

    link: str
    camera: Camera


@dataclass(frozen=True)
class Palm:
    """The palm's frame on a link: x along the stretched fingers, z out of the palm, origin in its middle."""

    link: str
    frame: Floats


@dataclass(frozen=True)
class Robot:
    """What the library needs to know of a robot.

    Args:
        name: for messages and files.
        root: link whose frame is the root frame of all points.
        chest: link that carries the shoulders and the neck; the reach cloud lives in its frame.
        gaze: variables of the gaze, in the order in which postures are given.
        torso: those of them that also move the arm, from root to chest.
        arm: joints from the chest to the palm.
        cameras: camera name -> mount.
        palm: frame of the palm.
        couplings: joint of the URDF -> {variable: factor}, for joints that are not variables themselves.
        ranges: limits [rad] of variables that the URDF does not know, and tighter ones for those it does.
        rest: posture [rad] of variables that is preferred when the task leaves a choice; others prefer the
            middle of their range.
        around_eyes: links that enclose the cameras and that no camera is to see.
        guarded: links of the arm -> height [m] that they keep over a work surface.
        aside: place [m] of the palm in the root frame where the hand is out of the eyes' way.
        parked: angles [rad] of joints that no task moves; others of them park at zero or their nearest limit.
        hand: motors and shapes of the hand at the palm; None for a robot that only reaches.
        urdf: the kinematics; a robot without it serves as a template, see :meth:`with_urdf`.
    """

    name: str
    root: str
    chest: str
    gaze: tuple[str, ...]
    torso: tuple[str, ...]
    arm: tuple[str, ...]
    cameras: Mapping[str, CameraMount]
    palm: Palm
    couplings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rest: Mapping[str, float] = field(default_factory=dict)
    around_eyes: tuple[str, ...] = ()
    guarded: Mapping[str, float] = field(default_factory=dict)
    aside: tuple[float, float, float] | None = None
    parked: Mapping[str, float] = field(default_factory=dict)
    hand: Hand | None = None
    urdf: Path | None = None

    def with_urdf(self, path: str | Path) -> Robot:
        """The same robot with its kinematics read from a URDF file."""
        return replace(self, urdf=Path(path))

    def with_image_size(self, width: int, height: int) -> Robot:
        """The same robot with every camera's image scaled to ``width`` x ``height`` pixels."""
        scaled = {
            name: replace(mount, camera=mount.camera.scale((width, height)))
            for name, mount in self.cameras.items()
        }
        return replace(self, cameras=scaled)

    @cached_property
    def tree(self) -> KinematicTree:
        """The kinematic tree; StateError when the robot has no URDF."""
        if self.urdf is None:
            raise StateError(f"robot '{self.name}' has no URDF; give it one with with_urdf(path)")
        return KinematicTree(self.urdf)

    @cached_property
    def camera_chains(self) -> dict[str, Chain]:
        """Chain from the root to each camera."""
        return {name: self.tree.chain(self.root, mount.link) for name, mount in self.cameras.items()}

    @cached_property
    def chest_chain(self) -> Chain:
        """Chain from the root to the chest; its variables are the torso's."""
        return self.tree.chain(self.root, self.chest)

    @cached_property
    def arm_chain(self) -> Chain:
        """Chain from the chest to the palm's link; its variables are the arm's."""
        return self.tree.chain(self.chest, self.palm.link)

    @cached_property
    def reach_chain(self) -> Chain:
        """Chain from the root to the palm's link; its variables are the torso's, then the arm's."""
        return self.tree.chain(self.root, self.palm.link)

    def limits(self, variables: tuple[str, ...]) -> Floats:
        """Lower and upper limits (n, 2) [rad] of variables."""
        rows = []
        for name in variables:
            if name in self.ranges:
                rows.append(self.ranges[name])
            elif name in self.tree.joints:
                rows.append((self.tree.joints[name].lower, self.tree.joints[name].upper))
            else:
                raise ArgumentError(f"robot '{self.name}' has no variable '{name}'")
        return np.array(rows, dtype=np.float64).reshape(-1, 2)

    def resting(self, variables: tuple[str, ...]) -> Floats:
        """Preferred posture (n,) [rad] of variables."""
        middle = self.limits(variables).mean(axis=1)
        return np.array([self.rest.get(name, mid) for name, mid in zip(variables, middle, strict=True)])

    def urdf_angles(self, names: tuple[str, ...], joints: Floats) -> Floats:
        """Angles (..., n) [rad] of URDF joints at gaze postures (..., len(gaze)), couplings resolved.

        Raises:
            ArgumentError: a joint depends on a variable that is not one of :attr:`gaze`.
        """
        column = {variable: i for i, variable in enumerate(self.gaze)}
        angles = np.zeros((*joints.shape[:-1], len(names)))
        for k, name in enumerate(names):
            for variable, factor in self.couplings.get(name, {name: 1.0}).items():
                if variable not in column:
                    raise ArgumentError(
                        f"gaze: robot '{self.name}' has joint '{name}' on the way to a camera or the chest, "
                        f"which needs '{variable}'; the variables are {self.gaze}"
                    )
                angles[..., k] += factor * joints[..., column[variable]]
        return angles

    def gaze_posture(self, joints: ArrayLike) -> Floats:
        """``joints`` checked: (len(gaze),) float64 [rad], finite; else ArgumentError."""
        return fixed("joints", joints, (len(self.gaze),))


def _degrees(**ranges: tuple[float, float]) -> dict[str, tuple[float, float]]:
    return {name: (float(np.deg2rad(low)), float(np.deg2rad(high))) for name, (low, high) in ranges.items()}


_FINGER_RANGES = _degrees(
    r_hand_finger=(0, 60),
    r_thumb_oppose=(0, 90),
    r_thumb_proximal=(0, 90),
    r_thumb_distal=(0, 180),
    r_index_proximal=(0, 90),
    r_index_distal=(0, 180),
    r_middle_proximal=(0, 90),
    r_middle_distal=(0, 180),
    r_pinky=(0, 270),
)
"""Of the right hand's nine motors. A motor that moves several joints in a row counts their sum, as the real
one's does; the spread counts from fingers side by side, the real one's from fingers spread."""

_FINGER_COUPLINGS: dict[str, dict[str, float]] = {
    "r_index_adduction_joint": {"r_hand_finger": -1 / 3},
    "r_ring_adduction_joint": {"r_hand_finger": 1 / 3},
    "r_little_adduction_joint": {"r_hand_finger": 1 / 3},
    "r_thumb_opposition_joint": {"r_thumb_oppose": 1.0},
    **{
        f"r_{finger}_proximal_joint": {f"r_{finger}_proximal": 1.0} for finger in ("thumb", "index", "middle")
    },
    **{
        f"r_{finger}_{phalanx}_joint": {f"r_{finger}_distal": 0.5}
        for finger in ("thumb", "index", "middle")
        for phalanx in ("middle", "distal")
    },
    **{
        f"r_{finger}_{phalanx}_joint": {"r_pinky": 1 / 3}
        for finger in ("ring", "little")
        for phalanx in ("proximal", "middle", "distal")
    },
}


def _shape(*degrees: float) -> tuple[float, ...]:
    """Targets [rad] of the motors in the order of ``_FINGER_RANGES``."""
    return tuple(float(angle) for angle in np.deg2rad(degrees))


_ICUB_HAND = Hand(
    motors=tuple(_FINGER_RANGES),
    shapes={
        # The thumb stands opposed before it comes near: swung round beside a glass, it would push it away.
        "open": _shape(0, 75, 0, 0, 5, 20, 5, 20, 15),
        # Proximal joints squeeze; the distal ones hold the finger's bow, or it would roll up on itself.
        "grasp": _shape(0, 75, 0, 20, 21, 60, 25, 60, 78),
        "closed": _shape(0, 75, 15, 60, 45, 60, 45, 60, 120),
        # Fingers straight and the thumb along the index finger's side: a hand as thin as the palm.
        "passing": _shape(0, 0, 75, 10, 0, 0, 0, 0, 0),
    },
    path=((1.0, "open"), (0.0, "grasp"), (-0.5, "closed")),
    slim="passing",
)

_EYE = Camera(width=320, height=240, fx=257.34, fy=257.34, cx=160.0, cy=120.0)

ICUB = Robot(
    name="iCub",
    root="root_link",
    chest="chest",
    gaze=(
        "torso_pitch",
        "torso_roll",
        "torso_yaw",
        "neck_pitch",
        "neck_roll",
        "neck_yaw",
        "eyes_tilt",
        "eyes_version",
        "eyes_vergence",
    ),
    torso=("torso_pitch", "torso_roll", "torso_yaw"),
    arm=(
        "r_shoulder_pitch",
        "r_shoulder_roll",
        "r_shoulder_yaw",
        "r_elbow",
        "r_wrist_prosup",
        "r_wrist_pitch",
        "r_wrist_yaw",
    ),
    cameras={"left": CameraMount("l_eye", _EYE), "right": CameraMount("r_eye", _EYE)},
    # The hand's Denavit-Hartenberg frame of iCubGazeboV2_5, on the wrist's last link.
    palm=Palm(
        "r_hand",
        transform(rotation_from_rpy((-np.pi / 2, -np.pi / 12, np.pi)), (-0.0576543, -0.0055568, 0.0136938)),
    ),
    couplings={
        "l_eye_pan": {"eyes_version": 1.0, "eyes_vergence": 0.5},
        "r_eye_pan": {"eyes_version": 1.0, "eyes_vergence": -0.5},
        **_FINGER_COUPLINGS,
    },
    ranges=_degrees(eyes_tilt=(-30, 30), eyes_version=(-30, 30), eyes_vergence=(0, 50)) | _FINGER_RANGES,
    around_eyes=("head",),
    guarded={"r_elbow_1": 0.055, "r_wrist_1": 0.055},
    parked={
        "l_shoulder_pitch": 0.15,
        "l_shoulder_roll": 0.35,
        "l_shoulder_yaw": 0.8,
        "l_wrist_prosup": 0.8,
        # Thumbs along the index fingers, out of the way of what the palms face.
        **{f"{side}_thumb_proximal_joint": 1.3 for side in "lr"},
        **{f"{side}_thumb_{phalanx}_joint": 0.09 for side in "lr" for phalanx in ("middle", "distal")},
    },
    hand=_ICUB_HAND,
    aside=(-0.10, 0.34, 0.06),
    rest=dict.fromkeys(("torso_pitch", "torso_roll", "torso_yaw", "neck_roll", "neck_yaw"), 0.0),
)
"""The iCub's gaze and right arm. Joint ranges are those of iCubGazeboV2_5 and of the simulator's eyes; the
cameras are the simulator's: 320 x 240, f = 257.34 px, centre (160, 120)."""
