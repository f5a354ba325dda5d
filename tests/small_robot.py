"""A two-eyed robot with one arm, written by hand, and its kinematics written a second time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorprime import Camera, Robot
from motorprime.kinematics import transform
from motorprime.robot import CameraMount, Palm

# (name, type, parent, child, xyz, rpy, axis)
JOINTS = [
    ("waist", "revolute", "base", "chest", (0.0, 0.0, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ("plate", "fixed", "chest", "shelf", (0.05, -0.02, 0.3), (0.3, -0.5, 0.7), None),
    ("neck", "revolute", "shelf", "head", (0.0, 0.03, 0.04), (-0.4, 0.2, 1.1), (1.0, 2.0, -2.0)),
    ("bolt", "fixed", "head", "bar", (0.01, 0.02, 0.03), (0.1, 0.2, 0.3), None),
    ("left_pan", "continuous", "bar", "left_eye", (0.0, -0.05, 0.0), (-1.6, 0.1, -1.5), (0.0, 1.0, 0.0)),
    ("right_pan", "continuous", "bar", "right_eye", (0.0, 0.05, 0.0), (-1.6, 0.1, -1.5), (0.0, 1.0, 0.0)),
    ("shoulder", "revolute", "chest", "upper", (0.0, 0.2, 0.2), (1.2, 0.0, -0.4), (0.0, -3.0, 4.0)),
    ("elbow", "revolute", "upper", "hand", (0.25, 0.0, 0.0), (0.0, 0.9, 0.0), (0.0, 0.0, 1.0)),
    ("slide", "prismatic", "hand", "finger", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
]
LIMITS = {"waist": (-1.0, 1.5), "neck": (-0.7, 0.6), "shoulder": (-2.0, 0.5), "elbow": (0.1, 2.2)}
CAMERA = Camera(width=320, height=240, fx=257.34, fy=257.34, cx=160.0, cy=120.0)


def urdf_text() -> str:
    links = ["base", *(joint[3] for joint in JOINTS)]
    parts = [f'<link name="{link}"/>' for link in links]
    for name, kind, parent, child, xyz, rpy, axis in JOINTS:
        inner = f'<parent link="{parent}"/><child link="{child}"/>'
        inner += f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>'
        if axis is not None:
            inner += f'<axis xyz="{_words(axis)}"/>'
        if name in LIMITS:
            inner += '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'.format(*LIMITS[name])
        parts.append(f'<joint name="{name}" type="{kind}">{inner}</joint>')
    return f'<?xml version="1.0"?>\n<robot name="small">{"".join(parts)}</robot>\n'


def _words(values) -> str:
    return " ".join(str(value) for value in values)


def write_urdf(folder: Path) -> Path:
    path = folder / "small.urdf"
    path.write_text(urdf_text())
    return path


def turn(axis, angle: float) -> np.ndarray:
    """Rotation (3, 3) through the exponential series of angle times the axis's cross matrix."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = angle * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    result, term = np.eye(3), np.eye(3)
    for k in range(1, 40):
        term = term @ cross / k
        result = result + term
    return result


def reference_pose(base: str, tip: str, angles: dict[str, float]) -> np.ndarray:
    """Pose (4, 4) of one link in another: a product of single turns about x, then y, then z."""
    above = {joint[3]: joint for joint in JOINTS}
    pose = np.eye(4)
    while tip != base:
        name, _, parent, _, xyz, (roll, pitch, yaw), axis = above[tip]
        place = np.eye(4)
        place[:3, :3] = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
        place[:3, 3] = xyz
        if axis is not None:
            moved = np.eye(4)
            moved[:3, :3] = turn(axis, angles.get(name, 0.0))
            place = place @ moved
        pose = place @ pose
        tip = parent
    return pose


PALM_FRAME = transform(turn((0, 0, 1), 0.4) @ turn((1, 0, 0), -0.3), (0.06, 0.01, -0.02))


def small_robot(folder: Path | None = None) -> Robot:
    """Its eyes are coupled: left_pan = version + squint / 2, right_pan = version - squint / 2."""
    robot = Robot(
        name="small",
        root="base",
        chest="chest",
        gaze=("neck", "waist", "version", "squint"),
        torso=("waist",),
        arm=("shoulder", "elbow"),
        cameras={"left": CameraMount("left_eye", CAMERA), "right": CameraMount("right_eye", CAMERA)},
        palm=Palm("hand", PALM_FRAME),
        couplings={
            "left_pan": {"version": 1.0, "squint": 0.5},
            "right_pan": {"version": 1.0, "squint": -0.5},
        },
        ranges={"version": (-0.5, 0.5), "squint": (0.0, 0.9), "elbow": (0.2, 2.0)},
        rest={"neck": 0.1},
    )
    return robot if folder is None else robot.with_urdf(write_urdf(folder))
