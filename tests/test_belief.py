"""A belief averages what is seen nearby, trusts the better view, and takes a jump for a jump."""

import numpy as np
import pytest

from motorprime.cylinder import Located
from motorprime.tasks.belief import BETTER, DOUBTFUL, FADING, JUMP, Belief

PLACE = np.array([-0.3, 0.1, 0.02])


def seen(place, overlap=0.9):
    return Located(np.array(place, float), overlap, overlap, overlap)


def off(x, y=0.0, z=0.0):
    return PLACE + np.array([x, y, z])


def believing(place=PLACE, overlap=0.9):
    belief = Belief()
    belief.update(seen(place, overlap))
    return belief


def test_nothing_is_believed_before_anything_was_seen():
    assert Belief().place is None
    assert Belief().trust == 0.0


def test_the_first_sighting_is_taken_as_it_is_however_bad_and_is_somewhere_new():
    belief = Belief()
    assert belief.update(seen(PLACE, 0.01)) is True
    np.testing.assert_array_equal(belief.place, PLACE)
    assert belief.trust == 0.01


def test_sightings_as_good_are_averaged():
    belief = believing()
    assert belief.update(seen(off(0.01, 0.0, -0.02))) is False
    np.testing.assert_allclose(belief.place, off(0.005, 0.0, -0.01))


def test_the_average_of_many_has_less_noise_than_one(rng):
    belief, errors = believing(), []
    for _ in range(400):
        belief.update(seen(PLACE + rng.normal(0.0, 0.003, 3)))
        errors.append(belief.place - PLACE)
    assert np.std(errors) == pytest.approx(0.003 / np.sqrt(3.0), rel=0.15)  # of halves, quarters, eighths ..


def test_one_that_is_seen_worse_counts_little():
    belief = believing(overlap=0.9)
    belief.update(seen(off(0.01), 0.9 * FADING - BETTER - 0.01))
    np.testing.assert_allclose(belief.place, off(0.001))
    assert belief.trust == pytest.approx(0.9 * FADING)


def test_one_that_is_seen_better_replaces_what_was_believed_without_being_a_jump():
    belief = believing(overlap=0.5)
    assert belief.update(seen(off(0.02), 0.5 * FADING + BETTER + 0.01)) is False
    np.testing.assert_allclose(belief.place, off(0.02))
    assert belief.trust == pytest.approx(0.5 * FADING + BETTER + 0.01)


@pytest.mark.parametrize("direction", np.vstack([np.eye(3), -np.eye(3)]).tolist())
def test_a_place_farther_than_noise_goes_is_a_jump_and_taken_at_once(direction):
    belief = believing(overlap=0.9)
    seen_as_well = FADING * 0.9 - DOUBTFUL + 1e-6
    assert belief.update(seen(PLACE + (JUMP + 1e-6) * np.array(direction), seen_as_well)) is True
    np.testing.assert_allclose(belief.place, PLACE + (JUMP + 1e-6) * np.array(direction))
    assert belief.trust == seen_as_well


def test_a_jump_that_is_seen_far_worse_is_doubted_but_not_for_ever():
    """A thing that is half hidden looks as if it were elsewhere."""
    belief = believing(overlap=0.9)
    sightings = 0
    while not belief.update(seen(off(2.0 * JUMP), 0.5)):
        np.testing.assert_array_equal(belief.place, PLACE)
        sightings += 1
    assert 3 < sightings < 20
    np.testing.assert_allclose(belief.place, off(2.0 * JUMP))


def test_a_place_a_little_nearer_is_none():
    belief = believing()
    assert belief.update(seen(off(JUMP - 1e-6))) is False
    np.testing.assert_allclose(belief.place, off(0.5 * (JUMP - 1e-6)))


def test_after_a_jump_it_averages_at_the_new_place():
    belief = believing()
    there = off(0.1)
    assert [belief.update(seen(there)) for _ in range(3)] == [True, False, False]
    np.testing.assert_allclose(belief.place, there)


def test_trust_fades_so_that_worse_sightings_count_in_the_end():
    belief = believing(overlap=0.9)
    worse = off(0.01)
    moved = []
    for _ in range(30):
        before = belief.place
        belief.update(seen(worse, 0.7))
        moved.append(np.linalg.norm(belief.place - before) / np.linalg.norm(worse - before))
    assert moved[0] == pytest.approx(0.1)
    assert moved[-1] == pytest.approx(0.5)
    assert belief.trust == pytest.approx(0.7, abs=0.02)


def test_trust_does_not_fall_below_the_view_that_was_just_had():
    belief = believing(overlap=0.9)
    belief.update(seen(PLACE, 0.9))
    assert belief.trust == 0.9


def test_what_it_is_given_is_not_changed():
    first, second = seen(PLACE), seen(off(0.01))
    belief = Belief()
    belief.update(first)
    belief.update(second)
    np.testing.assert_array_equal(first.centre, PLACE)
    np.testing.assert_array_equal(second.centre, off(0.01))
