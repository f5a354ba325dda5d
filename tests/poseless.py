"""Projections that know pixels and nothing else, as learned ones do; one of them errs."""

import numpy as np

from motorprime.projection import Projection

AROUND = np.array([(-0.25, 0.0, 0.0), (-0.35, 0.1, 0.0), (-0.4, -0.1, 0.1), (-0.3, 0.1, -0.15)])


class Poseless(Projection):
    """The pixels of another projection, without its poses and depths."""

    def __init__(self, projection, places=AROUND):
        self._through, self._places = projection, places

    @property
    def cameras(self):
        return self._through.cameras

    @property
    def shapes(self):
        return self._through.shapes

    def project(self, points, joints=None):
        return self._through.project(points, joints)

    def jacobian(self, points, joints=None):
        return self._through.jacobian(points, joints)

    def _starts(self, pixels, joints):
        count = len(next(iter(pixels.values())))
        return [np.tile(place, (count, 1)) for place in self._places]


class Wavy(Poseless):
    """Pixels off by waves over space and postures, of typically so many pixels, another one for each camera.

    error(x, q) = sum over k of d_k sin(a_k . x + b_k . q + c_k), wave lengths about 0.6 m and 4 rad.
    """

    def __init__(self, projection, pixels, joints, seed=0):
        super().__init__(projection)
        rng = np.random.default_rng(seed)
        self._waves = {
            camera: (
                rng.normal(0.0, 2.0 * np.pi / 0.6, (4, 3)),
                rng.normal(0.0, 2.0 * np.pi / 4.0, (4, joints)),
                rng.uniform(0.0, 2.0 * np.pi, 4),
                rng.normal(0.0, pixels / np.sqrt(2.0), (4, 2)),
            )
            for camera in projection.cameras
        }

    def project(self, points, joints=None):
        pixels = super().project(points, joints)
        return {
            camera: pixels[camera] + np.sin(self._phase(camera, points, joints)) @ waves[3]
            for camera, waves in self._waves.items()
        }

    def jacobian(self, points, joints=None):
        slopes = super().jacobian(points, joints)
        return {
            camera: slopes[camera]
            + np.einsum("nk,kd,kx->ndx", np.cos(self._phase(camera, points, joints)), waves[3], waves[0])
            for camera, waves in self._waves.items()
        }

    def _phase(self, camera, points, joints):
        over_space, over_joints, shift, _ = self._waves[camera]
        return np.asarray(points) @ over_space.T + over_joints @ np.asarray(joints) + shift


class Shifted(Poseless):
    """Pixels off by the same offset (u, v) everywhere, another one for each camera."""

    def __init__(self, projection, **offsets):
        super().__init__(projection)
        self._offsets = offsets

    def project(self, points, joints=None):
        return {
            camera: pixels + self._offsets.get(camera, (0.0, 0.0))
            for camera, pixels in super().project(points, joints).items()
        }
