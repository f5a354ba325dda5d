"""Computed babbling: what it draws is what the robot would see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import Camera, KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.learning.synthetic import draw_samples, palm_points
from motorprime.robot import CameraMount
from small_robot import PALM_FRAME, reference_pose, turn
from watching_robot import watching_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return watching_robot(tmp_path_factory.mktemp("robot"))


def elsewhere(robot):
    """The same robot, its palm 4 cm further, its left camera with another focal length."""
    frame = robot.palm.frame.copy()
    frame[0, 3] += 0.04
    palm = replace(robot.palm, frame=frame)
    left = CameraMount("left_eye", Camera(320, 240, 280.0, 280.0, 160.0, 120.0))
    return replace(robot, palm=palm, cameras={**robot.cameras, "left": left})


def test_pixels_are_the_projections_of_the_points_and_nan_where_the_image_ends(robot):
    samples = draw_samples(robot, robot, 60, 0)
    projection = KinematicProjection(robot)
    assert samples.names == robot.gaze and len(samples) == 60
    for joints, point, *pixels in zip(samples.joints, samples.points, *samples.pixels.values(), strict=True):
        expected = projection.project(point[None], joints)
        depths = projection.depths(point[None], joints)
        for (name, uv), found in zip(expected.items(), pixels, strict=True):
            u, v = uv[0]
            if -0.5 <= u < 319.5 and -0.5 <= v < 239.5 and depths[name][0] >= 0.05:
                np.testing.assert_allclose(found, uv[0], atol=1e-9)
            else:
                assert np.isnan(found).all()
    assert (samples.seen("left") | samples.seen("right")).all()
    assert not (samples.seen("left") & samples.seen("right")).all()


def test_points_are_the_nominal_palm_s_and_pixels_the_real_cameras(robot):
    real = elsewhere(robot)
    samples = draw_samples(real, robot, 40, 1)
    seen = samples.seen("left")
    waist = samples.columns(("waist",))[:, 0]
    # The waist stands on the root's z axis; without its turn the palms lie where the nominal arm brings them.
    arms = np.stack(np.meshgrid(np.linspace(-2.0, 0.5, 300), np.linspace(0.2, 2.0, 300)), axis=-1).reshape(
        -1, 2
    )
    reachable = palm_points(robot, np.zeros((len(arms), 4)), arms)
    for angle, point in zip(waist, samples.points, strict=True):
        turned = turn((0, 0, 1), -angle) @ point
        assert np.linalg.norm(reachable - turned, axis=1).min() < 0.005
    got = np.vstack(
        [
            KinematicProjection(real).project(p[None], q)["left"]
            for p, q in zip(samples.points, samples.joints, strict=True)
        ]
    )
    np.testing.assert_allclose(samples.pixels["left"][seen], got[seen], atol=1e-9)


def test_with_the_arm_the_joints_say_where_the_real_hand_is(robot):
    real = elsewhere(robot)
    samples = draw_samples(real, robot, 30, 2, arm=True)
    assert samples.names == (*robot.gaze, *robot.arm) and samples.points is None
    places = palm_points(real, samples.columns(robot.gaze), samples.columns(robot.arm))
    nominal = palm_points(robot, samples.columns(robot.gaze), samples.columns(robot.arm))
    np.testing.assert_allclose(np.linalg.norm(places - nominal, axis=1), 0.04, atol=1e-9)
    projection = KinematicProjection(real)
    for name in samples.cameras:
        assert samples.seen(name).sum() > 5
        for k in np.flatnonzero(samples.seen(name)):
            uv = projection.project(places[[k]], samples.joints[k, :4])[name][0]
            np.testing.assert_allclose(samples.pixels[name][k], uv, atol=1e-9)


def test_the_palm_is_where_a_second_kinematics_puts_it(robot):
    gaze, arm = np.array([[0.3, -0.2, 0.1, 0.4]]), np.array([[0.2, 1.1]])
    pose = reference_pose("base", "hand", {"waist": -0.2, "shoulder": 0.2, "elbow": 1.1}) @ PALM_FRAME
    np.testing.assert_allclose(palm_points(robot, gaze, arm), pose[None, :3, 3], atol=1e-9)
    assert palm_points(robot, gaze[:0], arm[:0]).shape == (0, 3)


def test_joints_are_uniform_over_their_ranges_before_the_view_chooses(robot):
    """The waist moves eyes and hand alike, so the view does not choose among its angles."""
    waist = draw_samples(robot, robot, 4000, 3).columns(("waist",))[:, 0]
    low, high = robot.limits(("waist",))[0]
    assert low <= waist.min() and waist.max() <= high
    share = np.histogram(waist, 5, (low, high))[0] / 4000
    np.testing.assert_allclose(share, 0.2, atol=0.03)


def test_few_samples_of_a_seed_are_the_first_of_many_and_another_seed_gives_others(robot):
    few, many = draw_samples(robot, robot, 50, 4, 0.3), draw_samples(robot, robot, 3000, 4, 0.3)
    np.testing.assert_array_equal(few.joints, many.joints[:50])
    np.testing.assert_array_equal(few.pixels["left"], many.pixels["left"][:50])
    assert not np.array_equal(few.joints, draw_samples(robot, robot, 50, 5, 0.3).joints)


def test_the_noise_has_the_spread_that_was_asked_for_and_moves_nothing_else(robot):
    clean, noisy = draw_samples(robot, robot, 1500, 6), draw_samples(robot, robot, 1500, 6, 0.7)
    np.testing.assert_array_equal(clean.points, noisy.points)
    errors = np.concatenate([noisy.pixels[c] - clean.pixels[c] for c in clean.cameras])
    errors = errors[~np.isnan(errors[:, 0])]
    np.testing.assert_allclose(errors.std(axis=0), 0.7, rtol=0.07)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.07)


def test_hands_too_near_to_an_eye_are_not_seen_by_it(robot):
    projection = KinematicProjection(robot)

    def depths(samples):
        rows = zip(samples.points, samples.joints, strict=True)
        found = np.array([projection.depths(p[None], q)["left"][0] for p, q in rows])
        return found[samples.seen("left")]

    middle = float(np.median(depths(draw_samples(robot, robot, 100, 7))))
    assert depths(draw_samples(robot, robot, 100, 7, nearest=middle)).min() >= middle


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"count": 0}, ArgumentError, "count: .*>= 1, got 0"),
        ({"count": 3.0}, ArgumentTypeError, "count"),
        ({"seed": -1}, ArgumentError, "seed"),
        ({"noise": -0.1}, ArgumentError, "noise: expected a number >= 0, got -0.1"),
        ({"noise": np.nan}, ArgumentError, "noise"),
        ({"nearest": -1.0}, ArgumentError, "nearest"),
    ],
)
def test_wrong_numbers_are_errors_that_name_them(robot, change, error, words):
    arguments = {"count": 3, "seed": 0} | change
    with pytest.raises(error, match=words):
        draw_samples(robot, robot, **arguments)


def test_robots_of_other_joints_are_refused(robot):
    with pytest.raises(ArgumentError, match=r"nominal: .*robot 'small'"):
        draw_samples(robot, replace(robot, gaze=("waist", "neck", "version", "squint")), 3, 0)
    with pytest.raises(ArgumentError, match=r"gaze: expected shape \(N, 4\), got \(4,\)"):
        palm_points(robot, np.zeros(4), np.zeros((1, 2)))
    with pytest.raises(ArgumentError, match=r"gaze: .*nan"):
        palm_points(robot, [[0, 0, 0, np.nan]], np.zeros((1, 2)))


def test_a_hand_that_is_never_in_view_ends_in_an_error(robot, monkeypatch):
    monkeypatch.setattr("motorprime.learning.synthetic.BARREN", 2)
    with pytest.raises(StateError, match="in view in none of 16384 postures"):
        draw_samples(robot, robot, 3, 0, nearest=50.0)
