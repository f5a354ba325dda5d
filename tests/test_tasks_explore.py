"""The finder: what it remembers, when it reports, and where the windows fall. No simulator is needed."""

import numpy as np
import pytest

from motorprime import Camera, Error, Everywhere, HistogramDetector, PinholeProjection, PosedCamera, Windows
from motorprime.attention import Look
from motorprime.cylinder import Cylinder, outline
from motorprime.landscape import gaussian_landscape
from motorprime.tasks.cycle import Settings
from motorprime.tasks.explore import Finder, Target, everywhere, windows_anywhere, windows_from
from motorprime.tasks.timing import Stages
from motorprime.views import Views
from painted_body import inside
from poseless import Poseless, Shifted

CAMERA = Camera(width=320, height=240, fx=257.34, fy=257.34, cx=160.0, cy=120.0)
GLASS = Cylinder(0.0325, 0.10)
CENTRE = np.array([-0.38, 0.02, -0.12])
RED, GREY, BLUE = (204, 15, 23), (120, 118, 116), (30, 60, 180)
NOWHERE = Windows(np.zeros((0, 2), np.int32), 20)


def posed():
    """Two eyes that look forward (the root's -x) and 20 degrees down, 68 mm apart."""
    c, s = np.cos(np.deg2rad(20.0)), np.sin(np.deg2rad(20.0))
    eyes = {}
    for name, y in (("left", -0.034), ("right", 0.034)):
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([[0.0, 1.0, 0.0], [s, 0.0, -c], [-c, 0.0, -s]])
        pose[:3, 3] = 0.0, y, 0.0
        eyes[name] = PosedCamera(CAMERA, pose)
    return eyes


def views(through=lambda projection: projection):
    return Views(through(PinholeProjection(posed())))


def picture(*shapes):
    """A grey picture with filled polygons (points, colour), later ones in front."""
    image = np.full((240, 320, 3), GREY, np.uint8)
    for points, colour in shapes:
        image[inside(points, image.shape[:2])] = colour
    return image


def rng_of(seed):
    return np.random.default_rng(seed)


def box(u, v, width, height):
    return [(u, v), (u + width, v), (u + width, v + height), (u, v + height)]


def glass_in(name, *others):
    return picture((outline(posed()[name], CENTRE, GLASS), RED), *others)


def pixel_of(name):
    return posed()[name].project(CENTRE[None])[0]


def both():
    return {name: glass_in(name) for name in ("left", "right")}


def at(name, count=1):
    """Windows on the glass."""
    return Windows(np.repeat(np.rint(pixel_of(name)).astype(np.int32)[None], count, axis=0), 20)


@pytest.fixture
def finder():
    target = np.array([RED], np.uint8).repeat(200, axis=0)
    return Finder(Target(GLASS, HistogramDetector(target)))


def test_a_full_scan_finds_the_glass_where_it_is(finder):
    sight = finder.look(both(), views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    np.testing.assert_allclose(sight.located.centre, CENTRE, atol=2e-3)
    assert sight.attended == 1.0


def test_windows_on_the_glass_find_it_and_look_at_little(finder):
    sight = finder.look(both(), views(), {"left": at("left"), "right": at("right")})
    np.testing.assert_allclose(sight.located.centre, CENTRE, atol=2e-3)
    assert 0.0 < sight.attended < 0.4
    assert set(finder.reported) == {"left", "right"}


def test_hits_are_remembered_per_eye_until_the_other_has_it(finder):
    first = finder.look(both(), views(), {"left": at("left"), "right": NOWHERE})
    assert first.located is None
    assert [len(finder.memory.get(name, ())) for name in ("left", "right")] == [1, 0]
    again = finder.look(both(), views(), {"left": NOWHERE, "right": NOWHERE})
    assert again.located is None
    second = finder.look(both(), views(), {"left": NOWHERE, "right": at("right")})
    np.testing.assert_allclose(second.located.centre, CENTRE, atol=2e-3)


def test_a_camera_without_windows_is_not_looked_at(finder):
    sight = finder.look(both(), views(), {"left": at("left")})
    assert sight.located is None
    assert set(sight.searches) == {"left"}


def test_forgetting_forgets_both_eyes(finder):
    finder.look(both(), views(), {"left": at("left"), "right": NOWHERE})
    finder.forget()
    assert not finder.memory
    assert finder.look(both(), views(), {"left": NOWHERE, "right": at("right")}).located is None


def test_seeing_the_same_again_adds_nothing(finder):
    for _ in range(4):
        finder.look(both(), views(), {"left": at("left", 5), "right": at("right", 5)})
    assert [len(finder.memory[name]) for name in ("left", "right")] == [1, 1]


def test_a_region_that_grew_replaces_its_old_self(finder):
    u, v = pixel_of("left")
    hand = (box(u + 3, v - 60, 60, 120), GREY)
    finder.look({**both(), "left": glass_in("left", hand)}, views(), {"left": at("left")})
    (half,) = finder.memory["left"]
    finder.look(both(), views(), {"left": at("left")})
    (whole,) = finder.memory["left"]
    assert whole.area > 1.2 * half.area


def test_pieces_of_a_split_silhouette_count_together(finder):
    images = {}
    for name in ("left", "right"):
        u, v = pixel_of(name)
        images[name] = glass_in(name, (box(u - 60, v - 4, 120, 8), GREY))  # a finger in front
    scan = everywhere({"left": (240, 320), "right": (240, 320)})
    sight = finder.look(images, views(), scan)
    assert [len(finder.memory[name]) for name in ("left", "right")] == [2, 2]
    np.testing.assert_allclose(sight.located.centre, CENTRE, atol=6e-3)
    assert all(finder.reported[name].area > finder.memory[name][0].area for name in finder.reported)


def test_red_in_one_eye_only_reports_nothing(finder):
    images = {"left": glass_in("left"), "right": picture()}
    sight = finder.look(images, views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    assert finder.memory["left"]
    assert sight.located is None


def test_red_that_is_not_shaped_like_the_glass_reports_nothing(finder):
    # The same flat red bar in both pictures, twice as wide as high: no upright glass explains it.
    images = {
        name: picture((box(100 + shift, 100, 90, 22), RED)) for name, shift in (("left", 40), ("right", 0))
    }
    sight = finder.look(images, views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    assert sight.located is None


def test_red_at_unlike_places_reports_nothing(finder):
    # A glass for the left eye, another one above it for the right: the rays do not meet.
    images = {"left": glass_in("left"), "right": picture((box(150, 15, 40, 60), RED))}
    sight = finder.look(images, views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    assert sight.located is None


def test_a_distractor_in_one_eye_does_not_move_the_report(finder):
    small = (box(5, 5, 14, 14), RED)
    images = {"left": glass_in("left", small), "right": glass_in("right")}
    sight = finder.look(images, views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    assert len(finder.memory["left"]) == 2
    np.testing.assert_allclose(sight.located.centre, CENTRE, atol=3e-3)


def test_other_colours_are_no_hits(finder):
    images = {name: picture((outline(posed()[name], CENTRE, GLASS), BLUE)) for name in ("left", "right")}
    sight = finder.look(images, views(), everywhere({"left": (240, 320), "right": (240, 320)}))
    assert sight.located is None
    assert not any(finder.memory.values())


def test_the_images_are_left_alone(finder):
    images = both()
    copies = {name: image.copy() for name, image in images.items()}
    for image in images.values():
        image.flags.writeable = False
    finder.look(images, views(), {"left": at("left"), "right": at("right")})
    for name, image in images.items():
        np.testing.assert_array_equal(image, copies[name])


# A camera that has no landscape of its own.

REACHABLE = np.random.default_rng(5).uniform((-0.5, -0.2, -0.25), (-0.25, 0.2, 0.0), (1000, 3))
KNOWN = pytest.mark.parametrize("through", [lambda known: known, Poseless], ids=["posed", "pixels only"])


@KNOWN
def test_a_hit_in_one_eye_tells_the_other_where_to_look(finder, through):
    """The line goes through the glass, along where the reachable places of that pixel are; nowhere else."""
    seen = views(through)
    finder.look(both(), seen, {"left": at("left"), "right": NOWHERE})
    own = looks(left=(100.0, 80.0))
    completed = finder.complete(own, seen, lambda: REACHABLE)
    assert set(completed) == {"left", "right"} and completed["left"] is own["left"]
    u, v = np.rint(pixel_of("right")).astype(int)
    line = completed["right"].landscape
    assert line[v, u] > 0.5 * line.max()
    assert not line[:20].any() and not line[-20:].any()
    assert not line[:, : u - 120].any()
    sight = finder.look(both(), seen, windows_from({"right": completed["right"]}, 50, 20, rng_of(1)))
    np.testing.assert_allclose(sight.located.centre, CENTRE, atol=2e-3)


@KNOWN
def test_the_line_is_as_deep_as_the_places(finder, through):
    """Nearer places lie farther to the left in the right eye."""
    seen = views(through)
    finder.look(both(), seen, {"left": at("left"), "right": NOWHERE})
    middles = []
    for factor in (0.6, 1.0, 1.6):
        line = finder.complete({}, seen, lambda f=factor: f * REACHABLE)["right"].landscape
        middles.append(np.average(np.arange(320), weights=line.sum(axis=0)))
    assert middles[0] < middles[1] - 10 and middles[1] < middles[2] - 5


def test_there_is_nothing_to_complete_without_a_hit_or_with_a_landscape(finder):
    def never():
        pytest.fail("nobody needs the places")

    assert finder.complete({}, views(), never) == {}
    finder.look(both(), views(), {"left": at("left"), "right": at("right")})
    there = looks(left=(100.0, 80.0), right=(100.0, 80.0))
    assert finder.complete(there, views(), never) == there


@KNOWN
def test_places_that_nobody_sees_make_no_line(finder, through):
    seen = views(through)
    finder.look(both(), seen, {"left": at("left"), "right": NOWHERE})
    assert finder.complete({}, seen, lambda: -REACHABLE) == {}
    assert finder.complete({}, seen, lambda: REACHABLE[:0]) == {}


# A projection that errs.


def test_the_finder_passes_level_and_slack_on(finder):
    """Taken as it is, 3 pixels of disparity are 3 cm of depth; on a table of known height they are not."""
    seen = views(lambda known: Shifted(known, left=(1.5, 1.0), right=(-1.5, -1.0)))
    scan = everywhere(seen.shapes)
    strict, loose, level = (
        Finder(finder.target, **options).look(both(), seen, scan).located
        for options in ({}, {"slack": 2.0}, {"slack": 2.0, "level": CENTRE[2]})
    )
    assert strict.overlap < 0.95 < 0.97 < loose.overlap
    assert np.linalg.norm(loose.centre - CENTRE) > 0.015
    assert level.centre[2] == CENTRE[2]
    assert np.linalg.norm(level.centre - CENTRE) < 6e-3


# Where the windows fall.


def looks(**means):
    return {
        camera: Look(gaussian_landscape(mean, (20.0, 0.0, 20.0), (240, 320)))
        for camera, mean in means.items()
    }


def test_windows_of_the_same_seed_are_the_same():
    there = looks(left=(100.0, 80.0), right=(200.0, 150.0))
    first, again, other = (windows_from(there, 30, 20, np.random.default_rng(seed)) for seed in (4, 4, 5))
    assert set(first) == {"left", "right"}
    for camera in first:
        assert first[camera].centres.shape == (30, 2)
        np.testing.assert_array_equal(first[camera].centres, again[camera].centres)
        assert (first[camera].centres != other[camera].centres).any()


def test_windows_are_fresh_every_time():
    there, generator = looks(left=(100.0, 80.0)), np.random.default_rng(4)
    first, second = (windows_from(there, 30, 20, generator)["left"].centres for _ in range(2))
    assert (first != second).any()


def test_windows_fall_on_the_landscape_only():
    there = looks(left=(100.0, 80.0))
    u, v = windows_from(there, 400, 20, np.random.default_rng(1))["left"].centres.T
    assert (there["left"].landscape[v, u] > 0.0).all()
    assert u.mean() == pytest.approx(100.0, abs=4.0)
    assert v.mean() == pytest.approx(80.0, abs=4.0)


def test_windows_anywhere_cover_the_whole_image():
    shapes = {"left": (24, 32)}
    there = windows_anywhere(shapes, 20000, 20, np.random.default_rng(2))["left"]
    counts = np.zeros((24, 32), int)
    np.add.at(counts, tuple(there.centres.T[::-1]), 1)
    assert counts.min() > 0  # every pixel, the borders too
    assert counts.max() < 3 * counts.mean()


def test_everywhere_is_everywhere():
    assert everywhere({"left": (2, 3), "right": (4, 5)}) == {"left": Everywhere(), "right": Everywhere()}


def test_stages_add_up_by_the_clock_that_is_passed():
    ticks = iter([0.0, 1.0, 10.0, 13.0, 20.0, 20.5])
    stages = Stages(lambda: next(ticks))
    for stage in ("detection", "detection"):
        with stages.time(stage):
            pass
    with pytest.raises(KeyError), stages.time("sampling"):
        raise KeyError
    assert stages.seconds == {"detection": [1.0, 3.0], "sampling": [0.5]}


@pytest.mark.parametrize(
    "wrong",
    [
        {"windows": 0},
        {"windows": 2.5},
        {"size": 0},
        {"patience": 0},
        {"postures": True},
        {"mixing": 1.5},
        {"mixing": float("nan")},
        {"width": 0.0},
        {"slack": -1.0},
        {"slack": float("nan")},
        {"width": float("inf")},
    ],
    ids=str,
)
def test_settings_that_cannot_work_are_refused_by_name(wrong):
    with pytest.raises(Error, match=next(iter(wrong))):
        Settings(**wrong)
