"""Cameras that do not move: projection matrices or posed cameras."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, image_shape
from ..camera import Camera, PosedCamera
from ..errors import ArgumentError, ArgumentTypeError, StateError
from .base import PosedProjection

_SKEW = 1e-4  # relative to fx: 0.05 px at the edge of a 1000 px image


class PinholeProjection(PosedProjection):
    """Fixed cameras, given as projection matrices (3, 4) or as :class:`PosedCamera`.

    cameras: {name: P} with P = s K [R | t], so that s' (u, v, 1)^T = P (x, y, z, 1)^T for a point of the root
    frame, or {name: PosedCamera}. P and -P are the same camera; the one is taken whose K has a positive
    diagonal and whose R is a rotation, so a matrix whose v runs upwards sees nothing of what is in front.
    shape: (height, width) [px] of all images made by matrices, or {name: (height, width)}. Projecting and
    triangulating do without it; ``shapes``, and so attention, does not.

    ``joints`` is accepted everywhere and ignored. Raises :class:`ArgumentError` for a matrix that is
    degenerate or has skew, and for a shape that contradicts a PosedCamera's.
    """

    def __init__(
        self,
        cameras: Mapping[str, npt.ArrayLike | PosedCamera],
        shape: tuple[int, int] | Mapping[str, tuple[int, int]] | None = None,
    ) -> None:
        """Decompose the matrices."""
        if not isinstance(cameras, Mapping):
            raise ArgumentTypeError(f"cameras: expected a mapping of names, got {type(cameras).__name__}")
        if isinstance(shape, Mapping):
            unknown = [name for name in shape if name not in cameras]
            if unknown:
                raise ArgumentError(f"shape: unknown camera {unknown[0]!r}; there are {', '.join(cameras)}")
        self._posed: dict[str, PosedCamera] = {}
        for name, camera in cameras.items():
            size = shape.get(name) if isinstance(shape, Mapping) else shape
            if not isinstance(camera, PosedCamera):
                self._posed[name] = _decompose(f"cameras[{name!r}]", camera, size)
                continue
            known = camera.camera.height, camera.camera.width
            if size is not None and image_shape("shape", size) != known:
                raise ArgumentError(f"shape: camera {name!r} has {known}, got {size}")
            self._posed[name] = camera
        super().__init__({name: camera.camera for name, camera in self._posed.items()})

    def posed(self, joints: npt.ArrayLike | None = None) -> dict[str, PosedCamera]:
        """Return the cameras at their poses, whatever the joints."""
        return dict(self._posed)

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each image; :class:`StateError` if one was not given."""
        unknown = [name for name, camera in self._cameras.items() if camera.width == 0]
        if unknown:
            raise StateError(
                f"the image size of camera {unknown[0]!r} is not known from its projection matrix: "
                "pass shape=(height, width) to PinholeProjection"
            )
        return super().shapes


def _decompose(name: str, matrix: npt.ArrayLike, shape: tuple[int, int] | None) -> PosedCamera:
    """Split P = s K [R | t] into intrinsics and the camera's pose in the root frame."""
    p = fixed(name, matrix, (3, 4))
    volume = np.linalg.det(p[:, :3])
    lengths = np.linalg.norm(p[:, :3], axis=1)
    if not abs(volume) > 1e-9 * lengths.prod():
        raise ArgumentError(
            f"{name}: expected a camera with a centre, but the left 3 x 3 part is singular "
            f"(determinant {volume:.3g})"
        )
    p = p * np.sign(volume) / lengths[2]
    k, rotation = _rq(p[:, :3])
    k /= k[2, 2]
    if abs(k[0, 1]) > _SKEW * k[0, 0]:
        raise ArgumentError(
            f"{name}: expected a camera without skew, got skew {k[0, 1]:.3g} px at fx = {k[0, 0]:.6g} px; "
            "calibrate without it and pass a PosedCamera"
        )
    height, width = (0, 0) if shape is None else image_shape("shape", shape)
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -np.linalg.solve(p[:, :3], p[:, 3])
    return PosedCamera(Camera(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2]), pose)


def _rq(matrix: Floats) -> tuple[Floats, Floats]:
    """Return an upper triangular K with a positive diagonal and an orthogonal R with K R = matrix."""
    # QR of the matrix turned upside down and transposed is RQ of the matrix.
    q, r = np.linalg.qr(matrix[::-1].T)
    upper, rotation = r.T[::-1, ::-1], q.T[::-1]
    signs = np.sign(np.diag(upper))
    return upper * signs, signs[:, None] * rotation
