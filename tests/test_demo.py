"""Which projection the demo sees by, how far it trusts it, and what it says of a run."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import synthetic_run
from motorprime import KinematicProjection, shipped
from motorprime.control.gaze import fixate
from motorprime.control.side_grasp import SIDE_GRASP
from motorprime.demo import (
    ReachOptions,
    _judged,
    _told,
    certificates_of,
    closing,
    projection_of,
    slack_of,
    title_of,
)
from motorprime.errors import ArgumentError, StateError
from motorprime.learning.network import Network
from motorprime.projection.neural import LearnedCamera, NeuralProjection
from motorprime.tasks.pick_trial import PickVerdict
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


def options(**asked):
    """What is asked of ``motorprime reach``, but for the arguments that are given."""
    usual = {"seed": 1, "name": "x", "runs": Path("runs"), "windows": 50, "width": None, "size": (320, 240)}
    usual |= {"noise": 2.0, "clutter": 4, "glass": True, "glass_at": None, "video": False, "gui": False}
    return ReachOptions(**(usual | asked))


def test_every_story_has_its_own_title():
    asked = [{"obstacle": o, "perturb": p} for o in (False, True) for p in (False, True)]
    titles = [title_of(options(**each)) for each in asked]
    assert len(set(titles)) == 4
    assert "behind an obstacle" in titles[2] and "jumps" in titles[1] and "appears" in titles[3]


def test_the_shipped_systems_are_certified_by_number():
    certificates = certificates_of(shipped.coupled_dynamics())
    assert list(certificates) == ["eye", "arm", "hand"]
    for each in certificates.values():
        assert each["continuous"] < 0.0 and 0.0 < each["discrete"] < 1.0 and each["step"] > 0.0


def said(outcome="lifted", reason="", obstacle=False, perturb=False, **judged):
    result = {
        "outcome": outcome,
        "reason": reason,
        "judged": synthetic_run.LIFTED | judged,
        "meta": {"obstacle": obstacle, "perturb": perturb},
    }
    return closing(result)


def test_a_lifted_glass_is_said_with_its_figures():
    ((line, good),) = said()
    assert (
        line
        == "Lifted: a glass of 153 g and 66 mm width, for a second 6.0 cm over the table, by friction alone."
    )
    assert good


def test_the_judge_is_believed_and_not_the_robot():
    ((line, good),) = said(lifted=False, height_m=None)
    assert "judged from outside it is not" in line and not good


def test_a_failure_is_said_with_its_reason():
    ((line, good),) = said("refused", "there is no way", lifted=False, height_m=None)
    assert line == "Refused: there is no way" and not good


def test_an_obstacle_that_was_not_touched_is_worth_a_word():
    assert said(obstacle=True)[1] == ("Nothing of the robot touched the obstacle.", True)
    touched = said(obstacle=True, touched_obstacle=True, touched=["obstacle", "table"])
    assert touched[1:] == [("The robot also touched: obstacle, table.", False)]
    assert len(said(obstacle=True, lifted=False, height_m=None)) == 1


@pytest.mark.parametrize(
    ("asked", "disturbed", "words"),
    [
        ({"perturb": True}, True, "the glass jumped 10 cm, and the hand followed"),
        ({"perturb": True}, False, "no time or room for the glass to jump"),
        ({"perturb": True, "obstacle": True}, True, "The obstacle appeared when the hand was on its way"),
        ({"perturb": True, "obstacle": True}, False, "no time or room for the obstacle to appear"),
    ],
)
def test_whether_the_disturbance_happened_is_said(asked, disturbed, words):
    line, good = said(**asked, disturbed=disturbed)[1]
    assert words in line and good == disturbed


def moment(icub, phase, *, opening, away):
    """A trial with its palm ``away`` [m] from the grasp, and a cycle of it that looks at an obstacle."""
    here, goal = np.eye(4), np.eye(4)
    goal[0, 3] = away
    legs = [SimpleNamespace(goal=SimpleNamespace(palm=palm)) for palm in (here, goal)]
    controller = SimpleNamespace(palm=here, grasp=SIDE_GRASP, state=SimpleNamespace(opening=opening))
    motion = SimpleNamespace(legs=legs, goal=legs[-1].goal)
    trial = SimpleNamespace(
        attention=SimpleNamespace(projection=KinematicProjection(icub)),
        task=SimpleNamespace(controller=controller, motion=motion),
    )
    gaze = fixate(icub, icub.resting(icub.gaze), synthetic_run.BESIDE)
    known = ((synthetic_run.BESIDE, synthetic_run.CANISTER),)
    return synthetic_run.cycle(phase, joints=gaze, obstacles=known), trial


def test_a_cycle_is_told_with_legs_and_outlines_of_obstacles(icub):
    told = _told(*moment(icub, "reach", opening=0.8, away=0.2), event="It thunders")
    np.testing.assert_array_equal(told.legs, [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    assert (told.opening, told.event) == (0.8, "It thunders")
    assert set(told.outlines) == {"left", "right"}
    for (outline,) in told.outlines.values():
        (left, top), (right, bottom) = outline.min(axis=0), outline.max(axis=0)
        assert left < 160 < right and top < 120 < bottom  # it is fixated
        assert 30 < right - left < 120 and 40 < bottom - top < 200  # 6 cm wide, 13 cm high, 40 cm away


@pytest.mark.parametrize(
    ("phase", "away", "expected"),
    [("reach", 0.2, SIDE_GRASP.roomy), ("reach", 0.001, 0.1), ("lift", 0.06, 0.1)],
)
def test_the_opening_is_what_the_fingers_are_told(icub, phase, away, expected):
    """On the way they stay wider than the dynamics say; in the grasp, and when it is lifted, they do not."""
    assert _told(*moment(icub, phase, opening=0.1, away=away), event="").opening == expected


def test_before_there_is_a_plan_nothing_is_made_up(icub):
    cycle, trial = moment(icub, "search", opening=0.1, away=0.2)
    trial.task.motion = None
    told = _told(cycle, trial, event="")
    assert told.legs == () and told.opening is None


def test_to_touch_the_glass_is_no_fault():
    verdict = PickVerdict("lifted", "", True, False, 0.06, 0.001, 0.1, 0.07, False, ("glass", "table"))
    judged = _judged(verdict)
    assert judged["touched"] == ["table"]
    assert set(judged) == set(synthetic_run.LIFTED)
