"""The composed iCub: its structure, its hands, and the cache that holds it."""

import os
import signal
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from motorprime import MissingExtraError, StateError
from motorprime.kinematics import KinematicTree, apply, invert
from motorprime.sim import icub as composing
from motorprime.sim.hand import FINGERS, THUMB, palm_frame
from motorprime.sim.icub import compose, load_icub

pytestmark = pytest.mark.sim

SIDES = pytest.mark.parametrize("side", ["l", "r"])
DISTAL = {finger.name: finger.phalanges[2] for finger in (*FINGERS, THUMB)}
OUT_OF_PALM = {"r": 1.0, "l": -1.0}  # z of the palm's frame leaves the left hand through its back


def elements(urdf, kind):
    return {element.get("name"): element for element in ET.parse(urdf).getroot().findall(kind)}


def limits(joint):
    limit = joint.find("limit")
    return [float(limit.get("lower")), float(limit.get("upper"))]


def fingertip(robot, side, finger, **angles):
    """Place (3,) [m] of a fingertip in the palm's frame."""
    chain = robot.tree.chain(f"{side}_hand", f"{side}_{finger}_distal")
    pose = chain.forward([angles.get(name.split("_")[2], 0.0) for name in chain.names])
    return apply(invert(palm_frame(side)) @ pose, np.array([[DISTAL[finger], 0.0, 0.0]]))[0]


def test_pybullet_can_take_it(icub):
    links = elements(icub.urdf, "link")
    assert 30 < len(links) < 128
    masses = [float(link.find("inertial/mass").get("value")) for link in links.values()]
    assert min(masses) > 0.0


def test_every_link_hangs_on_the_root_by_one_joint(icub):
    links, joints = elements(icub.urdf, "link"), elements(icub.urdf, "joint")
    children = [joint.find("child").get("link") for joint in joints.values()]
    assert sorted([*children, "root_link"]) == sorted(links)
    for link in links:
        icub.tree.chain("root_link", link)


def test_no_legs(icub):
    legs = ("hip", "leg", "knee", "ankle", "foot")
    assert not [name for name in icub.tree.links if any(part in name for part in legs)]


def test_meshes_lie_beside_the_urdf_and_are_small(icub):
    import trimesh

    names = {mesh.get("filename") for mesh in ET.parse(icub.urdf).getroot().iter("mesh")}
    assert names
    for name in names:
        assert name == Path(name).name
        mesh = trimesh.load(icub.urdf.parent / name)
        assert 0 < len(mesh.faces) <= 400
        assert np.abs(mesh.vertices).max() < 1.0  # metres


@SIDES
def test_a_hand_has_nineteen_joints_of_five_fingers(icub, side):
    names = [name for name in icub.tree.joints if name.startswith(f"{side}_") and name.endswith("_joint")]
    assert len(names) == 19
    for finger, moves in {"thumb": 4, "index": 4, "middle": 3, "ring": 4, "little": 4}.items():
        assert sum(name.startswith(f"{side}_{finger}_") for name in names) == moves
    assert f"{side}_thumb_opposition_joint" in names


def test_the_body_keeps_the_limits_and_origins_of_its_model(icub):
    import icub_models

    model = KinematicTree(icub_models.get_model_file("iCubGazeboV2_5"))
    shared = set(model.joints) & set(icub.tree.joints)
    assert {*icub.torso, *icub.arm, "neck_pitch", "neck_roll", "neck_yaw"} <= shared
    for name in shared:
        ours, theirs = icub.tree.joints[name], model.joints[name]
        assert (ours.parent, ours.child, ours.moves) == (theirs.parent, theirs.child, theirs.moves)
        assert (ours.lower, ours.upper) == (theirs.lower, theirs.upper)
        np.testing.assert_allclose(ours.origin, theirs.origin, atol=1e-12)
        np.testing.assert_allclose(ours.axis, theirs.axis, atol=1e-12)


def test_eyes_tilt_on_a_bar_and_pan_one_by_one(icub):
    joints = icub.tree.joints
    expected = {"eyes_tilt": ("head", "z", -30, 30), "l_eye_pan": ("eyes_bar", "y", -30, 55)}
    expected["r_eye_pan"] = ("eyes_bar", "y", -55, 30)
    for name, (parent, axis, low, high) in expected.items():
        assert joints[name].parent == parent
        np.testing.assert_array_equal(joints[name].axis, np.eye(3)["xyz".index(axis)])
        np.testing.assert_allclose(np.rad2deg([joints[name].lower, joints[name].upper]), [low, high])
    np.testing.assert_allclose(joints["eyes_tilt"].origin[:3, 3], [0, 0.104897, 0.045591])


def test_the_gaze_never_asks_more_than_the_eyes_can_turn(icub):
    version, vergence = icub.ranges["eyes_version"], icub.ranges["eyes_vergence"]
    left = [version[0] + vergence[0] / 2, version[1] + vergence[1] / 2]
    right = [version[0] - vergence[1] / 2, version[1] - vergence[0] / 2]
    for joint, (low, high) in {"l_eye_pan": left, "r_eye_pan": right}.items():
        assert icub.tree.joints[joint].lower <= low + 1e-9
        assert icub.tree.joints[joint].upper >= high - 1e-9


@SIDES
@pytest.mark.parametrize("finger", [finger.name for finger in FINGERS])
@pytest.mark.parametrize("phalanx", ["proximal", "middle", "distal"])
def test_fingers_flex_towards_the_palm_side(icub, side, finger, phalanx):
    straight, bent = (fingertip(icub, side, finger, **{phalanx: angle}) for angle in (0.0, 0.5))
    assert OUT_OF_PALM[side] * (bent - straight)[2] > 0.005
    assert straight[0] > 0.07  # stretched along x
    assert abs((bent - straight)[1]) < 1e-6


@SIDES
def test_the_thumb_opposes_to_the_palm_side_and_curls_to_the_fingers(icub, side):
    straight = fingertip(icub, side, "thumb")
    assert straight[1] < -0.08  # on the index finger's side
    opposed = fingertip(icub, side, "thumb", opposition=0.6)
    assert OUT_OF_PALM[side] * (opposed - straight)[2] > 0.02
    for phalanx in ("proximal", "middle", "distal"):
        curled = fingertip(icub, side, "thumb", **{phalanx: 0.5})
        assert (curled - straight)[0] > 0.005


@pytest.mark.parametrize("finger", list(DISTAL))
def test_the_hands_mirror_each_other(icub, rng, finger):
    names = [n.split("_")[2] for n in icub.tree.chain("r_hand", f"r_{finger}_distal").names]
    for _ in range(5):
        angles = dict(zip(names, rng.uniform(0.0, 1.2, len(names)), strict=True))
        # A spread turns about z, which the mirror leaves alone; it is the same angle on both hands.
        right, left = (fingertip(icub, side, finger, **angles) for side in ("r", "l"))
        np.testing.assert_allclose(left, right * [1, 1, -1], atol=1e-6)


def test_the_palms_mirror_each_other_at_zero(icub):
    poses = {}
    for side in ("l", "r"):
        chain = icub.tree.chain("root_link", f"{side}_hand")
        poses[side] = chain.forward(np.zeros(len(chain.names))) @ palm_frame(side)
    mirror = np.diag([1.0, -1.0, 1.0])
    right, left = poses["r"], poses["l"]
    np.testing.assert_allclose(left[:3, 3], mirror @ right[:3, 3], atol=1e-3)
    np.testing.assert_allclose(left[:3, 0], mirror @ right[:3, 0], atol=1e-5)
    np.testing.assert_allclose(left[:3, 2], -mirror @ right[:3, 2], atol=1e-5)


# The cache.


def stand_in(folder):
    (folder / "icub.urdf").write_text("<robot name='stand-in'/>")


def leftovers(cache):
    return [path.name for path in cache.iterdir() if path.name.startswith(".")]


def test_a_second_call_takes_the_first_one_s_robot(tmp_path, monkeypatch):
    monkeypatch.setattr(composing, "_compose_into", stand_in)
    urdf = compose(tmp_path / "new" / "cache")
    before = urdf.stat()
    monkeypatch.setattr(composing, "_compose_into", lambda folder: pytest.fail("composed twice"))
    again = compose(tmp_path / "new" / "cache")
    assert again == urdf
    assert (again.stat().st_ino, again.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert not leftovers(urdf.parents[1])


@pytest.mark.parametrize("variable", ["/some/where", "", None])
def test_the_cache_is_where_the_desktop_wants_it(tmp_path, monkeypatch, variable):
    monkeypatch.setattr(composing, "_compose_into", stand_in)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.chdir(tmp_path)
    expected = tmp_path / ".cache" / "motorprime"
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if variable is not None:  # an empty one counts as none
        variable = variable and str(tmp_path / "elsewhere")
        monkeypatch.setenv("XDG_CACHE_HOME", variable)
        expected = tmp_path / "elsewhere" / "motorprime" if variable else expected
    assert load_icub().urdf.parents[1] == expected


def test_a_failed_composing_leaves_nothing(tmp_path, monkeypatch):
    def fail(folder):
        stand_in(folder)
        raise RuntimeError("the disk is full")

    monkeypatch.setattr(composing, "_compose_into", fail)
    with pytest.raises(RuntimeError, match="disk is full"):
        compose(tmp_path)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(composing, "_compose_into", stand_in)
    assert compose(tmp_path).exists()


def test_a_killed_composing_is_never_taken_for_a_robot(tmp_path, monkeypatch):
    script = f"""
import os, signal
from pathlib import Path
from motorprime.sim import icub
def killed(folder):
    (folder / "icub.urdf").write_text("<robot")
    os.kill(os.getpid(), signal.SIGKILL)
icub._compose_into = killed
icub.compose(Path({str(tmp_path)!r}))
"""
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -signal.SIGKILL
    assert not list(tmp_path.glob("icub-*"))
    monkeypatch.setattr(composing, "_compose_into", stand_in)
    assert compose(tmp_path).read_text().startswith("<robot name")


def test_half_a_robot_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(composing, "_compose_into", stand_in)
    urdf = compose(tmp_path)
    urdf.unlink()
    (urdf.parent / "head.stl").write_text("half")
    assert compose(tmp_path).exists()
    assert not (urdf.parent / "head.stl").exists()


def test_a_robot_that_lost_a_mesh_is_composed_again(tmp_path, monkeypatch):
    def with_mesh(folder):
        (folder / "icub.urdf").write_text("<robot><link><mesh filename='head.stl'/></link></robot>")
        (folder / "head.stl").write_text("a head")

    monkeypatch.setattr(composing, "_compose_into", with_mesh)
    head = compose(tmp_path).with_name("head.stl")
    head.unlink()
    compose(tmp_path)
    assert head.exists()
    assert not leftovers(tmp_path)


def test_two_processes_share_one_cache(tmp_path, icub):
    command = [sys.executable, "-c", "from motorprime.sim.icub import load_icub; print(load_icub().urdf)"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    runs = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    answers = [run.communicate(timeout=120) for run in runs]
    assert [(run.returncode, err) for run, (_, err) in zip(runs, answers, strict=True)] == [(0, "")] * 2
    assert len({out for out, _ in answers}) == 1
    urdf = Path(answers[0][0].strip())
    assert urdf.read_bytes() == icub.urdf.read_bytes()
    assert {p.name for p in urdf.parent.iterdir()} == {p.name for p in icub.urdf.parent.iterdir()}
    assert not leftovers(urdf.parents[1])


def test_the_name_in_the_cache_changes_with_what_went_into_the_robot():
    assert composing._fingerprint("3.2.0") != composing._fingerprint("3.2.1")
    assert composing._fingerprint("3.2.0") == composing._fingerprint("3.2.0")


def test_without_the_model_the_extra_is_named(monkeypatch, tmp_path):
    def absent(name):
        raise composing.importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(composing.importlib.metadata, "version", absent)
    with pytest.raises(MissingExtraError, match=r"motorprime\[sim\]"):
        compose(tmp_path)


def test_a_cache_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StateError, match=r"cache.*cannot write into .*file"):
        compose(tmp_path / "file" / "cache")
