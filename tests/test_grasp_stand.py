"""The grasp stand: what it draws, how it judges, and that friction alone carries the glass."""

from dataclasses import replace

import numpy as np
import pytest

from motorprime import ArgumentTypeError, StateError
from motorprime.evaluate.grasp_stand import summary
from motorprime.sim.glass import Glass
from motorprime.sim.scene import REGION
from motorprime.tasks.grasp_stand import (
    HOLD,
    LIFTED,
    OFF,
    TURNED,
    GraspStand,
    GraspTrial,
    GraspVerdict,
    draw_grasp_trial,
    stand_solver,
)

pytestmark = pytest.mark.sim

HEAVY = GraspTrial(
    Glass(radius=0.0375, mass=0.3),
    (-0.30, 0.12),
    np.array([0.004, -0.004, 0.0]),
    np.array([0.0, 0.03, 0.0]),
)


@pytest.fixture(scope="module")
def solver(icub):
    return stand_solver(icub)


@pytest.fixture(scope="module")
def lifted(icub, solver):
    """The widest and heaviest glass with the palm off, and what was seen after each stage."""
    seen = {}

    def watch(stand):
        seen[stand.stage] = {
            "links": {contact.link for contact in stand.world.contacts(stand.glass.body)},
            "height": stand.glass.clearance(),
            "constraints": stand.world.bullet.getNumConstraints(),
        }

    with GraspStand(icub, HEAVY, solver=solver) as stand:
        return stand.run(watch), seen


def test_a_heavy_wide_glass_is_lifted_with_the_palm_off(lifted):
    verdict, seen = lifted
    assert verdict.lifted, verdict.reason
    assert verdict.lowest >= LIFTED
    assert seen["close"]["height"] < 0.005 < LIFTED <= seen["lift"]["height"]


def test_thumb_and_fingers_hold_it_and_nothing_is_tied_to_it(lifted):
    _, seen = lifted
    held = {link.split("_")[1] for link in seen["done"]["links"]}
    assert {"thumb", "index", "middle"} <= held
    assert all(stage["constraints"] == 0 for stage in seen.values())


def test_the_hand_comes_in_without_touching_it(lifted):
    verdict, seen = lifted
    assert seen["approach"]["links"] == set()
    assert verdict.pushed < 0.002
    assert verdict.dragged < 0.03
    assert verdict.toppled < np.deg2rad(10.0)


def test_no_motor_exceeds_its_torque_and_nothing_sinks_into_anything(lifted):
    verdict, _ = lifted
    assert verdict.torque <= 0.3 + 1e-6
    assert verdict.arm_torque <= 20.0
    assert verdict.torso_torque <= 60.0
    assert verdict.deepest < 0.002
    assert verdict.pressure > 0.3 * 9.81 / 0.64  # less could not carry it
    assert verdict.slipped < 0.003


def test_a_glass_without_friction_slips_through_the_hand(icub, solver):
    with GraspStand(icub, HEAVY, solver=solver) as stand:
        stand.world.bullet.changeDynamics(stand.glass.body, -1, lateralFriction=0.0)
        verdict = stand.run()
    assert not verdict.lifted
    assert verdict.lowest < 0.02


def test_what_is_drawn_stays_within_its_limits_and_goes_to_them():
    trials = [draw_grasp_trial(seed) for seed in range(200)]
    off = np.array([trial.off for trial in trials])
    turned = np.array([np.linalg.norm(trial.turned) for trial in trials])
    places = np.array([trial.xy for trial in trials])
    assert 0.95 * OFF < np.abs(off).max() <= OFF == 0.004
    assert 0.95 * TURNED < turned.max() <= TURNED == pytest.approx(np.deg2rad(2.0))
    for k, (low, high) in enumerate(REGION):
        assert low <= places[:, k].min() < places[:, k].max() <= high


def test_the_same_seed_draws_the_same_trial():
    first, again, other = (draw_grasp_trial(seed) for seed in (5, 5, 6))
    assert (first.glass, first.xy) == (again.glass, again.xy) != (other.glass, other.xy)
    np.testing.assert_array_equal(first.off, again.off)


@pytest.mark.parametrize("seed", [1.5, "one"])
def test_a_seed_that_is_none_is_named(seed):
    with pytest.raises(ArgumentTypeError, match="seed"):
        draw_grasp_trial(seed)


def test_a_glass_out_of_reach_is_not_lifted_and_the_reason_says_so(icub, solver):
    with GraspStand(icub, GraspTrial(xy=(-0.60, -0.40)), solver=solver) as stand:
        verdict = stand.run()
    assert not verdict.lifted
    assert "no side of the object can be grasped" in verdict.reason
    assert np.isnan(verdict.lowest)


@pytest.mark.parametrize(
    ("lowest", "touched", "expected"),
    [
        (LIFTED, {"r_hand", "r_thumb_distal", "r_little_middle"}, (True, "")),
        (LIFTED - 1e-4, {"r_hand"}, (False, "50 mm over the table")),
        (0.06, {"r_index_distal", "table"}, (False, "touched by table")),
        (0.06, {"r_index_distal", "r_wrist_1"}, (False, "touched by r_wrist_1")),
        (0.06, {"l_thumb_distal"}, (False, "touched by l_thumb_distal")),
    ],
)
def test_lifted_is_high_for_the_whole_second_and_by_the_right_hand_alone(
    icub, solver, lowest, touched, expected
):
    with GraspStand(icub, GraspTrial(), solver=solver) as stand:
        assert stand._judge(lowest, touched) == expected
    assert HOLD == 1.0


def test_a_robot_without_a_hand_is_named(icub):
    with pytest.raises(StateError, match="'iCub' has no hand"):
        GraspStand(replace(icub, hand=None), GraspTrial())


def test_the_summary_counts_by_mass_and_width_and_has_no_nan():
    good = GraspVerdict(
        True, pushed=0.001, dragged=0.01, toppled=0.1, lowest=0.06, slipped=0.0, pressure=40.0, torque=0.3
    )
    light, heavy = (GraspTrial(Glass(radius=r, mass=m)) for r, m in ((0.030, 0.08), (0.0375, 0.30)))
    figures = summary([(light, good), (heavy, replace(good, pushed=0.003)), (heavy, GraspVerdict())])
    assert (figures["lifted"], figures["unreachable"]) == (2, 1)
    assert figures["by_mass_g"] == {"80-153": "1 of 1", "153-227": "0 of 0", "227-300": "1 of 2"}
    assert list(figures["by_diameter_mm"].values()) == ["1 of 1", "0 of 0", "1 of 2"]
    assert figures["median_pushed_mm"] == pytest.approx(2.0)
    assert figures["max_pushed_mm"] == pytest.approx(3.0)
    assert figures["max_toppled_deg"] == pytest.approx(np.rad2deg(0.1))
    assert figures["least_pressure_by_weight"] == pytest.approx(40.0 / (9.81 * 0.3))
    assert figures["details"][2]["lowest"] is None and figures["details"][2]["lifted"] is False


def test_the_summary_of_trials_that_never_ran_has_no_figures():
    figures = summary([(GraspTrial(), GraspVerdict())])
    assert figures["median_pushed_mm"] is None and figures["least_pressure_by_weight"] is None
