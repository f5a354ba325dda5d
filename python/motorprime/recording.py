"""The run folder: what a run leaves behind, also when it is cut short.

result.json   figures of the run, for programs
report.html   the same for people, in one file that needs nothing else
video.webm    eyes and bystander in real time, unless it is off
picture.jpg   one frame of it
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from . import __version__
from .album import Album
from .errors import ArgumentError, Error, StateError
from .report import check_plots, movement_shots, plot_shots, write_report
from .summary import History, summarise
from .video import NoVideo, VideoWriter, video_frame
from .viz import Picture, stereo_panel

if TYPE_CHECKING:
    from .tasks.cycle import Cycle


def fresh_folder(base: Path, name: str) -> Path:
    """Create and return ``base/name``, or ``base/name-2``, ``base/name-3``, ... where that exists already.

    Raises:
        ArgumentError: ``name`` is no plain folder name, or the folder cannot be created.
    """
    if not name or name in (".", "..") or Path(name).name != name:
        raise ArgumentError(f"name: a plain folder name expected, got {name!r}")
    number = 1
    while True:
        folder = base / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
            return folder
        except FileExistsError as error:
            if not folder.exists():  # the name of an existing file lies on the way
                raise _cannot_create(folder, error) from None
            number += 1
        except OSError as error:
            raise _cannot_create(folder, error) from None


class Recording:
    """Collects a run's cycles and writes its folder; a context manager.

    When the block is left before :meth:`finish`, the folder is written all the same, with the outcome
    'interrupted' (Ctrl-C) or 'failed' (any other exception).

    Args:
        folder: is created where it is missing, see also :func:`fresh_folder`.
        title: headline of the report.
        meta: what was run, such as the seed; plain values by name.
        video: write a video.
        bystander: gives a view (H, W, 3) uint8 RGB of the robot; asked once a cycle, for the video only.
        certificates: of the dynamical systems that plan, by name: continuous [1/s], discrete, step [s].

    Raises:
        ArgumentError: the folder holds a run already or cannot be written.
        MissingExtraError: matplotlib is missing.
    """

    def __init__(
        self,
        folder: Path,
        *,
        title: str,
        meta: Mapping[str, Any],
        video: bool = True,
        bystander: Callable[[], Picture] | None = None,
        certificates: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        """See the class."""
        check_plots()
        self.folder, self.title, self.meta = folder, title, dict(meta)
        self.history: History = []
        self.certificates = dict(certificates or {})
        self._album = Album()
        self._bystander = bystander if video else None
        self._finished = False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if (folder / "result.json").exists():
                raise ArgumentError(f"folder: {folder} holds a run already; choose another one")
            self._write_result("running", "", {})
        except OSError as error:
            raise _cannot_create(folder, error) from None
        self.video = VideoWriter(folder / "video.webm") if video else NoVideo()

    @property
    def report(self) -> Path:
        """Where the report is written."""
        return self.folder / "report.html"

    def __enter__(self) -> Recording:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the folder if that was not done yet."""
        if self._finished:
            return
        if kind is None or error is None or issubclass(kind, (KeyboardInterrupt, GeneratorExit)):
            self.finish("interrupted", "the run was stopped before its end")
            return
        # What went wrong first must reach the user, not that its report could not be written either.
        with contextlib.suppress(Error, OSError):
            self.finish("failed", f"{kind.__name__}: {error}")

    def add(self, cycle: Cycle, *, truth: NDArray[np.float64] | None = None) -> None:
        """Take one vision cycle.

        Args:
            cycle: of a task.
            truth: the target's true position (3,) [m] at this moment, where it is known.
        """
        self.history.append(_record(cycle, truth))
        panel = stereo_panel(cycle)
        frame = view = None
        if isinstance(self.video, VideoWriter):
            view = self._bystander() if self._bystander else None
            frame = video_frame(cycle, view, panel=panel)
            self.video.add(frame)
        self._album.keep(cycle, panel, frame, view)

    def finish(self, outcome: str, reason: str = "", judged: Mapping[str, Any] | None = None) -> None:
        """Write the folder.

        Args:
            outcome: one or two words, such as 'reached'.
            reason: why, where that needs saying.
            judged: what an outside judge measured; plain values by name, units in the names.

        Raises:
            StateError: a file cannot be written.
        """
        self.video.close()
        try:
            data = self._write_result(outcome, reason, judged or {})
            film = self.folder / "video.webm"
            if self._album.poster is not None:
                (self.folder / "picture.jpg").write_bytes(self._album.poster)
            write_report(
                self.report,
                data,
                pictures=self._album.shots(),
                outside=self._album.outside(),
                plots=[*movement_shots(data), *plot_shots(data)],
                video=film if film.exists() and self.history else None,
                poster=self._album.poster,
            )
        except OSError as error:
            raise StateError(f"folder: cannot write into {self.folder}: {error.strerror}") from None
        self._finished = True

    def _write_result(self, outcome: str, reason: str, judged: Mapping[str, Any]) -> dict[str, Any]:
        data: dict[str, Any] = {
            "title": self.title,
            "outcome": outcome,
            "reason": reason,
            "meta": _plain(self.meta),
            "judged": _plain(judged),
            "certificates": _plain(self.certificates),
            **summarise(self.history),
            "versions": {
                "motorprime": __version__,
                "numpy": np.__version__,
                "opencv": cv2.__version__,
                "python": platform.python_version(),
            },
            "history": self.history,
        }
        replace_text(self.folder / "result.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
        return data


def replace_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, path)  # noqa: PTH105
    finally:
        partial.unlink(missing_ok=True)


def _cannot_create(folder: Path, error: OSError) -> ArgumentError:
    return ArgumentError(f"folder: cannot write into {folder}: {error.strerror}")


def _record(cycle: Cycle, truth: NDArray[np.float64] | None) -> dict[str, Any]:
    """A cycle without its pictures, in plain values."""
    sight, full = cycle.sight, cycle.full
    record: dict[str, Any] = {
        "phase": cycle.phase,
        "time": cycle.time,
        "seconds": cycle.seconds,
        "attended": sight.attended,
        "covered": [look.covered for look in cycle.looks.values()],
        "located": sight.located is not None,
        "place": None if sight.located is None else sight.located.centre,
        "estimate": cycle.estimate,
        "palm": cycle.palm,
        "goal": cycle.goal,
        "truth": truth,
        "obstacles": [
            {"centre": centre, "radius": shape.radius, "height": shape.height}
            for centre, shape in cycle.obstacles
        ],
        "legs": cycle.legs,
        "opening": cycle.opening,
        "event": cycle.event,
        "full_frame": None
        if full is None
        else {
            "seconds": full.seconds,
            "back_projection": full.back_projection,
            "located": full.located is not None,
        },
    }
    plain: dict[str, Any] = _plain(record)
    return plain


def _plain(value: Any) -> Any:
    """What JSON can say: arrays become lists, NaN and infinities null, everything strange its text."""
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
