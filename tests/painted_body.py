"""A robot without a simulator: perfect motors, and eyes that see a red glass, and a can, painted on grey."""

import numpy as np

from motorprime import HistogramDetector, KinematicProjection
from motorprime.control.reaching import Bench
from motorprime.cylinder import Cylinder, outline
from motorprime.tasks.explore import Target

GLASS = Cylinder(0.0325, 0.10)
BENCH = Bench(height=-0.06, edge=-0.15)
IN_REACH = np.array([-0.28, 0.10, -0.01])
BEYOND = np.array([-0.60, -0.30, -0.01])
CAN = Cylinder(0.03, 0.13)
RED, TEAL, GREY = (204, 15, 23), (10, 148, 158), (120, 118, 116)


def inside(polygon, shape):
    """Pixels (H, W) whose centres lie in a convex polygon (N, 2); OpenCV would fill half a pixel more."""
    corners, mask = np.asarray(polygon, dtype=float), np.zeros(shape, np.bool_)
    low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, shape[::-1])
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, shape[::-1])
    v, u = np.mgrid[low[1] : high[1], low[0] : high[0]]
    sides = np.array(
        [
            (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
        ]
    )
    mask[low[1] : high[1], low[0] : high[0]] = np.all(sides >= 0.0, axis=0) | np.all(sides <= 0.0, axis=0)
    return mask


def target():
    return Target(GLASS, HistogramDetector(np.array([RED], np.uint8).repeat(200, axis=0)))


def can():
    """An obstacle of a colour of its own."""
    return Target(CAN, HistogramDetector(np.array([TEAL], np.uint8).repeat(200, axis=0), label="can"))


def can_at(x, y):
    """The middle of a can on the bench."""
    return np.array([x, y, BENCH.height + CAN.height / 2])


class PaintedBody:
    """A body that has nothing but what the task's protocol asks for.

    Attributes:
        glass, can: where they are, None where there is none; may be set at any time.
        moves: {variable: target} of every move so far.
        times: of the ends of these moves [s].
    """

    def __init__(self, robot, glass=IN_REACH, *, can=None, **angles):
        self.robot = robot
        self.moves, self.times = [], []
        self.glass, self.can, self._time = glass, can, 0.0
        self._projection = KinematicProjection(robot)
        names = (*robot.gaze, *robot.arm, *(robot.hand.motors if robot.hand else ()))
        self._angles = dict(zip(names, map(float, robot.resting(names)), strict=True)) | angles

    @property
    def time(self):
        return self._time

    def see(self):
        pictures = {}
        for name, view in self._projection.posed(self.read(self.robot.gaze)).items():
            picture = np.full((*view.camera.shape, 3), GREY, np.uint8)
            things = [(self.glass, GLASS, RED), (self.can, CAN, TEAL)]
            things = [thing for thing in things if thing[0] is not None]
            eye = view.pose[:3, 3]
            for place, shape, colour in sorted(things, key=lambda thing: -np.linalg.norm(thing[0] - eye)):
                polygon = outline(view, place, shape)
                if polygon is not None and np.abs(polygon).max() < 1e4:
                    picture[inside(polygon, view.camera.shape)] = colour
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
        self.times.append(self._time)
