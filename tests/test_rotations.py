"""Rotation vectors: they go there and back at any angle, and turn the right way round."""

import numpy as np
import pytest

from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import rotation_from_rpy
from motorprime.rotations import rotation_matrices, rotation_vector, rotation_vectors


def test_a_positive_angle_turns_x_towards_y_about_z():
    turned = rotation_matrices([0.0, 0.0, 0.3])
    np.testing.assert_allclose(turned, rotation_from_rpy((0.0, 0.0, 0.3)), atol=1e-15)
    np.testing.assert_allclose(
        rotation_vectors(rotation_from_rpy((0.2, 0.0, 0.0))), [0.2, 0.0, 0.0], atol=1e-15
    )
    np.testing.assert_allclose(
        rotation_vectors(rotation_from_rpy((0.0, 0.2, 0.0))), [0.0, 0.2, 0.0], atol=1e-15
    )


@pytest.mark.parametrize("angle", [1e-200, 1e-12, 1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi - 1e-12])
def test_a_vector_comes_back_from_its_matrix_at_small_and_at_half_turns(angle, rng):
    axes = rng.normal(size=(50, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    back = rotation_vectors(rotation_matrices(vectors))
    np.testing.assert_allclose(
        back, vectors, rtol=1e-9 if angle < 3.1 else 0.0, atol=1e-9 if angle > 3.1 else 0.0
    )


def test_a_half_turn_is_a_half_turn_about_either_end_of_its_axis():
    for axis in np.vstack([np.eye(3), [[0.6, 0.0, 0.8], [-0.6, 0.8, 0.0]]]):
        matrix = 2.0 * np.outer(axis, axis) - np.eye(3)
        vector = rotation_vectors(matrix)
        assert np.linalg.norm(vector) == pytest.approx(np.pi)
        assert abs(vector @ axis) == pytest.approx(np.pi)


def test_a_vector_longer_than_a_half_turn_comes_back_the_short_way():
    np.testing.assert_allclose(
        rotation_vectors(rotation_matrices([0.0, 5.0, 0.0])), [0.0, 5.0 - 2.0 * np.pi, 0.0], atol=1e-12
    )


@pytest.mark.parametrize("angle", [0.0, 1e-200, 1e-9, 0.1, 2.0, np.pi - 1e-3, np.pi - 1e-9])
def test_one_vector_is_that_of_many(angle, rng):
    for axis in (*rng.normal(size=(20, 3)), *np.eye(3), *-np.eye(3)):
        turn = rotation_matrices(angle * axis / np.linalg.norm(axis))
        np.testing.assert_allclose(
            rotation_vector(turn), rotation_vectors(turn), rtol=1e-12, atol=1e-12 * angle
        )


def test_matrices_are_rotations_for_any_leading_shape(rng):
    vectors = 4.0 * rng.normal(size=(4, 5, 3))
    turns = rotation_matrices(vectors)
    assert turns.shape == (4, 5, 3, 3)
    np.testing.assert_allclose(
        turns @ np.swapaxes(turns, -1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    assert rotation_vectors(turns).shape == (4, 5, 3)
    assert rotation_vectors(np.zeros((0, 3, 3))).shape == (0, 3)
    assert rotation_matrices(np.zeros((0, 3))).shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.eye(4), r"rotations: expected shape"),
        (np.diag([1.0, 1.0, -1.0]), r"rotations: expected rotations"),
        (2.0 * np.eye(3), r"in place 0"),
        (np.full((3, 3), np.nan), r"rotations: expected finite"),
    ],
)
def test_what_is_no_rotation_is_an_error(value, message):
    with pytest.raises(ArgumentError, match=message):
        rotation_vectors(value)


def test_vectors_of_another_shape_or_kind_are_errors():
    with pytest.raises(ArgumentError, match=r"vectors: expected shape"):
        rotation_matrices([1.0, 2.0])
    with pytest.raises(ArgumentError, match=r"finite"):
        rotation_matrices([1.0, np.inf, 0.0])
    with pytest.raises(ArgumentTypeError, match=r"real numbers"):
        rotation_matrices(["a", "b", "c"])
