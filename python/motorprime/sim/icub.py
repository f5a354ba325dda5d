"""Compose an iCub that pybullet can load: the body of icub-models, with eyes and five-fingered hands.

The body comes from the PyPI package icub-models (iCubGazeboV2_5, CC BY-SA 4.0), which has neither eyes nor
fingers and some 170 massless sensor frames. The composed robot drops those frames and the legs, which no
eye sees, cuts the mitten off the hand's mesh, and adds the eyes' joints and 19 finger joints a hand. Meshes
are simplified once. The result is cached on disk under a name that changes with its ingredients.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import shutil
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from ..errors import MissingExtraError, StateError
from ..kinematics import apply, invert, rotation_from_rpy, transform
from ..robot import ICUB, Robot
from .hand import add_hand, palm_frame, write_phalanges

MODEL = "iCubGazeboV2_5"
FACES = 220  # per mesh: rendering time grows with it, the silhouette hardly changes above
PALM_ENDS_X, PALM_ENDS_Y = 0.020, -0.036  # where fingers and thumb of the mitten begin, palm frame [m]

# Eyes of the iCub's gaze chain: origin in the head, then each eye's pan on the tilting bar.
_TILT = ("0 0.104897 0.045591", "-2.356187 1.570796 0.785406")
_PAN = {"l_eye": ("0 0 -0.034", -30.0, 55.0), "r_eye": ("0 0 0.034", -55.0, 30.0)}


def load_icub(cache: Path | None = None) -> Robot:
    """The iCub with its composed URDF.

    Args:
        cache: folder for the composed model; default ``$XDG_CACHE_HOME/motorprime`` or ~/.cache/motorprime.

    Raises:
        MissingExtraError: icub-models or the mesh tools are not installed.
        StateError: the cache cannot be written.
    """
    return ICUB.with_urdf(compose(cache))


def compose(cache: Path | None = None) -> Path:
    """Path of the composed ``icub.urdf``; composes it when the cache does not hold it yet."""
    try:
        version = importlib.metadata.version("icub-models")
    except importlib.metadata.PackageNotFoundError:
        raise MissingExtraError("the simulated iCub", "sim") from None
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "motorprime"
    folder = (cache or base) / f"icub-{_fingerprint(version)}"
    if not _complete(folder):
        try:
            _compose_aside(folder)
        except OSError as error:
            raise StateError(f"cache: cannot write into {folder.parent}: {error.strerror}") from None
    return folder / "icub.urdf"


def _complete(folder: Path) -> bool:
    """Whether the URDF is there with all its meshes: something may have tidied the cache."""
    try:
        robot = ET.parse(folder / "icub.urdf")
    except (OSError, ET.ParseError):
        return False
    return all((folder / mesh.get("filename", "")).is_file() for mesh in robot.iter("mesh"))


def _compose_aside(folder: Path) -> None:
    """Compose beside ``folder`` and rename, so that a killed or a parallel run never leaves half a robot."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".composing-") as aside:
        built = Path(aside) / "model"
        built.mkdir()
        try:
            _compose_into(built)
        except ImportError as error:
            raise MissingExtraError(f"the simulated iCub ({error.name})", "sim") from None
        try:
            built.rename(folder)
        except OSError:
            if not _complete(folder):
                shutil.rmtree(folder, ignore_errors=True)
                built.rename(folder)


def _fingerprint(version: str) -> str:
    here = Path(__file__).parent
    # robot.py has the palm's frame, which the fingers stand on.
    names = ("icub.py", "hand.py", "meshes.py", "../robot.py", "../kinematics.py")
    sources = [here / name for name in names]
    text = version.encode() + b"".join(source.read_bytes() for source in sources)
    return hashlib.sha256(text).hexdigest()[:12]


def _compose_into(folder: Path) -> None:
    import icub_models

    model = Path(str(icub_models.get_model_file(MODEL)))
    meshes = model.parents[2] / "meshes"
    source = ET.parse(model).getroot()
    robot = ET.Element("robot", name="icub")
    links = {link.get("name", ""): link for link in source.findall("link")}
    joints = source.findall("joint")

    kept = _links_to_keep(links, joints)
    for name in kept:
        robot.append(_link(links[name], meshes, folder))
    for joint in joints:
        if _child(joint) in kept:
            _limit_effort(joint)
            robot.append(joint)

    _add_eyes(robot)
    write_phalanges(folder)
    for side in ("l", "r"):
        add_hand(robot, side)
    ET.indent(robot)
    ET.ElementTree(robot).write(folder / "icub.urdf")


def _child(joint: ET.Element) -> str:
    element = joint.find("child")
    return "" if element is None else element.get("link", "")


def _links_to_keep(links: dict[str, ET.Element], joints: list[ET.Element]) -> list[str]:
    """Links with mass, from the root link up; the legs are left out."""
    legs = ("_hip_", "_upper_leg", "_lower_leg", "_ankle_", "_foot")
    massive = [name for name, link in links.items() if link.find("inertial") is not None]
    return [name for name in massive if not any(part in name for part in legs)]


def _limit_effort(joint: ET.Element) -> None:
    # The model says 50,000 N m for every upper joint; these are round figures for the real motors.
    limit = joint.find("limit")
    if limit is not None:
        strong = joint.get("name", "").startswith("torso")
        limit.set("effort", "60" if strong else "20")
        limit.set("velocity", "2.0")


def _link(link: ET.Element, meshes: Path, folder: Path) -> ET.Element:
    """A copy of ``link`` whose meshes are simplified files in ``folder``; its collision is their hull."""
    copy = ET.Element("link", name=link.get("name", ""))
    inertial = link.find("inertial")
    if inertial is not None:
        copy.append(inertial)
    visual = link.find("visual")
    if visual is None:
        return copy
    mesh = next(visual.iter("mesh"))
    source = meshes / mesh.get("filename", "").split("/meshes/")[1]
    scale = float(mesh.get("scale", "1 1 1").split()[0])
    origin = visual.find("origin")
    name = f"{link.get('name')}.stl"
    _simplify(source, scale, origin, folder / name, palm=link.get("name", "").endswith("_hand"))
    for kind in ("visual", "collision"):
        part = ET.SubElement(copy, kind)
        ET.SubElement(ET.SubElement(part, "geometry"), "mesh", filename=name)
        if kind == "visual":
            material = ET.SubElement(part, "material", name="shell")
            ET.SubElement(material, "color", rgba="0.88 0.88 0.90 1")
    return copy


def _simplify(source: Path, scale: float, origin: ET.Element | None, target: Path, *, palm: bool) -> None:
    import fast_simplification
    import trimesh

    mesh = trimesh.load(source)
    mesh.merge_vertices()
    points = np.asarray(mesh.vertices) * scale
    if origin is not None:
        rpy, xyz = (
            np.array([float(word) for word in origin.get(key, "0 0 0").split()]) for key in ("rpy", "xyz")
        )
        points = apply(transform(rotation_from_rpy(rpy), xyz), points)
    faces = np.asarray(mesh.faces)
    if palm:
        inside = apply(invert(palm_frame(target.name[0])), points)
        kept = (inside[:, 0] < PALM_ENDS_X) & (inside[:, 1] > PALM_ENDS_Y)
        cut = trimesh.Trimesh(points[kept]).convex_hull
        points, faces = np.asarray(cut.vertices), np.asarray(cut.faces)
    if len(faces) > FACES:
        points, faces = fast_simplification.simplify(
            points.astype(np.float32), faces.astype(np.int32), target_count=FACES
        )
    trimesh.Trimesh(points, faces).export(target)


def _add_eyes(robot: ET.Element) -> None:
    _massive_link(robot, "eyes_bar")
    _revolute(robot, "eyes_tilt", "head", "eyes_bar", *_TILT, "0 0 1", -30.0, 30.0)
    for eye, (place, low, high) in _PAN.items():
        _massive_link(robot, eye)
        _revolute(robot, f"{eye}_pan", "eyes_bar", eye, place, f"0 {-np.pi / 2} 0", "0 1 0", low, high)


def _massive_link(robot: ET.Element, name: str) -> None:
    inertial = ET.SubElement(ET.SubElement(robot, "link", name=name), "inertial")
    ET.SubElement(inertial, "mass", value="0.05")
    ET.SubElement(inertial, "inertia", ixx="1e-4", ixy="0", ixz="0", iyy="1e-4", iyz="0", izz="1e-4")


def _revolute(
    robot: ET.Element,
    name: str,
    parent: str,
    child: str,
    xyz: str,
    rpy: str,
    axis: str,
    low: float,
    high: float,
) -> None:
    joint = ET.SubElement(robot, "joint", name=name, type="revolute")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    ET.SubElement(joint, "axis", xyz=axis)
    low, high = np.deg2rad(low), np.deg2rad(high)
    ET.SubElement(joint, "limit", lower=f"{low:.9f}", upper=f"{high:.9f}", effort="5", velocity="6")
