"""The scene: from one seed always the same, its things apart and upright."""

import numpy as np
import pytest

from motorprime import StateError
from motorprime.sim.cameras import Eyes
from motorprime.sim.glass import Glass
from motorprime.sim.scene import (
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
    folder = scene._folder.name
    scene.close()
    from pathlib import Path

    assert not Path(folder).exists()


def test_the_robot_is_shown_the_glass_alone_and_always_the_same():
    pixels = show_glass(Glass())
    assert pixels.ndim == 2
    assert pixels.shape[1] == 3
    assert len(pixels) > 1000
    assert (pixels[:, 0].astype(int) > 2 * pixels[:, 1]).mean() > 0.95  # red, hardly anything else
    np.testing.assert_array_equal(pixels, show_glass(Glass()))
