"""A robot without a simulator: perfect motors, and eyes that see a red glass painted on grey."""

import numpy as np

from motorprime import HistogramDetector, KinematicProjection
from motorprime.control.reaching import Bench
from motorprime.cylinder import Cylinder, outline
from motorprime.tasks.explore import Target

GLASS = Cylinder(0.0325, 0.10)
BENCH = Bench(height=-0.06, edge=-0.15)
IN_REACH = np.array([-0.28, 0.10, -0.01])
BEYOND = np.array([-0.60, -0.30, -0.01])
RED, GREY = (204, 15, 23), (120, 118, 116)


def inside(polygon, shape):
    """Pixels (H, W) whose centres lie in a convex polygon (N, 2); OpenCV would fill half a pixel more."""
    v, u = np.indices(shape)
    corners = np.asarray(polygon, dtype=float)
    sides = [
        (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    return np.all(np.array(sides) >= 0.0, axis=0) | np.all(np.array(sides) <= 0.0, axis=0)


def target():
    return Target(GLASS, HistogramDetector(np.array([RED], np.uint8).repeat(200, axis=0)))


class PaintedBody:
    """A body that has nothing but what the task's protocol asks for.

    Attributes:
        moves: {variable: target} of every move so far.
    """

    def __init__(self, robot, glass=IN_REACH, **angles):
        self.robot = robot
        self.moves = []
        self._glass, self._time = glass, 0.0
        self._projection = KinematicProjection(robot)
        names = (*robot.gaze, *robot.arm)
        self._angles = dict(zip(names, map(float, robot.resting(names)), strict=True)) | angles

    @property
    def time(self):
        return self._time

    def see(self):
        pictures = {}
        for name, view in self._projection.posed(self.read(self.robot.gaze)).items():
            picture = np.full((*view.camera.shape, 3), GREY, np.uint8)
            polygon = None if self._glass is None else outline(view, self._glass, GLASS)
            if polygon is not None and np.abs(polygon).max() < 1e4:
                picture[inside(polygon, view.camera.shape)] = RED
            pictures[name] = picture
        return pictures

    def read(self, variables):
        return np.array([self._angles[name] for name in variables])

    def move(self, targets, seconds):
        assert seconds > 0.0
        limits = self.robot.limits(tuple(targets))
        for (name, angle), (low, high) in zip(targets.items(), limits, strict=True):
            assert low - 1e-6 <= angle <= high + 1e-6, name
        self.moves.append(dict(targets))
        self._angles |= targets
        self._time += seconds
