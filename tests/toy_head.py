"""A head with two cameras that pans and tilts: enough of a robot to learn a projection from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motorprime import Camera, PosedCamera
from motorprime.learning.projections import learn_projection
from motorprime.projection.base import PosedProjection
from motorprime.samples import Samples

CAMERA = Camera(160, 120, 130.0, 130.0, 80.0, 60.0)
JOINTS = ("pan", "tilt")
SHAPES = {"left": (120, 160), "right": (120, 160)}


class Head(PosedProjection):
    """Cameras 6 cm apart on a head; ``offset`` is added to the joints, ``aside`` to the cameras' places."""

    def __init__(self, offset=(0.0, 0.0), aside=(0.0, 0.0, 0.0), focal=1.0):
        camera = Camera(160, 120, 130.0 * focal, 130.0 * focal, 80.0, 60.0)
        super().__init__({"left": camera, "right": camera})
        self.offset, self.aside = np.array(offset), np.array(aside)

    def posed(self, joints=None):
        pan, tilt = np.asarray(joints) + self.offset
        (cp, sp), (ct, st) = (np.cos(pan), np.sin(pan)), (np.cos(tilt), np.sin(tilt))
        turn = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array(
            [[1, 0, 0], [0, ct, -st], [0, st, ct]]
        )
        views = {}
        for name, x in (("left", -0.03), ("right", 0.03)):
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = turn, turn @ [x, 0.0, 0.0] + self.aside
            views[name] = PosedCamera(self._cameras[name], pose)
        return views


def babble(head, count, seed, noise=0.1):
    """Samples over a box before the head, whether in view or not."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-0.25, -0.2, 0.35), (0.25, 0.2, 0.75), (count, 3))
    joints = rng.uniform(-0.35, 0.35, (count, 2))
    pixels = {name: np.full((count, 2), np.nan) for name in head.cameras}
    for k in range(count):
        for name, uv in head.project(points[k : k + 1], joints[k]).items():
            if head.visible(points[k : k + 1], joints[k])[name][0]:
                pixels[name][k] = uv[0] + rng.normal(0.0, noise, 2)
    return Samples(JOINTS, joints, pixels, points)


def learn(samples, seed=1, iterations=60):
    return learn_projection(
        samples, SHAPES, JOINTS, robot="head", hidden=(12, 12), seed=seed, iterations=iterations
    )


def median_error(projection, samples):
    errors = []
    for k in range(len(samples)):
        told = projection.project(samples.points[k : k + 1], samples.joints[k])
        for camera, uv in samples.pixels.items():
            if not np.isnan(uv[k, 0]):
                errors.append(np.linalg.norm(told[camera][0] - uv[k]))
    return float(np.nanmedian(errors))


def truncated(path: Path, keep: float) -> Path:
    """A copy of a file of which only a part is left."""
    data = path.read_bytes()
    cut = path.with_name("cut-" + path.name)
    cut.write_bytes(data[: int(keep * len(data))])
    return cut
