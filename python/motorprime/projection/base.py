"""What every projection offers, and the part that all projections with known camera poses share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, rows
from ..camera import Camera, PosedCamera
from ..errors import ArgumentError, ArgumentTypeError, StateError
from .triangulation import nearest_to_rays, refine


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
    def jacobian(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Derivatives {name: (N, 2, 3)} [px / m] of ``project`` by the points."""

    def visible(
        self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None
    ) -> dict[str, npt.NDArray[np.bool_]]:
        """Whether each camera has each point in its image {name: (N,)}; occlusion is not known.

        This is judged before lens distortion, which may fold a point far outside back into the image.
        """
        pixels = self.project(points, joints)
        return {name: inside(pixels[name], shape) for name, shape in self.shapes.items()}

    def depths(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Return the depth along each optical axis {name: (N,)} [m]; negative behind the camera.

        Raises :class:`StateError` where the projection knows of no optical axes.
        """
        raise StateError(f"a {type(self).__name__} knows pixels, but no depths")

    def triangulate(self, pixels: Mapping[str, npt.ArrayLike], joints: npt.ArrayLike | None = None) -> Floats:
        """Return the points (N, 3) [m] with the least squared reprojection error [px^2].

        pixels {name: (N, 2)} of at least two cameras; a NaN row, as ``project`` writes it, means that this
        camera does not see the point. Damped Gauss-Newton steps on :meth:`jacobian` lower the error from
        where the projection starts. A point that fewer than two cameras see, or that the pixels do not
        determine, gives a NaN row.
        Raises :class:`ArgumentError` for fewer than two cameras, unknown names, infinities and unequal N.
        """
        targets = self._check_pixels(pixels)
        names, stacked = list(targets), np.stack(list(targets.values()))
        starts = np.stack(self._starts(targets, joints))
        which = np.flatnonzero(
            ~np.isnan(starts[:, :, 0]).ravel()
        )  # of all starts of all points, one after another
        point = which % starts.shape[1]
        seen = ~np.isnan(stacked[:, point, 0])
        aims = np.where(seen[..., None], stacked[:, point], 0.0)

        def evaluate(points: Floats) -> tuple[Floats, Floats]:
            reached, slopes = self._linearise(points, joints)
            errors = np.stack([reached[name] for name in names]) - aims
            slope = np.stack([slopes[name] for name in names])
            return np.where(seen[..., None], errors, 0.0), np.where(seen[..., None, None], slope, 0.0)

        points, cost = refine(evaluate, starts.reshape(-1, 3)[which], finest=self._finest)
        # Without a cost the point is behind one of its cameras, or outside what its lens can see.
        costs = np.full(starts.shape[:2], np.inf)
        costs.flat[which] = np.where(np.isnan(cost), np.inf, cost)
        starts.reshape(-1, 3)[which] = points
        best = costs.argmin(axis=0)
        everyone = np.arange(len(best))
        return np.where(np.isfinite(costs[best, everyone])[:, None], starts[best, everyone], np.nan)

    _finest = 1e-9
    """A step shorter than this [m] ends a triangulation."""

    @abstractmethod
    def _starts(self, pixels: Mapping[str, Floats], joints: npt.ArrayLike | None) -> list[Floats]:
        """Where triangulation starts: each (N, 3) [m], NaN rows for points that are not determined."""

    def _linearise(
        self, points: Floats, joints: npt.ArrayLike | None
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Pixels and their derivatives; NaN where a camera cannot have the point in view."""
        return self.project(points, joints), self.jacobian(points, joints)

    def _check_pixels(self, pixels: Mapping[str, npt.ArrayLike]) -> dict[str, Floats]:
        if not isinstance(pixels, Mapping):
            raise ArgumentTypeError(
                f"pixels: expected a mapping of camera names, got {type(pixels).__name__}"
            )
        unknown = [name for name in pixels if name not in self.cameras]
        if unknown:
            raise ArgumentError(f"pixels: unknown camera {unknown[0]!r}; there are {', '.join(self.cameras)}")
        if len(pixels) < 2:
            raise ArgumentError(f"pixels: expected at least two cameras, got {', '.join(pixels) or 'none'}")
        checked = {name: rows(f"pixels[{name!r}]", value, 2, nan=True) for name, value in pixels.items()}
        lengths = {name: len(value) for name, value in checked.items()}
        if len(set(lengths.values())) > 1:
            raise ArgumentError(f"pixels: expected the same number of rows for each camera, got {lengths}")
        return checked


def inside(pixels: Floats, shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Whether pixels (N, 2) lie in an image (height, width), from -0.5 to width - 0.5; NaN rows do not."""
    with np.errstate(invalid="ignore"):
        within = (pixels >= -0.5) & (pixels < (shape[1] - 0.5, shape[0] - 0.5))
    return np.asarray(within.all(axis=-1))


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

    def jacobian(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Derivatives {name: (N, 2, 3)} [px / m] of ``project`` by the points."""
        points = rows("points", points, 3)
        return {
            name: view.camera.jacobian(view.to_camera(points)) @ view.pose[:3, :3].T
            for name, view in self.posed(joints).items()
        }

    def _starts(self, pixels: Mapping[str, Floats], joints: npt.ArrayLike | None) -> list[Floats]:
        """The points nearest to all rays; NaN where rays are parallel to within 1 mrad.

        With origins o and unit directions d: sum (I - d d^T) x = sum (I - d d^T) o.
        """
        posed = self.posed(joints)
        return [nearest_to_rays([posed[name] for name in pixels], np.stack(list(pixels.values())))[0]]
