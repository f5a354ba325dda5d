"""``motorprime babble``: fill a folder with samples, show how far it is, and say what they are worth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from .errors import ArgumentError
from .evaluate.common import check_writable, table
from .learning.babbling import ArmBabble, Source, babble
from .learning.store import Store

if TYPE_CHECKING:
    from .tasks.babble import View

KINDS = ("gaze", "arm", "marker")
SHOWN = 12  # samples of the picture
_RED, _BLUE, _GREY = (210, 30, 30), (30, 60, 220), (110, 110, 110)


@dataclass(frozen=True)
class BabbleOptions:
    """What ``motorprime babble`` was asked for; see its ``--help``."""

    folder: Path
    samples: int
    what: str
    mode: str
    seed: int
    workers: int
    scheduler: str | None
    noise: float
    picture: Path | None


def run_babble(options: BabbleOptions, console: Console) -> dict[str, Any]:
    """Fill the folder, print the closing table and return its figures.

    Raises:
        ArgumentError: an option that makes no sense, or a folder of other samples.
        StateError: the disk is full, a part is damaged, workers or the scheduler are gone.
        MissingExtraError: an extra is not installed.
    """
    if options.what not in KINDS:
        raise ArgumentError(f"what: one of {', '.join(KINDS)} expected, got '{options.what}'")
    if options.picture is not None:
        _check_picture(options)
    source = _source(options)
    store = Store.create(options.folder, source.manifest(options.seed))
    try:
        result = _fill(store, source, options, console)
        if options.picture is not None and result["outcome"] == "complete":
            _write_picture(options.picture, contact_sheet(store, source))
            console.print(f"Picture: {options.picture}", markup=False, highlight=False, soft_wrap=True)
    finally:
        _close(options.what)
    return result


def _source(options: BabbleOptions) -> Source:
    from .sim.icub import load_icub

    robot = load_icub()
    if options.what == "arm":
        return ArmBabble(robot)
    from .tasks.babble import GazeBabble, MarkerBabble

    if options.what == "marker":
        return MarkerBabble(robot, robot, mode=options.mode, noise=options.noise)
    return GazeBabble(robot, mode=options.mode, noise=options.noise)


def _close(what: str) -> None:
    if what != "arm":
        from .tasks.studio import close_studio

        close_studio()


def _fill(store: Store, source: Source, options: BabbleOptions, console: Console) -> dict[str, Any]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    outcome, start = "complete", time.perf_counter()
    with Progress(*columns, console=console, transient=True) as bars:
        rate = _Rate(bars, bars.add_task("babbling", total=options.samples, rate=""))
        try:
            babble(
                store,
                source,
                options.samples,
                workers=options.workers,
                scheduler=options.scheduler,
                progress=rate,
            )
        except KeyboardInterrupt:
            outcome = "interrupted"
    seconds = time.perf_counter() - start
    result = {"outcome": outcome, "computed": rate.computed, "seconds": seconds}
    result["samples_per_second"] = rate.computed / seconds if rate.computed else None
    held = len(store)
    if outcome == "interrupted":
        console.print(
            f"Interrupted: {held} of {options.samples} samples are kept; the same command goes on there.",
            style="yellow",
            highlight=False,
        )
        return result | {"samples": held}
    figures = figures_of(store)
    shown = {name: value for name, value in (result | figures).items() if name != "outcome"}
    console.print(table(f"babble {options.what} in {options.folder}", shown))
    return result | figures


class _Rate:
    """Moves the bar and says how many samples a second are computed."""

    def __init__(self, bars: Progress, task: TaskID, clock: Callable[[], float] = time.perf_counter) -> None:
        self._bars, self._task, self._clock = bars, task, clock
        self._first: tuple[int, float] | None = None
        self.computed = 0

    def __call__(self, done: int) -> None:
        now = self._clock()
        if self._first is None:
            self._first = done, now
        self.computed = done - self._first[0]
        seconds = now - self._first[1]
        rate = f"{self.computed / seconds:.0f} samples/s" if self.computed and seconds > 0.0 else ""
        self._bars.update(self._task, completed=done, rate=rate)


def figures_of(store: Store) -> dict[str, Any]:
    """How many samples there are, what each camera saw, and how far labels are off the geometry [px].

    The difference is between the centroid that was segmented and the kinematics' centre of the outline, over
    all cameras; None where nothing was seen.
    """
    cameras = store.manifest.cameras
    figures: dict[str, Any] = {"samples": len(store)}
    if not cameras:
        return figures
    found = store.read(columns=[f"{c}_{part}" for c in cameras for part in _PARTS])
    seen = {c: ~np.isnan(found[f"{c}_u"]) for c in cameras}
    figures["seen_by_any"] = int(np.any(list(seen.values()), axis=0).sum())
    figures["seen_by_all"] = int(np.all(list(seen.values()), axis=0).sum())
    offsets, pictures = [], 0
    for camera in cameras:
        outcomes = found[f"{camera}_outcome"].astype(str)
        pictures += int((outcomes != "outside").sum())
        figures[camera] = {name: int((outcomes == name).sum()) for name in _OUTCOMES}
        du, dv = (found[f"{camera}_{axis}"] - found[f"{camera}_predicted_{axis}"] for axis in "uv")
        offsets.append(np.hypot(du, dv)[seen[camera]])
    off = np.concatenate(offsets)
    figures["pictures_taken"] = pictures
    figures["label_to_geometry_median_px"] = float(np.nanmedian(off)) if off.size else None
    figures["label_to_geometry_p95_px"] = float(np.nanpercentile(off, 95)) if off.size else None
    return figures


_PARTS = ("outcome", "u", "v", "predicted_u", "predicted_v")
_OUTCOMES = ("seen", "cut", "covered", "absent", "outside")


def contact_sheet(store: Store, source: Any) -> NDArray[np.uint8]:
    """A dozen samples, spread over those that a camera took a picture of, taken once more: (H, W, 3) RGB.

    A red cross is the label, a blue circle where the kinematics put the ball.
    """
    taken = " OR ".join(f"{camera}_outcome <> 'outside'" for camera in store.manifest.cameras)
    index = store.read(taken, ["i"])["i"]
    if not len(index):
        raise ArgumentError("picture: no camera took a picture in any of the samples")
    chosen = index[np.linspace(0, len(index) - 1, min(SHOWN, len(index))).round().astype(int)]
    tiles = []
    for i in chosen:
        _, views = source.look(store.manifest.seed, int(i))
        shapes = {name: mount.camera.shape for name, mount in source.robot.cameras.items()}
        tiles.append(np.hstack([_tile(f"{i} {name}", view, shapes[name]) for name, view in views.items()]))
    while len(tiles) % 3:
        tiles.append(np.full_like(tiles[0], 255))
    return np.vstack([np.hstack(tiles[k : k + 3]) for k in range(0, len(tiles), 3)])


def _tile(title: str, view: View, shape: tuple[int, int]) -> NDArray[np.uint8]:
    tile = np.full((*shape, 3), 190, np.uint8) if view.picture is None else view.picture.copy()
    cv2.putText(tile, f"{title}: {view.sighting.outcome}", (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _GREY, 1)
    if np.isfinite(view.predicted).all() and np.abs(view.predicted).max() < 1e4:
        cv2.circle(tile, _place(view.predicted), 14, _BLUE, 1)
    if view.sighting.outcome == "seen":
        cv2.drawMarker(tile, _place(view.sighting.centre), _RED, cv2.MARKER_CROSS, 9)
    tile[:, -1] = tile[-1] = 120
    return tile


def _place(pixel: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(pixel[0])), round(float(pixel[1]))


def _check_picture(options: BabbleOptions) -> None:
    if options.what == "arm":
        raise ArgumentError("picture: the arm's samples have no pictures")
    path = options.picture
    assert path is not None
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ArgumentError(f"picture: a .png or .jpg file expected, got {path.name}")
    check_writable(path, "picture")


def _write_picture(path: Path, picture: NDArray[np.uint8]) -> None:
    _, data = cv2.imencode(path.suffix.lower(), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    try:
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise ArgumentError(f"picture: cannot write {path}: {error.strerror}") from None
