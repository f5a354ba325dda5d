"""A projection at one posture: what the cameras have before them just now."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, fixed, rows
from .errors import ArgumentError, ArgumentTypeError
from .projection import PinholeProjection, PosedProjection, Projection

STEPS = 8  # of Gauss and Newton, from a place to one that appears at a pixel
ARRIVED = 0.5  # so near [px] to the pixel it has


class Views:
    """The cameras of a projection while the joints stay.

    Kinematics are computed once, however often is projected.

    Args:
        projection: of any kind.
        joints: the posture, in the projection's order; fixed cameras need none.
    """

    def __init__(self, projection: Projection, joints: npt.ArrayLike | None = None) -> None:
        if not isinstance(projection, Projection):
            raise ArgumentTypeError(f"projection: a Projection expected, got {type(projection).__name__}")
        if isinstance(projection, PosedProjection):
            projection, joints = PinholeProjection(projection.posed(joints)), None
        self._projection, self._joints = projection, joints

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return self._projection.cameras

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each image."""
        return self._projection.shapes

    def project(self, points: npt.ArrayLike) -> dict[str, Floats]:
        """Pixels {camera: (N, 2)} of points (N, 3) [m]; NaN rows as in :meth:`Projection.project`."""
        return self._projection.project(points, self._joints)

    def jacobian(self, points: npt.ArrayLike) -> dict[str, Floats]:
        """Derivatives {camera: (N, 2, 3)} [px / m] of :meth:`project` by the points."""
        return self._projection.jacobian(points, self._joints)

    def triangulate(self, pixels: Mapping[str, npt.ArrayLike]) -> Floats:
        """Points (N, 3) [m] that appear at pixels; see :meth:`Projection.triangulate`."""
        return self._projection.triangulate(pixels, self._joints)

    def along(self, camera: str, pixel: npt.ArrayLike, places: npt.ArrayLike) -> Floats:
        """Points (M, 3) [m] that appear at one pixel of a camera: without depths, what a ray is made of.

        Each place that the camera has in its image is led to the pixel p by Gauss-Newton steps of least norm,
        x + J^T (J J^T)^-1 (p - project(x)), which leave its distance about as it is. So the points are spread
        in depth as the places are.

        Args:
            camera: its name.
            pixel: (u, v).
            places: (N, 3) [m] to start from.

        Returns:
            The points, M <= N of them; none where no place gets there.

        Raises:
            ArgumentError: no such camera, or NaN.
        """
        if camera not in self.cameras:
            raise ArgumentError(f"camera: unknown camera '{camera}'; there are {', '.join(self.cameras)}")
        aim, points = fixed("pixel", pixel, (2,)), rows("places", places, 3)
        points = points[self._projection.visible(points, self._joints)[camera]]
        for _ in range(STEPS):
            missing = aim - self.project(points)[camera]
            # A point that was led out of view is lost.
            points, missing = (array[np.isfinite(missing).all(axis=1)] for array in (points, missing))
            if (np.abs(missing) < 1e-3).all():
                break
            slope = self.jacobian(points)[camera]
            gram = slope @ slope.transpose(0, 2, 1)
            solvable = np.linalg.cond(gram) < 1e8
            points, missing, slope, gram = (a[solvable] for a in (points, missing, slope, gram))
            points = points + np.einsum(
                "nij,ni->nj", slope, np.linalg.solve(gram, missing[:, :, None])[:, :, 0]
            )
        reached = self.project(points)[camera]
        with np.errstate(invalid="ignore"):
            arrived: Floats = points[np.linalg.norm(reached - aim, axis=1) < ARRIVED]
        return arrived
