"""Robots that do not match their models: errors drawn at random, and URDF files that have them built in."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np

from ._arrays import Floats, fixed, generator
from .camera import Camera
from .errors import ArgumentError
from .kinematics import rpy_from_rotation
from .projection.calibration import Calibration, corrected_joints
from .projection.corrected import mounting_pose
from .robot import CameraMount, Robot


def perturb(
    robot: Robot,
    seed: int | np.random.Generator | None,
    folder: str | Path,
    *,
    offsets: float = float(np.deg2rad(3.0)),
    links: float = 0.005,
    focal: float = 0.03,
    distortion: float = 0.1,
    mounting: float = 0.0,
    arm: bool = False,
) -> Robot:
    """A robot as it may be in truth when ``robot`` is its model: :func:`draw_errors`, then :func:`build`."""
    errors = draw_errors(
        robot, seed, offsets=offsets, links=links, focal=focal, distortion=distortion, mounting=mounting,
        arm=arm,
    )  # fmt: skip
    return build(robot, errors, folder)


def draw_errors(
    robot: Robot,
    seed: int | np.random.Generator | None,
    *,
    offsets: float = float(np.deg2rad(3.0)),
    links: float = 0.005,
    focal: float = 0.03,
    distortion: float = 0.1,
    mounting: float = 0.0,
    arm: bool = False,
) -> Calibration:
    """Errors of a robot's model, every number uniform between minus and plus its bound.

    Args:
        robot: with its URDF.
        seed: for the draw.
        offsets: bound [rad] of each gaze variable's offset.
        links: bound [m] of each coordinate of the moving joints' origins, from the root to the cameras.
        focal: relative bound of each camera's focal length; fx and fy change alike.
        distortion: bound of k1; that of k2 is half of it, that of p1 and p2 a fiftieth.
        mounting: bound [rad] of the components of each camera's rotation on its link.
        arm: whether the arm has offsets and wrong links too. Without, it draws the same for the rest.

    Raises:
        ArgumentError: a bound that is negative or not finite, or a focal bound of 1 and more.
    """
    bounds = {
        "offsets": offsets, "links": links, "focal": focal, "distortion": distortion, "mounting": mounting,
    }  # fmt: skip
    for name, value in bounds.items():
        if float(fixed(name, value, ())) < 0.0:
            raise ArgumentError(f"{name}: expected a bound >= 0, got {value}")
    if focal >= 1.0:
        raise ArgumentError(f"focal: expected a relative bound < 1, got {focal}")
    rng = generator(seed)
    moving = [joint.name for joint in corrected_joints(robot) if joint.moves]
    own = [name for name in moving if name not in robot.arm_chain.names]
    turns = {name: float(rng.uniform(-offsets, offsets)) for name in robot.gaze}
    shifts = {name: rng.uniform(-links, links, 3) for name in own}
    cameras = {name: _wrong(mount.camera, focal, distortion, rng) for name, mount in robot.cameras.items()}
    mountings = {name: np.append(rng.uniform(-mounting, mounting, 3), np.zeros(3)) for name in robot.cameras}
    if arm:
        turns |= {name: float(rng.uniform(-offsets, offsets)) for name in robot.arm}
        shifts |= {name: rng.uniform(-links, links, 3) for name in moving if name not in own}
    return Calibration(robot.name, turns, shifts, mountings if mounting else {}, cameras)


def build(robot: Robot, calibration: Calibration, folder: str | Path) -> Robot:
    """The robot with a calibration built into its URDF, for programs that know no calibrations.

    Offsets turn the joints' origins about their axes, so that the same encoder values mean another pose;
    joint limits stay those of the encoders. A camera with a mounting gets a link of its own. Meshes are
    referred to where they are.

    Args:
        robot: with its URDF, which is not changed.
        calibration: of this robot.
        folder: an existing folder for the new file, ``<name of the URDF>``.

    Raises:
        ArgumentError: another robot's calibration, a file that cannot be written, or the URDF's own folder.
    """
    calibration.check(robot)
    source, folder = robot.tree.path, Path(folder)
    target = folder / source.name
    if target.exists() and target.samefile(source):
        raise ArgumentError(f"folder: {folder} holds the URDF of robot '{robot.name}' itself")
    root = copy.deepcopy(ET.parse(source).getroot())
    elements = {element.get("name", ""): element for element in root.findall("joint")}
    turns = _joint_offsets(robot, calibration)
    for joint in corrected_joints(robot):
        origin = joint.origin.copy()
        origin[:3, 3] += calibration.links.get(joint.name, 0.0)
        if joint.moves:
            origin = origin @ joint.turn(np.array(turns.get(joint.name, 0.0)))
        _set_origin(elements[joint.name], origin)
    mounts = {}
    for name, mount in robot.cameras.items():
        link = mount.link
        if name in calibration.mountings:
            link = _add_camera_link(root, name, mount.link, calibration.mountings[name])
        mounts[name] = CameraMount(link, calibration.camera(robot, name))
    for mesh in root.iter("mesh"):
        filename = mesh.get("filename", "")
        if "://" not in filename:
            mesh.set("filename", str((source.parent / filename).resolve()))
    try:
        ET.ElementTree(root).write(target)
    except OSError as error:
        raise ArgumentError(f"folder: cannot write {target}: {error.strerror}") from None
    return replace(robot, cameras=mounts, urdf=target)


def _wrong(camera: Camera, focal: float, distortion: float, rng: np.random.Generator) -> Camera:
    factor = 1.0 + rng.uniform(-focal, focal)
    bounds = distortion * np.array([1.0, 0.5, 0.02, 0.02])
    change = rng.uniform(-bounds, bounds)
    own = np.zeros(max(4, len(camera.distortion)))
    own[: len(camera.distortion)] = camera.distortion
    own[:4] += change
    bent = tuple(own.tolist()) if own.any() else ()
    return replace(camera, fx=camera.fx * factor, fy=camera.fy * factor, distortion=bent)


def _joint_offsets(robot: Robot, calibration: Calibration) -> dict[str, float]:
    """Offsets [rad] of the URDF's joints: couplings resolved."""
    gaze = np.array([calibration.offsets.get(name, 0.0) for name in robot.gaze])
    offsets = {name: calibration.offsets.get(name, 0.0) for name in robot.arm}
    for chain in (*robot.camera_chains.values(), robot.chest_chain):
        offsets |= dict(zip(chain.names, robot.urdf_angles(chain.names, gaze).tolist(), strict=True))
    return offsets


def _set_origin(joint: ET.Element, origin: Floats) -> None:
    element = joint.find("origin")
    if element is None:
        element = ET.SubElement(joint, "origin")
    element.set("xyz", _words(origin[:3, 3]))
    element.set("rpy", _words(rpy_from_rotation(origin[:3, :3])))


def _words(values: Floats) -> str:
    return " ".join(repr(value) for value in values.tolist())


def _add_camera_link(root: ET.Element, camera: str, link: str, mounting: Floats) -> str:
    """A link for a camera that is not mounted as its link says; light, since some programs refuse no mass."""
    name = f"{link}_{camera}_camera"
    inertial = ET.SubElement(ET.SubElement(root, "link", name=name), "inertial")
    ET.SubElement(inertial, "mass", value="1e-6")
    ET.SubElement(inertial, "inertia", ixx="1e-9", ixy="0", ixz="0", iyy="1e-9", iyz="0", izz="1e-9")
    joint = ET.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=link)
    ET.SubElement(joint, "child", link=name)
    _set_origin(joint, mounting_pose(mounting))
    return name
