"""What every projection offers, and the part that all projections with known camera poses share."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, rows
from ..camera import Camera, PosedCamera
from ..errors import ArgumentError, ArgumentTypeError

MIN_ANGLE = 1e-3
"""Two rays that enclose a smaller angle [rad] are taken as parallel."""

_ITERATIONS = 10
_STEP = 1e-9  # [m], a smaller step ends the iteration


class Projection(ABC):
    """Where points of the root frame appear in the cameras, given the robot's joints.

    Points are (N, 3) [m], pixels (N, 2) as (u, v). ``joints`` is the posture in the projection's own order (9
    for the iCub); fixed cameras ignore it. Results are keyed by camera name, in the order of ``cameras``.
    """

    @property
    @abstractmethod
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""

    @property
    @abstractmethod
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each camera's image."""

    @abstractmethod
    def project(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Project points (N, 3) to pixels {name: (N, 2)}.

        A point less than 0.01 m in front of a camera gives a NaN row, never a mirrored one; pixels may lie
        outside the image. Raises :class:`ArgumentError` for another shape, NaN or infinity.
        """

    @abstractmethod
    def depths(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Return the depth along each optical axis {name: (N,)} [m]; negative behind the camera."""

    @abstractmethod
    def triangulate(self, pixels: Mapping[str, npt.ArrayLike], joints: npt.ArrayLike | None = None) -> Floats:
        """Return the points (N, 3) that appear at pixels {name: (N, 2)} of at least two cameras.

        A NaN row of pixels, as ``project`` writes it, means that this camera does not see the point. A point
        that fewer than two cameras see, or that the pixels do not determine, gives a NaN row.
        """


class PosedProjection(Projection):
    """A projection through cameras whose poses are known, fixed or by kinematics.

    A subclass hands its cameras to ``__init__`` and implements ``posed``; the rest is here.
    """

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        """Take the cameras by name, in the order of the results."""
        if not isinstance(cameras, Mapping):
            raise ArgumentTypeError(f"cameras: expected a mapping of names, got {type(cameras).__name__}")
        if not cameras:
            raise ArgumentError("cameras: expected at least one camera, got none")
        for name, camera in cameras.items():
            if not isinstance(camera, Camera):
                raise ArgumentTypeError(f"cameras[{name!r}]: expected a Camera, got {type(camera).__name__}")
        self._cameras = dict(cameras)

    @abstractmethod
    def posed(self, joints: npt.ArrayLike | None = None) -> dict[str, PosedCamera]:
        """Return every camera at its pose in the root frame, in the order of ``cameras``."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(self._cameras)

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each image; :class:`StateError` for a camera without a known size."""
        return {name: camera.shape for name, camera in self._cameras.items()}

    def project(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Project points (N, 3) to pixels {name: (N, 2)}; see :meth:`Projection.project`."""
        points = rows("points", points, 3)
        return {name: camera.project(points) for name, camera in self.posed(joints).items()}

    def depths(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Return the depth along each optical axis {name: (N,)} [m]; negative behind the camera."""
        points = rows("points", points, 3)
        return {name: camera.depth(points) for name, camera in self.posed(joints).items()}

    def triangulate(self, pixels: Mapping[str, npt.ArrayLike], joints: npt.ArrayLike | None = None) -> Floats:
        """Return the points (N, 3) [m] with the least squared reprojection error [px^2].

        pixels {name: (N, 2)} of at least two cameras; a NaN row means that this camera does not see it.
        It starts at the point nearest to all rays (origin o, unit direction d)::

            sum (I - d d^T) x = sum (I - d d^T) o

        and goes on by Gauss-Newton steps on the pixels, lens distortion included, keeping a step only where
        it lowers the error. A row is NaN if fewer than two cameras see the point, if the rays are parallel to
        within 1 mrad, or if they meet less than 0.01 m in front of one of the cameras.
        Raises :class:`ArgumentError` for fewer than two cameras, unknown names, infinities and unequal N.
        """
        seen = self._check_pixels(pixels)
        posed = self.posed(joints)
        cameras = [posed[name] for name in seen]
        targets = np.stack(list(seen.values()))
        points, visible = nearest_to_rays(cameras, targets)
        good = ~np.isnan(points[:, 0])
        points[good] = _refine(cameras, targets[:, good], visible[:, good], points[good])
        return points

    def _check_pixels(self, pixels: Mapping[str, npt.ArrayLike]) -> dict[str, Floats]:
        if not isinstance(pixels, Mapping):
            raise ArgumentTypeError(
                f"pixels: expected a mapping of camera names, got {type(pixels).__name__}"
            )
        unknown = [name for name in pixels if name not in self._cameras]
        if unknown:
            raise ArgumentError(f"pixels: unknown camera {unknown[0]!r}; there are {', '.join(self.cameras)}")
        if len(pixels) < 2:
            raise ArgumentError(f"pixels: expected at least two cameras, got {', '.join(pixels) or 'none'}")
        checked = {name: rows(f"pixels[{name!r}]", value, 2, nan=True) for name, value in pixels.items()}
        lengths = {name: len(value) for name, value in checked.items()}
        if len(set(lengths.values())) > 1:
            raise ArgumentError(f"pixels: expected the same number of rows for each camera, got {lengths}")
        return checked


def nearest_to_rays(cameras: list[PosedCamera], targets: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the points (N, 3) nearest to the rays of targets (C, N, 2), and which rays (C, N) count."""
    count = targets.shape[1]
    visible: npt.NDArray[np.bool_] = np.asarray(~np.isnan(targets).any(axis=2))
    normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for camera, target, seen in zip(cameras, targets, visible, strict=True):
        origin, direction = camera.rays(np.where(seen[:, None], target, 0.0))
        seen &= ~np.isnan(direction[:, 0])
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
        across[~seen] = 0.0
        normal += across
        right += across @ origin
    # For two rays the smallest eigenvalue is 1 - cos(angle between them).
    determined = visible.sum(axis=0) >= 2
    determined &= np.linalg.eigvalsh(normal)[:, 0] >= 1.0 - math.cos(MIN_ANGLE)
    points = np.full((count, 3), np.nan)
    points[determined] = np.linalg.solve(normal[determined], right[determined, :, None])[:, :, 0]
    return points, visible


def _refine(
    cameras: list[PosedCamera], targets: Floats, visible: npt.NDArray[np.bool_], points: Floats
) -> Floats:
    """Gauss-Newton on the reprojection error of all points at once; never worse than the start."""

    def evaluate(points: Floats) -> tuple[Floats, Floats, Floats]:
        n = len(points)
        cost, gradient, hessian = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
        for camera, target, seen in zip(cameras, targets, visible, strict=True):
            local = camera.to_camera(points)
            error = np.where(seen[:, None], camera.camera.project(local) - target, 0.0)
            slope = camera.camera.jacobian(local) @ camera.pose[:3, :3].T
            slope = np.where(seen[:, None, None], slope, 0.0)
            cost += (error**2).sum(axis=1)
            gradient += np.einsum("nij,ni->nj", slope, error)
            hessian += np.einsum("nij,nik->njk", slope, slope)
        return cost, gradient, hessian

    cost, gradient, hessian = evaluate(points)
    for _ in range(_ITERATIONS):
        # A trace of damping, far below the steps' precision, keeps a singular system from raising.
        size = np.trace(hessian, axis1=1, axis2=2)
        hessian = hessian + 1e-13 * size[:, None, None] * np.eye(3)
        solvable = np.isfinite(cost) & (size > 0.0)
        step = np.zeros_like(points)
        step[solvable] = np.linalg.solve(hessian[solvable], gradient[solvable, :, None])[:, :, 0]
        new = evaluate(points - step)
        with np.errstate(invalid="ignore"):
            better = new[0] < cost
        points = np.where(better[:, None], points - step, points)
        cost = np.where(better, new[0], cost)
        if not (better & (np.abs(step).max(axis=1) > _STEP)).any():
            break
        gradient = np.where(better[:, None], new[1], gradient)
        hessian = np.where(better[:, None, None], new[2], hessian)
    # Without a cost the point is behind one of its cameras, or outside what its lens can see.
    return np.where(np.isfinite(cost)[:, None], points, np.nan)
