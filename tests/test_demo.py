"""Which projection the demo sees by, and how far it trusts it."""

import numpy as np
import pytest

from motorprime import KinematicProjection, shipped
from motorprime.demo import projection_of, slack_of
from motorprime.errors import ArgumentError, StateError
from motorprime.learning.network import Network
from motorprime.projection.neural import LearnedCamera, NeuralProjection
from poseless import Poseless

pytestmark = pytest.mark.sim


def networks(joints, **errors):
    """A projection of untrained networks with these median errors [px]."""
    rng = np.random.default_rng(0)
    x, seen = rng.normal(size=(20, 3 + len(joints))), np.ones((20, 1))
    learned = {
        camera: LearnedCamera(
            (240, 320),
            Network.random((x.shape[1], 3, 2), 0, x, rng.normal(size=(20, 2))),
            Network.random((x.shape[1], 3, 1), 0, x, seen),
            error,
        )
        for camera, error in errors.items()
    }
    return NeuralProjection(learned, joints, robot="iCub", points=np.zeros((1, 3)))


def test_the_robot_s_kinematics_are_trusted(icub):
    projection = projection_of(icub, "kinematic")
    assert isinstance(projection, KinematicProjection) and projection.robot is icub
    assert slack_of(projection) == 0.0


@pytest.mark.parametrize("kind", ["neural", "hybrid"])
def test_what_is_shipped_is_taken_for_this_robot(icub, monkeypatch, kind):
    asked = []
    known = Poseless(KinematicProjection(icub))
    monkeypatch.setattr(shipped, f"{kind}_projection", lambda robot: asked.append(robot) or known)
    assert projection_of(icub, kind) is known
    assert asked == [icub]


def test_a_hybrid_that_has_learned_nothing_is_trusted_as_its_kinematics(icub):
    assert slack_of(projection_of(icub, "hybrid")) == 0.0


def test_networks_are_trusted_as_far_as_they_know_themselves(icub):
    """The largest of the cameras' median errors."""
    assert slack_of(networks(icub.gaze, left=3.5, right=4.25)) == 4.25
    assert slack_of(Poseless(KinematicProjection(icub))) == 0.0


def test_another_kind_is_refused(icub):
    with pytest.raises(ArgumentError, match="projection: 'kinematic', 'neural' or 'hybrid' expected"):
        projection_of(icub, "psychic")


def test_missing_weights_are_a_clear_error(icub, monkeypatch):
    monkeypatch.setattr(shipped, "NEURAL", "absent.safetensors")
    with pytest.raises(StateError, match=r"weights/absent\.safetensors is missing"):
        projection_of(icub, "neural")
