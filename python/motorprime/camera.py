"""Cameras: intrinsics with lens distortion, and a camera at a pose.

Pixels are (u, v), u to the right and v down, pixel centres at integers, so that an image covers
-0.5 .. width - 0.5. The camera frame has x right, y down and z forward, in metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, finite, fixed, image_shape, integer, numbers, rigid, rows
from .errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from .lens import Lens

MIN_DEPTH = 0.01
"""A point nearer to the image plane than this [m] has no pixel."""

_COUNTS = (0, 4, 5, 8, 12, 14)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with OpenCV's lens model.

    width, height: the image [px]; both 0 where the size is not known, and then ``shape``, ``crop`` and
    ``scale`` raise :class:`StateError`. fx, fy: focal lengths [px], > 0. cx, cy: principal point [px].
    distortion: 0, 4, 5, 8, 12 or 14 coefficients k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty; a
    list or an array is taken too. With (x', y') the (X / Z, Y / Z) bent as in :mod:`motorprime.lens`::

        u = fx x' + cx,   v = fy y' + cy

    Raises :class:`ArgumentError` or :class:`ArgumentTypeError` for anything else.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check every field and convert it to a plain int, float or tuple."""
        for name in ("width", "height"):
            object.__setattr__(self, name, integer(name, getattr(self, name), at_least=0))
        if (self.width == 0) != (self.height == 0):
            raise ArgumentError(
                "width, height: expected both >= 1, or both 0 for an unknown size, "
                f"got {self.width}, {self.height}"
            )
        for name in ("fx", "fy", "cx", "cy"):
            object.__setattr__(self, name, float(fixed(name, getattr(self, name), ())))
        for name in ("fx", "fy"):
            if getattr(self, name) <= 0.0:
                raise ArgumentError(f"{name}: expected a focal length > 0 px, got {getattr(self, name)}")
        given = self.distortion
        empty = isinstance(given, (tuple, list)) and not given
        distortion = np.empty(0) if empty else finite("distortion", numbers("distortion", given).reshape(-1))
        if distortion.size not in _COUNTS:
            raise ArgumentError(
                "distortion: expected 0, 4, 5, 8, 12 or 14 coefficients in OpenCV's order, "
                f"got {distortion.size}"
            )
        object.__setattr__(self, "distortion", tuple(distortion.tolist()))

    @classmethod
    def from_matrix(
        cls, matrix: npt.ArrayLike, shape: tuple[int, int], distortion: tuple[float, ...] = ()
    ) -> Camera:
        """Make a camera from [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] (3, 3) and shape (height, width).

        Raises :class:`ArgumentError` for skew and for another last row.
        """
        k = fixed("matrix", matrix, (3, 3))
        if abs(k[0, 1]) > 1e-6 * abs(k[0, 0]) or k[1, 0] != 0.0 or not np.array_equal(k[2], (0.0, 0.0, 1.0)):
            raise ArgumentError(
                f"matrix: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew, got {k.tolist()}"
            )
        height, width = image_shape("shape", shape)
        return cls(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2], distortion)

    @classmethod
    def from_fov(cls, width: int, height: int, fov: float, *, axis: str = "horizontal") -> Camera:
        """Make an undistorted camera with square pixels, its axis in the middle of the image.

        fov [rad] is the angle between the outer edges of the image along ``axis``, 'horizontal' or
        'vertical': f = (width / 2) / tan(fov / 2).
        """
        if axis not in ("horizontal", "vertical"):
            raise ArgumentError(f"axis: expected 'horizontal' or 'vertical', got {axis!r}")
        angle = float(fixed("fov", fov, ()))
        if not 0.0 < angle < math.pi:
            raise ArgumentError(f"fov: expected radians between 0 and pi, got {angle}")
        width = integer("width", width, at_least=1)
        height = integer("height", height, at_least=1)
        focal = (width if axis == "horizontal" else height) / 2.0 / math.tan(angle / 2.0)
        return cls(width, height, focal, focal, (width - 1) / 2.0, (height - 1) / 2.0)

    @classmethod
    def from_opencv_yaml(cls, path: str | PathLike[str], *, shape: tuple[int, int] | None = None) -> Camera:
        """Read what OpenCV's calibration programs write (YAML, XML or JSON).

        shape: (height, width), for files that do not say the image's size. All-zero distortion becomes ().
        Raises :class:`ArgumentError` that names the file and the key.
        """
        from .camera_files import read_opencv

        return read_opencv(path, shape)

    @classmethod
    def from_camera_info(cls, path: str | PathLike[str]) -> Camera:
        """Read a ROS CameraInfo YAML: the file of camera_calibration, or a printed message.

        The camera is that of the raw image: matrix K and distortion D; rectification, binning and region of
        interest are ignored. All-zero distortion becomes (). Raises :class:`ArgumentError` that names the
        file and the key, also for a distortion model other than plumb_bob and rational_polynomial.
        """
        from .camera_files import read_camera_info

        return read_camera_info(path)

    def to_opencv_yaml(self, path: str | PathLike[str]) -> None:
        """Write a file that ``from_opencv_yaml`` and cv2.FileStorage read back to the last bit.

        Raises :class:`ArgumentError` if it cannot be written, :class:`StateError` without an image size.
        """
        from .camera_files import write_opencv

        write_opencv(self, path)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) [px]. Raises :class:`StateError` if the size is not known."""
        if self.width == 0:
            raise StateError("this camera was made without an image size: make it with width and height")
        return self.height, self.width

    @property
    def matrix(self) -> Floats:
        """[[fx, 0, cx], [0, fy, cy], [0, 0, 1]], (3, 3), a new array."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @cached_property
    def _lens(self) -> Lens | None:
        return Lens(self.distortion) if any(self.distortion) else None

    def project(self, points: npt.ArrayLike) -> Floats:
        """Project points (N, 3) [m] of the camera frame to pixels (N, 2).

        A point with z < 0.01 m gives a NaN row, and so does one so far off the axis that the lens polynomial
        would fold it back into the image; this is judged before distortion. Pixels may lie outside the image.
        Raises :class:`ArgumentError` for another shape, NaN or infinity.
        """
        xy = self._normalised(rows("points", points, 3))
        if self._lens is not None:
            xy = self._lens.distort(xy)
        pixels: Floats = xy * (self.fx, self.fy) + (self.cx, self.cy)
        return pixels

    def jacobian(self, points: npt.ArrayLike) -> Floats:
        """Derive ``project``: points (N, 3) to (N, 2, 3) [px / m], NaN where ``project`` gives NaN."""
        points = rows("points", points, 3)
        xy = self._normalised(points)
        pinhole: Floats = np.zeros((len(points), 2, 3))
        pinhole[:, 0, 0] = pinhole[:, 1, 1] = 1.0
        pinhole[:, :, 2] = -xy
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            pinhole *= np.where(np.isnan(xy[:, 0]), np.nan, 1.0 / points[:, 2])[:, None, None]
            if self._lens is not None:
                inside = (xy**2).sum(axis=1) <= self._lens.limit**2
                pinhole = self._lens.jacobian(np.where(inside[:, None], xy, np.nan)) @ pinhole
        pinhole *= np.array([self.fx, self.fy])[:, None]
        return pinhole

    def rays(self, pixels: npt.ArrayLike) -> Floats:
        """Return the directions (N, 3) with z = 1 in which pixels (N, 2) look, without distortion.

        A ray times a depth is the point at that depth. The lens is inverted by Newton's method to 1e-12 of
        the focal length; a pixel that the lens model reaches from nowhere gives a NaN row.
        Raises :class:`ArgumentError` for another shape, NaN or infinity.
        """
        xy = (rows("pixels", pixels, 2) - (self.cx, self.cy)) / (self.fx, self.fy)
        if self._lens is not None:
            xy = self._lens.undistort(xy)
        return np.column_stack([xy, np.where(np.isnan(xy[:, 0]), np.nan, 1.0)])

    def crop(self, u0: int, v0: int, width: int, height: int) -> Camera:
        """Return the camera of ``image[v0:v0 + height, u0:u0 + width]``, which must lie inside the image."""
        tall, wide = self.shape
        u0, v0 = integer("u0", u0, at_least=0), integer("v0", v0, at_least=0)
        width, height = integer("width", width, at_least=1), integer("height", height, at_least=1)
        if u0 + width > wide or v0 + height > tall:
            raise ArgumentError(
                f"u0, v0, width, height: expected a window inside {wide} x {tall} px, "
                f"got {width} x {height} at ({u0}, {v0})"
            )
        return replace(self, width=width, height=height, cx=self.cx - u0, cy=self.cy - v0)

    def scale(self, size: float | tuple[int, int]) -> Camera:
        """Return the camera of the resized image: ``size`` is a factor > 0 or (width, height).

        A factor gives the rounded size. With s = new width / width, pixel centres at integers ask for
        cx' = (cx + 0.5) s - 0.5; this is what cv2.resize does. Distortion does not change.
        """
        tall, wide = self.shape
        if isinstance(size, (tuple, list)):
            if len(size) != 2:
                raise ArgumentError(f"size: expected a factor or (width, height), got {size!r}")
            width, height = (integer("size", value, at_least=1) for value in size)
        else:
            factor = float(fixed("size", size, ()))
            width, height = round(wide * factor), round(tall * factor)
            if width < 1 or height < 1:
                raise ArgumentError(f"size: expected a factor that leaves at least 1 x 1 px, got {factor}")
        su, sv = width / wide, height / tall
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * su,
            fy=self.fy * sv,
            cx=(self.cx + 0.5) * su - 0.5,
            cy=(self.cy + 0.5) * sv - 0.5,
        )

    def _normalised(self, points: Floats) -> Floats:
        """Return (X / Z, Y / Z), NaN where Z < MIN_DEPTH."""
        z = points[:, 2:]
        with np.errstate(over="ignore"):
            xy: Floats = points[:, :2] / np.where(z >= MIN_DEPTH, z, np.nan)
        return xy


@dataclass(frozen=True, eq=False)
class PosedCamera:
    """A camera at a pose (4, 4): the camera frame in the root frame, which maps camera to root coordinates.

    The columns of pose[:3, :3] are the camera's right, down and forward in the root frame, pose[:3, 3] is its
    centre [m]. Raises :class:`ArgumentError` if the pose is not a rigid motion (to 1e-5).
    """

    camera: Camera
    pose: Floats

    def __post_init__(self) -> None:
        """Check the pose and keep a read-only copy."""
        if not isinstance(self.camera, Camera):
            raise ArgumentTypeError(f"camera: expected a Camera, got {type(self.camera).__name__}")
        pose = rigid("pose", self.pose).copy()
        pose.setflags(write=False)
        object.__setattr__(self, "pose", pose)

    @property
    def origin(self) -> Floats:
        """The camera's centre in the root frame (3,) [m]."""
        return self.pose[:3, 3]

    def to_camera(self, points_root: npt.ArrayLike) -> Floats:
        """Express points (N, 3) of the root frame in the camera frame (N, 3) [m]."""
        moved: Floats = (rows("points_root", points_root, 3) - self.origin) @ self.pose[:3, :3]
        return moved

    def project(self, points_root: npt.ArrayLike) -> Floats:
        """Project points (N, 3) of the root frame to pixels (N, 2); NaN rows as in :meth:`Camera.project`."""
        return self.camera.project(self.to_camera(points_root))

    def depth(self, points_root: npt.ArrayLike) -> Floats:
        """Return the depth along the optical axis (N,) [m]; negative behind the camera."""
        return self.to_camera(points_root)[:, 2]

    def rays(self, pixels: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return the camera's centre (3,) and the pixels' directions (N, 3) in the root frame.

        The directions have length 1 along the optical axis, so ``origin + depth * direction`` is the point of
        that depth. NaN rows as in :meth:`Camera.rays`.
        """
        return self.origin.copy(), self.camera.rays(pixels) @ self.pose[:3, :3].T


def sphere_outline_centre(camera: Camera, centre: npt.ArrayLike, radius: float) -> Floats:
    """Return the centre (2,) [px] of the ellipse that is a sphere's outline in an undistorted image.

    centre (3,) in the camera frame and radius >= 0 [m]. A direction d touches the sphere round C if
    (d . C)^2 = (|C|^2 - r^2) |d|^2. For d = (x, y, 1) this is a conic; its gradient vanishes at its centre::

        (X^2 - k) x + X Y y = -X Z,   X Y x + (Y^2 - k) y = -Y Z,   k = X^2 + Y^2 + Z^2 - r^2

    Inserting (x, y) = a (X, Y) gives a (r^2 - Z^2) = -Z, hence ::

        u = fx X Z / (Z^2 - r^2) + cx,   v = fy Y Z / (Z^2 - r^2) + cy

    further from the axis than the projection of C. Raises :class:`NotInViewError` unless the whole sphere is
    at least 0.01 m in front, and :class:`ArgumentError` for a camera with distortion, whose outline is no
    ellipse.
    """
    x, y, z = fixed("centre", centre, (3,)).tolist()
    r = float(fixed("radius", radius, ()))
    if r < 0.0:
        raise ArgumentError(f"radius: expected >= 0 m, got {r}")
    if any(camera.distortion):
        raise ArgumentError("camera: expected one without distortion; undistort the image first")
    if z - r < MIN_DEPTH:
        raise NotInViewError(
            f"the sphere at z = {z} m with radius {r} m is not wholly in front of the camera"
        )
    stretch = z / (z * z - r * r)
    return np.array([camera.fx * x * stretch + camera.cx, camera.fy * y * stretch + camera.cy])
