"""A rig of three small cameras for the tests of the fused step: matrices, networks, paths."""

import itertools
import math

import numpy as np

from motorprime import Mlp

SHAPES = {"left": (48, 64), "right": (35, 51), "hand": (17, 80)}
MATRIX = np.array([[60.0, 0.0, 31.5, 0.0], [0.0, 60.0, 23.5, 0.0], [0.0, 0.0, 1.0, 0.0]])
BLIND = MATRIX * [-1.0, 1.0, -1.0, 1.0]
"""The same camera turned around: everything lies behind it."""
POINTS = np.random.default_rng(0).uniform([-0.3, -0.3, 0.7], [0.3, 0.3, 1.5], (25, 3))
JOINTS = np.array([0.3, -0.5, 0.1])


def network(sizes, seed, mean, std):
    """A random network whose outputs scatter around a mean."""
    rng = np.random.default_rng(seed)
    weights = [rng.normal(0, 1 / math.sqrt(i), (o, i)) for i, o in itertools.pairwise(sizes)]
    biases = [rng.normal(0, 0.5, o) for o in sizes[1:]]
    return Mlp(weights, biases, np.zeros(sizes[0]), np.ones(sizes[0]), mean, std)


def moved(across, down):
    """The matrix of a camera that sees everything shifted by so many pixels per metre of depth."""
    matrix = MATRIX.copy()
    matrix[:2, 3] += across, down
    return matrix


PROJECTOR = network((6, 8, 2), 1, [30.0, 20.0], [15.0, 15.0])
POSTURE = network((3, 8, 5), 2, [30.0, 20.0, 2.0, 0.0, 2.0], [10.0, 10.0, 0.5, 4.0, 0.5])
MAPS = {"left": MATRIX, "right": PROJECTOR, "hand": moved(5.0, -3.0)}
PIXELS = {name: np.random.default_rng(k).uniform(-20, 70, (30, 2)) for k, name in enumerate(SHAPES)}
