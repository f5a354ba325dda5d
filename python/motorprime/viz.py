"""Pictures of what the robot attends to: landscape, planned path, scanned windows, what was found.

Everything here takes and gives (H, W, 3) uint8 RGB and changes nothing that it is given. Pictures are drawn
at twice the camera's size, so that lines stay crisp on 320 x 240 pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .detectors import Windows
from .detectors.base import check_image
from .errors import ArgumentError

if TYPE_CHECKING:
    from .tasks.cycle import Cycle

Picture: TypeAlias = NDArray[np.uint8]
Colour: TypeAlias = tuple[int, int, int]

RED: Colour = (226, 32, 36)
WHITE: Colour = (255, 255, 255)
BLUE: Colour = (70, 140, 255)
YELLOW: Colour = (255, 214, 10)
GREEN: Colour = (40, 240, 90)
MAGENTA: Colour = (245, 70, 225)
INK: Colour = (24, 28, 36)
PAPER: Colour = (244, 246, 249)

LEGEND: tuple[tuple[Colour, str], ...] = (
    (RED, "attentional landscape"),
    (WHITE, "planned path of the hand"),
    (BLUE, "scanned window"),
    (YELLOW, "window that hit"),
    (GREEN, "target found"),
    (MAGENTA, "known obstacle"),
)
"""What the colours mean, in the order in which they are explained."""

PHASES: Mapping[str, str] = {
    "search": "Search: look into the reachable space",
    "fixate": "Fixate: eyes turned to the target, look again",
    "survey": "Survey: does anything stand in the hand's way?",
    "reach": "Reach: look along the planned path of the hand",
    "grasp": "Grasp: the hand closes",
    "lift": "Lift: straight up, held by friction alone",
}
"""A line for strangers about each phase of picking up."""

LEGS: Mapping[int, str] = {
    3: "Reach: around the obstacle, by a via-point",
    2: "Reach: to the place before the target",
    1: "Reach: the last way to the target",
}
"""The same for a reach of which so many legs are left."""

FACE = cv2.FONT_HERSHEY_DUPLEX
_SHIFT = 4  # fractional bits of drawn points
_MARGIN = 40.0  # a path is drawn this far beyond the image [px]


def draw_attention(
    image: Picture,
    *,
    landscape: NDArray[np.float32] | None = None,
    path: npt.ArrayLike | None = None,
    windows: Windows | npt.ArrayLike | None = None,
    window_size: int = 20,
    hits: npt.ArrayLike | None = None,
    silhouette: NDArray[np.bool_] | None = None,
    obstacles: Sequence[npt.ArrayLike] = (),
    label: str | None = None,
    scale: int = 2,
) -> Picture:
    """Draw where a robot looks over what it sees; anything may be left out.

    Args:
        image: (H, W, 3) uint8 RGB.
        landscape: (H, W), >= 0: blended in as red, the redder the more relevant.
        path: (N, 2) of (u, v): a white line with a dark outline and a ring at its end. A NaN row interrupts
            the line; points far outside are fine.
        windows: where was scanned: :class:`Windows`, or centres (N, 2) of ``window_size`` pixels.
        hits: (K, 2) upper left corners (u, v) of windows that hit, as in ``Search.hits``: drawn in yellow.
        silhouette: (H, W) bool, what was found: outlined in green.
        obstacles: closed outlines (M, 2) of (u, v) of what stands in the way: drawn in magenta.
        label: a short caption in the upper left corner.
        scale: enlargement.

    Returns:
        (scale * H, scale * W, 3) uint8 RGB.

    Raises:
        ArgumentError: an argument has the wrong shape, or a window does not fit into the image.
        ArgumentTypeError: ``image`` is not uint8.
    """
    image = check_image(image)
    if scale < 1:
        raise ArgumentError(f"scale: at least 1 expected, got {scale}")
    height, width = image.shape[:2]
    size = (scale * width, scale * height)
    canvas = _resized(_muted(image), size, cv2.INTER_CUBIC)
    if landscape is not None:
        _same_shape("landscape", landscape, (height, width))
        canvas = _blend(canvas, landscape, size)
    if windows is not None:
        wanted = windows if isinstance(windows, Windows) else Windows(_centres(windows), window_size)
        _draw_windows(canvas, wanted.corners((height, width)), wanted.size, BLUE, scale, 0.95)
        window_size = wanted.size
    if hits is not None:
        corners = _points("hits", hits).astype(np.intp)
        _draw_windows(canvas, corners, window_size, YELLOW, scale, 1.0)
    if silhouette is not None:
        _same_shape("silhouette", silhouette, (height, width))
        _draw_silhouette(canvas, silhouette, scale)
    for outline in obstacles:
        _draw_outline(canvas, _points("obstacles", outline), scale)
    if path is not None:
        _draw_path(canvas, _points("path", path), scale)
    if label:
        write(canvas, label, (8, 8), size=0.55, boxed=True)
    return canvas


def stereo_panel(cycle: Cycle, *, scale: int | None = None, captions: bool = True) -> Picture:
    """What every eye saw in one vision cycle and where attention was, side by side.

    Args:
        cycle: of a task.
        scale: enlargement of each image; None for 2, or 1 for images wider than 480 pixels.
        captions: say in each picture which camera, phase and time it is.

    Returns:
        (scale * H, scale * sum of W plus gaps, 3) uint8 RGB; the cameras in their own order.
    """
    return side_by_side(
        [
            draw_attention(
                image,
                landscape=cycle.looks[camera].landscape if camera in cycle.looks else None,
                path=cycle.path_pixels.get(camera),
                windows=_windows_of(cycle, camera),
                window_size=_window_size(cycle, camera),
                hits=cycle.sight.searches[camera].hits if camera in cycle.sight.searches else None,
                silhouette=_found(cycle, camera),
                obstacles=cycle.outlines.get(camera, ()),
                label=f"{camera} eye   {cycle.phase}   {cycle.time:.1f} s" if captions else None,
                scale=scale or (2 if image.shape[1] <= 480 else 1),
            )
            for camera, image in cycle.images.items()
        ]
    )


def story(cycle: Cycle) -> str:
    """A line for strangers about what happens in a cycle."""
    if cycle.phase == "reach" and len(cycle.legs) in LEGS:
        return LEGS[len(cycle.legs)]
    return PHASES.get(cycle.phase, cycle.phase)


def side_by_side(pictures: Sequence[Picture], *, gap: int = 8, background: Colour = INK) -> Picture:
    """Pictures in one row, their tops aligned.

    Raises:
        ArgumentError: there is none.
    """
    if not pictures:
        raise ArgumentError("pictures: at least one expected, got none")
    height = max(picture.shape[0] for picture in pictures)
    width = sum(picture.shape[1] for picture in pictures) + gap * (len(pictures) - 1)
    row = blank(height, width, background)
    u = 0
    for picture in pictures:
        row[: picture.shape[0], u : u + picture.shape[1]] = picture
        u += picture.shape[1] + gap
    return row


def legend_strip(width: int, *, background: Colour = INK, ink: Colour = PAPER) -> Picture:
    """The colours and their meanings in lines at most ``width`` pixels wide: (H, width, 3) uint8 RGB."""
    size, swatch, line = 0.5, 16, 26
    places: list[tuple[int, int]] = []
    u, v = 8, 0
    for _, meaning in LEGEND:
        needed = swatch + 8 + text_width(meaning, size) + 20
        if u > 8 and u + needed > width:
            u, v = 8, v + line
        places.append((u, v))
        u += needed
    strip = blank(v + line + 4, width, background)
    for (colour, meaning), (left, top) in zip(LEGEND, places, strict=True):
        corner = (left, top + 7)
        cv2.rectangle(strip, corner, (left + swatch, top + 7 + swatch), colour, -1)
        cv2.rectangle(strip, corner, (left + swatch, top + 7 + swatch), (128, 128, 128), 1)
        write(strip, meaning, (left + swatch + 8, top + 9), size=size, colour=ink)
    return strip


def blank(height: int, width: int, colour: Colour = PAPER) -> Picture:
    """An even picture (height, width, 3)."""
    return np.full((height, width, 3), colour, dtype=np.uint8)


def text_width(text: str, size: float, weight: int = 1) -> int:
    """Width [px] of a line of text as :func:`write` draws it."""
    return int(cv2.getTextSize(text, FACE, size, weight)[0][0])


def write(
    canvas: Picture,
    text: str,
    corner: tuple[int, int],
    *,
    size: float = 0.6,
    colour: Colour = WHITE,
    weight: int = 1,
    boxed: bool = False,
) -> None:
    """Write one line into ``canvas`` with its upper left corner at ``corner`` (u, v).

    Args:
        canvas: changed in place.
        text: characters outside ASCII become question marks, the font has no others.
        corner: (u, v).
        size: about 22 px high at 1.
        colour: of the letters.
        weight: of the strokes [px].
        boxed: darken what is behind.
    """
    text = text.encode("ascii", "replace").decode()
    (width, height), base = cv2.getTextSize(text, FACE, size, weight)
    u, v = corner
    if boxed:
        part = canvas[max(v - 4, 0) : v + height + base + 2, max(u - 6, 0) : u + width + 6]
        part[:] = part // 4
    cv2.putText(canvas, text, (u, v + height), FACE, size, colour, weight, cv2.LINE_AA)


def _windows_of(cycle: Cycle, camera: str) -> Windows | None:
    where = cycle.sight.where.get(camera)
    return where if isinstance(where, Windows) else None


def _window_size(cycle: Cycle, camera: str) -> int:
    windows = _windows_of(cycle, camera)
    return 20 if windows is None else windows.size


def _found(cycle: Cycle, camera: str) -> NDArray[np.bool_] | None:
    search = cycle.sight.searches.get(camera)
    if search is None or not search.silhouettes:
        return None
    height, width = cycle.images[camera].shape[:2]
    full = np.zeros((height, width), dtype=np.bool_)
    for silhouette in search.silhouettes:
        full |= silhouette.paint((height, width))
    return full


def _same_shape(name: str, array: npt.ArrayLike, shape: tuple[int, int]) -> None:
    if np.shape(array) != shape:
        raise ArgumentError(f"{name}: shape {shape} of the image expected, got {np.shape(array)}")


def _points(name: str, points: npt.ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ArgumentError(f"{name}: shape (N, 2) of (u, v) expected, got {array.shape}")
    return array


def _centres(windows: npt.ArrayLike) -> NDArray[np.int32]:
    return np.rint(_points("windows", windows)).astype(np.int32)


def _resized(picture: Picture, size: tuple[int, int], how: int) -> Picture:
    resized: Picture = cv2.resize(picture, size, interpolation=how)  # type: ignore[assignment]
    return resized


def _muted(image: Picture) -> Picture:
    """A third less colourful, so that what is drawn stands out."""
    grey = image.mean(axis=2, keepdims=True)
    muted: Picture = (0.68 * image + 0.32 * grey).astype(np.uint8)
    return muted


def _blend(canvas: Picture, landscape: NDArray[np.float32], size: tuple[int, int]) -> Picture:
    level = np.nan_to_num(np.asarray(landscape, dtype=np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    top = float(level.max())
    if top <= 0.0:
        return canvas
    share = cv2.resize(np.clip(level / top, 0.0, 1.0), size, interpolation=cv2.INTER_LINEAR)
    # Low relevance must still be visible: where the landscape ends is half of what it says. One that fills
    # the picture is drawn paler, so that things keep their own colours.
    strength = 1.0 - 0.5 * float(np.mean(share > 0.0))
    alpha = np.where(share > 0.0, strength * (0.1 + 0.46 * share**0.7), 0.0)[..., None]
    blended: Picture = ((1.0 - alpha) * canvas + alpha * np.array(RED)).astype(np.uint8)
    return blended


def _draw_windows(
    canvas: Picture, corners: NDArray[np.intp], size: int, colour: Colour, scale: int, opacity: float
) -> None:
    over = canvas.copy()
    for u, v in corners:
        first = (int(u) * scale, int(v) * scale)
        last = ((int(u) + size) * scale - 1, (int(v) + size) * scale - 1)
        cv2.rectangle(over, first, last, colour, 1)
    cv2.addWeighted(over, opacity, canvas, 1.0 - opacity, 0.0, dst=canvas)


def _draw_silhouette(canvas: Picture, silhouette: NDArray[np.bool_], scale: int) -> None:
    size = (canvas.shape[1], canvas.shape[0])
    large = _resized(silhouette.astype(np.uint8), size, cv2.INTER_NEAREST)
    outlines, _ = cv2.findContours(large, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(canvas, outlines, -1, INK, scale + 2, cv2.LINE_AA)
    cv2.drawContours(canvas, outlines, -1, GREEN, scale, cv2.LINE_AA)


def _draw_outline(canvas: Picture, outline: NDArray[np.float64], scale: int) -> None:
    closed = np.concatenate([outline, outline[:1]])
    _draw_lines(canvas, (closed + 0.5) * scale - 0.5, ((INK, scale + 2), (MAGENTA, scale)))


def _draw_lines(canvas: Picture, drawn: NDArray[np.float64], strokes: Sequence[tuple[Colour, int]]) -> None:
    """A line (N, 2) in the canvas's pixels, one stroke over the other; NaN interrupts it."""
    low = np.full(2, -_MARGIN)
    high = np.array([canvas.shape[1], canvas.shape[0]]) + _MARGIN
    pieces = [_clipped(a, b, low, high) for a, b in pairwise(drawn)]
    for colour, weight in strokes:
        for piece in pieces:
            if piece is not None:
                first, last = (_fixed(end) for end in piece)
                cv2.line(canvas, first, last, colour, weight, cv2.LINE_AA, _SHIFT)


def _draw_path(canvas: Picture, path: NDArray[np.float64], scale: int) -> None:
    drawn = (path + 0.5) * scale - 0.5
    _draw_lines(canvas, drawn, ((INK, 3 * scale), (WHITE, scale + 1)))
    low = np.full(2, -_MARGIN)
    high = np.array([canvas.shape[1], canvas.shape[0]]) + _MARGIN
    seen = drawn[np.isfinite(drawn).all(axis=1)]
    if len(seen) and (seen[-1] > low).all() and (seen[-1] < high).all():
        radius = (3 * scale) << _SHIFT
        for colour, weight in ((INK, 2 * scale + 1), (WHITE, scale)):
            cv2.circle(canvas, _fixed(seen[-1]), radius, colour, weight, cv2.LINE_AA, _SHIFT)


def _fixed(point: NDArray[np.float64]) -> tuple[int, int]:
    u, v = np.rint(point * 2**_SHIFT).astype(int)
    return int(u), int(v)


def _clipped(
    a: NDArray[np.float64], b: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The part of a line within a box (Liang-Barsky); None where there is none, or with NaN."""
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return None
    along = b - a
    enter, leave = 0.0, 1.0
    for k in range(2):
        if along[k] == 0.0:
            if not low[k] <= a[k] <= high[k]:
                return None
            continue
        first, last = sorted(((low[k] - a[k]) / along[k], (high[k] - a[k]) / along[k]))
        enter, leave = max(enter, float(first)), min(leave, float(last))
    return None if enter > leave else (a + enter * along, a + leave * along)
