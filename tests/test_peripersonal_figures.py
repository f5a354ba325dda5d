"""The figures of learned peripersonal attention, and its picture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from head_eye_rig import ball_of_points
from motorprime.errors import ArgumentError, StateError
from motorprime.evaluate.peripersonal_figures import evaluate_peripersonal, overlap
from motorprime.evaluate.peripersonal_picture import draw_peripersonal
from motorprime.learning.peripersonal import learn_peripersonal
from motorprime.learning.posture_ellipses import fit_postures, random_head_eye
from motorprime.projection import KinematicProjection
from small_robot import small_robot

viz = pytest.mark.viz
KEYS = {
    "seed", "postures", "ellipses", "iou_mean", "iou_p05", "iou_min", "view_agreement", "infer_us",
}  # fmt: skip


def iou(mean, chol, other_mean, other_chol):
    return overlap(*(np.array(part, float) for part in (mean, chol, other_mean, other_chol)))


@pytest.mark.parametrize("distance", [0.0, 1.0, 30.0, 59.0, 60.1, 500.0])
@pytest.mark.parametrize("angle", [0.0, 0.8, math.pi / 2])
def test_two_circles_share_the_lens_of_the_textbook(distance, angle):
    """Radius 30, three standard deviations of 10: 2 r^2 acos(d / 2r) - d/2 sqrt(4 r^2 - d^2)."""
    r = 30.0
    lens = 0.0
    if distance < 2 * r:
        lens = 2 * r**2 * math.acos(distance / (2 * r)) - distance / 2 * math.sqrt(4 * r**2 - distance**2)
    expected = lens / (2 * math.pi * r**2 - lens)
    there = (50.0 + distance * math.cos(angle), 40.0 + distance * math.sin(angle))
    assert iou((50.0, 40.0), (10.0, 0.0, 10.0), there, (10.0, 0.0, 10.0)) == pytest.approx(expected, abs=1e-5)


def test_an_ellipse_within_another_shares_its_area():
    """Both ways round; areas are in the ratio of the factors' determinants."""
    large, small = ((0.0, 0.0), (20.0, -9.0, 15.0)), ((3.0, -2.0), (6.0, 2.0, 4.0))
    expected = 6.0 * 4.0 / (20.0 * 15.0)
    assert iou(*large, *small) == pytest.approx(expected, abs=2e-5)
    assert iou(*small, *large) == pytest.approx(expected, abs=2e-5)
    assert iou(*large, *large) == pytest.approx(1.0, abs=1e-9)


def test_the_overlap_of_slanted_ellipses_is_that_of_counted_points():
    """Against points counted inside (p - m)^T (L L^T)^-1 (p - m) <= 9, a million to the plane."""
    one, two = ((10.0, 5.0), (20.0, -12.0, 9.0)), ((25.0, -6.0), (14.0, 8.0, 16.0))
    axis = np.linspace(-80.0, 100.0, 1000)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    inside = []
    for mean, (l1, l2, l3) in (one, two):
        white = np.linalg.solve(np.array([[l1, 0.0], [l2, l3]]), (grid - mean).reshape(-1, 2).T)
        inside.append((white**2).sum(axis=0) <= 9.0)
    counted = np.count_nonzero(inside[0] & inside[1]) / np.count_nonzero(inside[0] | inside[1])
    assert 0.2 < counted < 0.8
    assert iou(*one, *two) == pytest.approx(counted, abs=1e-3)
    assert iou(*two, *one) == pytest.approx(iou(*one, *two), abs=1e-5)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def cloud(robot):
    return ball_of_points(robot, size=600)


@pytest.fixture(scope="module")
def model(robot, cloud):
    return learn_peripersonal(robot, cloud=cloud, seed=0, postures=500, hidden=(8,), iterations=30)[0]


class Twisted:
    """A model, with its ellipses or its judgement of what is in view changed."""

    def __init__(self, model, change=None, seen=None):
        self.model, self.change, self.seen, self.cameras = model, change, seen, model.cameras

    def visible(self, joints):
        return self.model.visible(joints) if self.seen is None else dict.fromkeys(self.cameras, self.seen)

    def ellipses(self, joints):
        fits = self.model.ellipses(joints)
        for fit in fits.values():
            if self.change is not None:
                self.change(fit)
        return fits


def test_the_figures_of_a_good_model_are_good(robot, cloud, model):
    figures = evaluate_peripersonal(model, robot, seed=5, postures=60, cloud=cloud)
    assert set(figures) == KEYS and figures["seed"] == 5 and figures["postures"] == 60
    assert 60 < figures["ellipses"] <= 120
    assert 0.9 < figures["iou_mean"] < 1.0
    assert figures["iou_min"] <= figures["iou_p05"] <= figures["iou_mean"]
    assert figures["view_agreement"] > 0.97 and figures["infer_us"] > 0.0


def test_the_seed_names_the_postures(robot, cloud, model):
    runs = [evaluate_peripersonal(model, robot, seed=s, postures=20, cloud=cloud) for s in (5, 5, 6)]
    assert runs[0]["iou_mean"] == runs[1]["iou_mean"] != runs[2]["iou_mean"]


def test_a_shifted_or_a_larger_ellipse_overlaps_less(robot, cloud, model):
    def figures(change):
        return evaluate_peripersonal(Twisted(model, change), robot, seed=5, postures=30, cloud=cloud)

    good = figures(None)["iou_mean"]
    doubled = figures(lambda fit: np.multiply(fit.chol, 2.0, out=fit.chol))["iou_mean"]
    shifted = figures(lambda fit: np.add(fit.mean, 40.0, out=fit.mean))["iou_mean"]
    assert doubled == pytest.approx(0.25, abs=0.02)
    assert shifted < good - 0.2


def test_a_camera_that_the_model_does_not_see_counts_as_no_overlap(robot, cloud, model):
    blind = evaluate_peripersonal(Twisted(model, seen=False), robot, seed=5, postures=30, cloud=cloud)
    assert blind["iou_mean"] == 0.0 and blind["infer_us"] is None
    assert blind["view_agreement"] < 0.4


def test_only_postures_with_a_tenth_of_the_cloud_in_an_image_are_judged(robot, cloud, model):
    """Counted again: of the first postures drawn, every camera that has 60 of the 600 points in its image."""
    figures = evaluate_peripersonal(model, robot, seed=5, postures=30, cloud=cloud)
    drawn = random_head_eye(robot, 1000, np.random.default_rng(5))
    fits = fit_postures(cloud, KinematicProjection(robot), drawn)
    enough = np.column_stack([fits[camera].inside >= 60 for camera in model.cameras])
    assert figures["ellipses"] == enough[enough.any(axis=1)][:30].sum()


def test_of_a_small_cloud_only_what_the_direct_fit_takes_as_in_view_is_judged(robot, model):
    """A tenth of 300 points is fewer than the 50 that the direct fit asks for."""
    figures = evaluate_peripersonal(model, robot, seed=5, postures=60, cloud=ball_of_points(robot, size=300))
    drawn = random_head_eye(robot, 1000, np.random.default_rng(5))
    fits = fit_postures(ball_of_points(robot, size=300), KinematicProjection(robot), drawn)
    enough = np.column_stack([fits[camera].in_view for camera in model.cameras])
    assert figures["ellipses"] == enough[enough.any(axis=1)][:60].sum()


def test_a_space_out_of_view_and_a_wrong_number_are_named(robot, model):
    behind = ball_of_points(robot, distance=-0.5, size=60)
    with pytest.raises(StateError, match="30 are wanted, but of 50000 uniform ones only 0"):
        evaluate_peripersonal(model, robot, postures=30, cloud=behind)
    with pytest.raises(ArgumentError, match="postures"):
        evaluate_peripersonal(model, robot, postures=0)


@viz
def test_the_picture_has_a_row_for_each_posture_and_a_column_for_each_camera(robot, cloud, model):
    figure = draw_peripersonal(model, robot, 1, 2, cloud=cloud)
    axes = figure.get_axes()
    assert len(axes) == 4
    for panel, camera in zip(axes, ("left", "right") * 2, strict=True):
        dots, fitted, learned = panel.get_lines()
        assert len(dots.get_xdata()) == 600
        # Both ellipses are of the same space and lie where it lies; v runs down.
        np.testing.assert_allclose(fitted.get_xydata(), learned.get_xydata(), atol=20.0)
        centre = fitted.get_xydata()[:-1].mean(axis=0)
        np.testing.assert_allclose(centre, dots.get_xydata().mean(axis=0), atol=10.0)
        assert panel.get_ylim()[0] > panel.get_ylim()[1]
        assert panel.get_title(loc="left").startswith(f"{camera} camera\n")
        assert "% of the positions" in panel.get_title(loc="left")
    assert len(figure.legends[0].get_texts()) == 5


@viz
def test_the_picture_shows_postures_with_a_tenth_of_the_space_in_every_image(robot, model):
    """Unchosen ones would fail: of 8 in a row some hardly see it."""
    dense = ball_of_points(robot, size=2500)
    for panel in draw_peripersonal(model, robot, 1, 8, cloud=dense).get_axes():
        dots = panel.get_lines()[0].get_xydata()
        assert ((dots >= -0.5) & (dots <= (319.5, 239.5))).all(axis=1).sum() >= 250


@viz
def test_the_picture_says_where_the_model_sees_nothing_and_what_cannot_be_drawn(robot, cloud, model):
    from motorprime import NotInViewError

    def nothing(joints):
        raise NotInViewError("blind")

    blind = Twisted(model)
    blind.ellipses, blind.shapes = nothing, model.shapes
    panel = draw_peripersonal(blind, robot, 1, 1, cloud=cloud).get_axes()[0]
    assert "learned as out of view" in panel.get_title(loc="left") and len(panel.get_lines()) == 2
    with pytest.raises(StateError, match="1 are wanted"):
        draw_peripersonal(model, robot, 1, 1, cloud=ball_of_points(robot, distance=-0.5))
    with pytest.raises(ArgumentError, match="postures"):
        draw_peripersonal(model, robot, 1, 0, cloud=cloud)
