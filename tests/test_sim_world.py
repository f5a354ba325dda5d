"""The physics world: its poses are the library's kinematics, its motors move, nothing is teleported."""

import numpy as np
import pytest

from motorprime import ArgumentError, KinematicProjection, StateError
from motorprime.sim import world as world_module
from motorprime.sim.world import STEP, World

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module")
def world(icub):
    with World(icub) as world:
        yield world


@pytest.fixture
def fresh(icub):
    with World(icub) as world:
        yield world


def angle_between(first, second):
    """Angle [rad] of the rotation between two (3, 3); accurate near zero."""
    return 2.0 * np.arcsin(np.linalg.norm(first - second) / np.sqrt(8.0))


def strike_everywhere(world, generator):
    """Every joint of the robot anywhere within its limits."""
    robot = world.robot
    variables = {*robot.gaze, *robot.arm}
    names = tuple(sorted(variables))
    limits = robot.limits(names)
    world.place(dict(zip(names, generator.uniform(limits[:, 0], limits[:, 1]), strict=True)))


def at_zero(world):
    world.place(dict.fromkeys(world.joint_index, 0.0))


def test_eyes_and_hand_at_zero_are_where_the_icub_s_are(world):
    at_zero(world)
    left, right, hand = (world.link_pose(name) for name in ("l_eye", "r_eye", "r_hand"))
    np.testing.assert_allclose(left[:3, 3], [-0.0564, -0.0340, 0.3469], atol=1e-4)
    np.testing.assert_allclose(right[:3, 3], [-0.0564, 0.0340, 0.3469], atol=1e-4)
    np.testing.assert_allclose(hand[:3, 3], [-0.0106, 0.0899, -0.1266], atol=1e-4)
    # x right, y down, z forward; the root's x points backwards, y right, z up.
    ahead = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    for eye in (left, right):
        assert angle_between(eye[:3, :3], ahead) < np.deg2rad(0.01)
    # By the model's own chain: turned by 15 degrees about the root's y.
    c, s = np.cos(np.pi / 12), np.sin(np.pi / 12)
    assert angle_between(hand[:3, :3], np.array([[-s, 0, -c], [0, 1, 0], [c, 0, -s]])) < np.deg2rad(0.01)


def test_the_baseline_is_68_mm_in_every_posture(world, rng):
    for _ in range(5):
        strike_everywhere(world, rng)
        gap = world.link_pose("l_eye")[:3, 3] - world.link_pose("r_eye")[:3, 3]
        assert np.linalg.norm(gap) == pytest.approx(0.068, abs=1e-5)


def test_physics_and_kinematics_agree_in_random_postures(world, icub, rng):
    projection = KinematicProjection(icub)
    for _ in range(25):
        strike_everywhere(world, rng)
        for name, view in projection.posed(world.gaze()).items():
            np.testing.assert_allclose(world.link_pose(icub.cameras[name].link), view.pose, atol=1e-5)
        hand = icub.reach_chain.forward(world.read(icub.reach_chain.names))
        np.testing.assert_allclose(world.link_pose("r_hand"), hand, atol=1e-5)
        np.testing.assert_allclose(world.palm_pose(), hand @ icub.palm.frame, atol=1e-5)


def test_finger_links_agree_too(world, icub, rng):
    for side in ("l", "r"):
        for finger in ("thumb", "index", "middle", "ring", "little"):
            chain = icub.tree.chain("root_link", f"{side}_{finger}_distal")
            angles = rng.uniform(chain.limits[:, 0], chain.limits[:, 1])
            world.place(dict(zip(chain.names, angles, strict=True)))
            np.testing.assert_allclose(
                world.link_pose(f"{side}_{finger}_distal"), chain.forward(angles), atol=1e-5
            )


def test_the_root_frame_is_the_world_s(world):
    np.testing.assert_allclose(world.link_pose("root_link"), np.eye(4), atol=1e-9)


def test_version_and_vergence_become_pans_and_come_back(world):
    world.place({"eyes_version": 0.2, "eyes_vergence": 0.3})
    assert world.angle("l_eye_pan") == pytest.approx(0.35)
    assert world.angle("r_eye_pan") == pytest.approx(0.05)
    np.testing.assert_allclose(world.read(("eyes_vergence", "eyes_version")), [0.3, 0.2], atol=1e-12)


def test_vergence_crosses_the_eyes(world):
    at_zero(world)
    world.place({"eyes_version": 0.0, "eyes_vergence": np.deg2rad(20.0)})
    left, right = world.link_pose("l_eye"), world.link_pose("r_eye")
    meeting = 0.034 / np.tan(np.deg2rad(10.0))
    for eye in (left, right):
        np.testing.assert_allclose(
            eye[:3, 3] + eye[:3, 2] * np.hypot(meeting, 0.034), left[:3, 3] + [-meeting, 0.034, 0], atol=1e-4
        )


def test_unknown_variables_are_named(world):
    with pytest.raises(ArgumentError, match="no_such_joint"):
        world.place({"no_such_joint": 0.0})
    with pytest.raises(ArgumentError, match="no_such_joint"):
        world.command({"no_such_joint": 0.0})
    with pytest.raises(ArgumentError, match="no_such_joint"):
        world.read(["no_such_joint"])


def test_a_command_moves_by_motors_not_at_once(fresh):
    start = fresh.angle("neck_pitch")
    fresh.command({"neck_pitch": start + 0.3})
    assert fresh.angle("neck_pitch") == start
    fresh.step()
    assert abs(fresh.angle("neck_pitch") - start) < 0.05
    fresh.step(240)
    assert fresh.angle("neck_pitch") == pytest.approx(start + 0.3, abs=0.01)
    assert fresh.time == pytest.approx(241 * STEP)


def test_held_joints_stay_against_gravity(fresh):
    names = tuple(fresh.joint_index)
    before = fresh.read(names)
    fresh.step(240)
    np.testing.assert_allclose(fresh.read(names), before, atol=0.01)


def test_a_parked_robot_stays_within_its_limits(fresh, icub):
    for name in fresh.joint_index:
        joint = icub.tree.joints[name]
        assert joint.lower - 1e-9 <= fresh.angle(name) <= joint.upper + 1e-9


def test_the_robot_does_not_collide_with_itself_at_rest(fresh):
    fresh.step(24)
    assert fresh.touching() == set()


def test_hidden_links_come_back_also_after_an_error(fresh):
    def colours():
        return [shape[7] for shape in fresh.bullet.getVisualShapeData(fresh.body)]

    before = colours()
    with fresh.hidden(["head"]):
        assert sum(a != b for a, b in zip(colours(), before, strict=True)) == 1
    assert colours() == before
    with pytest.raises(RuntimeError, match="stop"), fresh.hidden(["head"]):
        raise RuntimeError("stop")
    assert colours() == before


def test_the_same_commands_give_the_same_motion(icub):
    ends = []
    for _ in range(2):
        with World(icub) as world:
            world.command({"torso_yaw": 0.2, "r_shoulder_pitch": -0.6, "r_elbow": 1.2})
            world.step(100)
            ends.append(world.read(tuple(world.joint_index)))
    np.testing.assert_array_equal(*ends)


def test_closing_twice_is_no_error_and_frees_the_client(icub):
    world = World(icub)
    world.close()
    world.close()
    assert not world.bullet.isConnected()


def test_a_robot_that_has_gone_is_named_and_leaves_no_client(icub, tmp_path, capfd, monkeypatch):
    client = world_module.connect()
    monkeypatch.setattr(world_module, "connect", lambda gui: client)
    with pytest.raises(StateError, match=r"robot: pybullet cannot load .*gone\.urdf"):
        World(icub.with_urdf(tmp_path / "gone.urdf"))
    assert capfd.readouterr().out == ""
    assert not client.isConnected()


def test_two_worlds_do_not_share_anything(world, fresh):
    world.place({"neck_yaw": 0.4})
    fresh.place({"neck_yaw": -0.4})
    assert world.angle("neck_yaw") == pytest.approx(0.4)


def test_pybullet_keeps_silent(icub, capfd):
    with World(icub):
        pass
    world_module.connect().disconnect()
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")
