"""Where the thumb's tip is in an image."""

import cv2
import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.recordings import thumb_tips
from motorprime.recordings.thumb import background, segment, tip
from yarp_folder import thumb_image


def capsule(centre, angle, radius=7.0, length=18.0, shape=(120, 160)):
    """Mask of a thumb with a round end at a centre; it points to ``angle``, square at its other end."""
    v, u = np.mgrid[: shape[0], : shape[1]]
    point = np.stack([u - centre[0], v - centre[1]], axis=-1)
    direction = np.array([np.cos(angle), np.sin(angle)])
    along, across = point @ direction, point @ (-direction[1], direction[0])
    return (np.hypot(*np.moveaxis(point, -1, 0)) <= radius) | (
        (along <= 0) & (along >= -length) & (np.abs(across) <= radius)
    )


@pytest.mark.parametrize("angle", np.deg2rad([100, 135, 180, 200, 225, 260]))
def test_the_tip_is_the_centre_of_the_round_end_however_the_thumb_points(angle):
    centre = np.array([70.3, 60.8])
    found = tip(capsule(centre, angle), np.array([np.cos(angle), np.sin(angle)]))
    np.testing.assert_allclose(found, centre, atol=0.4)


@pytest.mark.parametrize("radius", [4.0, 6.0, 11.0])
def test_the_tip_does_not_depend_on_how_near_the_thumb_is(radius):
    centre = np.array([70.0, 60.0])
    found = tip(capsule(centre, 3.5, radius, 3.0 * radius), np.array([-1.0, 0.0]))
    np.testing.assert_allclose(found, centre, atol=0.4)


def test_of_both_ends_the_one_that_points_away_from_the_arm_is_the_tip():
    upright = capsule((70.0, 40.0), -np.pi / 2)
    assert tip(upright, np.array([0.0, -1.0]))[1] < 42
    assert tip(upright, np.array([0.0, 1.0]))[1] > 46


def test_threads_at_the_other_end_do_not_move_the_tip():
    mask = capsule((60.0, 60.0), np.pi)
    plain = tip(mask, np.array([-1.0, 0.0]))
    mask[66, 60:125] = True
    np.testing.assert_allclose(tip(mask, np.array([-1.0, 0.0])), plain, atol=0.5)


@pytest.mark.parametrize("size", [(1, 30), (30, 1), (5, 5)])
def test_a_mask_without_a_round_end_has_a_tip_inside_it(size):
    mask = np.zeros((60, 60), dtype=bool)
    mask[20 : 20 + size[0], 20 : 20 + size[1]] = True
    u, v = tip(mask, np.array([-1.0, 0.0]))
    assert 19 <= u <= 20 + size[1] and 19 <= v <= 20 + size[0]


def test_thumbs_are_found_where_they_are_in_images():
    centres = np.random.default_rng(0).uniform((20, 20), (100, 80), (15, 2))
    found = thumb_tips([thumb_image(centre) for centre in centres])
    np.testing.assert_allclose(found, centres, atol=0.35)


def test_an_image_without_a_thumb_gives_a_nan_row():
    images = [thumb_image((40.0 + 5 * k, 50.0)) for k in range(8)]
    images[3] = np.full_like(images[3], 40)
    found = thumb_tips(images)
    np.testing.assert_array_equal(np.isnan(found).all(axis=1), np.arange(8) == 3)


def test_what_is_always_bright_is_background():
    images = [thumb_image((60.0 + 5 * k, 50.0)) for k in range(8)]
    for image in images:
        cv2.rectangle(image, (5, 5), (25, 25), (255, 255, 255), -1)
    found = thumb_tips(images)
    np.testing.assert_allclose(found, [(60.0 + 5 * k, 50.0) for k in range(8)], atol=0.35)


def test_a_thumb_that_rests_in_most_of_the_images_is_not_background():
    images = [thumb_image((60.0, 50.0))] * 7 + [thumb_image((100.0, 70.0))] * 3
    assert not np.isnan(thumb_tips(images)).any()
    assert background(images)[50, 60] < 100


def test_coloured_grey_small_and_farther_bright_parts_are_no_thumb():
    image = thumb_image((90.0, 50.0))
    cv2.rectangle(image, (10, 10), (30, 30), (255, 255, 0), -1)
    image[60:64, 20:24] = 255
    cv2.rectangle(image, (10, 80), (30, 100), (100, 100, 100), -1)
    cv2.rectangle(image, (140, 10), (158, 40), (255, 255, 255), -1)
    mask, pointing = segment(image, np.full(image.shape[:2], 40.0))
    assert mask[50, 90]
    assert not mask[20, 20] and not mask[62, 22] and not mask[90, 20] and not mask[20, 150]
    assert pointing[0] != 0


def test_no_images_are_an_error():
    with pytest.raises(ArgumentError, match="at least one"):
        thumb_tips([])
