"""The scene: from one seed always the same, its things apart and upright."""

import numpy as np
import pytest

from motorprime import ArgumentError, StateError
from motorprime.sim.cameras import Eyes
from motorprime.sim.glass import Glass
from motorprime.sim.scene import (
    CANISTER,
    KITCHENWARE,
    SMALL_GLASS,
    TABLE_HEIGHT,
    TABLE_X,
    TABLE_Y,
    Layout,
    Scene,
    draw_layout,
)
from motorprime.sim.showing import show_glass
from motorprime.sim.world import World

pytestmark = pytest.mark.sim

LOOKING_DOWN = {"neck_pitch": -0.6, "eyes_tilt": -0.3}


def layout(seed=5, **options):
    return draw_layout(np.random.default_rng(seed), **options)


@pytest.fixture
def world(icub):
    with World(icub) as world:
        yield world


@pytest.fixture
def scene(world):
    scene = Scene(world, layout())
    yield scene
    scene.close()


def test_the_same_seed_draws_the_same_layout():
    assert layout(7) == layout(7)
    assert layout(7) != layout(8)


@pytest.mark.parametrize("seed", range(40))
def test_things_keep_their_distances(seed):
    drawn = layout(seed, clutter=6)
    x, y = drawn.glass_xy
    assert -0.34 <= x <= -0.22
    assert 0.0 <= y <= 0.20
    assert len({thing.name for thing, _ in drawn.clutter}) == len(drawn.clutter) == 6
    places = np.array([spot for _, spot in drawn.clutter])
    radii = np.array([thing.radius for thing, _ in drawn.clutter])
    assert (places[:, 0] - radii > TABLE_X[0]).all()
    assert (places[:, 0] + radii < TABLE_X[1]).all()
    assert (np.abs(places[:, 1]) + radii < TABLE_Y[1]).all()
    for k in range(6):
        apart = np.linalg.norm(places - places[k], axis=1) - radii - radii[k]
        assert (np.delete(apart, k) >= 0.03).all()
    offsets = places - drawn.glass_xy
    gaps = np.linalg.norm(offsets, axis=1)
    assert (gaps >= drawn.glass.radius + radii + 0.05).all()
    near = offsets[:, 0] > -0.02  # where the eyes look from
    assert (gaps[near] >= 0.24).all()
    beside = offsets[:, 1] > -drawn.glass.radius - radii  # to the right, where the hand comes from
    assert (offsets[beside, 0] <= -0.12).all()


def test_all_kitchenware_always_finds_a_place():
    for seed in range(40, 400):
        assert len(layout(seed, clutter=6).clutter) == 6


def test_no_clutter_is_fine_and_a_layout_without_it_has_none():
    assert layout(clutter=0).clutter == ()


def test_too_much_clutter_is_an_error_that_says_so():
    with pytest.raises(StateError, match="clutter: 60 things do not fit"):
        layout(clutter=60)


def test_no_other_thing_has_the_glass_s_colour():
    # The detector's hue bins are 12 degrees wide; the nearest hue must be some of them away.
    import colorsys

    red = colorsys.rgb_to_hsv(*Glass().rgb)[0]
    for thing in KITCHENWARE:
        hue, saturation, _ = colorsys.rgb_to_hsv(*thing.rgb)
        apart = abs((hue - red + 0.5) % 1.0 - 0.5) * 360.0
        assert apart > 24.0 or saturation < 0.1, thing.name


@pytest.mark.parametrize("glass", [Glass(), SMALL_GLASS], ids=["normal", "small"])
def test_the_glass_stands_upright_where_it_was_drawn(world, glass):
    drawn = layout(glass=glass)
    scene = Scene(world, drawn)
    for _ in range(2):
        centre, axis = scene.glass_pose()
        np.testing.assert_allclose(centre[:2], drawn.glass_xy, atol=1e-3)
        assert centre[2] == pytest.approx(TABLE_HEIGHT + glass.height / 2, abs=1e-3)
        assert axis[2] > np.cos(np.deg2rad(0.5))
        world.step(240)
    scene.close()


def test_everything_stays_on_the_table(world, scene):
    world.step(240)
    for body, (_, spot) in zip(scene.clutter, scene.layout.clutter, strict=True):
        place, turn = world.bullet.getBasePositionAndOrientation(body)
        np.testing.assert_allclose(place[:2], spot, atol=0.01)
        up = np.reshape(world.bullet.getMatrixFromQuaternion(turn), (3, 3))[2, 2]
        assert up > np.cos(np.deg2rad(3.0))


def test_bodies_have_names(world, scene):
    assert scene.name_of(scene.glass) == "glass"
    assert scene.name_of(scene.table) == "table"
    names = [scene.name_of(body) for body in scene.clutter]
    assert names == [thing.name for thing, _ in scene.layout.clutter]
    others = set(range(world.bullet.getNumBodies())) - {scene.glass, scene.table, *scene.clutter}
    assert {scene.name_of(body) for body in others - {world.body}} == {"room"}


def test_the_glass_can_be_taken_away(world, scene):
    body = scene.glass
    scene.remove_glass()
    scene.remove_glass()
    assert scene.glass is None
    with pytest.raises(StateError, match="no glass"):
        scene.glass_pose()
    world.place(LOOKING_DOWN)
    for frame in Eyes(world).capture().values():
        assert not (frame.body == body).any()


# What an experimenter does to a scene.


def free_spot(scene):
    """A place on the table with room all about."""
    others = np.array([scene.layout.glass_xy, *(spot for _, spot in scene.layout.clutter)])
    grid = np.stack(np.meshgrid(np.linspace(-0.55, -0.22, 20), np.linspace(-0.38, 0.38, 40)), -1).reshape(
        -1, 2
    )
    gaps = np.linalg.norm(grid[:, None] - others, axis=2).min(axis=1)
    return tuple(map(float, grid[int(np.argmax(gaps))]))


def test_an_obstacle_stands_upright_on_the_table_where_it_is_put(world, scene):
    spot = free_spot(scene)
    assert scene.obstacle is None
    scene.stand_obstacle(CANISTER, spot)
    assert scene.name_of(scene.obstacle) == "obstacle"
    world.step(240)
    place, turn = world.bullet.getBasePositionAndOrientation(scene.obstacle)
    np.testing.assert_allclose(place, [*spot, TABLE_HEIGHT + CANISTER.height / 2], atol=1e-3)
    assert np.reshape(world.bullet.getMatrixFromQuaternion(turn), (3, 3))[2, 2] > np.cos(np.deg2rad(0.5))
    dynamics = world.bullet.getDynamicsInfo(scene.obstacle, -1)
    assert dynamics[0] == pytest.approx(CANISTER.mass)


def test_an_obstacle_is_seen_in_a_colour_that_nothing_else_has(world, scene):
    world.place(LOOKING_DOWN)
    before = Eyes(world).capture()["left"]
    scene.stand_obstacle(CANISTER, (-0.40, 0.0))
    after = Eyes(world).capture()["left"]
    mask = after.body == scene.obstacle
    assert mask.sum() > 200
    teal = (after.rgb[..., 1].astype(int) > 1.6 * after.rgb[..., 0]) & (after.rgb[..., 2] > after.rgb[..., 1])
    assert teal[mask].mean() > 0.9
    assert teal[~mask].mean() < 0.01
    assert (before.body != scene.obstacle).all()


def test_there_is_one_obstacle_at_a_time_and_it_can_be_taken_away(world, scene):
    spot = free_spot(scene)
    scene.stand_obstacle(CANISTER, spot)
    with pytest.raises(StateError, match="an obstacle already"):
        scene.stand_obstacle(CANISTER, spot)
    body = scene.obstacle
    scene.remove_obstacle()
    scene.remove_obstacle()
    assert scene.obstacle is None
    assert body not in [world.bullet.getBodyUniqueId(k) for k in range(world.bullet.getNumBodies())]
    scene.stand_obstacle(CANISTER, spot)
    assert scene.obstacle is not None


@pytest.mark.parametrize(
    "at", [(-0.15, 0.0), (-0.62, 0.0), (-0.3, 0.45), (-0.3, -0.45), (1.0, 1.0), (np.nan, 0.0)]
)
def test_nothing_is_put_beside_the_table(world, scene, at):
    with pytest.raises(ArgumentError, match="at: "):
        scene.stand_obstacle(CANISTER, at)
    assert scene.obstacle is None
    with pytest.raises(ArgumentError, match="at: "):
        scene.move_glass(at)
    np.testing.assert_allclose(scene.glass_pose()[0][:2], scene.layout.glass_xy, atol=1e-3)
    assert not scene.on_table(np.array(at), 0.03)


def test_on_table_counts_the_whole_foot(scene):
    near = TABLE_X[1] - 0.03
    assert scene.on_table(np.array([near - 1e-6, 0.0]), 0.03)
    assert not scene.on_table(np.array([near + 1e-6, 0.0]), 0.03)
    assert scene.on_table(np.array([-0.3, TABLE_Y[0] + 0.031]), 0.03)
    assert not scene.on_table(np.array([-0.3, TABLE_Y[0] + 0.029]), 0.03)


def test_a_glass_that_is_moved_stands_there_upright_and_at_rest(world, scene):
    spot = free_spot(scene)
    world.bullet.resetBaseVelocity(scene.glass, (0.5, 0.0, 0.0), (3.0, 0.0, 0.0))
    world.step(10)
    scene.move_glass(spot)
    assert np.abs(np.array(world.bullet.getBaseVelocity(scene.glass))).max() == 0.0
    for _ in range(2):
        centre, axis = scene.glass_pose()
        np.testing.assert_allclose(centre, [*spot, TABLE_HEIGHT + scene.layout.glass.height / 2], atol=1e-3)
        assert axis[2] > np.cos(np.deg2rad(0.5))
        world.step(240)


def test_a_glass_that_is_not_there_cannot_be_moved(scene):
    scene.remove_glass()
    with pytest.raises(StateError, match="no glass"):
        scene.move_glass((-0.3, 0.1))
    assert scene.touching_glass() == set()


def test_what_touches_the_glass_is_told_by_name_and_the_robot_is_left_out(world, scene):
    assert scene.touching_glass() == {"table"}
    x, y = scene.layout.glass_xy
    scene.stand_obstacle(CANISTER, (x, y + scene.layout.glass.radius + CANISTER.radius - 0.002))
    world.bullet.performCollisionDetection()
    assert scene.touching_glass() == {"table", "obstacle"}
    scene.remove_obstacle()
    near = (x, y + scene.layout.glass.radius + CANISTER.radius + 0.003)
    scene.stand_obstacle(CANISTER, near)
    world.bullet.performCollisionDetection()
    assert scene.touching_glass() == {"table"}  # 3 mm off is no touch
    palm = world.palm_pose()[:3, 3]
    world.bullet.resetBasePositionAndOrientation(scene.glass, palm.tolist(), (0, 0, 0, 1))
    world.bullet.performCollisionDetection()
    assert scene.glass in world.touching()
    assert scene.touching_glass() == set()


def test_glass_and_robot_rub_as_they_are_said_to_and_nothing_keeps_a_glass_from_rolling(world, scene):
    for body in (scene.glass, scene.table):
        friction = world.bullet.getDynamicsInfo(body, -1)
        assert friction[1] == pytest.approx(0.8)
        assert friction[6] == friction[7] == 0.0  # rolling, spinning
    for link in world.link_index.values():
        friction = world.bullet.getDynamicsInfo(world.body, link)
        assert friction[1] <= 0.8 + 1e-9
        assert friction[6] == friction[7] == 0.0


def picture(icub, drawn):
    with World(icub) as world:
        scene = Scene(world, drawn)
        world.place(LOOKING_DOWN)
        rgb = Eyes(world).capture()["left"].rgb
        scene.close()
    return rgb


def test_the_same_seed_renders_the_same_pixels(icub):
    first = picture(icub, layout(9))
    np.testing.assert_array_equal(first, picture(icub, layout(9)))
    assert (first != picture(icub, layout(10))).mean() > 0.2


def test_another_seed_of_textures_is_another_room(icub):
    drawn = layout(9)
    other = Layout(drawn.glass, drawn.glass_xy, drawn.clutter, drawn.textures + 1)
    assert (picture(icub, drawn) != picture(icub, other)).mean() > 0.2


def test_closing_removes_the_textures_folder(world):
    scene = Scene(world, layout(clutter=0))
    assert scene.folder.is_dir()
    scene.close()
    assert not scene.folder.exists()


def test_the_robot_is_shown_the_glass_alone_and_always_the_same():
    pixels = show_glass(Glass())
    assert pixels.ndim == 2
    assert pixels.shape[1] == 3
    assert len(pixels) > 1000
    assert (pixels[:, 0].astype(int) > 2 * pixels[:, 1]).mean() > 0.95  # red, hardly anything else
    np.testing.assert_array_equal(pixels, show_glass(Glass()))
