"""A projection at one posture, and the points that a camera sees at one pixel."""

import numpy as np
import pytest

from motorprime import Camera, KinematicProjection, PinholeProjection, PosedCamera
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import transform
from motorprime.views import ARRIVED, Views
from poseless import Poseless, Wavy
from small_robot import small_robot

POSTURE = np.array([0.1, 0.2, 0.05, 0.1])
CAMERA = Camera(320, 240, 257.34, 257.34, 160.0, 120.0)
BENT = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (-0.2, 0.05, 0.001, -0.002))


def fixed(camera=CAMERA):
    """Two cameras 68 mm apart that look along z."""
    return PinholeProjection(
        {
            name: PosedCamera(camera, transform(np.eye(3), (x, 0, 0)))
            for name, x in {"left": -0.034, "right": 0.034}.items()
        }
    )


def places(rng, count=200):
    """Places in front of the eyes and beside them, some behind."""
    return rng.uniform((-0.2, -0.2, -0.3), (0.2, 0.2, 0.7), (count, 3))


@pytest.fixture
def kinematic(tmp_path):
    return KinematicProjection(small_robot(tmp_path))


def test_it_says_what_the_projection_says_at_that_posture(kinematic, rng):
    points = rng.uniform(-1.0, 1.0, (200, 3))
    for projection in (kinematic, Poseless(kinematic), Wavy(kinematic, 4.0, 4)):
        views = Views(projection, POSTURE)
        assert views.cameras == projection.cameras and views.shapes == projection.shapes
        for ours, theirs in (
            (views.project(points), projection.project(points, POSTURE)),
            (views.jacobian(points), projection.jacobian(points, POSTURE)),
        ):
            for camera in projection.cameras:
                assert np.isfinite(theirs[camera]).any()
                np.testing.assert_allclose(ours[camera], theirs[camera], rtol=1e-12)


def test_it_triangulates_at_that_posture():
    point = np.array([[0.03, -0.02, 0.4]])
    for projection in (fixed(), Poseless(fixed(), places=np.array([[0.0, 0.0, 0.3]]))):
        found = Views(projection).triangulate(fixed().project(point))
        np.testing.assert_allclose(found, point, atol=1e-6)


def test_kinematics_are_computed_once(kinematic, monkeypatch, rng):
    asked = []
    posed = KinematicProjection.posed
    monkeypatch.setattr(
        KinematicProjection, "posed", lambda self, joints: asked.append(joints) or posed(self, joints)
    )
    views = Views(kinematic, POSTURE)
    for _ in range(3):
        views.project(places(rng))
        views.jacobian(places(rng))
    assert len(asked) == 1


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "lens"])
@pytest.mark.parametrize("pixel", [(160.0, 120.0), (40.0, 200.0), (300.5, 12.25)])
def test_points_along_a_pixel_lie_on_its_ray(camera, pixel, rng):
    projection = fixed(camera)
    view = projection.posed()["left"]
    origin, (direction,) = view.rays([pixel])
    direction /= np.linalg.norm(direction)
    for known in (projection, Poseless(projection)):
        points = Views(known).along("left", pixel, places(rng))
        assert len(points) > 20
        pixels = projection.project(points)["left"]
        assert np.linalg.norm(pixels - pixel, axis=1).max() < ARRIVED
        distance = (points - origin) @ direction
        np.testing.assert_allclose(points, origin + distance[:, None] * direction, atol=2e-3)
        assert distance.min() > 0.0


def test_they_are_as_far_away_as_the_places_that_are_in_view(rng):
    projection, start = fixed(), places(rng)
    seen = start[projection.visible(start)["left"]]
    points = Views(projection).along("left", (80.0, 60.0), start)
    assert len(points) == len(seen)
    eye = projection.posed()["left"].origin
    there, here = (np.linalg.norm(p - eye, axis=1) for p in (points, seen))
    # Steps across the line of sight are chords: they lead outwards, the longer the farther.
    assert (there > 0.99 * here).all() and (there < 1.4 * here).all()
    assert np.median(there / here) < 1.25


def test_they_appear_at_the_pixel_by_a_projection_that_errs_too(kinematic, rng):
    wavy = Wavy(kinematic, 4.0, 4)
    eye = kinematic.posed(POSTURE)["left"].pose
    start = rng.uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.6), (50, 3)) @ eye[:3, :3].T + eye[:3, 3]
    points = Views(wavy, POSTURE).along("left", (100.0, 90.0), start)
    assert len(points) > 40
    assert np.linalg.norm(wavy.project(points, POSTURE)["left"] - (100, 90), axis=1).max() < ARRIVED
    assert np.linalg.norm(kinematic.project(points, POSTURE)["left"] - (100, 90), axis=1).min() > ARRIVED


class Waving(Poseless):
    """Columns between 110 and 210 only, to and fro, as a network may do where it has learned nothing."""

    def project(self, points, joints=None):
        return {
            name: np.column_stack([160.0 + 50.0 * np.sin((pixels[:, 0] - 160.0) / 50.0), pixels[:, 1]])
            for name, pixels in super().project(points, joints).items()
        }

    def jacobian(self, points, joints=None):
        slopes = super().jacobian(points, joints)
        for name, pixels in super().project(points, joints).items():
            slopes[name][:, 0] *= np.cos((pixels[:, :1] - 160.0) / 50.0)
        return slopes


def test_places_that_never_get_to_the_pixel_give_no_points(rng):
    views = Views(Waving(fixed()))
    assert len(views.along("left", (150.0, 120.0), places(rng))) > 10
    assert views.along("left", (230.0, 120.0), places(rng)).shape == (0, 3)


def test_places_out_of_view_give_no_points_and_are_left_alone():
    views, behind = Views(fixed()), np.array([[0.0, 0.0, -0.4], [3.0, 0.0, 0.1]])
    copy = behind.copy()
    assert views.along("left", (160, 120), behind).shape == (0, 3)
    assert views.along("left", (160, 120), np.empty((0, 3))).shape == (0, 3)
    ahead = np.array([[0.1, 0.05, 0.4]])
    before = ahead.copy()
    assert views.along("left", (160, 120), ahead).shape == (1, 3)
    np.testing.assert_array_equal(ahead, before)
    np.testing.assert_array_equal(behind, copy)


@pytest.mark.parametrize(
    ("camera", "pixel", "start", "name"),
    [
        ("middle", (1.0, 2.0), np.zeros((1, 3)), "camera: unknown camera 'middle'; there are left, right"),
        ("left", (np.nan, 2.0), np.zeros((1, 3)), "pixel"),
        ("left", (1.0, 2.0, 3.0), np.zeros((1, 3)), "pixel"),
        ("left", (1.0, 2.0), np.full((1, 3), np.nan), "places"),
        ("left", (1.0, 2.0), np.zeros((1, 2)), "places"),
    ],
)
def test_what_cannot_be_meant_is_named(camera, pixel, start, name):
    with pytest.raises(ArgumentError, match=name):
        Views(fixed()).along(camera, pixel, start)


def test_views_need_a_projection_and_its_joints(kinematic):
    with pytest.raises(ArgumentTypeError, match="projection: a Projection expected, got dict"):
        Views({"left": CAMERA})
    with pytest.raises(ArgumentError, match="joints"):
        Views(kinematic)
    with pytest.raises(ArgumentError, match="joints"):
        Views(kinematic, POSTURE[:2])
