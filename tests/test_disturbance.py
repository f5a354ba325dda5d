"""What happens on the way: once, not before its time, where there is room, and as far as it is said to."""

from types import SimpleNamespace

import numpy as np
import pytest

from motorprime.errors import StateError
from motorprime.sim.scene import CANISTER, REGION, TABLE_X, Glass, Layout
from motorprime.tasks.disturbance import (
    BESIDE,
    BETWEEN,
    GLASS_ROOM,
    HAND_ROOM,
    JUMP,
    ROOM,
    Disturbance,
    spot_beside,
    spot_between,
)

pytestmark = pytest.mark.sim

GLASS_AT = (-0.28, 0.10)
PALM = np.array([-0.25, 0.42, 0.05])


class BareScene:
    """A scene as the experimenter's side uses it, without a world."""

    def __init__(self, glass_at=GLASS_AT, clutter=()):
        self.layout = Layout(Glass(), glass_at, tuple(clutter))
        self.glass_at, self.obstacle_at = np.array(glass_at, float), None

    def glass_pose(self):
        return np.array([*self.glass_at, -0.01]), np.array([0.0, 0.0, 1.0])

    def on_table(self, at, radius):
        return bool(at[0] < TABLE_X[1] - radius)

    def move_glass(self, at):
        self.glass_at = np.array(at)

    def stand_obstacle(self, shape, at):
        self.obstacle_at = np.array(at)


def thing(radius):
    return SimpleNamespace(radius=radius, name="thing")


def anywhere(spot):
    return True


def nowhere(spot):
    return False


def cycle(phase, time):
    return SimpleNamespace(phase=phase, time=time)


def beside(seed, scene=None, palm=PALM, room=anywhere):
    return np.array(spot_beside(scene or BareScene(), palm, np.random.default_rng(seed), room))


def between(seed, scene=None, palm=PALM, room=anywhere):
    return np.array(spot_between(scene or BareScene(), CANISTER, palm, np.random.default_rng(seed), room))


# Where.


def test_a_glass_jumps_by_so_much_and_stays_in_the_region_within_reach():
    spots = np.array([beside(seed) for seed in range(60)])
    np.testing.assert_allclose(np.linalg.norm(spots - GLASS_AT, axis=1), JUMP)
    assert JUMP == 0.10
    for values, (low, high) in zip(spots.T, REGION, strict=True):
        assert values.min() >= low and values.max() <= high
    assert np.ptp(spots, axis=0).min() > 0.05  # not always to the same side


def test_it_does_not_jump_under_the_hand():
    palm = np.array([-0.28, 0.19, 0.0])
    for seed in range(20):
        try:
            spot = beside(seed, palm=palm)
        except StateError:
            continue
        assert np.linalg.norm(spot - palm[:2]) - Glass().radius > HAND_ROOM


def test_it_keeps_off_kitchenware():
    other = np.array([-0.28, 0.20])
    scene = BareScene(clutter=[(thing(0.04), tuple(other))])
    for seed in range(20):
        spot = beside(seed, scene)
        assert np.linalg.norm(spot - other) - 0.04 - Glass().radius > GLASS_ROOM


def test_without_room_for_the_glass_there_is_an_error_that_says_so():
    crowded = BareScene(clutter=[(thing(0.3), GLASS_AT)])
    with pytest.raises(StateError, match="glass: no place"):
        beside(0, crowded)
    with pytest.raises(StateError, match="glass: no place"):
        beside(0, room=nowhere)


def test_an_obstacle_stands_between_palm_and_glass_beside_the_straight_way_at_most():
    way = np.array(GLASS_AT) - PALM[:2]
    length = np.linalg.norm(way)
    along, aside = [], []
    for seed in range(60):
        offset = between(seed) - PALM[:2]
        along.append(offset @ way / length**2)
        aside.append((offset[0] * way[1] - offset[1] * way[0]) / length)
    assert min(along) >= BETWEEN[0] and max(along) <= BETWEEN[1]
    assert np.abs(aside).max() <= BESIDE
    assert min(aside) < -0.3 * BESIDE and max(aside) > 0.3 * BESIDE  # on either side


def test_it_leaves_room_for_hand_and_fingers_and_keeps_off_kitchenware():
    other = np.array([-0.34, 0.28])
    scene = BareScene(clutter=[(thing(0.03), tuple(other))])
    for seed in range(40):
        spot = between(seed, scene)
        assert np.linalg.norm(spot - GLASS_AT) - Glass().radius - CANISTER.radius > GLASS_ROOM
        assert np.linalg.norm(spot - PALM[:2]) - CANISTER.radius > HAND_ROOM
        assert np.linalg.norm(spot - other) - 0.03 - CANISTER.radius > ROOM


def test_it_stands_on_the_table():
    palm = np.array([-0.02, 0.20, 0.0])  # before the table
    for seed in range(20):
        try:
            spot = between(seed, palm=palm)
        except StateError:
            continue
        assert spot[0] < TABLE_X[1] - CANISTER.radius


@pytest.mark.parametrize("palm", [(*GLASS_AT, 0.2), (GLASS_AT[0] + 0.05, GLASS_AT[1] + 0.05, 0.0)])
def test_a_palm_that_is_there_already_leaves_no_room(palm):
    with pytest.raises(StateError, match="obstacle: "):
        between(0, palm=np.array(palm))


def test_a_place_that_leaves_no_room_for_the_arm_is_not_taken():
    with pytest.raises(StateError, match="obstacle: there is no room"):
        between(0, room=nowhere)
    asked = []

    def second(spot):
        asked.append(spot)
        return len(asked) == 2

    assert tuple(between(0, room=second)) == asked[1] != asked[0]
    assert all(isinstance(value, float) for value in asked[0])


def test_the_same_seed_draws_the_same_places():
    np.testing.assert_array_equal(beside(3), beside(3))
    np.testing.assert_array_equal(between(3), between(3))
    assert (beside(3) != beside(4)).any()


# When.


def disturbance(obstacle=None, after=0.5, room=anywhere):
    return Disturbance(np.random.default_rng(0), after, obstacle, room)


def test_it_happens_once_and_so_long_after_the_hand_has_set_out():
    scene, happening = BareScene(), disturbance()
    for phase, time in (("search", 0.0), ("fixate", 3.0), ("survey", 6.0), ("reach", 7.0), ("reach", 7.4)):
        happening.watch(cycle(phase, time), scene, PALM)
        assert not happening.happened
        np.testing.assert_array_equal(scene.glass_at, GLASS_AT)
    happening.watch(cycle("reach", 7.5), scene, PALM)
    assert happening.happened
    there = scene.glass_at.copy()
    assert np.linalg.norm(there - GLASS_AT) == pytest.approx(JUMP)
    assert scene.obstacle_at is None
    happening.watch(cycle("reach", 7.6), scene, PALM)
    np.testing.assert_array_equal(scene.glass_at, there)


def test_an_obstacle_appears_and_the_glass_stays():
    scene, happening = BareScene(), disturbance(CANISTER, after=0.0)
    happening.watch(cycle("reach", 2.0), scene, PALM)
    assert happening.happened
    assert scene.obstacle_at is not None
    np.testing.assert_array_equal(scene.glass_at, GLASS_AT)


def test_not_while_it_grasps_or_lifts():
    scene, happening = BareScene(), disturbance(after=0.0)
    for phase in ("grasp", "lift", "search"):
        happening.watch(cycle(phase, 9.0), scene, PALM)
    assert not happening.happened


def test_without_room_it_waits_for_the_next_cycle_and_says_that_nothing_happened():
    rooms = iter([False] * 4 + [True])
    scene, happening = BareScene(), disturbance(after=0.0, room=lambda spot: next(rooms))
    happening.watch(cycle("reach", 1.0), scene, PALM)
    assert not happening.happened
    np.testing.assert_array_equal(scene.glass_at, GLASS_AT)
    happening.watch(cycle("reach", 1.1), scene, PALM)
    assert happening.happened
