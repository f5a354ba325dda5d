"""The cycle of attention: looks, windows and masks; the use that the README shows."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import Attention, Detections, Detector, Everywhere, Look, PinholeProjection, Windows
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from motorprime.peripersonal import ProjectedGaussian, ReachCloud
from reference import gaussian_landscape as reference_gaussian

SHAPE = (240, 320)
LEFT = np.array([[250.0, 0, 160, 0], [0, 250.0, 120, 0], [0, 0, 1, 0]])
RIGHT = LEFT.copy()
RIGHT[0, 3] = -250.0 * 0.07  # its centre is 7 cm further right
PROJECTION = PinholeProjection({"left": LEFT, "right": RIGHT}, SHAPE)
PATH = np.column_stack([np.linspace(-0.08, 0.08, 20), np.full(20, 0.03), np.full(20, 0.5)])


def ramp():
    landscape = np.zeros(SHAPE, np.float32)
    landscape[60:100, 200:260] = np.arange(1, 2401, dtype=np.float32).reshape(40, 60)
    return landscape


def test_windows_are_centred_on_the_support_and_the_seed_decides():
    look = Look(ramp())
    windows = look.windows(300, size=12, seed=5)
    assert isinstance(windows, Windows) and windows.size == 12
    u, v = windows.centres.T
    assert look.landscape[v, u].min() > 0
    assert np.ptp(u) > 40 and np.ptp(v) > 25
    np.testing.assert_array_equal(windows.centres, look.windows(300, seed=5).centres)
    assert not np.array_equal(windows.centres, look.windows(300, seed=6).centres)
    assert look.windows(0).centres.shape == (0, 2)
    assert look.windows(3).size == 20


def test_a_generator_advances_so_that_every_cycle_looks_elsewhere():
    generator = np.random.default_rng(0)
    look = Look(ramp())
    first, second = look.windows(20, seed=generator), look.windows(20, seed=generator)
    assert not np.array_equal(first.centres, second.centres)


@pytest.mark.parametrize("fraction", [0.001, 0.01, 0.02])
def test_a_mask_holds_the_asked_fraction_of_the_whole_image_the_highest_pixels_of_it(fraction):
    landscape = ramp()
    mask = Look(landscape).mask(fraction=fraction).mask
    wanted = int(np.ceil(fraction * 240 * 320))
    assert mask.shape == SHAPE and mask.sum() == wanted
    assert landscape[mask].min() == 2400 - wanted + 1
    np.testing.assert_array_equal(Look(landscape).mask(count=wanted).mask, mask)


def test_a_mask_never_leaves_the_support():
    mask = Look(ramp()).mask(fraction=0.9).mask
    np.testing.assert_array_equal(mask, ramp() > 0)


def test_an_empty_landscape_says_so():
    look = Look(np.zeros(SHAPE, np.float32))
    assert look.is_empty and look.covered == 0.0
    for ask in (lambda: look.windows(5), lambda: look.mask(fraction=0.3)):
        with pytest.raises(ArgumentError, match="landscape"):
            ask()
    full = Look(ramp())
    assert not full.is_empty and full.covered == 2400 / 76800


@pytest.mark.parametrize(
    ("ask", "name", "error"),
    [
        (lambda look: look.windows(-1), "n must", ArgumentError),
        (lambda look: look.windows(2.5), "n must", ArgumentTypeError),
        (lambda look: look.windows(3, size=0), "size", ArgumentError),
        (lambda look: look.windows(3, size=2.5), "size", ArgumentTypeError),
        (lambda look: look.windows(3, size=True), "size", ArgumentTypeError),
        (lambda look: look.windows(3, seed=-1), "seed", ArgumentError),
        (lambda look: look.windows(3, seed="one"), "seed", ArgumentTypeError),
        (lambda look: look.mask(), "fraction or count", ArgumentError),
        (lambda look: look.mask(fraction=0.1, count=3), "fraction and count", ArgumentError),
        (lambda look: look.mask(fraction=0.0), "fraction", ArgumentError),
        (lambda look: look.mask(fraction=1.1), "fraction", ArgumentError),
        (lambda look: look.mask(fraction=np.nan), "fraction", ArgumentError),
        (lambda look: look.mask(count=0), "count", ArgumentError),
    ],
)
def test_what_is_wrong_is_named(ask, name, error):
    with pytest.raises(error, match=name):
        ask(Look(ramp()))


def test_a_motor_plan_looks_where_the_path_appears_in_either_camera():
    looks = Attention(PROJECTION).motor_plan(PATH, width=12.5)
    assert list(looks) == ["left", "right"]
    for name, shift in (("left", 0.0), ("right", 35.0)):
        v, u = np.nonzero(looks[name].landscape)
        assert (u.min(), u.max()) == (120 - shift - 12, 200 - shift + 12)
        assert (v.min(), v.max()) == (135 - 12, 135 + 12)


def test_a_camera_in_whose_image_the_path_leaves_no_trace_is_left_out():
    aside = np.add(PATH, (0.43, 0.0, 0.0))  # beyond the left camera's right border, within the right one's
    assert list(Attention(PROJECTION).motor_plan(aside, width=10.0)) == ["right"]
    assert Attention(PROJECTION).motor_plan(np.add(PATH, (9.0, 0.0, 0.0))) == {}
    with pytest.raises(NotInViewError):
        Attention(PROJECTION).motor_plan(-PATH)


def test_the_two_halves_give_what_the_whole_gives():
    attention = Attention(PROJECTION)
    whole = attention.motor_plan(PATH, width=15.0, kernel="gaussian")
    halves = attention.motor_plan_from(PROJECTION.project(PATH), width=15.0, kernel="gaussian")
    for name, look in whole.items():
        np.testing.assert_array_equal(halves[name].landscape, look.landscape)


class Standing(ReachCloud):
    """A cloud of given points, whatever the posture."""

    def __init__(self, points) -> None:
        self.points = points

    def in_root(self, joints):
        return self.points


def test_peripersonal_attention_is_the_gaussian_of_the_cloud_s_pixels():
    """Against the fit and the landscape written again, with the flattening of Eq. 10."""
    points = np.random.default_rng(2).normal((0.05, -0.04, 0.5), (0.03, 0.03, 0.02), (400, 3))
    attention = Attention(PROJECTION, cloud=Standing(points))
    for mixing in (1.0, 0.2):
        looks = attention.peripersonal(None, mixing=mixing)
        for name, shift in (("left", 0.0), ("right", 0.07)):
            pixels = 250.0 * (points[:, :2] - (shift, 0)) / points[:, 2:] + (160, 120)
            factor = np.linalg.cholesky(np.cov(pixels.T))
            expected = reference_gaussian(
                pixels.mean(axis=0), (factor[0, 0], factor[1, 0], factor[1, 1]), SHAPE, mixing=mixing
            )
            off = np.abs(looks[name].landscape - expected)
            # The border of the ellipse may decide otherwise for a pixel or two.
            assert np.count_nonzero(off > 2e-4) <= 2
    halves = attention.peripersonal_from(attention.gaussians(None), mixing=0.2)
    np.testing.assert_array_equal(halves["left"].landscape, looks["left"].landscape)


def test_an_ellipse_outside_the_image_gives_no_look_and_never_an_empty_one():
    """50 points of 4,000 may lie in the image while three sigmas around the mean do not."""
    rng = np.random.default_rng(0)
    points = np.vstack(
        [
            rng.normal((0.95, 0.0, 0.5), (0.004, 0.004, 0.0), (3950, 3)),
            rng.normal((0.31, 0.0, 0.5), (0.001, 0.001, 0.0), (60, 3)),
        ]
    )
    attention = Attention(PinholeProjection({"left": LEFT}, SHAPE), cloud=Standing(points))
    assert attention.gaussians(None)["left"].inside >= 50
    with pytest.raises(NotInViewError, match="outside"):
        attention.peripersonal(None)
    seen = ProjectedGaussian(np.array([100.0, 100.0]), np.array([9.0, 0.0, 9.0]), 60)
    unseen = ProjectedGaussian(np.array([-900.0, 100.0]), np.array([9.0, 0.0, 9.0]), 60)
    assert list(Attention(PROJECTION).peripersonal_from({"left": unseen, "right": seen})) == ["right"]
    with pytest.raises(ArgumentError, match="unknown camera 'tail'; there are left, right"):
        Attention(PROJECTION).peripersonal_from({"tail": seen})


def test_peripersonal_attention_without_a_cloud_says_what_is_missing():
    with pytest.raises(StateError, match="ReachCloud"):
        Attention(PROJECTION).peripersonal(np.zeros(9))


class Brightest:
    """A user's own detector in three lines: it knows nothing of motorprime but what it is given."""

    def detect(self, image, where):
        means = [
            image[v : v + where.size, u : u + where.size].mean() for u, v in where.corners(image.shape[:2])
        ]
        u, v = where.corners(image.shape[:2])[int(np.argmax(means))]
        return Detections(
            np.array([[u, v, u + where.size, v + where.size]], np.float32), np.ones(1, np.float32)
        )


def test_ten_lines_make_a_detector_look_along_the_plan_only():
    """A bright distractor off the plan is never seen; the target on it is found to a window's size."""
    image = np.zeros((*SHAPE, 3), np.uint8)
    image[10:50, 10:50] = 255  # the distractor
    image[128:143, 190:205] = 200  # the target, at the path's end
    detector = Brightest()
    assert isinstance(detector, Detector)

    attention = Attention(PROJECTION)
    look = attention.motor_plan(PATH, width=20.0)["left"]
    found = detector.detect(image, look.windows(50, size=20, seed=1))
    u0, v0, u1, v1 = found.boxes[0]
    assert abs((u0 + u1) / 2 - 197) < 15 and abs((v0 + v1) / 2 - 135) < 15
    assert len(found) == 1 and not isinstance(look, Everywhere)
