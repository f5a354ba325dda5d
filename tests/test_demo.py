"""Which projection the demo sees by, and how far it trusts it."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

import motorprime
from motorprime import KinematicProjection
from motorprime.demo import projection_of, slack_of
from motorprime.errors import ArgumentError, StateError
from motorprime.learning.network import Network
from motorprime.projection.neural import LearnedCamera, NeuralProjection
from poseless import Poseless

pytestmark = pytest.mark.sim


def networks(joints, shape=(240, 320), **errors):
    """A projection of untrained networks with these median errors [px]."""
    rng = np.random.default_rng(0)
    x, seen = rng.normal(size=(20, 3 + len(joints))), np.ones((20, 1))
    learned = {
        camera: LearnedCamera(
            shape,
            Network.random((x.shape[1], 3, 2), 0, x, rng.normal(size=(20, 2))),
            Network.random((x.shape[1], 3, 1), 0, x, seen),
            error,
        )
        for camera, error in errors.items()
    }
    return NeuralProjection(learned, joints, robot="iCub", points=np.zeros((1, 3)))


@pytest.fixture
def ship(monkeypatch):
    """Put functions in the place of what is shipped."""

    def put(**functions):
        module = SimpleNamespace(**functions)
        monkeypatch.setitem(sys.modules, "motorprime.shipped", module)
        monkeypatch.setattr(motorprime, "shipped", module, raising=False)

    return put


def test_the_robot_s_kinematics_are_trusted(icub):
    projection = projection_of(icub, "kinematic")
    assert isinstance(projection, KinematicProjection) and projection.robot is icub
    assert slack_of(projection) == 0.0


@pytest.mark.parametrize("kind", ["neural", "hybrid"])
def test_what_is_shipped_is_taken_for_this_robot(icub, ship, kind):
    asked = []
    known = Poseless(KinematicProjection(icub))
    ship(**{f"{kind}_projection": lambda robot: asked.append(robot) or known})
    assert projection_of(icub, kind) is known
    assert asked == [icub]


def test_networks_are_trusted_as_far_as_they_know_themselves(icub):
    """The largest of the cameras' median errors."""
    assert slack_of(networks(icub.gaze, left=3.5, right=4.25)) == 4.25
    assert slack_of(Poseless(KinematicProjection(icub))) == 0.0


def test_images_of_another_size_than_learned_are_refused(icub, ship):
    learned = networks(icub.gaze, left=3.0, right=3.0)
    ship(neural_projection=lambda robot: learned)
    assert projection_of(icub, "neural") is learned
    message = "size: the neural projection knows images of 320x240 from camera 'left' only, got 640x480"
    with pytest.raises(ArgumentError, match=message):
        projection_of(icub.with_image_size(640, 480), "neural")


def test_another_kind_is_refused(icub):
    with pytest.raises(ArgumentError, match="projection: 'kinematic', 'neural' or 'hybrid' expected"):
        projection_of(icub, "psychic")


@pytest.mark.parametrize("kind", ["neural", "hybrid"])
def test_missing_weights_are_a_clear_error(icub, monkeypatch, kind):
    monkeypatch.setitem(sys.modules, "motorprime.shipped", None)
    monkeypatch.delattr(motorprime, "shipped", raising=False)
    with pytest.raises(StateError, match=f"projection: this installation brings no {kind} one along"):
        projection_of(icub, kind)
