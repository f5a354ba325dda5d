"""One cycle of attention in one call: from the plan or the posture to where each camera shall look.

:func:`attention_step` gives what projecting, :func:`kernel_landscape` or :func:`gaussian_landscape` and
:func:`gibbs_sample` or :func:`threshold` give one after the other, bit for bit, without coming back to Python
between them. It is meant for the control loop, with ``out=`` the result of the cycle before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import image_shape, integer
from .errors import ArgumentError, ArgumentTypeError, NotInViewError
from .landscape import KernelName, Landscape, Numbers, Rows, Seed, random_bits
from .motorplan import default_width

__all__ = ["Attended", "CameraMap", "attention_step"]

CameraMap: TypeAlias = _core.Mlp | tuple[_core.Mlp, _core.Mlp] | npt.NDArray[np.floating[Any]]
"""How the plan appears in a camera: a network, a network and another one that tells what is in view, or a
projection matrix (3, 4)."""


@dataclass(frozen=True, eq=False)
class Attended:
    """Where one camera shall look.

    Attributes:
        landscape: (H, W) float32, or smaller, see ``stride`` of :func:`attention_step`.
        centres: (n, 2) int32 centres (u, v) of windows, or None where a mask was asked for.
        mask: (H, W) bool, the most relevant pixels, or None where windows were asked for.
        level: the threshold of the mask, one of the landscape's values.
    """

    landscape: Landscape
    centres: npt.NDArray[np.int32] | None = None
    mask: npt.NDArray[np.bool_] | None = None
    level: float | None = None


def attention_step(
    maps: Mapping[str, CameraMap] | None,
    shapes: Mapping[str, tuple[int, int]],
    points: Rows | None = None,
    joints: Numbers | None = None,
    *,
    pixels: Mapping[str, Rows] | None = None,
    windows: int | None = None,
    fraction: float | None = None,
    count: int | None = None,
    stride: int = 1,
    width: float | tuple[float, float] | None = None,
    kernel: KernelName = "triangular",
    cutoff: float = 3.0,
    mixing: float = 1.0,
    seed: Seed = None,
    threads: bool = False,
    out: Mapping[str, Attended] | None = None,
) -> dict[str, Attended]:
    """Landscape and where to look for all cameras, in one call into the kernels.

    There are three ways in. With ``maps`` and ``points`` the path of the hand is projected and carries
    kernels (Eq. 6-9). With ``maps`` and no points the maps give the ellipse of the reachable space for the
    posture (Eq. 2-5, 10). With ``pixels`` the path is projected already, by whatever :class:`Projection`.

    Source: Lukic, Billard and Santos-Victor, Sections III and IV; the networks are those of III-A and III-B.

    Args:
        maps: {camera: map}. For a path a projection matrix (3, 4), of any scale and sign as for
            :class:`PinholeProjection`, or an ``Mlp`` from (x, y, z, joints) to (u, v), or a pair of it and
            one from the same to a number, which is negative for points that the camera does not see; they are
            left out. ``NeuralProjection.maps`` are such pairs. For a posture an ``Mlp`` from the joints to
            (u, v, ln L1, L2, ln L3); the logarithms are clipped to +-12, so that every output is an ellipse.
        shapes: {camera: (height, width)} for at least these cameras.
        points: (N, 3) planned path of the hand [m] in the root frame. A point less than 0.01 m in front of a
            matrix's camera is left out.
        joints: (J,) posture [rad]; matrices need none.
        pixels: {camera: (N, 2)} projected path instead of ``maps``; NaN rows are left out.
        windows: number of windows, whose centres are Gibbs samples from an exact start (section IV-B); or
        fraction: share of each image to look at, its most relevant pixels (section IV-A); or
        count: number of pixels to look at.
        stride: side [px] of the square cells of the image for each of which the landscape has one element,
            (ceil(H / stride), ceil(W / stride)) in all: it is that of an image so many times smaller. Windows
            fall on any pixel of the cells that are drawn, a mask has whole cells. Landscapes are smooth over
            some tens of pixels; of 320 x 240 pixels a stride of 4 loses next to nothing and takes a quarter
            of the time. At most the kernel's width.
        width: kernel width [px], one number or (horizontal, vertical); default 40 in an image 320 wide,
            scaled with the image.
        kernel: 'triangular' or 'gaussian'.
        cutoff: radius of the ellipses in standard deviations.
        mixing: pi of Eq. 10 for the ellipses, 1 for thresholds, about 0.2 for windows.
        seed: as in :func:`gibbs_sample`; camera k of the maps, counted from 0, draws with ``seed + k`` modulo
            2^64.
        threads: run the cameras side by side; the result is the same.
        out: results of earlier calls, whose arrays are written again where they fit what is asked. A camera
            that sees nothing is not in the result; ``kept |= attention_step(..., out=kept)`` keeps its
            arrays.

    Returns:
        {camera: Attended}, without the cameras in whose image the plan leaves no trace.

    Raises:
        ArgumentError: not exactly one of ``windows``, ``fraction`` and ``count``; not exactly one of ``maps``
            and ``pixels``; a network that does not fit the joints; NaN; a wrong shape.
        ArgumentTypeError: an argument has the wrong type or dtype.
        NotInViewError: no camera has any of the path in front of it.
    """
    sources = _sources(maps, pixels, points)
    if (windows is not None) + (fraction is not None) + (count is not None) != 1:
        raise ArgumentError("windows, fraction, count: give exactly one of them")
    n = None if windows is None else _at_most("windows", integer("windows", windows, at_least=0))
    if not isinstance(threads, (bool, np.bool_)):
        raise ArgumentTypeError(f"threads: expected True or False, got {threads!r}")
    _check_mapping("shapes", shapes)
    earlier = {} if out is None else out
    _check_mapping("out", earlier)
    cell = _at_most("stride", integer("stride", stride, at_least=1))
    cameras = []
    results = []
    for camera, source in sources.items():
        if camera not in shapes:
            raise ArgumentError(f"shapes: camera '{camera}' is missing; there are {', '.join(shapes)}")
        shape = _size(camera, shapes[camera])
        result = _room(camera, shape, cell, n, earlier.get(camera))
        look = result.mask if n is None else result.centres
        h = default_width(shape) if width is None else width
        cameras.append((camera, source, shape, h, result.landscape, look))
        results.append(result)
    seen = _core.attention_step(
        cameras, points, joints, kernel, cutoff, mixing, fraction, count, cell, random_bits(seed), threads
    )
    if all(level is None for level in seen):
        path = "points" if pixels is None else "pixels"
        raise NotInViewError(f"{path}: none of them is in front of a camera")
    attended = {}
    for (camera, *_), result, level in zip(cameras, results, seen, strict=True):
        if level is None or level is False:
            continue
        if n is None:
            result = Attended(result.landscape, mask=result.mask, level=level)
        attended[camera] = result
    return attended


def _sources(
    maps: Mapping[str, CameraMap] | None,
    pixels: Mapping[str, Rows] | None,
    points: Rows | None,
) -> Mapping[str, CameraMap | Rows]:
    if (maps is None) == (pixels is None):
        raise ArgumentError("maps, pixels: give exactly one of them")
    sources: Mapping[str, CameraMap | Rows] | None = pixels if maps is None else maps
    name = "pixels" if maps is None else "maps"
    _check_mapping(name, sources)
    if not sources:
        raise ArgumentError(f"{name}: expected at least one camera, got none")
    for camera, source in sources.items():
        if not isinstance(camera, str):
            raise ArgumentTypeError(f"{name}: expected names of cameras, got {camera!r}")
        matrix = isinstance(source, np.ndarray) and source.shape == (3, 4)
        pair = isinstance(source, tuple) and [type(part) for part in source] == [_core.Mlp, _core.Mlp]
        network = pair or isinstance(source, _core.Mlp)
        if pixels is not None and (matrix or network):
            raise ArgumentError(f"pixels['{camera}']: expected an array (N, 2), got {_describe(source)}")
        if maps is not None and not matrix and not network:
            error = ArgumentError if isinstance(source, np.ndarray) else ArgumentTypeError
            raise error(
                f"maps['{camera}']: expected an Mlp or a projection matrix (3, 4), got {_describe(source)}"
            )
        if points is None and (matrix or pair):
            what = "a projection matrix" if matrix else "a pair of networks"
            raise ArgumentError(f"points: maps['{camera}'] is {what} and needs a path")
    if pixels is not None and points is not None:
        raise ArgumentError("points, pixels: give one of them")
    return sources


def _describe(value: object) -> str:
    shape = getattr(value, "shape", None)
    return type(value).__name__ if shape is None else f"an array {shape}"


def _check_mapping(name: str, value: object) -> None:
    if not isinstance(value, (dict, Mapping)):  # the dict first: it is the usual one and quick to tell
        raise ArgumentTypeError(f"{name}: expected a mapping of cameras, got {type(value).__name__}")


def _at_most(name: str, value: int, most: int = 2**31 - 1) -> int:
    if value > most:
        raise ArgumentError(f"{name}: expected at most {most}, got {value}")
    return value


def _size(camera: str, shape: object) -> tuple[int, int]:
    """(height, width) of an image that there can be."""
    if type(shape) is tuple and len(shape) == 2:
        height, width = shape
        if type(height) is int and type(width) is int and height > 0 and 0 < width < 2**31 / height:
            return height, width
    name = f"shapes['{camera}']"
    height, width = (integer(name, side, at_least=1) for side in image_shape(name, shape))
    _at_most(f"{name} in pixels", height * width)
    return height, width


def _room(
    camera: str, shape: tuple[int, int], stride: int, windows: int | None, earlier: Attended | None
) -> Attended:
    """Arrays to write to: those of the call before, if they fit."""
    if earlier is not None and not isinstance(earlier, Attended):
        raise ArgumentTypeError(f"out['{camera}']: expected Attended, got {type(earlier).__name__}")
    cells = -(-shape[0] // stride), -(-shape[1] // stride)
    if earlier is not None and earlier.landscape.shape == cells:
        look = earlier.mask if windows is None else earlier.centres
        fits = look is not None and (look.shape == shape if windows is None else len(look) == windows)
        if fits:
            return earlier
    landscape = _core.empty_landscape(cells)
    if windows is None:
        return Attended(landscape, mask=np.empty(shape, np.bool_))
    return Attended(landscape, centres=np.empty((windows, 2), np.int32))
