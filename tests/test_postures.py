"""Random postures of gaze and arm: where the hand is, which camera has it in view, how they are spread."""

from dataclasses import replace

import numpy as np
import pytest

from motorprime import ArgumentError, Camera, NotInViewError
from motorprime.learning import postures as module
from motorprime.learning.postures import MARGIN, Postures
from motorprime.robot import CameraMount
from small_robot import PALM_FRAME, reference_pose, small_robot


@pytest.fixture
def robot(tmp_path):
    """The hand-written robot, with eyes that see wide enough to have its hand in view now and then."""
    wide = Camera(320, 240, 120.0, 110.0, 150.0, 125.0)
    mounts = {"left": CameraMount("left_eye", wide), "right": CameraMount("right_eye", wide)}
    return replace(small_robot(tmp_path), cameras=mounts)


def angles_of(robot, gaze, arm):
    value = dict(zip(robot.gaze + robot.arm, (*gaze, *arm), strict=True))
    pan = {
        "left_pan": value["version"] + value["squint"] / 2,
        "right_pan": value["version"] - value["squint"] / 2,
    }
    return value | pan


def test_the_point_is_where_the_kinematics_written_a_second_time_put_it(robot, rng):
    offset = (0.02, -0.01, 0.03)
    for _ in range(5):
        drawn = Postures(robot, radius=0.01, offset=offset).draw(rng)
        hand = reference_pose("base", "hand", angles_of(robot, drawn.gaze, drawn.arm))
        assert np.allclose(drawn.point, (hand @ PALM_FRAME @ (*offset, 1.0))[:3], atol=1e-12)


def test_postures_fill_the_limits_and_no_more(robot):
    generator, postures = np.random.default_rng(3), Postures(robot, radius=0.01)
    drawn = np.array([(*p.gaze, *p.arm) for p in (postures.draw(generator) for _ in range(400))])
    low, high = robot.limits(robot.gaze + robot.arm).T
    share = (drawn - low) / (high - low)
    assert (share >= 0).all() and (share <= 1).all()
    assert (np.abs(share.mean(axis=0) - 0.5) < 0.06).all()
    assert (np.abs(share.std(axis=0) - 12**-0.5) < 0.03).all()


def whole_ball_in_view(robot, camera, gaze, arm, point, radius):
    """By the outline itself: 400 directions that touch the sphere, projected by hand."""
    mount = robot.cameras[camera]
    pose = reference_pose("base", mount.link, angles_of(robot, gaze, arm))
    centre = pose[:3, :3].T @ (point - pose[:3, 3])
    distance = np.linalg.norm(centre)
    if centre[2] < 0.01 + radius:
        return None
    axis = centre / distance
    across = np.linalg.svd(axis[None])[2][1:]
    angle = np.arcsin(radius / distance)
    turn = np.linspace(0.0, 2.0 * np.pi, 200)[:, None]
    rim = np.cos(angle) * axis + np.sin(angle) * (np.cos(turn) * across[0] + np.sin(turn) * across[1])
    u = mount.camera.fx * rim[:, 0] / rim[:, 2] + mount.camera.cx
    v = mount.camera.fy * rim[:, 1] / rim[:, 2] + mount.camera.cy
    height, width = mount.camera.shape
    return min(u.min(), v.min(), width - 1 - u.max(), height - 1 - v.max())


@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
def test_in_view_is_the_whole_ball_and_a_margin(robot, side):
    """Balls along each border, some of them two pixels too far out, some two pixels less."""
    generator, radius = np.random.default_rng(5), 0.02
    postures, gaze, arm = Postures(robot, radius=radius), np.zeros(4), (0.0, 1.0)
    camera = robot.cameras["left"].camera
    pose = reference_pose("base", "left_eye", angles_of(robot, gaze, arm))
    across = {"left": 10.0, "right": 310.0, "top": 10.0, "bottom": 230.0}[side]
    answers = {True: 0, False: 0}
    for _ in range(300):
        near = across + generator.uniform(-25.0, 25.0)
        u, v = (
            (near, generator.uniform(60, 180))
            if side in ("left", "right")
            else (generator.uniform(60, 260), near)
        )
        ray = np.array([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0])
        point = (pose @ (*(generator.uniform(0.15, 0.5) * ray), 1.0))[:3]
        room = whole_ball_in_view(robot, "left", gaze, arm, point, radius)
        if 0.5 < abs(room + MARGIN + 0.5) < 4.0:
            answer = postures.in_view(gaze, point)["left"]
            assert answer == (room > -MARGIN - 0.5), room
            answers[answer] += 1
    assert min(answers.values()) > 5


def test_a_ball_that_holds_the_camera_itself_is_not_in_view(robot):
    postures, gaze = Postures(robot, radius=0.02), np.zeros(4)
    pose = reference_pose("base", "left_eye", angles_of(robot, gaze, (0.0, 1.0)))
    for depth in (0.0, 0.01, 0.019, 0.02):
        assert not postures.in_view(gaze, pose[:3, 3] + depth * pose[:3, 2])["left"]


def test_what_is_behind_the_camera_is_not_in_view(robot):
    postures = Postures(robot, radius=0.02)
    gaze = np.zeros(4)
    pose = reference_pose("base", "left_eye", angles_of(robot, gaze, (0.0, 1.0)))
    ahead, behind = (pose[:3, 3] + depth * pose[:3, 2] for depth in (0.5, -0.5))
    assert postures.in_view(gaze, ahead)["left"]
    assert not postures.in_view(gaze, behind)["left"]


def test_near_is_uniform_on_the_condition_of_being_in_view(robot):
    """Against draws of all postures of which those in view are kept: the same means and spreads."""
    postures = Postures(robot, radius=0.02)
    generator = np.random.default_rng(7)
    near = [postures.draw_in_view(generator) for _ in range(250)]
    assert all(any(postures.in_view(p.gaze, p.point).values()) for p in near)
    kept = []
    while len(kept) < 250:
        drawn = postures.draw(generator)
        if any(postures.in_view(drawn.gaze, drawn.point).values()):
            kept.append(drawn)
    a, b = (np.array([(*p.gaze, *p.arm, *p.point) for p in group]) for group in (near, kept))
    spread = b.std(axis=0)
    # Four standard errors of a difference of means, and of standard deviations.
    assert (np.abs(a.mean(axis=0) - b.mean(axis=0)) < 4 * spread * np.sqrt(2 / 250)).all()
    assert (np.abs(a.std(axis=0) - spread) < 4 * spread * np.sqrt(1 / 250)).all()


def test_the_same_generator_gives_the_same_posture(robot):
    postures = Postures(robot, radius=0.02)
    one, two = (postures.draw_in_view(np.random.default_rng([1, 2])) for _ in range(2))
    assert np.array_equal(one.gaze, two.gaze) and np.array_equal(one.arm, two.arm)
    assert np.array_equal(one.point, two.point)


def test_a_robot_that_cannot_see_its_hand_is_an_error_not_an_endless_search(tmp_path, monkeypatch):
    blind = Camera(320, 240, 1e6, 1e6, 160.0, 120.0)
    mounts = {"left": CameraMount("left_eye", blind)}
    monkeypatch.setattr(module, "ATTEMPTS", 3)
    with pytest.raises(NotInViewError, match="none of 192 random ones has the hand of robot 'small'"):
        Postures(replace(small_robot(tmp_path), cameras=mounts), radius=0.02).draw_in_view(
            np.random.default_rng(0)
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"radius": 0.0}, "radius: expected a number > 0"),
        ({"radius": np.nan}, "radius: expected finite"),
        ({"radius": 0.01, "offset": (0.0, 0.0)}, r"offset: expected shape \(3,\)"),
        ({"radius": 0.01, "offset": (0.0, np.inf, 0.0)}, "offset: expected finite"),
    ],
)
def test_options_that_make_no_sense_are_errors(robot, options, words):
    with pytest.raises(ArgumentError, match=words):
        Postures(robot, **options)
