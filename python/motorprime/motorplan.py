"""Motor-plan attention (section III-C2): the planned path of the hand, projected into the eyes.

Kernels at the projected points make the landscape (Eq. 6-9). Their width is set in pixels, or in metres
around the path, which gives each point the width that its depth asks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ._arrays import Floats, numbers, positive, rows
from .errors import ArgumentError, ArgumentTypeError, NotInViewError
from .landscape import KernelName, kernel_landscape
from .projection import Projection

DEFAULT_WIDTH = 40.0
"""Kernel width [px] in an image 320 pixels wide; scaled with the image."""

PATH_SHARE = 0.5
"""Of the palm's path, beside 1 of each thing that the plan involves."""


def default_width(shape: tuple[int, int]) -> float:
    """Default kernel width [px] for an image of (height, width)."""
    return DEFAULT_WIDTH * shape[1] / 320.0


def motorplan_landscape(
    path: npt.ArrayLike,
    projection: Projection,
    joints: npt.ArrayLike | None = None,
    *,
    width: float | None = None,
    metres: float | None = None,
    kernel: KernelName = "triangular",
) -> dict[str, NDArray[np.float32]]:
    """Landscape of a planned path in every camera that sees some of it.

    Args:
        path: (N, 3) planned points of the hand [m] in the root frame.
        projection: to the cameras, whose image shapes are known.
        joints: gaze posture; fixed cameras need none.
        width: kernel width h [px] of Eq. 8; default 40 at 320 x 240, scaled with the image's width.
        metres: kernel width around the path [m] instead; each point's width in pixels follows from its depth.
        kernel: 'triangular' or 'gaussian'.

    Returns:
        {camera: (H, W) float32}; a camera behind which the whole path lies is left out.

    Raises:
        ArgumentError: an empty path, NaN, or both widths given.
        NotInViewError: no camera has any of the path in front of it.
    """
    points = rows("path", path, 3)
    if not len(points):
        raise ArgumentError("path: at least one point expected, got an empty trajectory")
    if width is not None and metres is not None:
        raise ArgumentError("width, metres: give one of them")
    pixels = projection.project(points, joints)
    if metres is None:
        return pixel_landscapes(pixels, projection.shapes, width=width, kernel=kernel)
    metres = positive("metres", metres)
    widths = {camera: _widths(points, projection, joints, camera, metres) for camera in pixels}
    return pixel_landscapes(pixels, projection.shapes, width=widths, kernel=kernel)


def pixel_landscapes(
    pixels: Mapping[str, Floats],
    shapes: Mapping[str, tuple[int, int]],
    *,
    width: float | Mapping[str, Floats] | None = None,
    kernel: KernelName = "triangular",
    weights: npt.ArrayLike | None = None,
) -> dict[str, NDArray[np.float32]]:
    """Landscape of a projected path in every camera that has some of it in front.

    Args:
        pixels: {camera: (N, 2)} (u, v); NaN rows are points that the camera does not see.
        shapes: {camera: (height, width)}.
        width: kernel width h [px]: one number, or {camera: (N,)} a width per point; default 40 at 320 x 240.
        kernel: 'triangular' or 'gaussian'.
        weights: (N,) of the points, >= 0; all the same when not given.

    Raises:
        ArgumentError: an unknown camera, or pixels or weights of another shape.
        NotInViewError: only NaN rows in every camera.
    """
    shares = None if weights is None else numbers("weights", weights)
    landscapes = {}
    for camera, given in pixels.items():
        if camera not in shapes:
            raise ArgumentError(f"pixels: unknown camera '{camera}'; there are {', '.join(shapes)}")
        places = numbers(f"pixels['{camera}']", given)
        if places.ndim != 2 or places.shape[1] != 2:
            raise ArgumentError(f"pixels['{camera}']: expected shape (N, 2), got {places.shape}")
        if isinstance(given, np.ndarray) and given.dtype.kind != "f":
            raise ArgumentTypeError(f"pixels['{camera}']: float pixels expected, got {given.dtype}")
        if shares is not None and shares.shape != places.shape[:1]:
            raise ArgumentError(f"weights: expected shape {places.shape[:1]}, got {shares.shape}")
        ahead = np.isfinite(places).all(axis=1)
        if isinstance(width, Mapping):
            ahead &= ~np.isnan(width[camera])
        if not ahead.any():
            continue
        size: float | Floats
        if isinstance(width, Mapping):
            size = width[camera][ahead]
        else:
            size = default_width(shapes[camera]) if width is None else width
        landscapes[camera] = kernel_landscape(
            places[ahead],
            shapes[camera],
            width=size,
            kernel=kernel,
            weights=None if shares is None else shares[ahead],
        )
    if not landscapes:
        raise NotInViewError("path: none of its points is in front of a camera")
    return landscapes


def all_involved(
    path: npt.ArrayLike, *, hand: npt.ArrayLike | None = None, things: Sequence[npt.ArrayLike] = ()
) -> tuple[Floats, Floats]:
    """Points (N, 3) [m] of all that a plan involves, and weights (N,) that give each part its share.

    The palm's path alone says where the hand will be. To see the whole of what the plan is about, the hand
    itself as it is now and the things that it is to take or to get past belong to it as well.

    Args:
        path: (K, 3) of the palm, from here to the end; its share is :data:`PATH_SHARE`.
        hand: (M, 3) of palm and fingers; its share is 1.
        things: points (L, 3) of each thing, where it is believed to be; the share of each is 1.

    Raises:
        ArgumentError: another shape, NaN, or a part without points.
    """
    parts = [("path", path, PATH_SHARE)]
    parts += [] if hand is None else [("hand", hand, 1.0)]
    parts += [(f"things[{k}]", thing, 1.0) for k, thing in enumerate(things)]
    points, weights = [], []
    for name, part, share in parts:
        places = rows(name, part, 3)
        if not len(places):
            raise ArgumentError(f"{name}: at least one point expected, got none")
        points.append(places)
        weights.append(np.full(len(places), share / len(places)))
    return np.concatenate(points), np.concatenate(weights)


def _widths(
    points: Floats, projection: Projection, joints: npt.ArrayLike | None, camera: str, metres: float
) -> Floats:
    """Width (N,) [px] of ``metres`` across the line of sight at each point.

    Taken as the root of the projection's area scale, so that no direction is preferred; this needs nothing
    from the projection but projecting. NaN where the camera does not see the point or the space next to it.
    """
    step = 1e-4
    moved = [
        projection.project(points + step * axis, joints)[camera]
        - projection.project(points - step * axis, joints)[camera]
        for axis in np.eye(3)
    ]
    jacobian = np.stack(moved, axis=-1) / (2.0 * step)  # (N, 2, 3) [px/m]
    across, down = jacobian[:, 0], jacobian[:, 1]
    area = np.linalg.norm(np.cross(across, down), axis=1)  # root of the Gram determinant
    widths: Floats = metres * np.sqrt(area)
    return widths
