"""Learning the reachable space's Gaussians: tiny trainings on the small robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from head_eye_rig import ball_of_points
from motorprime import Attention, KinematicProjection, NotInViewError, ReachCloud, fit_peripersonal
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.evaluate.peripersonal_figures import evaluate_peripersonal
from motorprime.learning.peripersonal import learn_peripersonal, targets
from motorprime.learning.posture_ellipses import PostureEllipses, fit_postures, random_head_eye
from motorprime.robot import CameraMount
from small_robot import CAMERA, small_robot

TINY = {"postures": 500, "hidden": (8,), "iterations": 30}


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def cloud(robot):
    return ball_of_points(robot)


@pytest.fixture(scope="module")
def learned(robot, cloud):
    return learn_peripersonal(robot, cloud=cloud, seed=1, **TINY)


def test_the_learned_gaussians_are_those_of_the_direct_fit_on_unseen_postures(robot, cloud, learned):
    """To a few pixels of the space's 36 px, with the torso anywhere."""
    model, _ = learned
    projection = KinematicProjection(robot)
    rng = np.random.default_rng(77)
    off, compared = [], 0
    for joints in random_head_eye(robot, 150, rng):
        joints[1] = rng.uniform(-1.0, 1.5)  # the waist
        try:
            direct, found = fit_peripersonal(cloud, projection, joints), model.ellipses(joints)
        except NotInViewError:
            continue
        for camera in set(direct) & set(found):
            compared += 1
            off.append(
                np.r_[found[camera].mean - direct[camera].mean, found[camera].chol - direct[camera].chol]
            )
    assert compared > 150
    assert np.percentile(np.abs(off), 95) < 4.0
    assert np.median(np.abs(off)) < 1.0


def test_what_is_in_view_is_told_as_the_direct_fit_tells_it(robot, cloud, learned):
    model, _ = learned
    postures = random_head_eye(robot, 300, 78)
    fits = fit_postures(cloud, KinematicProjection(robot), postures)
    agree = [
        [seen == fits[camera].in_view[k] for camera, seen in model.visible(joints).items()]
        for k, joints in enumerate(postures)
    ]
    outside = np.mean([~fit.in_view for fit in fits.values()])
    assert 0.1 < outside < 0.4  # so that saying 'in view' always would not do
    assert np.mean(agree) > 0.97


def test_the_model_knows_what_it_was_learned_for(robot, learned):
    model, _ = learned
    assert (model.robot, model.joints, model.inputs) == ("small", robot.gaze, ("neck", "version", "squint"))
    assert model.shapes == {"left": (240, 320), "right": (240, 320)}
    assert [network.sizes for network in model.maps.values()] == [(3, 8, 5)] * 2
    Attention(KinematicProjection(robot), peripersonal=model)


def test_the_report_tells_of_every_network_and_its_errors_on_what_it_did_not_see(learned):
    _, report = learned
    assert report["postures"] == 500 and report["cloud"] == 300
    assert report["view"]["samples"] == 500 and report["view"]["agreement"] > 0.95
    assert list(report["cameras"]) == ["left", "right"]
    for story in report["cameras"].values():
        assert 300 < story["samples"] < 500
        assert 0 < story["iterations"] <= 30 and story["restart"] == 0
        assert story["reason"] in ("iterations", "validation", "converged")
        assert 0.05 < story["mean_px"] < 4.0 and 0.0001 < story["factor"] < 0.05


def test_a_seed_gives_a_model_and_another_one_another(robot, cloud, learned):
    again, _ = learn_peripersonal(robot, cloud=cloud, seed=1, **TINY)
    other, _ = learn_peripersonal(robot, cloud=cloud, seed=2, **TINY)
    joints = np.array([0.0, 0.0, 0.1, 0.3])
    one, two, three = (model.ellipses(joints)["left"] for model in (learned[0], again, other))
    np.testing.assert_array_equal(one.chol, two.chol)
    assert not np.array_equal(one.chol, three.chol)


def test_a_watcher_is_told_of_every_iteration_and_restarts_choose_one(robot, cloud):
    told = []
    settings = TINY | {"iterations": 3, "restarts": 2}
    _, report = learn_peripersonal(
        robot, cloud=cloud, seed=0, watch=lambda *news: told.append(news), **settings
    )
    for what in ("view", "left", "right"):
        assert [number for name, number, _ in told if name == what] == [1, 2, 3, 1, 2, 3]
    assert all(errors.shape == (2,) for _, _, errors in told)
    assert {story["restart"] for story in (*report["cameras"].values(), report["view"])} <= {0, 1}


def test_another_projection_is_learned_through(robot, cloud):
    """Twice the focal length makes twice the ellipse."""
    zoomed = {
        name: CameraMount(mount.link, replace(CAMERA, fx=2 * CAMERA.fx, fy=2 * CAMERA.fy))
        for name, mount in robot.cameras.items()
    }
    projection = KinematicProjection(replace(robot, cameras=zoomed))
    model, _ = learn_peripersonal(robot, projection=projection, cloud=cloud, seed=0, **TINY)
    joints = np.array([-0.05, 0.0, 0.0, 0.4])
    wide = fit_peripersonal(cloud, KinematicProjection(robot), joints)["left"]
    np.testing.assert_allclose(model.ellipses(joints)["left"].chol[0] / wide.chol[0], 2.0, atol=0.15)


def test_what_is_learned_are_the_five_of_the_paper_with_logarithms():
    fit = PostureEllipses(np.array([[3.0, 4.0]]), np.array([[np.e, -5.0, np.e**2]]), np.array([60]))
    np.testing.assert_allclose(targets(fit), [[3.0, 4.0, 1.0, -5.0, 2.0]])


@pytest.mark.parametrize(
    ("changes", "name", "error"),
    [
        ({"postures": 0}, "postures", ArgumentError),
        ({"postures": 5.5}, "postures", ArgumentTypeError),
        ({"postures": 4}, "samples", ArgumentError),
        ({"hidden": (0,)}, "sizes", ArgumentError),
        ({"restarts": 0}, "restarts", ArgumentError),
        ({"seed": -3}, "seed", ArgumentError),
        ({"seed": "one"}, "seed", ArgumentTypeError),
    ],
)
def test_what_is_wrong_is_named(robot, cloud, changes, name, error):
    with pytest.raises(error, match=name):
        learn_peripersonal(robot, cloud=cloud, **(TINY | {"seed": 0} | changes))


def test_a_camera_that_hardly_sees_the_space_is_named_with_the_count(robot):
    behind = ball_of_points(robot, distance=-0.5)
    with pytest.raises(ArgumentError, match=r"of 500 drawn, camera 'left' .* in view in 0"):
        learn_peripersonal(robot, cloud=behind, seed=0, **TINY)


def test_a_robot_without_a_urdf_says_how_to_get_one():
    with pytest.raises(StateError, match="with_urdf"):
        learn_peripersonal(small_robot())


@pytest.mark.sim
def test_the_icub_s_gaussians_are_learned_to_a_few_hundredths(icub):
    """A tenth of the usual training; the overlap of the ellipses is judged on unseen postures."""
    cloud = ReachCloud(icub, size=1000)
    settings = {"postures": 2000, "hidden": (12,), "iterations": 40}
    model, report = learn_peripersonal(icub, cloud=cloud, seed=0, **settings)
    assert report["view"]["agreement"] > 0.95
    figures = evaluate_peripersonal(model, icub, seed=11, postures=100, cloud=cloud)
    assert figures["iou_mean"] > 0.93 and figures["iou_p05"] > 0.85
    assert figures["view_agreement"] > 0.95
