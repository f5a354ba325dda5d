"""A flat textured object, drawn into a picture by a known homography: found where it is, and its pose."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from motorprime import Camera, Detector, Everywhere, Mask, PlanarDetector, Surf, Tiles, Windows
from motorprime.detectors import planar
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.evaluate.textures import draw_texture
from motorprime.rotations import rotation_matrices

SHAPE = (240, 320)
CAMERA = Camera.from_fov(320, 240, np.radians(60))
SIZE = (0.20, 0.15)  # [m]
GREY = draw_texture(21, 150, 200)
TEMPLATE = np.stack([GREY, GREY[::-1, ::-1], GREY], axis=2)
DETECTOR = PlanarDetector(TEMPLATE, label="book")


def pose(turn, place):
    """Pose (4, 4) of the object in the camera frame."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrices(np.array(turn, dtype=float))
    matrix[:3, 3] = place
    return matrix


def homography_of(motion, camera=CAMERA):
    """Template pixels to image pixels: the middle of the template is the origin of the plane z = 0."""
    height, width = GREY.shape
    to_plane = np.array(
        [
            [SIZE[0] / width, 0, -SIZE[0] / width * (width - 1) / 2],
            [0, SIZE[1] / height, -SIZE[1] / height * (height - 1) / 2],
            [0, 0, 1],
        ]
    )
    return camera.matrix @ motion[:3][:, [0, 1, 3]] @ to_plane


def picture(homography=None, seed=33):
    """Clutter, with the object in it."""
    clutter = draw_texture(seed, *SHAPE)
    image = np.stack([clutter] * 3, axis=2)
    if homography is not None:
        cv2.warpPerspective(
            TEMPLATE,
            homography,
            SHAPE[::-1],
            dst=image,
            flags=cv2.INTER_AREA,
            borderMode=cv2.BORDER_TRANSPARENT,
        )
    return image


POSES = [
    pose((0, 0, 0), (0, 0, 0.4)),
    pose((0, 0, 0.8), (0.02, -0.01, 0.35)),
    pose((0.4, 0, 0), (-0.03, 0.01, 0.35)),
    pose((0.1, -0.5, -2.5), (0.01, 0.02, 0.35)),
]


def corners_of(homography):
    height, width = GREY.shape
    ends = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
    return cv2.perspectiveTransform(ends[:, None], homography)[:, 0]


@pytest.mark.parametrize("truth", POSES)
def test_the_object_is_found_with_its_corners_and_its_pose(truth):
    homography = homography_of(truth)
    image = picture(homography)
    sighting = DETECTOR.find(image, Everywhere())
    assert sighting is not None
    np.testing.assert_allclose(sighting.corners, corners_of(homography), atol=2.0)
    mapped = cv2.perspectiveTransform(sighting.template_points[:, None], sighting.homography)[:, 0]
    assert (np.hypot(*(mapped - sighting.image_points).T) <= 3.001).all()
    assert len(sighting.image_points) >= 10 and 0.3 < sighting.score <= 1.0
    found = DETECTOR.pose(sighting, SIZE, CAMERA)
    np.testing.assert_allclose(found[:3, 3], truth[:3, 3], atol=0.006)
    assert np.trace(found[:3, :3].T @ truth[:3, :3]) > 1 + 2 * np.cos(np.radians(4))
    assert found[3].tolist() == [0, 0, 0, 1]


def test_a_detection_is_the_box_of_the_corners_within_the_image():
    homography = homography_of(pose((0, 0, 0.3), (0.12, 0, 0.35)))
    found = DETECTOR.detect(picture(homography), Everywhere())
    corners = corners_of(homography)
    assert corners[:, 0].max() > 320  # part of it is outside
    assert found.labels == ("book",) and len(found) == 1 and found.attended == 240 * 320
    np.testing.assert_allclose(found.boxes[0, :2], corners.min(axis=0), atol=3)
    assert found.boxes[0, 2] == 320
    assert isinstance(DETECTOR, Detector)


def test_it_looks_only_where_it_is_told():
    homography = homography_of(POSES[0])
    image = picture(homography)
    mask = np.zeros(SHAPE, bool)
    mask[60:180, 80:240] = True
    left = mask.copy()
    left[:, 60:] = False
    places = [
        (Mask(mask), 120 * 160),
        (Tiles(np.array([[80, 60, 160, 180], [160, 60, 240, 180]])), 120 * 160),
        (Windows(np.array([[160, 120], [161, 120]]), 110), 110 * 111),
    ]
    for where, attended in places:
        found = DETECTOR.detect(image, where)
        assert len(found) == 1 and found.attended == attended
    for where in (Mask(left), Tiles(np.zeros((0, 4), int)), Windows(np.array([[20, 20]]), 40)):
        assert len(DETECTOR.detect(image, where)) == 0
    assert DETECTOR.find(image, Mask(np.zeros(SHAPE, bool))) is None


@pytest.mark.parametrize("seed", range(33, 39))
def test_clutter_alone_is_not_the_object(seed):
    assert DETECTOR.find(picture(seed=seed), Everywhere()) is None


def test_the_ratio_test_leaves_out_matches_that_could_as_well_be_others():
    image = picture(homography_of(POSES[2]))
    scores = [
        PlanarDetector(TEMPLATE, ratio=ratio).find(image, Everywhere()).score for ratio in (0.7, 0.9, 1.0)
    ]
    assert scores[0] > scores[1] + 0.1 > scores[2] + 0.1


def test_a_mirror_image_is_not_the_object():
    """Even a detector that does not care for orientations sees that no front looks like that."""
    image = picture(homography_of(POSES[0]))
    detector = PlanarDetector(TEMPLATE, min_matches=4, ratio=1.0)
    seen = detector.find(np.ascontiguousarray(image[:, ::-1]), Everywhere())
    assert seen is None or seen.score < 0.2


def test_a_grey_template_and_a_lens_are_taken_too():
    truth = POSES[2]
    image = np.stack([picture(homography_of(truth))[..., 1]] * 3, axis=2)
    detector = PlanarDetector(np.ascontiguousarray(TEMPLATE[..., 1]), surf=Surf(extended=True))
    sighting = detector.find(image, Everywhere())
    bent = Camera(320, 240, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, (1e-4, 0.0, 0.0, 0.0))
    for camera in (CAMERA, bent):
        np.testing.assert_allclose(detector.pose(sighting, SIZE, camera)[:3, 3], truth[:3, 3], atol=0.006)


def test_an_object_twice_as_large_is_twice_as_far():
    sighting = DETECTOR.find(picture(homography_of(POSES[1])), Everywhere())
    near, far = (DETECTOR.pose(sighting, size, CAMERA) for size in (SIZE, (0.4, 0.3)))
    np.testing.assert_allclose(far[:3, 3], 2 * near[:3, 3], rtol=1e-3)
    np.testing.assert_allclose(far[:3, :3], near[:3, :3], atol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "error", "name"),
    [
        (
            {"template": np.zeros((60, 80), np.uint8)},
            ArgumentError,
            "template: at least 10 keypoints.*found 0",
        ),
        ({"template": TEMPLATE.astype(float)}, ArgumentTypeError, "template"),
        ({"template": TEMPLATE.tolist()}, ArgumentTypeError, "template"),
        ({"template": np.zeros((60, 80, 4), np.uint8)}, ArgumentError, "template"),
        ({"template": np.zeros((0, 80), np.uint8)}, ArgumentError, "template"),
        ({"surf": 300.0}, ArgumentTypeError, "surf"),
        ({"ratio": 0.0}, ArgumentError, "ratio"),
        ({"ratio": np.nan}, ArgumentError, "ratio"),
        ({"tolerance": -1.0}, ArgumentError, "tolerance"),
        ({"min_matches": 3}, ArgumentError, "min_matches"),
        ({"min_matches": 4.5}, ArgumentTypeError, "min_matches"),
    ],
)
def test_a_detector_that_cannot_work_is_refused(arguments, error, name):
    with pytest.raises(error, match=name):
        PlanarDetector(**{"template": TEMPLATE, **arguments})


def test_wrong_images_places_and_sizes_are_named():
    image = picture()
    for bad in (image[..., 0], image.astype(np.uint16), np.zeros((9, 9, 4), np.uint8)):
        with pytest.raises((ArgumentError, ArgumentTypeError), match="image"):
            DETECTOR.detect(bad, Everywhere())
    with pytest.raises(ArgumentError, match=r"mask: shape \(240, 320\) expected"):
        DETECTOR.detect(image, Mask(np.zeros((320, 240), bool)))
    with pytest.raises(ArgumentError, match="size"):
        DETECTOR.detect(image, Windows(np.array([[5, 5]]), 300))
    with pytest.raises(ArgumentTypeError, match="where"):
        DETECTOR.detect(image, None)
    sighting = DETECTOR.find(picture(homography_of(POSES[0])), Everywhere())
    for size in ((0.2,), (0.2, 0.0), (np.nan, 0.1), 0.2):
        with pytest.raises(ArgumentError, match="size"):
            DETECTOR.pose(sighting, size, CAMERA)


def test_a_sighting_without_a_pose_is_an_error():
    sighting = DETECTOR.find(picture(homography_of(POSES[0])), Everywhere())
    nowhere = type(sighting)(
        sighting.homography,
        sighting.corners,
        sighting.template_points,
        np.zeros_like(sighting.image_points),
        sighting.score,
    )
    with pytest.raises(StateError, match="no pose"):
        DETECTOR.pose(nowhere, SIZE, CAMERA)


def test_only_a_convex_area_gone_around_clockwise_is_a_front():
    front = np.array([[0.0, 0.0], [10.0, 1.0], [9.0, 12.0], [-1.0, 9.0]])
    assert planar._is_front(front) and planar._is_front(np.roll(front, 2, axis=0))
    assert not planar._is_front(front[::-1])
    assert not planar._is_front(front[[0, 2, 1, 3]])
    assert not planar._is_front(front * 0.01)
    assert not planar._is_front(np.full((4, 2), np.nan))


def test_copies_of_the_object_are_found_one_by_one():
    """By a ratio test in the image each copy would rival the others."""
    places = [pose((0, 0, 0.3), (-0.1, -0.05, 0.5)), pose((0, 0.3, 0), (0.1, 0.04, 0.45))]
    image, first = picture(), homography_of(places[0])
    for motion in places:
        there = picture(homography_of(motion))
        image = np.where(there == picture(), image, there)
    found = DETECTOR.find_all(image, Everywhere())
    assert len(found) == 2 and len(DETECTOR.detect(image, Everywhere())) == 2
    for motion in places:
        expected = corners_of(homography_of(motion))
        assert min(np.abs(seen.corners - expected).max() for seen in found) < 2.0
    assert len(found[0].image_points) >= len(found[1].image_points) >= DETECTOR.min_matches
    np.testing.assert_array_equal(DETECTOR.find(image, Everywhere()).corners, found[0].corners)
    mask = cv2.fillConvexPoly(np.zeros(SHAPE, np.uint8), corners_of(first).astype(np.int32), 1) > 0
    (only,) = DETECTOR.find_all(image, Mask(mask))
    assert np.abs(only.corners - corners_of(first)).max() < 5.0  # keypoints near its border see over it
    assert DETECTOR.find_all(picture(), Everywhere()) == []
    assert DETECTOR.detect(picture(), Everywhere()).boxes.shape == (0, 4)
