"""The simulated hand's motors, limits and skin, and what it is to hold: checks of the physics itself."""

import numpy as np
import pytest

from motorprime import ArgumentError
from motorprime.sim.glass import (
    DIAMETERS,
    HEIGHTS,
    MASSES,
    Glass,
    StandingGlass,
    add_table,
    draw_glass,
)
from motorprime.sim.world import FRICTION, World, pybullet

pytestmark = pytest.mark.sim

FINGER_TORQUE, ARM_TORQUE = 0.3, 20.0
TOP = -0.06


@pytest.fixture(scope="module")
def a_world(icub):
    with World(icub) as world:
        yield world


@pytest.fixture
def world(a_world):
    """The robot parked, its right hand flat."""
    a_world.place({**dict.fromkeys(a_world.robot.arm, 0.0), **dict.fromkeys(a_world.robot.hand.motors, 0.0)})
    return a_world


def finger_joints(robot):
    motors = set(robot.hand.motors)
    return [joint for joint, terms in robot.couplings.items() if set(terms) & motors]


@pytest.fixture
def standing(world, tmp_path):
    table = add_table(world, TOP, (-0.62, -0.15), (-0.45, 0.45))
    glass = StandingGlass(world, Glass(mass=0.2), (-0.4, -0.2), TOP, tmp_path / "glass.obj")
    yield glass
    for body in (table, glass.body):
        world.bullet.removeBody(body)


def test_the_nine_motors_go_where_they_are_told_and_say_where_they_are(world):
    hand = world.robot.hand
    for name in hand.shapes:
        world.command(hand.shape(name))
        world.step(150)
        np.testing.assert_allclose(world.read(hand.motors), list(hand.shape(name).values()), atol=0.01)


def test_a_motor_of_two_joints_bends_both_alike(world):
    world.command({"r_index_distal": 1.0})
    world.step(200)
    assert world.angle("r_index_middle_joint") == pytest.approx(0.5, abs=0.01)
    assert world.angle("r_index_distal_joint") == pytest.approx(0.5, abs=0.01)
    assert world.angle("r_index_proximal_joint") == pytest.approx(0.0, abs=0.01)


def test_no_finger_is_stronger_than_0_3_nm_and_no_arm_joint_than_20(world):
    robot = world.robot
    assert {world.effort(joint) for joint in finger_joints(robot)} == {FINGER_TORQUE}
    assert max(world.effort(joint) for joint in robot.arm) <= ARM_TORQUE


def push(world, link, force):
    """A force (3,) [N] on a link's origin, until the next step."""
    place = world.link_pose(link)[:3, 3]
    index = world.link_index[link]
    world.bullet.applyExternalForce(world.body, index, list(force), list(place), pybullet.WORLD_FRAME)


def test_a_motor_yields_to_more_than_its_torque_and_applies_no_more(world):
    """20 N on a lever of 26 mm are 0.52 N m."""
    joint, peak = "r_index_proximal_joint", 0.0
    world.command(dict.fromkeys(world.robot.hand.motors, 0.0))
    for _ in range(120):
        push(world, "r_index_middle", 20.0 * world.palm_pose()[:3, 2])
        world.step()
        peak = max(peak, abs(world.torque(joint)))
    assert peak == pytest.approx(FINGER_TORQUE, abs=1e-6)
    assert world.angle(joint) > 1.0


def test_a_joint_pressed_against_its_limit_stays_there(world):
    """A force on the far end of the thumb bends it back; what its motor lacks, the stop gives."""
    joint = "r_thumb_proximal_joint"
    world.place(world.robot.hand.shape("open"))
    world.command(world.robot.hand.shape("open"))
    world.step(30)
    for _ in range(60):
        push(world, "r_thumb_distal", -25.0 * world.palm_pose()[:3, 0])
        world.step()
    assert world.angle(joint) == pytest.approx(0.0, abs=np.deg2rad(0.5))


def test_every_surface_rubs_as_it_may_and_nothing_resists_rolling(world, standing):
    bodies = [(world.body, link) for link in world.link_index.values()] + [(standing.body, -1)]
    for body, link in bodies:
        dynamics = world.bullet.getDynamicsInfo(body, link)
        assert (dynamics[1], dynamics[6], dynamics[7]) == (FRICTION, 0.0, 0.0)
    assert FRICTION <= 0.8


def test_the_fingers_have_the_inertia_that_the_urdf_says(world):
    dynamics = world.bullet.getDynamicsInfo(world.body, world.link_index["r_index_distal"])
    np.testing.assert_allclose(dynamics[2], 4e-6)


def test_a_glass_stands_still_and_upright_on_its_table(world, standing):
    start = standing.pose()[0]
    world.step(240)
    np.testing.assert_allclose(standing.pose()[0], start, atol=1e-3)
    assert standing.tilt() < 1e-3
    assert standing.clearance() == pytest.approx(0.0, abs=1e-3)
    assert world.bullet.getDynamicsInfo(standing.body, -1)[0] == 0.2


def test_a_tilted_glass_s_lowest_point_is_its_rim(world, standing):
    angle, glass = 0.5, standing.glass
    place = (-0.4, -0.2, TOP + 0.2)
    world.bullet.resetBasePositionAndOrientation(
        standing.body, place, (np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2))
    )
    assert standing.tilt() == pytest.approx(angle)
    rim = 0.2 - np.cos(angle) * glass.height / 2 - np.sin(angle) * glass.radius
    assert standing.clearance() == pytest.approx(rim)


def test_contacts_name_link_place_force_and_side(world, standing):
    """A glass dropped on the head: what presses it comes from below, and rubs no more than friction can."""
    assert world.contacts(standing.body) == []
    x, y, z = world.link_pose("head")[:3, 3]
    world.put(standing.body, (x, y, z + 0.3))
    pressed = []
    for _ in range(120):
        world.step()
        pressed += [contact for contact in world.contacts(standing.body) if contact.pressure > 0.0]
    assert pressed
    for contact in pressed:
        assert contact.link in world.link_index
        assert np.linalg.norm(contact.normal) == pytest.approx(1.0, abs=1e-6)
        assert contact.normal[2] < 0.0
        assert np.linalg.norm(contact.place - (x, y, z)) < 0.4
        # pybullet limits either direction along the surface by itself
        assert contact.friction <= np.sqrt(2.0) * FRICTION**2 * contact.pressure + 1e-6
        assert contact.depth > -0.002


def test_a_contact_s_depth_is_how_far_the_two_are_inside_each_other(world, standing):
    """Centred on the palm's, which is some centimetres across, the glass is deep inside it."""
    x, y, z = world.link_pose("r_hand")[:3, 3]
    world.put(standing.body, (x, y, z))
    world.bullet.performCollisionDetection()
    depths = [contact.depth for contact in world.contacts(standing.body) if contact.link == "r_hand"]
    assert max(depths) > 0.01


def test_glasses_are_drawn_within_their_limits_and_all_over_them():
    drawn = [draw_glass(seed) for seed in range(300)]
    for values, (low, high) in (
        ([glass.mass for glass in drawn], MASSES),
        ([2 * glass.radius for glass in drawn], DIAMETERS),
        ([glass.height for glass in drawn], HEIGHTS),
    ):
        span = high - low
        assert low <= min(values) < low + 0.05 * span
        assert high - 0.05 * span < max(values) <= high
    assert (MASSES, DIAMETERS) == ((0.080, 0.300), (0.060, 0.075))
    assert draw_glass(7) == draw_glass(7) != draw_glass(8)


@pytest.mark.parametrize("name", ["radius", "height", "mass"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_glass_without_size_or_mass_is_named(name, value):
    with pytest.raises(ArgumentError, match=name):
        Glass(**{name: value})
