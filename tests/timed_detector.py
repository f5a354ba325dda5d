"""A clock that is set by hand, and a detector that takes time on it."""

from __future__ import annotations

import numpy as np

from motorprime import Detections, Everywhere, Mask, Tiles, Windows


class SetClock:
    """Seconds that pass when something takes time; each reading takes ``tick``."""

    def __init__(self, tick=1e-7):
        self.now, self.tick = 100.0, tick

    def __call__(self):
        self.now += self.tick
        return self.now


class TimedDetector:
    """Takes the time of its prices, multiplied by ``slow`` and what ``noise`` draws; finds ``boxes``."""

    def __init__(self, clock, *, call=1e-4, window=1e-5, tile=5e-5, pixel=1e-8, found=(), noise=None):
        self.clock, self.prices = clock, (call, window, tile, pixel)
        self.found, self.noise, self.slow, self.looks = found, noise, 1.0, []

    def detect(self, image, where):
        self.looks.append(where)
        seconds = self.slow * float(np.dot(self.prices, self.amounts(image, where)))
        self.clock.now += seconds if self.noise is None else self.noise(seconds)
        boxes = [box for _, box in self.found]
        return Detections(
            np.array(boxes, np.float32).reshape(-1, 4),
            np.linspace(0.9, 0.5, len(boxes), dtype=np.float32),
            tuple(label for label, _ in self.found),
            int(self.amounts(image, where)[3]),
        )

    @staticmethod
    def amounts(image, where):
        if isinstance(where, Windows):
            return (1, len(where.centres), 0, 0)
        if isinstance(where, Tiles):
            sides = where.boxes[:, 2:] - where.boxes[:, :2]
            return (1, 0, len(where.boxes), int((sides[:, 0] * sides[:, 1]).sum()))
        if isinstance(where, Mask):
            return (1, 0, 0, int(where.mask.sum()))
        assert isinstance(where, Everywhere)
        return (1, 0, 0, image.shape[0] * image.shape[1])
