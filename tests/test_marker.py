"""The coloured ball: whole ones are found to a tenth of a pixel, hidden and cut ones are no labels."""

import numpy as np
import pytest

from motorprime import ArgumentError, ArgumentTypeError, Camera
from motorprime.camera import sphere_outline_centre
from motorprime.detectors.marker import GREEN, Colour, _roundness, find_ball

CAMERA = Camera(320, 240, 257.34, 257.34, 160.0, 120.0)
STRETCHED = Camera(320, 240, 280.0, 220.0, 150.0, 130.0)
BENT = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (-0.3, 0.1, 0.002, -0.001))
RADIUS = 0.015


def rays_of(camera, fine=1):
    """Unit directions of the pixels, or of ``fine`` x ``fine`` points in each."""
    step = (np.arange(fine) + 0.5) / fine - 0.5
    u = (np.arange(camera.width)[:, None] + step).ravel()
    v = (np.arange(camera.height)[:, None] + step).ravel()
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)).reshape(len(v), len(u), 3)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def silhouette(camera, centre, radius=RADIUS, fine=1):
    """A direction meets the sphere if its angle to the centre is at most asin(r / distance)."""
    distance = np.linalg.norm(centre)
    return rays_of(camera, fine) @ (np.asarray(centre) / distance) >= np.sqrt(1.0 - (radius / distance) ** 2)


def picture(mask, rgb=(20, 190, 45), ground=(250, 250, 252)):
    """Shaded from left to right, so that a threshold on brightness would not do."""
    shade = np.linspace(0.35, 1.0, mask.shape[1])[None, :, None]
    image = np.where(mask[..., None], np.array(rgb) * shade, np.array(ground))
    return image.round().astype(np.uint8)


PLACES = [(0.0, 0.0, 0.3), (0.13, 0.1, 0.28), (-0.1, 0.05, 0.24), (0.15, -0.11, 0.32), (-0.03, 0.02, 0.1)]


@pytest.mark.parametrize("centre", PLACES)
def test_a_whole_ball_is_labelled_at_the_centre_of_its_outline(centre):
    found = find_ball(picture(silhouette(CAMERA, centre)), CAMERA)
    assert found.outcome == "seen"
    assert np.abs(found.centre - sphere_outline_centre(CAMERA, centre, RADIUS)).max() < 0.1
    assert found.pixels == silhouette(CAMERA, centre).sum()


@pytest.mark.parametrize("camera", [STRETCHED, BENT], ids=["unequal focal lengths", "a bent lens"])
@pytest.mark.parametrize("centre", PLACES)
def test_the_lens_is_allowed_for_in_the_shape(camera, centre):
    fine = silhouette(camera, centre, fine=3)
    v, u = np.nonzero(fine)
    expected = (np.array([u.mean(), v.mean()]) + 0.5) / 3 - 0.5
    found = find_ball(picture(silhouette(camera, centre)), camera)
    assert found.outcome == "seen"
    assert np.abs(found.centre - expected).max() < 0.1


def test_without_the_lens_an_oval_in_the_corner_would_be_taken_for_a_hidden_ball():
    """The outline at the corner is a quarter longer than wide: a camera that looks there sees it round."""
    image = picture(silhouette(CAMERA, (0.15, -0.11, 0.32)))
    towards = Camera(320, 240, 257.34, 257.34, 281.0, 31.5)  # its axis goes through the ball
    assert find_ball(image, CAMERA).outcome == "seen"
    assert find_ball(image, towards).outcome == "covered"


@pytest.mark.parametrize("angle", np.arange(0.0, 2.0 * np.pi, 0.4))
@pytest.mark.parametrize(("depth", "hidden_part"), [(0.25, 0.1), (0.15, 0.04)])
def test_an_edge_that_hides_little_is_noticed_from_every_side(angle, depth, hidden_part):
    centre = np.array([0.04, -0.02, depth])
    mask = silhouette(CAMERA, centre)
    v, u = np.nonzero(mask)
    along = u * np.cos(angle) + v * np.sin(angle)
    hidden = along > np.quantile(along, 1.0 - hidden_part)
    mask[v[hidden], u[hidden]] = False
    found = find_ball(picture(mask), CAMERA)
    assert found.outcome == "covered"
    assert np.isnan(found.centre).all() and found.pixels == mask.sum()


@pytest.mark.parametrize("width", [3, 6])
def test_a_finger_across_the_middle_is_noticed_though_the_centroid_stays(width):
    mask = silhouette(CAMERA, (0.0, 0.0, 0.2))
    mask[:, 160 - width // 2 : 160 - width // 2 + width] = False
    assert find_ball(picture(mask), CAMERA).outcome == "covered"


def test_a_finger_s_tip_in_the_middle_is_noticed():
    mask = silhouette(CAMERA, (0.0, 0.0, 0.2))
    mask[115:126, 155:166] = False
    assert find_ball(picture(mask), CAMERA).outcome == "covered"


@pytest.mark.parametrize(
    "centre", [(0.185, 0.0, 0.3), (-0.185, 0, 0.3), (0.0, 0.138, 0.3), (0.0, -0.138, 0.3)]
)
def test_a_ball_that_touches_the_border_is_cut(centre):
    mask = silhouette(CAMERA, centre)
    assert mask[[0, -1]].any() or mask[:, [0, -1]].any()
    assert find_ball(picture(mask), CAMERA).outcome == "cut"


def test_a_ball_one_pixel_from_the_border_is_seen():
    mask = silhouette(CAMERA, (0.0, 0.0, 0.3))
    v, u = np.nonzero(mask)
    whole = np.zeros_like(mask)
    camera = Camera(320, 240, 257.34, 257.34, 160.0 - u.min() + 1, 120.0 - v.min() + 1)
    whole[v - v.min() + 1, u - u.min() + 1] = True
    assert find_ball(picture(whole), camera).outcome == "seen"
    whole[v - v.min(), u - u.min() + 1] = True
    assert find_ball(picture(whole), camera).outcome == "cut"


def test_small_discs_are_round_on_average(rng):
    v, u = np.mgrid[:240, :320].astype(float)
    found = []
    for centre in rng.uniform((155, 115), (165, 125), (100, 2)):
        inside = (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= 3.5**2
        pixels = np.column_stack([u[inside], v[inside]])
        found.append(_roundness(pixels - pixels.mean(axis=0), pixels.mean(axis=0), CAMERA).mean())
    assert np.mean(found) == pytest.approx(1.0, abs=0.01)


def test_too_few_pixels_and_none_are_absent():
    far = silhouette(CAMERA, (0.0, 0.0, 2.0))
    assert 0 < far.sum() < 30
    found = find_ball(picture(far), CAMERA)
    assert (found.outcome, found.pixels) == ("absent", far.sum())
    assert find_ball(picture(far), CAMERA, min_pixels=5).outcome == "seen"
    assert find_ball(picture(np.zeros_like(far)), CAMERA).outcome == "absent"


def test_the_largest_patch_is_the_ball():
    mask = silhouette(CAMERA, (0.0, 0.0, 0.3))
    centre = find_ball(picture(mask), CAMERA).centre
    mask[200:204, 20:24] = True
    assert np.array_equal(find_ball(picture(mask), CAMERA).centre, centre)


@pytest.mark.parametrize(
    "rgb",
    [(204, 15, 23), (33, 82, 173), (235, 199, 51), (204, 107, 31), (224, 224, 230), (30, 30, 33), (0, 8, 0)],
)
def test_nothing_else_is_green(rgb):
    """The red glass, kitchenware, shell and fingers, and what is too dark to have a colour."""
    assert find_ball(picture(silhouette(CAMERA, (0.0, 0.0, 0.3)), rgb), CAMERA).outcome == "absent"


def test_another_colour_is_found_when_asked_for():
    red = picture(silhouette(CAMERA, (0.0, 0.0, 0.3)), (200, 30, 10))
    assert find_ball(red, CAMERA, colour=Colour((0.0, 20.0))).outcome == "seen"


def test_the_sensor_s_noise_does_not_matter(rng):
    image = picture(silhouette(CAMERA, (0.03, 0.02, 0.3)))
    clean = find_ball(image, CAMERA)
    noisy = np.clip(image + rng.normal(0.0, 4.0, image.shape), 0, 255).round().astype(np.uint8)
    found = find_ball(noisy, CAMERA)
    assert found.outcome == "seen"
    assert np.abs(found.centre - clean.centre).max() < 0.05


def test_a_direction_that_the_lens_does_not_know_is_covered_not_a_crash():
    folding = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (-0.9, 0.0, 0.0, 0.0))
    mask = np.zeros((240, 320), bool)
    mask[20:40, 20:40] = True
    assert find_ball(picture(mask), folding).outcome == "covered"


@pytest.mark.parametrize(
    ("image", "error", "words"),
    [
        (
            np.zeros((240, 319, 3), np.uint8),
            ArgumentError,
            r"image: the camera's shape \(240, 320\)",
        ),
        (np.zeros((240, 320), np.uint8), ArgumentError, r"image: shape \(H, W, 3\) expected"),
        (np.zeros((240, 320, 3)), ArgumentTypeError, "image: a uint8 array"),
    ],
)
def test_images_that_do_not_fit_are_errors(image, error, words):
    with pytest.raises(error, match=words):
        find_ball(image, CAMERA)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"min_pixels": 0}, "min_pixels: expected an integer >= 1"),
        ({"tolerance": 0.0}, "tolerance: expected a number > 0"),
        ({"tolerance": np.nan}, "tolerance: expected finite"),
    ],
)
def test_options_that_make_no_sense_are_errors(options, words):
    with pytest.raises(ArgumentError, match=words):
        find_ball(np.zeros((240, 320, 3), np.uint8), CAMERA, **options)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"hue": (100.0, 90.0)}, "hue: 0 <= low < high <= 360"),
        ({"hue": (-1.0, 90.0)}, "hue: 0 <= low < high <= 360"),
        ({"hue": (10.0, np.nan)}, "hue: 0 <= low < high <= 360"),
        ({"hue": (0.0, 9.0), "saturation": 256}, "saturation: at most 255"),
        ({"hue": (0.0, 9.0), "value": -1}, "value: expected an integer >= 0"),
    ],
)
def test_colours_that_are_none_are_errors(fields, words):
    with pytest.raises(ArgumentError, match=words):
        Colour(**fields)


def test_the_image_is_not_changed():
    image = picture(silhouette(CAMERA, (0.0, 0.0, 0.3)))
    before = image.copy()
    find_ball(image, CAMERA)
    assert GREEN.mask(image).sum() == 255 * silhouette(CAMERA, (0.0, 0.0, 0.3)).sum()
    assert np.array_equal(image, before)
