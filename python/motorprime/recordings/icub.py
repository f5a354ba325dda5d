"""Recordings of an iCub's head, right arm and eyes, as samples of where its thumb appears."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, fixed
from ..errors import ArgumentError
from ..robot import ICUB
from ..samples import Samples
from .synchronise import estimate_lag, find_holds, merge
from .thumb import thumb_tips
from .yarp import Frames, check_recording, read_encoders, read_images

Labels = Callable[[Frames], Floats]
"""Finds the point of the hand in the images of a camera: (N, 2) pixels, NaN rows where it is not seen."""


@dataclass(frozen=True)
class Layout:
    """Which stream is what.

    Args:
        names: the joints of the samples.
        encoders: {stream: joint of each of its columns, in degrees}; columns of joints that are not in
            ``names`` are read and left out.
        images: {camera: stream}.
    """

    names: tuple[str, ...]
    encoders: Mapping[str, tuple[str, ...]]
    images: Mapping[str, str]


_FINGERS = ("spread", "thumb_oppose", "thumb_proximal", "thumb_distal", "index_proximal", "index_distal")
ICUB_RIGHT_ARM = Layout(
    names=(*ICUB.gaze, *ICUB.arm),
    encoders={
        "head": ICUB.gaze[3:],
        "rightArm": (*ICUB.arm, *_FINGERS, "middle_proximal", "middle_distal", "ring_and_little"),
    },
    images={"left": "images/left", "right": "images/right"},
)
"""Head and right arm as their motors are ordered, eyes' version and vergence as the encoders say them."""


@dataclass(frozen=True, eq=False)
class RobotRecording:
    """What a recording holds.

    Attributes:
        samples: of the postures that some camera saw: joints [rad], the hand's point in each camera.
        times: (N,) when each posture was taken [s], since the recording began.
        duration: of the recording [s].
        postures: that were held.
        outliers: postures that were held too briefly to be believed.
        lag: of the images behind the encoders [s].
        paired: {camera: images that show a held posture}, the others came too near to a change.
        images: {camera: an image file of each sample, None where there is none}.
        absent: joints that were not recorded; their columns are zero.
        skipped: {stream: lines that were left out}.
    """

    samples: Samples
    times: Floats
    duration: float
    postures: int
    outliers: int
    lag: float
    paired: Mapping[str, int]
    images: Mapping[str, tuple[Path | None, ...]] = field(repr=False)
    absent: tuple[str, ...] = ()
    skipped: Mapping[str, int] = field(default_factory=dict)


def read_recording(
    folder: str | Path,
    layout: Layout = ICUB_RIGHT_ARM,
    *,
    labels: Labels = thumb_tips,
    lag: float | None = None,
    guard: float = 0.01,
    min_hold: float = 0.04,
    still: float = 0.05,
    gap: float = 0.25,
) -> RobotRecording:
    """Read a folder of yarpdatadumper into samples: one for each posture that was held.

    Args:
        folder: of the recording.
        layout: which stream is what; as default the iCub's head, right arm and eyes.
        labels: finds the point of the hand in images.
        lag: of the images behind the encoders [s]; None estimates it from the images themselves.
        guard: an image within so many seconds of a change shows no posture for sure.
        min_hold: postures that were held shorter [s] are outliers.
        still: encoders that change no more than this [deg] stand still.
        gap: encoders that say nothing for longer than this [s] are not believed to stand still.

    Raises:
        ArgumentError: what is wrong with the recording, with file and line; no posture was held or seen.
    """
    for name, value in {"guard": guard, "min_hold": min_hold, "still": still, "gap": gap}.items():
        if not float(fixed(name, value, ())) >= 0.0:
            raise ArgumentError(f"{name}: expected >= 0, got {value}")
    folder = check_recording(folder, (*layout.encoders, *layout.images.values()))
    encoders = {name: read_encoders(folder / name, len(c)) for name, c in layout.encoders.items()}
    images = {camera: read_images(folder / name) for camera, name in layout.images.items()}
    found = find_holds([(e.times, e.values) for e in encoders.values()], still=still, gap=gap)
    holds = found.longer_than(min_hold)
    if not len(holds):
        raise ArgumentError(f"recording: none of {len(found)} postures in {folder} was held {min_hold} s")
    pixels = {camera: labels(stream) for camera, stream in images.items()}
    stamps = {camera: stream.times for camera, stream in images.items()}
    lag = estimate_lag(holds, stamps, pixels) if lag is None else float(fixed("lag", lag, ()))
    index = {camera: holds.at(times - lag, guard) for camera, times in stamps.items()}
    merged = {camera: merge(index[camera], pixels[camera], len(holds)) for camera in images}
    seen = np.any([~np.isnan(value[:, 0]) for value in merged.values()], axis=0)
    if not seen.any():
        raise ArgumentError(f"recording: no image of {folder} shows the hand in any of {len(holds)} postures")
    columns = [name for stream in layout.encoders.values() for name in stream]
    joints = np.zeros((len(holds), len(layout.names)))
    for k, name in enumerate(layout.names):
        if name in columns:
            joints[:, k] = np.deg2rad(holds.values[:, columns.index(name)])
    begin = min(float(e.times[0]) for e in encoders.values())
    shown = {
        camera: tuple(_first(images[camera].paths, index[camera], int(k)) for k in np.flatnonzero(seen))
        for camera in images
    }
    return RobotRecording(
        samples=Samples(layout.names, joints, merged).take(seen),
        times=holds.start[seen] - begin,
        duration=max(float(e.times[-1]) for e in encoders.values()) - begin,
        postures=len(holds),
        outliers=len(found) - len(holds),
        lag=lag,
        paired={camera: int((value >= 0).sum()) for camera, value in index.items()},
        images=shown,
        absent=tuple(name for name in layout.names if name not in columns),
        skipped={name: encoders[name].skipped for name in encoders}
        | {name: images[camera].skipped for camera, name in layout.images.items()},
    )


def _first(paths: tuple[Path, ...], index: NDArray[np.intp], k: int) -> Path | None:
    mine = np.flatnonzero(index == k)
    return paths[int(mine[0])] if len(mine) else None
