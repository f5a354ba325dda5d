"""A blocked path goes around, on the side where it would have collided, or is refused."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from motorprime.control.clearance import Obstacle
from motorprime.control.motion import Leg
from motorprime.control.movement import Goal, State
from motorprime.control.obstacle import ALLOWANCE, MARGIN, SAFETY, TIGHT, plan_motion
from motorprime.cylinder import Cylinder
from motorprime.errors import ArgumentError, Error, UnreachableError
from motorprime.kinematics import transform
from small_dynamics import simple

TABLE = -0.06
CAN = Cylinder(0.03, 0.13)
GOAL = np.array([-0.30, 0.0, 0.0])
FROM_THE_RIGHT = np.array([-0.30, 0.50, 0.0])  # the way there runs along y
FROM_THE_NEAR_SIDE = np.array([0.20, 0.0, 0.0])  # along x
DYNAMICS = simple()  # of one component, so paths are straight


def pose(place):
    return transform(np.eye(3), place)


def start(place):
    return State(GOAL, pose(place), 1.0)


def to(place, **options):
    return Leg(Goal(GOAL, pose(place)), **options)


def standing(x, y, shape=CAN):
    return Obstacle(shape, np.array([x, y, TABLE + shape.height / 2]))


def plan(place, *obstacles, goal=GOAL, **options):
    return plan_motion(DYNAMICS, start(place), [to(goal)], obstacles, **options)


def distances(path, obstacle):
    """Of points (N, 3) outside an upright cylinder from its surface; 0 inside."""
    offset = path - obstacle.centre
    beside = np.maximum(np.linalg.norm(offset[:, :2], axis=1) - obstacle.shape.radius, 0.0)
    above = np.maximum(np.abs(offset[:, 2]) - obstacle.shape.height / 2, 0.0)
    return np.hypot(beside, above)


def least(motion, obstacle):
    return distances(motion.simulated.path, obstacle).min()


def via(motion):
    return motion.legs[0].goal.palm[:3, 3]


# Where there is nothing to avoid.


def test_without_obstacles_the_way_is_the_straight_one():
    motion = plan(FROM_THE_RIGHT)
    assert len(motion.legs) == 1
    assert motion.clearance == np.inf
    assert np.ptp(motion.simulated.path[:, 0]) < 1e-12
    assert motion.simulated.arrived


def test_what_stands_aside_changes_nothing_but_the_clearance_that_is_told():
    aside = standing(-0.30 - 0.03 - ALLOWANCE - 0.005, 0.25)
    motion = plan(FROM_THE_RIGHT, aside)
    assert len(motion.legs) == 1
    np.testing.assert_array_equal(motion.simulated.path, plan(FROM_THE_RIGHT).simulated.path)
    assert motion.clearance == pytest.approx(ALLOWANCE + 0.005, abs=1e-4)  # between two samples
    nearer = standing(-0.30 - 0.03 - ALLOWANCE + 0.005, 0.25)
    assert len(plan(FROM_THE_RIGHT, nearer).legs) == 2


# Where the way is blocked.


def test_a_blocked_path_goes_around_and_arrives():
    obstacle = standing(-0.30, 0.25)
    direct, motion = plan(FROM_THE_RIGHT), plan(FROM_THE_RIGHT, obstacle)
    assert least(direct, obstacle) < 1e-3
    assert least(motion, obstacle) >= ALLOWANCE
    assert motion.clearance == pytest.approx(least(motion, obstacle))
    assert motion.simulated.arrived
    np.testing.assert_allclose(motion.simulated.path[-1], GOAL, atol=2e-3)
    np.testing.assert_allclose(motion.simulated.path[0], FROM_THE_RIGHT, atol=1e-9)


def test_the_hand_is_slim_and_does_not_close_at_the_via_point():
    motion = plan(FROM_THE_RIGHT, standing(-0.30, 0.25))
    first, last = motion.legs
    assert first.slim and not last.slim
    assert first.goal.amplitude == 0.0 and first.goal.opening == 1.0
    np.testing.assert_allclose(motion.simulated.openings[: motion.begins[1]], 1.0, atol=1e-6)
    assert last.goal.palm is motion.goal.palm


def test_the_palm_is_turned_halfway_at_the_via_point():
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    goal = Leg(Goal(GOAL, transform(quarter, GOAL)))
    motion = plan_motion(DYNAMICS, start(FROM_THE_RIGHT), [goal], [standing(-0.30, 0.25)])
    half = motion.legs[0].goal.palm[:3, :3]
    np.testing.assert_allclose(half @ half, quarter, atol=1e-9)
    assert half[1, 0] > 0.7  # and not the long way round


@pytest.mark.parametrize("aside", [0.01, 0.03, 0.05])
def test_it_passes_on_the_side_where_the_collision_is_expected(aside):
    """The path runs before or behind the obstacle's axis: it is bent on to that side. -x is in front."""
    behind = plan(FROM_THE_RIGHT, standing(-0.30 - aside, 0.25))
    before = plan(FROM_THE_RIGHT, standing(-0.30 + aside, 0.25))
    assert via(behind)[0] > -0.30 - aside + CAN.radius + ALLOWANCE  # posterior
    assert via(before)[0] < -0.30 + aside - CAN.radius - ALLOWANCE  # anterior
    for motion, sign in ((behind, 1.0), (before, -1.0)):
        path = motion.simulated.path
        beside = np.abs(path[:, 1] - 0.25) < CAN.radius
        assert beside.any()
        assert (sign * (path[beside, 0] + 0.30) > 0.0).all()
    # The mirrored scene has the mirrored path.
    mirrored = behind.simulated.path * [-1.0, 1.0, 1.0] - [0.60, 0.0, 0.0]
    np.testing.assert_allclose(before.simulated.path, mirrored, atol=1e-9)


def test_what_counts_as_in_front_may_be_another_direction_of_any_length():
    """A path along x that runs to one side of the obstacle, where left and right are front and back."""
    for sign in (1.0, -1.0):
        obstacle = standing(-0.05, -0.02 * sign)
        sideways = plan(FROM_THE_NEAR_SIDE, obstacle, anterior=(0.0, 7.0, 0.0))
        assert sign * (via(sideways)[1] - obstacle.centre[1]) == pytest.approx(CAN.radius + SAFETY)
        assert least(sideways, obstacle) >= ALLOWANCE


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_path_from_front_to_back_passes_across_on_the_nearer_side(sign):
    """In front and behind lie on the path itself, which neither gets around."""
    obstacle = standing(-0.05, -0.02 * sign)
    motion = plan(FROM_THE_NEAR_SIDE, obstacle)
    assert least(motion, obstacle) >= ALLOWANCE
    assert sign * (via(motion)[1] - obstacle.centre[1]) > CAN.radius + ALLOWANCE


@pytest.mark.parametrize("height", [-0.02, 0.0, 0.04])
def test_it_passes_at_the_height_of_the_path(height):
    up = np.array([0.0, 0.0, height])
    motion = plan(FROM_THE_RIGHT + up, standing(-0.31, 0.25), goal=GOAL + up)
    assert via(motion)[2] == pytest.approx(height, abs=1e-9)
    assert np.ptp(motion.simulated.path[:, 2]) < 1e-9


@pytest.mark.parametrize("aside", [True, False])
def test_where_no_side_leads_past_it_goes_over_aside_or_right_across(aside):
    low = Cylinder(0.03, 0.08)
    obstacle, top = standing(-0.30, 0.25, low), TABLE + low.height

    def high(motion):
        off = np.linalg.norm((via(motion) - obstacle.centre)[:2])
        return via(motion)[2] > top + ALLOWANCE and (off > 0.05) == aside

    motion = plan(FROM_THE_RIGHT, obstacle, feasible=high)
    assert high(motion)
    assert least(motion, obstacle) >= ALLOWANCE
    over = motion.simulated.path[np.abs(motion.simulated.path[:, 1] - 0.25) < low.radius, 2]
    assert over.max() > top + (0.0 if aside else ALLOWANCE)


def test_two_that_stand_in_the_way_are_both_cleared():
    both = standing(-0.30, 0.17), standing(-0.32, 0.33)
    motion = plan(FROM_THE_RIGHT, *both)
    assert motion.simulated.arrived
    for obstacle in both:
        assert least(motion, obstacle) >= ALLOWANCE
    assert motion.clearance == pytest.approx(min(least(motion, obstacle) for obstacle in both))


def test_the_way_around_one_does_not_lead_into_another():
    """The collision is expected behind; there something else stands."""
    first = standing(-0.32, 0.25)
    alone = plan(FROM_THE_RIGHT, first)
    second = standing(via(alone)[0] + 0.01, 0.25)
    assert least(alone, second) < ALLOWANCE <= least(plan(FROM_THE_RIGHT), second)
    motion = plan(FROM_THE_RIGHT, first, second)
    for obstacle in (first, second):
        assert least(motion, obstacle) >= ALLOWANCE


def test_a_larger_allowance_is_kept_too():
    obstacle = standing(-0.30, 0.25)
    motion = plan(FROM_THE_RIGHT, obstacle, allowance=0.08)
    assert least(motion, obstacle) >= 0.08


def test_legs_behind_the_via_point_are_kept_as_they_are():
    legs = [to(GOAL + np.array([0.0, 0.08, 0.0]), near=0.01, turned=0.1), to(GOAL)]
    motion = plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs, [standing(-0.30, 0.27)])
    assert list(motion.legs[1:]) == legs
    assert len(motion.legs) == len(motion.begins) == 3


# The target.


def grasp_from_the_far_side():
    """The way to the pre-grasp leads through the target, which stands before the grasp."""
    target = standing(-0.30, 0.05, Cylinder(0.035, 0.10))
    legs = [to((-0.30, -0.08, 0.0), near=0.008), to((-0.30, 0.01, 0.0))]
    return legs, target


def test_the_target_is_kept_off_until_the_last_leg_and_there_it_is_not():
    legs, target = grasp_from_the_far_side()
    careless = plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs)
    assert least(careless, target) == 0.0
    motion = plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs, target=target)
    gaps = distances(motion.simulated.path, target)
    assert gaps[: motion.begins[-1]].min() > TIGHT
    assert gaps[-1] < 0.01
    assert motion.simulated.arrived


def test_a_single_leg_leads_to_the_target_whatever_stands_there():
    _, target = grasp_from_the_far_side()
    motion = plan_motion(DYNAMICS, start(FROM_THE_RIGHT), [to((-0.30, 0.05, 0.0))], target=target)
    assert len(motion.legs) == 1


def test_the_target_is_no_obstacle_by_whose_clearance_a_motion_is_judged():
    legs, target = grasp_from_the_far_side()
    assert plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs, target=target).clearance == np.inf


# What is refused.


def test_a_goal_in_an_obstacle_or_too_near_is_refused():
    for y in (0.0, CAN.radius + TIGHT - 0.001):
        with pytest.raises(UnreachableError, match=r"goal: in collision; .* cm from an obstacle at .* needs"):
            plan(FROM_THE_RIGHT, standing(-0.30, y))
    plan(FROM_THE_RIGHT, standing(-0.30, -CAN.radius - TIGHT - 0.001))


def test_a_start_in_an_obstacle_or_too_near_is_refused():
    for y in (0.50, 0.50 + CAN.radius + MARGIN - 0.001):
        with pytest.raises(
            UnreachableError, match=r"start: in collision; the palm is .* cm from an obstacle"
        ):
            plan(FROM_THE_RIGHT, standing(-0.30, y))
    plan(FROM_THE_RIGHT, standing(-0.30, 0.50 + CAN.radius + MARGIN + 0.001))


def test_a_pregrasp_in_an_obstacle_is_refused_too():
    legs = [to((-0.30, 0.20, 0.0)), to(GOAL)]
    with pytest.raises(UnreachableError, match="goal: in collision"):
        plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs, [standing(-0.30, 0.20)])


def test_an_obstacle_around_the_target_is_refused():
    wide = Cylinder(0.15, 0.2)
    with pytest.raises(UnreachableError, match="goal: in collision"):
        plan(FROM_THE_RIGHT, standing(GOAL[0], GOAL[1], wide))


def test_a_start_close_to_an_obstacle_may_leave_it_but_not_come_nearer():
    obstacle = standing(-0.30, 0.50 + CAN.radius + 0.03)
    motion = plan(FROM_THE_RIGHT, obstacle)
    assert least(motion, obstacle) > 0.03 - MARGIN
    beside = standing(-0.30, 0.50 - CAN.radius - 0.03)
    motion = plan(FROM_THE_RIGHT, beside)
    assert least(motion, beside) > 0.03 - MARGIN


def test_what_cannot_be_passed_is_refused_and_the_message_says_where_it_stands():
    wall = standing(-0.30, 0.25, Cylinder(0.03, 0.13))
    with pytest.raises(UnreachableError, match=r"none of \d+ ways by via-points .* \[-0.3 +0.25 +0.005\]"):
        plan(FROM_THE_RIGHT, wall, feasible=lambda motion: False)
    slow = DYNAMICS.with_speed(0.02)
    with pytest.raises(UnreachableError):  # nothing arrives in time
        plan_motion(slow, start(FROM_THE_RIGHT), [to(GOAL)], [wall])
    with pytest.raises(UnreachableError):
        plan_motion(slow, start(FROM_THE_RIGHT), [to(GOAL)])


# What the arm can do.


def test_a_way_that_the_arm_cannot_follow_is_refused_where_nothing_stands():
    with pytest.raises(UnreachableError, match="the arm cannot follow"):
        plan(FROM_THE_RIGHT, feasible=lambda motion: False)


def test_a_free_way_is_asked_about_and_replaced_where_the_arm_cannot():
    aside = standing(-0.45, 0.25)
    direct = plan(FROM_THE_RIGHT, aside)
    asked = []
    motion = plan(FROM_THE_RIGHT, aside, feasible=lambda motion: asked.append(motion) or len(motion.legs) > 1)
    assert len(direct.legs) == len(asked[0].legs) == 1
    assert motion.legs == asked[-1].legs
    assert len(motion.legs) == 2
    assert least(motion, aside) >= ALLOWANCE


def test_the_first_motion_that_the_arm_can_do_is_taken_and_all_that_are_asked_about_are_clear():
    obstacle, asked = standing(-0.31, 0.25), []

    def second(motion):
        asked.append(motion)
        return len(asked) == 2

    motion = plan(FROM_THE_RIGHT, obstacle, feasible=second)
    assert len(asked) == 2
    assert motion.legs == asked[1].legs
    for one in asked:
        assert least(one, obstacle) >= ALLOWANCE
        assert one.simulated.arrived
    assert via(asked[0])[0] > -0.30 > via(asked[1])[0]  # the other side comes second


# Bad arguments.


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"allowance": np.nan}, "allowance"),
        ({"allowance": -0.01}, "allowance"),
        ({"allowance": np.inf}, "allowance"),
        ({"anterior": (0.0, 0.0, 0.0)}, "anterior"),
        ({"anterior": (np.nan, 0.0, 0.0)}, "anterior"),
        ({"anterior": (1.0, 0.0)}, "anterior"),
    ],
)
def test_bad_arguments_are_named(options, name):
    with pytest.raises(Error, match=name):
        plan(FROM_THE_RIGHT, standing(-0.30, 0.25), **options)


def test_no_legs_are_refused():
    with pytest.raises(ArgumentError, match="legs"):
        plan_motion(DYNAMICS, start(FROM_THE_RIGHT), [])


def test_an_obstacle_that_is_no_place_or_no_size_is_refused():
    for centre in ((np.nan, 0.0, 0.0), (0.0, 0.0), (np.inf, 0.0, 0.0)):
        with pytest.raises(ArgumentError, match="centre"):
            Obstacle(CAN, np.array(centre))
    for size in ((np.nan, 0.1), (0.03, -0.1), (0.0, 0.1)):
        with pytest.raises(Error, match=r"radius|height"):
            Cylinder(*size)


def test_nothing_that_is_given_is_changed():
    state, legs, obstacle = start(FROM_THE_RIGHT), [to(GOAL)], standing(-0.30, 0.25)
    anterior, centre = np.array([-2.0, 0.0, 0.0]), obstacle.centre.copy()
    plan_motion(DYNAMICS, state, legs, [obstacle], target=standing(-0.30, -0.2), anterior=anterior)
    np.testing.assert_array_equal(anterior, [-2.0, 0.0, 0.0])
    np.testing.assert_array_equal(obstacle.centre, centre)
    assert len(legs) == 1
    np.testing.assert_array_equal(state.palm, pose(FROM_THE_RIGHT))


# Any scene.

horizontal = st.floats(-0.4, 0.4)
height = st.floats(TABLE + 0.04, TABLE + 0.25)
place = st.tuples(horizontal, horizontal, height).map(np.array)
cylinder = st.builds(Cylinder, st.floats(0.01, 0.06), st.floats(0.05, 0.22))


@settings(max_examples=60, deadline=None)
@given(
    begin=place,
    end=place,
    shapes=st.lists(cylinder, min_size=1, max_size=3),
    shares=st.tuples(*[st.floats(0.2, 0.8)] * 3),
    asides=st.tuples(*[st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))] * 3),
)
def test_a_planned_path_is_clear_of_everything_or_refused(begin, end, shapes, shares, asides):
    assume(np.linalg.norm(end - begin) > 0.1)
    obstacles = [
        standing(*(begin + share * (end - begin))[:2] + aside, shape)
        for shape, share, aside in zip(shapes, shares, asides, strict=False)
    ]
    legs = [to(end)]
    try:
        motion = plan_motion(DYNAMICS, start(begin), legs, obstacles)
    except UnreachableError as refusal:
        assert str(refusal).startswith(("goal: ", "start: ", "obstacle: "))
        return
    assert motion.simulated.arrived
    np.testing.assert_allclose(motion.simulated.path[-1], end, atol=2e-3)
    for obstacle in obstacles:
        ends = distances(np.array([begin, end]), obstacle)
        kept = min(ALLOWANCE, *(ends - MARGIN / 2))
        assert least(motion, obstacle) >= kept - 1e-9
    assert motion.clearance == pytest.approx(min(least(motion, o) for o in obstacles), abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(begin=place, shape=cylinder, share=st.floats(0.3, 0.7))
def test_mirrored_scenes_have_mirrored_paths(begin, shape, share):
    """Left and right are alike: the path in a mirrored scene is the mirrored path."""
    assume(np.linalg.norm(begin - GOAL) > 0.25 and abs(begin[1]) > 0.05)
    spot = begin + share * (GOAL - begin) + [0.0, 0.013, 0.0]
    flip = np.array([1.0, -1.0, 1.0])
    try:
        motion = plan(begin, standing(spot[0], spot[1], shape))
    except UnreachableError:
        with pytest.raises(UnreachableError):
            plan(begin * flip, standing(spot[0], -spot[1], shape), goal=GOAL * flip)
        return
    mirrored = plan(begin * flip, standing(spot[0], -spot[1], shape), goal=GOAL * flip)
    np.testing.assert_allclose(mirrored.simulated.path, motion.simulated.path * flip, atol=1e-6)


def test_most_scenes_are_not_refused():
    """So that the tests above hold of something: the way ahead is blocked, start and goal are free."""
    rng, planned = np.random.default_rng(0), 0
    for _ in range(40):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        begin = GOAL + rng.uniform(0.3, 0.5) * np.array([np.cos(angle), np.sin(angle), 0.1])
        spot = begin + 0.5 * (GOAL - begin) + rng.uniform(-0.03, 0.03, 3)
        try:
            plan(begin, standing(spot[0], spot[1]))
            planned += 1
        except UnreachableError:
            pass
    assert planned >= 36


def test_a_motion_may_be_planned_again_from_where_it_is():
    obstacle = standing(-0.30, 0.25)
    motion = plan(FROM_THE_RIGHT, obstacle)
    rolled = motion.simulated
    for k in range(0, motion.begins[1], 10):
        state = State(rolled.fixations[k], rolled.palms[k], float(rolled.openings[k]))
        again = plan_motion(DYNAMICS, state, [to(GOAL)], [obstacle])
        limit = min(ALLOWANCE, distances(rolled.path[[k]], obstacle)[0] - MARGIN / 2)
        assert least(again, obstacle) >= limit - 1e-9


def test_what_stands_farther_than_the_goal_is_no_hindrance():
    motion = plan(FROM_THE_RIGHT, standing(-0.30, -0.15))
    assert len(motion.legs) == 1


def test_of_two_that_are_hit_the_first_on_the_way_is_passed_first_however_they_are_listed():
    """A via-point beside either leads past both."""
    first, second = standing(-0.38, 0.38), standing(-0.38, 0.12)
    for listed in ((first, second), (second, first)):
        motion = plan(FROM_THE_RIGHT, *listed)
        np.testing.assert_allclose(via(motion)[1], 0.38)
        assert min(least(motion, obstacle) for obstacle in listed) >= ALLOWANCE


def test_where_no_way_leads_around_what_is_hit_first_it_is_tried_around_the_other():
    first, second = standing(-0.38, 0.38), standing(-0.38, 0.12)
    motion = plan(FROM_THE_RIGHT, first, second, feasible=lambda motion: abs(via(motion)[1] - 0.12) < 0.01)
    assert min(least(motion, obstacle) for obstacle in (first, second)) >= ALLOWANCE


def test_where_the_arm_cannot_and_nothing_is_hit_the_nearest_thing_is_tried_first_and_the_target_last():
    far, near = standing(-0.50, 0.40), standing(-0.45, 0.25)
    target = standing(-0.30, -0.10, Cylinder(0.03, 0.10))
    legs, asked = [to((-0.30, 0.08, 0.0)), to(GOAL)], []

    def beside(motion):
        if len(motion.legs) > 2:
            asked.append(min((far, near, target), key=lambda o: np.linalg.norm(via(motion) - o.centre)))
        return False

    with pytest.raises(UnreachableError):
        plan_motion(DYNAMICS, start(FROM_THE_RIGHT), legs, [far, near], target=target, feasible=beside)
    places = [asked.index(thing) for thing in (near, far)]
    assert places == sorted(places)
    assert asked[0] is near
    assert target not in asked[: asked.index(far)]


def test_a_goal_close_behind_it_is_come_to_by_two_via_points():
    """Where no single one is taken: first beside the obstacle, then beyond the goal."""
    obstacle, tried = standing(-0.15, 0.02), []

    def by_two(motion):
        tried.append(len(motion.legs))
        return len(motion.legs) == 3

    motion = plan(FROM_THE_NEAR_SIDE, obstacle, goal=np.array([-0.26, 0.0, 0.0]), feasible=by_two)
    assert tried == sorted(tried)
    first, second = (leg.goal.palm[:3, 3] - obstacle.centre for leg in motion.legs[:2])
    outwards = (np.array([-0.26, 0.0]) - obstacle.centre[:2]) / np.hypot(0.11, 0.02)
    assert abs(first[:2] @ outwards) < 1e-9
    assert second[:2] @ outwards == pytest.approx(np.linalg.norm(second[:2]))
    assert np.linalg.norm(second[:2]) >= CAN.radius + SAFETY - 1e-9
    assert motion.simulated.arrived
    assert least(motion, obstacle) >= ALLOWANCE


def test_directions_between_are_tried_when_the_others_will_not_do():
    """Eight all around, but for those that the first four are."""
    obstacle, seen = standing(-0.30, 0.25), []

    def never(motion):
        if len(motion.legs) == 2:
            seen.append(np.round((via(motion) - obstacle.centre)[:2], 6))
        return False

    with pytest.raises(UnreachableError):
        plan(FROM_THE_RIGHT, obstacle, feasible=never)
    directions = {tuple(np.round(place / np.linalg.norm(place), 3)) for place in seen if place.any()}
    level = [one for one in directions if min(abs(np.array(one))) > 0.1]
    assert level
    assert all(abs(abs(u) - abs(v)) < 1e-3 for u, v in level)
    slanting = [min(abs(place)) > 0.01 for place in seen]
    assert slanting == sorted(slanting)
