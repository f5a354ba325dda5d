"""Five fingers of capsules on the iCub's palm.

Places are in the right palm's frame (x along the stretched fingers, z out of the palm, the thumb at -y),
lengths in metres; the left hand mirrors z. Every finger but the middle one can spread (adduction),
the thumb opposes, and each has three flexion joints: 19 joints a hand, which the real robot drives with 9
motors.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._arrays import Floats
from ..kinematics import rotation_from_rpy, transform
from ..robot import ICUB
from .meshes import write_lathe

RADIUS = 0.0065
DENSITY = 1100.0


@dataclass(frozen=True)
class Finger:
    """A finger's base (x, y, z), its phalanges' lengths, and whether it can spread."""

    name: str
    base: tuple[float, float, float]
    phalanges: tuple[float, float, float]
    spreads: bool


# Joints' places and lengths are those of the real hand's kinematics, fingers side by side.
FINGERS = (
    Finger("index", (0.017, -0.0265, -0.011), (0.0259, 0.022, 0.0168), True),
    Finger("middle", (0.0178, -0.0083, -0.0118), (0.0285, 0.024, 0.0168), False),
    Finger("ring", (0.0163, 0.0083, -0.0115), (0.0259, 0.022, 0.0168), True),
    Finger("little", (0.0144, 0.0245, -0.0096), (0.0219, 0.019, 0.0168), True),
)
THUMB = Finger("thumb", (-0.0254, -0.0118, -0.0017), (0.026, 0.022, 0.0168), True)
THUMB_AXES = np.array(
    [[0.121132, 0.043736, -0.991672], [-0.958978, 0.263104, -0.105535], [0.256297, 0.963776, 0.073812]]
)
"""Axes (columns) of the thumb's base in the palm's frame: it opposes about its z, from x towards y."""
METACARPAL = (0.021, 0.0056, 0.0)
"""From the thumb's base to its first flexion joint, in the opposed thumb's own axes."""


def palm_frame(side: str) -> Floats:
    """Frame (4, 4) of the palm on ``r_hand`` or ``l_hand``."""
    if side == "r":
        return ICUB.palm.frame
    return transform(rotation_from_rpy((-np.pi / 2, -np.pi / 12, 0.0)), (0.0576543, -0.0055568, 0.0136938))


def add_hand(robot: ET.Element, side: str) -> None:
    """Add the fingers of hand ``side`` ('l' or 'r') to a URDF that has the link ``<side>_hand``."""
    # The left palm's frame is the right one's but for z, which leaves through the back of the hand.
    right = side == "r"
    mirror = np.diag([1.0, 1.0, 1.0 if right else -1.0])
    to_palm = "0 -1 0" if right else "0 1 0"  # turns x towards the side that the palm faces
    to_thumb = "0 1 0" if right else "0 -1 0"
    palm = palm_frame(side)
    for finger in FINGERS:
        base = transform(np.eye(3), mirror @ finger.base)
        _add_finger(robot, side, finger, palm @ base, spread_axis="0 0 1", flex_axis=to_palm)
    # The mirror turns a right-handed frame into a left-handed one: the left thumb's z changes its sign.
    axes = mirror @ THUMB_AXES @ mirror
    base = transform(axes, mirror @ THUMB.base)
    _add_finger(robot, side, THUMB, palm @ base, spread_axis="0 0 1", flex_axis=to_thumb, knuckle=METACARPAL)


def _add_finger(
    robot: ET.Element,
    side: str,
    finger: Finger,
    base: Floats,
    *,
    spread_axis: str,
    flex_axis: str,
    knuckle: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    parent, frame = f"{side}_hand", base
    if finger.spreads:
        name = f"{side}_{finger.name}_{'opposition' if finger is THUMB else 'adduction'}"
        _link(robot, name, knuckle[0], knuckle[1])
        low, high = (0.0, np.pi / 2) if finger is THUMB else (-np.pi / 9, np.pi / 9)
        _joint(robot, name, parent, frame, spread_axis, low, high)
        parent, frame = name, transform(np.eye(3), knuckle)
    for k, length in enumerate(finger.phalanges):
        name = f"{side}_{finger.name}_{('proximal', 'middle', 'distal')[k]}"
        _link(robot, name, length)
        _joint(robot, name, parent, frame, flex_axis, 0.0, np.pi / 2)
        parent, frame = name, transform(np.eye(3), (length, 0.0, 0.0))


def _link(robot: ET.Element, name: str, length: float, aside: float = 0.0) -> None:
    """A capsule along x from the link's origin, ``aside`` along y."""
    link = ET.SubElement(robot, "link", name=name)
    mass = DENSITY * np.pi * RADIUS**2 * max(length, 0.015)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=f"{length / 2} {aside} 0")
    ET.SubElement(inertial, "mass", value=f"{mass:.6f}")
    # A larger inertia than the capsule's own: so light a link on a 20 N m arm makes the solver ring.
    ET.SubElement(inertial, "inertia", ixx="4e-6", ixy="0", ixz="0", iyy="4e-6", iyz="0", izz="4e-6")
    if length < 0.01:
        return
    for kind in ("visual", "collision"):
        part = ET.SubElement(link, kind)
        ET.SubElement(part, "origin", xyz=f"{length / 2} {aside} 0", rpy=f"0 {np.pi / 2} 0")
        geometry = ET.SubElement(part, "geometry")
        if kind == "collision":
            ET.SubElement(geometry, "capsule", radius=f"{RADIUS}", length=f"{length}")
        else:
            # The renderer's own capsule has as many triangles as an arm.
            ET.SubElement(geometry, "mesh", filename=phalanx_file(length))
            material = ET.SubElement(part, "material", name="finger")
            ET.SubElement(material, "color", rgba="0.25 0.26 0.28 1")


def phalanx_file(length: float) -> str:
    """Name of the mesh of a phalanx of this length [m], beside the URDF."""
    return f"phalanx-{length * 1e4:.0f}.obj"


def write_phalanges(folder: Path) -> None:
    """Write the meshes of all phalanges: capsules along z, round their middle."""
    bend = np.linspace(-np.pi / 2, np.pi / 2, 7)[1:-1]
    for length in {METACARPAL[0], *(length for finger in (*FINGERS, THUMB) for length in finger.phalanges)}:
        profile = [
            (RADIUS * np.cos(a), RADIUS * np.sin(a) + np.sign(a) * length / 2) for a in bend if a != 0.0
        ]
        middle = len(profile) // 2
        profile[middle:middle] = [(RADIUS, -length / 2), (RADIUS, length / 2)]
        write_lathe(folder / phalanx_file(length), profile, sides=8)


def _joint(
    robot: ET.Element, name: str, parent: str, frame: Floats, axis: str, low: float, high: float
) -> None:
    joint = ET.SubElement(robot, "joint", name=f"{name}_joint", type="revolute")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=name)
    xyz = " ".join(f"{value:.9f}" for value in frame[:3, 3])
    ET.SubElement(joint, "origin", xyz=xyz, rpy=_rpy(frame[:3, :3]))
    ET.SubElement(joint, "axis", xyz=axis)
    ET.SubElement(joint, "limit", lower=f"{low:.6f}", upper=f"{high:.6f}", effort="0.3", velocity="5")


def _rpy(rotation: Floats) -> str:
    """Roll, pitch, yaw of a rotation, as URDF writes them."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    if abs(np.cos(pitch)) < 1e-9:  # gimbal lock: yaw is free, take none
        roll = np.arctan2(-rotation[1, 2], rotation[1, 1])
        return f"{roll:.9f} {pitch:.9f} 0"
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    return f"{roll:.9f} {pitch:.9f} {yaw:.9f}"
