"""``motorprime evaluate recording``: a robot that was recorded, its thumb predicted from its joints alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..errors import ArgumentError
from ..hand_map import learn_hand_map
from ..projection import KinematicProjection, Priors
from ..recordings import RobotRecording, read_recording
from ..robot import Robot
from ..samples import Samples
from .common import Progress

SHARE = 0.7
"""Of the time that is trained on; the rest is predicted."""
TIP_ONLY = Priors(
    offsets=0.0, arm_offsets=0.0, links=0.0, turn=0.0, shift=0.0, focal=0.0, centre=0.0, radial=0.0,
    tangential=0.0, hand=0.1,
)  # fmt: skip
"""The robot as its model says; only where the thumb's tip is on the hand must be found."""
ADAPTED = Priors(arm_offsets=float(np.deg2rad(10.0)), hand=0.1)
"""An arm that was not calibrated may be off by ten degrees, and the tip is not in the palm's middle."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """One way of predicting, on both halves of the question.

    Attributes:
        late: {camera: (N, 2)} of all samples, learned from the first 70 % of the time.
        wide: the same, learned from the last 70 %.
    """

    late: Mapping[str, Floats]
    wide: Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class Measured:
    """The figures, and what a picture needs.

    Attributes:
        figures: as JSON has them.
        recording: what was read.
        before, after: predictions by the model as it is, and adapted.
        late, wide: (N,) which samples are predicted.
    """

    figures: dict[str, Any]
    recording: RobotRecording
    before: Prediction
    after: Prediction
    late: NDArray[np.bool_]
    wide: NDArray[np.bool_]


def evaluate_recording(
    robot: Robot, path: Path, *, seed: int = 0, progress: Progress | None = None
) -> Measured:
    """Predict the thumb's tip in both eyes of a recorded iCub, before and after adapting to it.

    Trained on the first 70 % of the time and tested on the last 30 %, and the other way round, where the
    motions of the test are the wide ones. ``before`` has the encoders as they are and the nominal robot, and
    fits the tip's place on the hand; ``after`` is calibrated; ``hand_map`` is a network on the joints
    that knows no robot.

    Args:
        robot: the nominal one, with its URDF.
        path: folder of the recording.
        seed: of the network.
        progress: shows how far it is.

    Raises:
        ArgumentError: the recording cannot be read, or is too short.
    """
    progress = progress or Progress()
    recording = read_recording(path)
    samples, share = recording.samples, recording.times / recording.duration
    late, wide = share >= SHARE, share < 1.0 - SHARE
    for name, test in {"first": wide, "last": late}.items():
        if not test.any():
            raise ArgumentError(
                f"recording: {path} has no posture in the {name} {1.0 - SHARE:.0%} of its time"
            )
    jobs = [(priors, test) for priors in (TIP_ONLY, ADAPTED) for test in (late, wide)]
    predicted = [
        _calibrated(robot, samples, priors, ~test) for priors, test in progress.over(jobs, "calibrating")
    ]
    before, after = Prediction(*predicted[:2]), Prediction(*predicted[2:])
    map_late, map_wide = (learn_hand_map(samples.take(~t), seed=seed) for t in (late, wide))
    networks = Prediction(map_late.hand_pixels(samples.joints), map_wide.hand_pixels(samples.joints))
    figures = {
        "seed": seed,
        "recording": {
            "postures": recording.postures,
            "seen": len(samples),
            "outliers": recording.outliers,
            "skipped": sum(recording.skipped.values()),
            "lag_s": recording.lag,
            "train": int((~late).sum()),
            "test": int(late.sum()),
            "wide_test": int(wide.sum()),
            **_figures("before", samples, before, late, wide),
            **_figures("after", samples, after, late, wide),
            **_figures("hand_map", samples, networks, late, wide),
            "hand_map_inside": float(map_late.inside(samples.joints[late]).mean()),
            "wide_hand_map_inside": float(map_wide.inside(samples.joints[wide]).mean()),
        },
    }
    return Measured(figures, recording, before, after, late, wide)


def errors(samples: Samples, predicted: Mapping[str, Floats], rows: NDArray[np.bool_]) -> dict[str, Floats]:
    """{camera: (N,) [px]} of the rows; NaN where the camera did not see the tip."""
    return {
        camera: np.linalg.norm(predicted[camera][rows] - samples.pixels[camera][rows], axis=1)
        for camera in samples.cameras
    }


def _calibrated(
    robot: Robot, samples: Samples, priors: Priors, train: NDArray[np.bool_]
) -> dict[str, Floats]:
    adapted = KinematicProjection(robot).adapt(samples.take(train), priors=priors)
    return {camera: pixels[:, 0] for camera, pixels in adapted.hand_pixels(samples.joints).items()}


def _figures(
    name: str, samples: Samples, predicted: Prediction, late: NDArray[np.bool_], wide: NDArray[np.bool_]
) -> dict[str, float]:
    """Median and 90th percentile over both cameras; those of ``after`` are plainly ``p90``."""
    result = {}
    for prefix, pixels, rows in (("", predicted.late, late), ("wide_", predicted.wide, wide)):
        off = np.concatenate(list(errors(samples, pixels, rows).values()))
        result[f"{prefix}{name}_px"] = float(np.nanmedian(off))
        p90 = f"{prefix}p90_px" if name == "after" else f"{prefix}{name}_p90_px"
        result[p90] = float(np.nanpercentile(off, 90))
    return result
