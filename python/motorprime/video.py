"""The video of a run: the robot's eyes above, a bystander's view and the figures below."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import cv2
import numpy as np

from .errors import ArgumentError, StateError
from .silence import silenced
from .viz import (
    BLUE,
    INK,
    MAGENTA,
    PAPER,
    Colour,
    Picture,
    blank,
    legend_strip,
    side_by_side,
    stereo_panel,
    story,
    text_width,
    write,
)

if TYPE_CHECKING:
    from .tasks.cycle import Cycle

RATE = 10  # frames, and vision cycles, per second
HOLD = 1.0  # how long the last frame stays [s]
WIDEST = 1288  # frame [px]: two eyes of 640 and a gap
GREY: Colour = (150, 156, 168)
DIM: Colour = (58, 64, 76)
GOOD: Colour = (60, 214, 110)


class NoVideo:
    """Takes frames and does nothing with them."""

    def __enter__(self) -> NoVideo:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file."""
        self.close()

    def add(self, frame: Picture) -> None:
        """Drop a frame."""

    def close(self) -> None:
        """Nothing to close."""


class VideoWriter(NoVideo):
    """Writes WebM (VP8), which every browser plays; a context manager.

    The first frame sets the size.

    Args:
        path: of the file, ending in .webm.
        rate: frames per second.
        hold: how long the last frame stays [s].

    Raises:
        ArgumentError: the name does not end in .webm.
    """

    def __init__(self, path: Path, *, rate: int = RATE, hold: float = HOLD) -> None:
        """See the class."""
        if path.suffix != ".webm":
            raise ArgumentError(f"path: a name ending in .webm expected, got {path.name}")
        self.path, self.rate, self.hold = path, rate, hold
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)
        self._last: Picture | None = None

    def add(self, frame: Picture) -> None:
        """Append a frame (H, W, 3) uint8 RGB.

        Raises:
            ArgumentError: it is not as large as the first.
            StateError: the file cannot be written.
        """
        size = (frame.shape[1], frame.shape[0])
        if self._writer is None:
            self._writer, self._size = self._open(size), size
        if size != self._size:
            raise ArgumentError(
                f"frame: {self._size[0]} x {self._size[1]} expected, got {size[0]} x {size[1]}"
            )
        self._last = cv2.cvtColor(frame, cv2.COLOR_RGB2BGR)  # type: ignore[assignment]
        self._writer.write(self._last)  # type: ignore[arg-type]

    def close(self) -> None:
        """Hold the last frame and finish the file; again is harmless."""
        if self._writer is None:
            return
        for _ in range(round(self.hold * self.rate)):
            self._writer.write(self._last)  # type: ignore[arg-type]
        self._writer.release()
        self._writer = None

    def _open(self, size: tuple[int, int]) -> cv2.VideoWriter:
        with silenced(2):  # past every log level it prints that WebM has no tag for VP8, which needs none
            code = cv2.VideoWriter_fourcc(*"VP80")  # type: ignore[attr-defined]
            writer = cv2.VideoWriter(str(self.path), code, self.rate, size)
        if not writer.isOpened():
            raise StateError(
                f"video: cannot write {self.path} as WebM (VP8) with this OpenCV; try without a video"
            )
        return writer


def video_frame(cycle: Cycle, bystander: Picture | None = None, *, panel: Picture | None = None) -> Picture:
    """One frame: the eyes above; the bystander's view, what happens and what it cost below.

    Args:
        cycle: of a task.
        bystander: a view of the robot (H, W, 3) uint8, or none.
        panel: ``stereo_panel(cycle)`` if it is at hand.

    Returns:
        (H, W, 3) uint8 RGB, both even.
    """
    eyes = stereo_panel(cycle) if panel is None else panel
    if eyes.shape[1] > WIDEST:
        height = round(eyes.shape[0] * WIDEST / eyes.shape[1])
        eyes = cv2.resize(eyes, (WIDEST, height), interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
    width = eyes.shape[1]
    if bystander is None:
        low = figures(cycle, width)
    else:
        left = (width - 8) // 2
        height = round(bystander.shape[0] * left / bystander.shape[1])
        view: Picture = cv2.resize(bystander, (left, height), interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
        low = side_by_side([view, figures(cycle, width - 8 - left, height)])
    frame = blank(eyes.shape[0] + 8 + low.shape[0], width, INK)
    frame[: eyes.shape[0]] = eyes
    frame[eyes.shape[0] + 8 :] = low
    return frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2]


def figures(cycle: Cycle, width: int, height: int = 420) -> Picture:
    """A board (height, width, 3) that says what happens in a cycle and what looking cost."""
    board = blank(height, width, INK)
    small, left = width < 500, 24
    size = 0.5 if small else 0.68
    write(board, story(cycle), (left, 22), size=size, colour=PAPER)
    found = cycle.sight.located is not None
    seen = "target located in this cycle" if found else "target not seen in this cycle"
    write(board, f"{cycle.time:.1f} s", (left, 58), size=0.6, colour=GREY)
    if cycle.event:
        write(board, cycle.event, (left + 90, 58), size=0.6, colour=MAGENTA)
    else:
        write(board, seen, (left + 90, 58), size=0.6, colour=GOOD if found else GREY)
    attended = cycle.sight.attended
    write(board, f"Looked at {attended:.0%} of the pixels", (left, 106), size=0.62, colour=PAPER)
    _bar(board, 134, attended, BLUE)
    spent = 1e3 * sum(cycle.seconds.values())
    full = None if cycle.full is None else 1e3 * cycle.full.seconds
    longest = max(spent, full or 0.0, 1e-9)
    write(board, f"Vision cycle with attention: {spent:.1f} ms", (left, 182), size=0.62, colour=PAPER)
    _bar(board, 210, spent / longest, BLUE)
    if full is not None:
        write(board, f"Scan of the full images: {full:.0f} ms", (left, 252), size=0.62, colour=PAPER)
        _bar(board, 280, 1.0, GREY)
    if cycle.goal is not None:
        away = 100.0 * float(np.linalg.norm(cycle.palm - cycle.goal))
        write(board, f"Palm {away:.1f} cm from the grasp", (left, 322), size=0.62, colour=PAPER)
    if cycle.opening is not None:
        hand = "Hand squeezes" if cycle.opening < 0.0 else f"Hand {cycle.opening:.0%} open"
        write(board, hand, (width - left - text_width(hand, 0.62), 322), size=0.62, colour=PAPER)
    strip = legend_strip(width - left)
    top = min(366, height - strip.shape[0] - 10)
    room = board[top : top + strip.shape[0], left - 8 : left - 8 + strip.shape[1]]
    room[:] = strip[: room.shape[0], : room.shape[1]]
    return board


def _bar(board: Picture, top: int, share: float, colour: Colour) -> None:
    left, right = 24, board.shape[1] - 24
    cv2.rectangle(board, (left, top), (right, top + 16), DIM, -1)
    reach = left + round((right - left) * min(max(share, 0.0), 1.0))
    cv2.rectangle(board, (left, top), (max(reach, left + 1), top + 16), colour, -1)
