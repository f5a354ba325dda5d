"""From which side an object is grasped."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.control.clearance import Obstacle
from motorprime.control.grasping import FARTHEST, Grasp, choose_grasp
from motorprime.control.pose import PoseSolution, PoseSolver
from motorprime.control.reaching import AZIMUTHS, Bench
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, UnreachableError

pytestmark = pytest.mark.sim

BENCH = Bench(height=-0.06, edge=-0.15)
CENTRE = np.array([-0.30, 0.10, 0.01])


def side(centre, standoff=0.05):
    """The palm level, its z towards the axis, fingers level."""

    def pose(azimuth):
        z = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
        y = np.array([0.0, 0.0, -1.0])
        palm = np.eye(4)
        palm[:3, :3] = np.column_stack([np.cross(y, z), y, z])
        palm[:3, 3] = np.asarray(centre) - standoff * z
        return palm

    return pose


@pytest.fixture(scope="module")
def solver(icub):
    return PoseSolver(icub, BENCH)


def off(icub, solution, target):
    palm = icub.reach_chain.forward(solution.angles) @ icub.palm.frame
    turn = np.arccos(np.clip((np.trace(palm[:3, :3].T @ target[:3, :3]) - 1) / 2, -1, 1))
    return np.linalg.norm(palm[:3, 3] - target[:3, 3]), turn


@pytest.mark.parametrize("centre", [(-0.30, 0.10, 0.01), (-0.26, 0.05, 0.0), (-0.34, 0.16, 0.02)])
def test_grasp_and_pregrasp_are_both_where_they_were_asked(icub, solver, centre):
    grasp = choose_grasp(solver, side(centre), distance=0.06)
    np.testing.assert_allclose(grasp.palm, side(centre)(grasp.azimuth))
    np.testing.assert_allclose(grasp.palm_before[:3, :3], grasp.palm[:3, :3])
    np.testing.assert_allclose(grasp.palm_before[:3, 3], grasp.palm[:3, 3] - 0.06 * grasp.palm[:3, 2])
    for solution, target in ((grasp.grasp, grasp.palm), (grasp.pregrasp, grasp.palm_before)):
        place, turn = off(icub, solution, target)
        assert place < 0.002 and turn < np.deg2rad(2.0)
    assert AZIMUTHS[0] <= grasp.azimuth <= AZIMUTHS[-1]
    assert grasp.feasible and np.abs(grasp.grasp.angles - grasp.pregrasp.angles).max() <= FARTHEST


def test_no_other_side_is_much_more_comfortable(solver):
    best = choose_grasp(solver, side(CENTRE))
    for azimuth in np.linspace(AZIMUTHS[0], AZIMUTHS[-1], 13):
        try:
            other = choose_grasp(solver, side(CENTRE), azimuths=[azimuth])
        except UnreachableError:
            continue
        assert best.discomfort <= other.discomfort * 1.05 + 1e-3


def test_the_best_side_is_refined_between_those_that_are_asked_for(solver):
    """Of -20, 40 and 100 deg; 10 deg, halfway, is better than all three."""
    asked = np.deg2rad([-20.0, 40.0, 100.0])
    refined = choose_grasp(solver, side(CENTRE), azimuths=asked)
    alone = [choose_grasp(solver, side(CENTRE), azimuths=[azimuth]) for azimuth in asked[:2]]
    assert refined.discomfort < 0.95 * min(one.discomfort for one in alone)
    assert np.abs(refined.azimuth - asked).min() > 0.1


def test_sides_that_cannot_be_better_are_not_solved_with_their_clearances(solver, monkeypatch):
    """Two solves for the best side and for each of four refinements at most; nine sides would need 18."""
    guarded, nearest = [], PoseSolver.nearest

    def counting(self, *args, **options):
        guarded.append(not self._clearance.idle)
        return nearest(self, *args, **options)

    monkeypatch.setattr(PoseSolver, "nearest", counting)
    choose_grasp(solver, side(CENTRE))
    assert 2 <= sum(guarded) <= 10


def test_a_pregrasp_that_is_another_posture_is_no_approach():
    def solution(angle):
        return PoseSolution(np.array([0.0, angle]), 0.0, 0.0, 0.0, 0, True)

    def grasp(angle):
        return Grasp(0.0, np.eye(4), np.eye(4), solution(0.1), solution(angle), 0.0)

    assert grasp(0.1 + FARTHEST - 0.01).feasible and not grasp(0.1 + FARTHEST + 0.01).feasible
    assert not grasp(0.1 - FARTHEST - 0.01).feasible


def test_the_discomfort_is_that_of_both_postures(solver):
    best = choose_grasp(solver, side(CENTRE))
    both = solver.discomfort(best.grasp.angles) + solver.discomfort(best.pregrasp.angles)
    assert best.discomfort == pytest.approx(both)


def test_backwards_is_in_the_palm_s_axes_and_only_its_direction_counts(solver):
    best = choose_grasp(solver, side(CENTRE), distance=0.05, backwards=(-3.0, 0.0, -3.0))
    shift = best.palm[:3, :3].T @ (best.palm_before[:3, 3] - best.palm[:3, 3])
    np.testing.assert_allclose(shift, 0.05 * np.array([-1, 0, -1]) / np.sqrt(2), atol=1e-12)


def test_an_obstacle_in_the_way_of_the_best_side_makes_another_one_best(icub, solver):
    free = choose_grasp(solver, side(CENTRE))
    wrist = solver.arm.at(free.pregrasp.angles).frames[8, :3, 3]
    pole = Obstacle(Cylinder(0.015, 0.3), wrist + np.array([0.05, 0.04, 0.0]))
    hindered = solver.over(BENCH, [pole])
    best = choose_grasp(hindered, side(CENTRE))
    assert hindered._clearance.worst(hindered.arm.at(free.pregrasp.angles)) > 0.005
    for solution in (best.grasp, best.pregrasp):
        assert hindered._clearance.worst(hindered.arm.at(solution.angles)) <= 0.005
    assert best.discomfort >= free.discomfort


def test_what_is_out_of_reach_or_walled_in_is_refused(icub, solver):
    with pytest.raises(
        UnreachableError, match=r"no side of the object .* best of 9 leaves the palm \d+\.\d mm"
    ):
        choose_grasp(solver, side((-0.9, 0.1, 0.0)))
    walled = solver.over(BENCH, [Obstacle(Cylinder(0.12, 0.3), CENTRE)])
    with pytest.raises(UnreachableError, match="too near to what it keeps off"):
        choose_grasp(walled, side(CENTRE))


def test_one_azimuth_is_enough_and_is_not_refined(solver):
    assert choose_grasp(solver, side(CENTRE), azimuths=[0.3]).azimuth == 0.3


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"azimuths": []}, "azimuths"),
        ({"azimuths": [0.2, 0.1]}, "azimuths: expected one or more ascending"),
        ({"azimuths": [0.1, np.nan]}, "azimuths"),
        ({"azimuths": 0.1}, "azimuths"),
        ({"distance": -0.1}, "distance"),
        ({"distance": np.nan}, "distance"),
        ({"backwards": (0.0, 0.0, 0.0)}, "backwards: expected a direction"),
        ({"backwards": (0.0, 1.0)}, "backwards"),
        ({"start": np.zeros(3)}, "start"),
        ({"hold": np.zeros(3)}, "hold"),
        ({"pose": lambda azimuth: np.eye(3)}, "pose"),
        ({"pose": lambda azimuth: np.full((4, 4), np.nan)}, "pose"),
    ],
)
def test_a_question_that_is_wrong_is_named(solver, change, name):
    with pytest.raises(ArgumentError, match=name):
        choose_grasp(solver, **{"pose": side(CENTRE), **change})
