"""Movements that somebody has shown, and the tables they are read from."""

import numpy as np
import pytest

from motorprime.control.demonstrations import Demonstration, check_extent, read_demonstrations, stacked
from motorprime.errors import ArgumentError
from motorprime.evaluate.warping import aligned_distance, warped_distance

TIMES = np.arange(6) * 0.5
STATES = np.column_stack([TIMES**2, 1.0 - TIMES])


def test_velocities_are_central_differences_where_none_are_given():
    one = Demonstration(TIMES, STATES)
    np.testing.assert_allclose(one.speeds[1:-1], np.column_stack([2 * TIMES, -np.ones(6)])[1:-1])
    given = Demonstration(TIMES, STATES, 7.0 * STATES)
    np.testing.assert_array_equal(given.speeds, 7.0 * STATES)
    assert one.duration == 2.5 and len(one) == 6


def test_a_demonstration_keeps_copies():
    states = STATES.copy()
    one = Demonstration(TIMES, states)
    states[:] = 0.0
    np.testing.assert_array_equal(one.states, STATES)
    with pytest.raises(ValueError, match="read-only"):
        one.states[0] = 1.0


def test_relative_to_its_end_a_movement_ends_at_zero_as_fast_as_before():
    one = Demonstration(TIMES, STATES)
    ended = one.relative_to()
    np.testing.assert_array_equal(ended.states[-1], 0.0)
    np.testing.assert_array_equal(ended.speeds, one.speeds)
    np.testing.assert_allclose(one.relative_to([1.0, 2.0]).states, STATES - [1.0, 2.0])


def test_thinned_out_a_movement_keeps_the_velocities_it_had():
    thin = Demonstration(TIMES, STATES).every(2)
    np.testing.assert_array_equal(thin.times, TIMES[::2])
    np.testing.assert_array_equal(thin.speeds, Demonstration(TIMES, STATES).speeds[::2])
    with pytest.raises(ArgumentError, match="at least 3"):
        thin.every(2)


@pytest.mark.parametrize(
    ("times", "states", "message"),
    [
        (TIMES, STATES[:, 0], r"states: expected shape \(N, d\)"),
        (TIMES[:1], STATES[:1], "at least 3 samples of a movement, got 1"),
        (TIMES[:5], STATES, r"times: expected shape \(6,\)"),
        (TIMES, np.where(STATES == 0.25, np.nan, STATES), r"states: .*\[1, 0\]"),
        (np.where(TIMES == 1.0, np.nan, TIMES), STATES, "times: expected finite"),
        (TIMES[::-1], STATES, "times: expected to increase"),
        (np.minimum(TIMES, 2.0), STATES, r"times: expected to increase, got 2 s at \[4\]"),
        (TIMES, STATES.astype(str), "states: expected real numbers"),
    ],
)
def test_what_is_no_movement_is_refused(times, states, message):
    with pytest.raises((ArgumentError, TypeError), match=message):
        Demonstration(times, states)


def test_velocities_must_be_as_many_as_states():
    with pytest.raises(ArgumentError, match=r"velocities: expected shape \(6, 2\)"):
        Demonstration(TIMES, STATES, STATES[:3])


def test_movements_of_several_dimensions_or_none_cannot_be_stacked():
    one = Demonstration(TIMES, STATES)
    assert stacked([one, one])[0].shape == (12, 2)
    with pytest.raises(ArgumentError, match="at least one"):
        stacked([])
    with pytest.raises(ArgumentError, match=r"one dimension, got \[1, 2\]"):
        stacked([one, Demonstration(TIMES, STATES[:, :1])])


def csv(tmp_path, text):
    path = tmp_path / "shown.csv"
    path.write_text(text)
    return path


def test_a_table_tells_its_movements_apart(tmp_path):
    path = csv(
        tmp_path, "demonstration,time,x,y\n2,0,0,1\n2,0.1,0.1,1\n2,0.2,0.2,1\n1,0,5,5\n1,1,5,6\n1,2,5,7\n"
    )
    first, second = read_demonstrations(path)
    np.testing.assert_array_equal(first.states, [[0.0, 1.0], [0.1, 1.0], [0.2, 1.0]])
    np.testing.assert_array_equal(second.times, [0.0, 1.0, 2.0])


def test_a_table_without_labels_is_one_movement_also_as_a_numpy_file(tmp_path):
    path = csv(tmp_path, "time;x\n0;0\n1;0.5\n2;1\n")
    (one,) = read_demonstrations(path)
    array = np.array([(0.0, 0.0), (1.0, 0.5), (2.0, 1.0)], dtype=[("time", "f8"), ("x", "f4")])
    np.save(tmp_path / "shown.npy", array)
    (same,) = read_demonstrations(tmp_path / "shown.npy")
    np.testing.assert_array_equal(one.states, same.states)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n0,1\n", "no column 'time'"),
        ("time,demonstration\n0,1\n", "no coordinate"),
        ("time,x\n0,0\n1,\n2,1\n", "data row 2: 'x' has no value"),
        ("time,x\n0,0\n", "at least 3 samples of a movement, got 1"),
        ("time,x\n0,0\n2,1\n1,2\n", "times: expected to increase"),
        ("time,x\n0,0\n1,nan\n2,2\n", "finite number expected"),
        ("time,x\n0,0\n1,750\n2,1500\n", "a movement of 1500 m; at most 3 m expected. Are these millimetres"),
        ("demonstration,time,x\n4,0,0\n4,1,0\n3,0,0\n3,1,0\n3,2,0\n", "demonstration 4: .*got 2"),
    ],
)
def test_tables_that_hold_no_movement_say_where_it_goes_wrong(tmp_path, text, message):
    with pytest.raises(ArgumentError, match=message):
        read_demonstrations(csv(tmp_path, text))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ArgumentError, match="cannot read"):
        read_demonstrations(tmp_path / "none.csv")


def test_a_wide_movement_is_fine_for_whom_expects_one():
    check_extent(np.array([[0.0], [4.0]]), longest=5.0)
    with pytest.raises(ArgumentError, match="a movement of 4 m"):
        check_extent(np.array([[0.0], [4.0]]))


def plain_warping(first, second):
    """The textbook's double loop."""
    table = np.full((len(first) + 1, len(second) + 1), np.inf)
    table[0, 0] = 0.0
    for i, x in enumerate(first):
        for j, y in enumerate(second):
            best = min(table[i, j], table[i, j + 1], table[i + 1, j])
            table[i + 1, j + 1] = np.linalg.norm(x - y) + best
    return table[-1, -1]


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 7), (7, 1), (12, 5), (5, 12), (9, 9)])
def test_warping_by_diagonals_is_warping_by_a_double_loop(rng, n, m):
    first, second = rng.normal(size=(n, 2)), rng.normal(size=(m, 2))
    assert warped_distance(first, second) == pytest.approx(plain_warping(first, second))


def test_a_path_at_another_pace_is_no_distance_away(rng):
    path = rng.normal(size=(20, 3))
    slow = np.repeat(path, 3, axis=0)
    assert warped_distance(path, slow) == 0.0 and aligned_distance(path, slow) == 0.0


def test_the_aligned_distance_of_shifted_lines_is_their_shift():
    line = np.column_stack([np.linspace(0.0, 1.0, 50), np.zeros(50)])
    assert aligned_distance(line, line + np.array([0.0, 0.007])) == pytest.approx(0.007)


def test_paths_without_points_cannot_be_warped():
    with pytest.raises(ArgumentError, match="paths: expected points"):
        warped_distance(np.zeros((0, 2)), np.zeros((3, 2)))
