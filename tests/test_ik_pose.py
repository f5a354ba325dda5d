"""Full poses of the palm: solved, refused, followed; and the derivative that all of it rests on."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.control.clearance import Obstacle
from motorprime.control.pose import DEEPEST, PoseSolver, _Goal, _inverse_right_jacobian
from motorprime.control.reaching import Bench
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, ArgumentTypeError, UnreachableError
from motorprime.rotations import rotation_matrices, rotation_vectors
from small_robot import small_robot

BENCH = Bench(height=-0.06, edge=-0.15)
POLE = Obstacle(Cylinder(0.03, 0.3), (-0.25, 0.25, 0.05))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A solver for a robot of three joints that no simulator has to be there for."""
    return PoseSolver(small_robot(tmp_path_factory.mktemp("small")))


@pytest.fixture(scope="module")
def solver(icub):
    return PoseSolver(icub)


def postures(solver, count, seed=0):
    return np.random.default_rng(seed).uniform(*solver.limits.T, size=(count, len(solver.names)))


def apart(one, other):
    """Distance [m] and angle [rad] between two poses, by the trace."""
    cosine = (np.trace(one[:3, :3].T @ other[:3, :3]) - 1) / 2
    return np.linalg.norm(one[:3, 3] - other[:3, 3]), np.arccos(np.clip(cosine, -1, 1))


# What a solution is.


def test_three_joints_come_back_to_the_pose_they_gave(small):
    for angles in postures(small, 20):
        found = small.solve(small.palm(angles))
        np.testing.assert_allclose(found.angles, angles, atol=5e-3)
        assert found.solved


@pytest.mark.sim
def test_poses_of_an_icub_are_reached_from_rest_within_the_limits(icub, solver):
    """By the URDF's chain, not the solver's."""
    low, high = icub.limits(solver.names).T
    for angles in postures(solver, 60):
        target = icub.reach_chain.forward(angles) @ icub.palm.frame
        found = solver.solve(target)
        place, turn = apart(target, icub.reach_chain.forward(found.angles) @ icub.palm.frame)
        assert place < 0.002 and turn < np.deg2rad(2.0)
        assert found.position_error == pytest.approx(place, abs=1e-9)
        assert found.rotation_error == pytest.approx(turn, abs=1e-5)
        assert (low < found.angles).all() and (found.angles < high).all()
        assert found.depth == 0.0 and 0 <= found.restarts <= 12


@pytest.mark.sim
def test_what_the_pose_leaves_open_goes_towards_the_held_posture(solver):
    """No nearby posture of the same pose is more comfortable: the slope of comfort along it is nearly 0."""
    other = solver.rest + 0.3 * (solver.limits[:, 1] - solver.rest)
    nearer = []
    for angles in postures(solver, 10, seed=5):
        target = solver.palm(angles)
        resting, held = solver.solve(target), solver.solve(target, hold=other)
        assert solver.discomfort(held.angles, other) <= solver.discomfort(resting.angles, other) * 1.02 + 1e-3
        assert solver.discomfort(resting.angles) <= solver.discomfort(held.angles) * 1.02 + 1e-3
        nearer.append(np.abs(held.angles - resting.angles).max())
    assert np.median(nearer) > 0.05


@pytest.mark.sim
def test_holding_a_posture_of_the_pose_keeps_it(solver):
    for angles in postures(solver, 5, seed=6):
        found = solver.solve(solver.palm(angles), angles, hold=angles)
        np.testing.assert_allclose(found.angles, angles, atol=1e-6)


@pytest.mark.sim
def test_a_free_axis_lets_the_palm_turn_about_it_and_about_no_other(solver):
    """Targets turned far about the palm's z: with that turn free the solution points the same way."""
    turned = []
    for angles in postures(solver, 8, seed=7):
        target = solver.palm(angles)
        target[:3, :3] = target[:3, :3] @ rotation_matrices([0.0, 0.0, 2.5])
        found = solver.nearest(target, turning=(1.0, 1.0, 0.0))
        palm = solver.palm(found.angles)
        assert found.solved
        assert np.arccos(np.clip(palm[:3, 2] @ target[:3, 2], -1, 1)) < np.deg2rad(2.0)
        turned.append(apart(palm, target)[1])
    assert np.median(turned) > 0.5


@pytest.mark.sim
def test_the_same_question_has_the_same_answer_and_leaves_its_arrays_alone(icub, solver):
    target, start = solver.palm(postures(solver, 1, seed=8)[0]), solver.rest.copy()
    before = target.copy(), start.copy()
    one, two = solver.solve(target, start), PoseSolver(icub).solve(target, start)
    np.testing.assert_array_equal(one.angles, two.angles)
    np.testing.assert_array_equal(target, before[0])
    np.testing.assert_array_equal(start, before[1])


@pytest.mark.sim
def test_a_margin_keeps_joints_off_their_limits(icub):
    tight = PoseSolver(icub, margin=0.2)
    limits = icub.limits(tight.names)
    span = limits[:, 1] - limits[:, 0]
    for angles in postures(PoseSolver(icub), 5):
        found = tight.nearest(tight.palm(angles), restarts=1).angles
        assert ((found - limits[:, 0]) / span > 0.2 - 1e-9).all()
        assert ((limits[:, 1] - found) / span > 0.2 - 1e-9).all()


# What cannot be reached.


@pytest.mark.sim
@pytest.mark.parametrize("place", [(-1.5, 0.1, 0.0), (0.5, 0.1, 0.0)])
def test_an_unreachable_pose_is_refused_with_how_near_the_palm_comes(solver, place):
    target = solver.palm(solver.rest)
    target[:3, 3] = place
    with pytest.raises(UnreachableError, match=r"target: .* stays \d+\.\d mm and \d+\.\d deg off"):
        solver.solve(target, restarts=2)
    found = solver.nearest(target, restarts=2)
    assert not found.solved and found.restarts == 2 and found.position_error > 0.1
    assert apart(solver.palm(found.angles), target)[0] == pytest.approx(found.position_error)


@pytest.mark.sim
def test_further_starts_solve_what_the_first_does_not(icub):
    """Poses drawn until ten were missed from rest."""
    solver = PoseSolver(icub, margin=0.0)
    missed = []
    for angles in postures(solver, 800, seed=9):
        target = solver.palm(angles)
        if not solver.nearest(target, restarts=0).solved:
            missed.append(solver.nearest(target))
        if len(missed) == 10:
            break
    assert len(missed) == 10
    assert sum(found.solved and found.restarts >= 1 for found in missed) >= 9


# Clearances.


@pytest.mark.sim
def test_an_obstacle_where_the_elbow_was_makes_the_arm_take_another_way_to_the_same_pose(solver):
    """Poses of which another posture is known to be clear."""
    solved, deepest = [], []
    for angles in postures(solver, 250, seed=10):
        target = solver.palm(angles)
        elbow = solver.arm.at(solver.nearest(target).angles).frames[6, :3, 3]
        if np.linalg.norm(solver.arm.at(angles).frames[6, :3, 3] - elbow) < 0.06:
            continue
        guarded = solver.over(None, [Obstacle(Cylinder(0.005, 0.02), elbow, distance=0.0)])
        if guarded._clearance.worst(guarded.arm.at(angles)) > 0.0:
            continue
        found = guarded.nearest(target)
        deepest.append(guarded._clearance.worst(guarded.arm.at(found.angles)))
        assert found.depth == deepest[-1]
        assert found.solved <= (deepest[-1] <= DEEPEST)
        solved.append(found.solved)
    assert len(solved) >= 10
    assert np.mean(solved) >= 0.9


@pytest.mark.sim
def test_a_posture_that_draws_much_goes_before_the_pose(solver):
    held = solver.rest + 0.15
    target = solver.palm(solver.rest)
    for drawn, nearer in ((0.0, target), (1e5, solver.palm(held))):
        angles = solver.rest + 0.07
        for _ in range(30):
            angles = solver.follow(target, angles, step=0.05, hold=held, drawn=drawn).angles
        assert np.linalg.norm(solver.palm(angles)[:3, 3] - nearer[:3, 3]) < 0.005
    with pytest.raises(ArgumentError, match="drawn"):
        solver.follow(target, solver.rest, step=0.05, drawn=-1.0)


def test_a_wary_arm_rather_misses_the_pose_than_come_near(solver):
    target = solver.palm(solver.rest)
    thing = Obstacle(Cylinder(0.03, 0.2), target[:3, 3] + (0.0, 0.05, 0.0))
    bold = solver.over(None, [thing]).nearest(target, restarts=0)
    wary = solver.over(None, [thing], wary=5.0).nearest(target, restarts=0)
    assert 0.0 < wary.depth < 0.5 * bold.depth
    assert wary.position_error > bold.position_error
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ArgumentError, match="wary"):
            solver.over(None, wary=wrong)


def test_a_pose_within_an_obstacle_is_not_solved_and_says_how_deep(icub, solver):
    target = solver.palm(solver.rest)
    buried = solver.over(None, [Obstacle(Cylinder(0.05, 0.2), target[:3, 3])])
    with pytest.raises(UnreachableError, match=r"[1-9]\d* mm too near to what it keeps off"):
        buried.solve(target, restarts=1)
    assert solver.solve(target).solved  # the solver that it was made of is as it was
    assert buried.over(None).solve(target).solved


@pytest.mark.sim
def test_errors_within_the_tolerance_are_no_solution_while_a_clearance_is_missed(icub, solver):
    target = solver.palm(solver.rest)
    buried = Obstacle(Cylinder(0.05, 0.2), target[:3, 3])
    lax = PoseSolver(icub, None, [buried], tolerance=(0.5, 3.0)).nearest(target, restarts=0)
    assert lax.position_error < 0.5 and lax.rotation_error < 3.0
    assert lax.depth > DEEPEST and not lax.solved


def test_place_and_rotation_each_have_to_be_within_their_tolerance(small):
    """Three joints reach the place or the rotation, not both."""
    target = small.palm(small.rest)
    target[:3, :3] = target[:3, :3] @ rotation_matrices([0.3, -0.2, 0.2])
    for tolerance, solved in (((1.0, 0.001), False), ((1e-6, 3.0), False), ((1.0, 3.0), True)):
        strict = PoseSolver(small.robot, tolerance=tolerance)
        found = strict.nearest(target, restarts=2)
        assert found.rotation_error > 0.001 and found.position_error > 1e-6
        assert found.solved is solved


def test_further_starts_are_the_postures_with_the_nearest_palms(small):
    goal = _Goal(small._library_palms[7], small.rest, np.ones(3))
    starts = small._starts(goal, 5)
    np.testing.assert_array_equal(starts[0], small._library[7])
    off = [
        np.hypot(600 * place, 60 * turn) for place, turn in (apart(small.palm(q), goal.palm) for q in starts)
    ]
    every = [
        np.hypot(600 * place, 60 * turn)
        for place, turn in (apart(palm, goal.palm) for palm in small._library_palms)
    ]
    np.testing.assert_allclose(off, np.sort(every)[:5], atol=1e-4)


# Following.


@pytest.mark.sim
def test_a_followed_goal_is_kept_with_steps_no_larger_than_allowed(solver):
    """A way of 10 cm in 1 s, 100 times a second, from a solved pose."""
    start = solver.solve(solver.palm(solver.rest)).angles
    target = solver.palm(start)
    angles, off = start, []
    for t in np.linspace(0.0, 1.0, 100):
        goal = target.copy()
        goal[:3, 3] += 0.1 * t * np.array([-0.6, -0.8, 0.0])
        found = solver.follow(goal, angles, step=0.01)
        assert np.abs(found.angles - angles).max() <= 0.01 + 1e-12
        angles = found.angles
        off.append(found.position_error)
    assert max(off) < 0.002 and found.solved


@pytest.mark.sim
def test_a_goal_that_jumps_is_approached_at_the_bounded_speed_and_no_error_is_raised(solver):
    start, goal = solver.rest, solver.palm(postures(solver, 1, seed=11)[0])
    steps = np.linspace(0.005, 0.02, len(start))
    first = solver.follow(goal, start, step=steps)
    assert not first.solved
    assert (np.abs(first.angles - start) <= steps + 1e-12).all()
    assert np.abs(first.angles - start).max() > 0.004
    goal[:3, 3] += 5.0
    assert solver.follow(goal, start, step=steps).position_error > 4.0


def test_angles_beyond_the_limits_come_back_a_step_at_a_time(small):
    beyond = small.limits[:, 1] + 0.3
    found = small.follow(small.palm(small.rest), beyond, step=0.1)
    assert (found.angles <= beyond).all()
    assert np.abs(found.angles - np.maximum(beyond - 0.1, small.limits[:, 1])).max() < 0.11


# The mathematics.


@pytest.mark.parametrize("vector", [(0, 0, 0), (1e-5, 0, 0), (0.5, -0.2, 0.9), (2.0, 1.5, -1.2), (0, 3.1, 0)])
def test_the_rate_of_a_rotation_vector_is_its_inverse_right_jacobian_times_the_body_s_turning(vector):
    rotation, h = rotation_matrices(vector), 1e-6
    numeric = [
        rotation_vectors(rotation @ rotation_matrices(e)) - rotation_vectors(rotation @ rotation_matrices(-e))
        for e in h * np.eye(3)
    ]
    np.testing.assert_allclose(
        _inverse_right_jacobian(np.array(vector, float)), np.transpose(numeric) / (2 * h), atol=1e-5
    )


@pytest.mark.sim
@pytest.mark.parametrize("turning", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.0)])
@pytest.mark.parametrize("firmness", [1.0, 0.05])
def test_the_analytic_jacobian_is_the_derivative_of_all_residuals(icub, turning, firmness):
    elbow = lambda posture: (posture.frames[6, :1, 3], posture._twists[:, 0] @ posture.frames[6, :, 3])  # noqa: E731

    def preference(posture):
        value, slope = elbow(posture)
        return value, np.where(np.arange(10) <= 6, slope, 0.0)[None]

    solver = PoseSolver(icub, BENCH, [POLE], preference=preference)
    for q in postures(solver, 10, seed=12):
        goal = _Goal(solver.palm(solver.rest), solver.rest, np.array(turning))
        residuals, jacobian = solver._residuals(goal, firmness, q)
        h = 1e-7
        numeric = np.stack(
            [
                (solver._residuals(goal, firmness, q + e)[0] - solver._residuals(goal, firmness, q - e)[0])
                / (2 * h)
                for e in h * np.eye(10)
            ],
            axis=1,
        )
        assert residuals.shape == (len(jacobian),)
        np.testing.assert_allclose(jacobian, numeric, atol=2e-4)


# Errors.


@pytest.mark.parametrize(
    ("ask", "name"),
    [
        (lambda s: s.solve(np.eye(3)), "target"),
        (lambda s: s.solve(np.diag([2.0, 1, 1, 1])), "target: expected a rotation"),
        (lambda s: s.solve(np.diag([-1.0, 1, 1, 1])), "target: expected a rotation"),
        (lambda s: s.solve(np.full((4, 4), np.nan)), "target"),
        (lambda s: s.solve(np.eye(4), np.zeros(2)), "start"),
        (lambda s: s.solve(np.eye(4), [0.0, np.nan, 0.0]), "start"),
        (lambda s: s.solve(np.eye(4), hold=np.zeros(4)), "hold"),
        (lambda s: s.solve(np.eye(4), turning=(1.0, 1.0)), "turning"),
        (lambda s: s.solve(np.eye(4), turning=(1.0, 1.0, 1.5)), "turning: expected weights from 0 to 1"),
        (lambda s: s.solve(np.eye(4), turning=(1.0, -0.1, 1.0)), "turning: expected weights from 0 to 1"),
        (lambda s: s.solve(np.eye(4), restarts=-1), "restarts"),
        (lambda s: s.follow(np.eye(4), np.zeros(2), step=0.1), "angles"),
        (lambda s: s.follow(np.eye(4), s.rest, step=0.0), "step: expected numbers > 0"),
        (lambda s: s.follow(np.eye(4), s.rest, step=[0.1, 0.1]), "step"),
        (lambda s: s.follow(np.eye(4), s.rest, step=np.nan), "step"),
        (lambda s: s.follow(np.eye(4), s.rest, step=0.1, iterations=0), "iterations"),
        (lambda s: PoseSolver(s.robot, margin=0.5), "margin: expected less than half"),
        (lambda s: PoseSolver(s.robot, margin=-0.1), "margin"),
        (lambda s: PoseSolver(s.robot, tolerance=(0.0, 0.1)), r"tolerance\[0\]"),
        (lambda s: PoseSolver(s.robot, tolerance=(0.001, np.inf)), "tolerance"),
        (lambda s: PoseSolver(s.robot, seed=-1), "seed"),
    ],
)
def test_a_question_that_is_wrong_is_named(small, ask, name):
    with pytest.raises(ArgumentError, match=name):
        ask(small)


def test_words_are_no_numbers(small):
    with pytest.raises(ArgumentTypeError, match="target"):
        small.solve("there")
    with pytest.raises(ArgumentTypeError, match="restarts"):
        small.solve(np.eye(4), restarts=1.5)
