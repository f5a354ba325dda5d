"""``motorprime evaluate regions``: real detectors on 30 % of the pixels: what is saved, what is found."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..detectors import Detections, Detector, Everywhere, Keypoints, Tiles, Where
from ..detectors.cascade import Cascade
from ..detectors.keypoints import Structured
from ..detectors.merging import intersection_over_union
from ..detectors.opencv import Akaze, Brisk, Kaze, Orb, Sift
from ..errors import ArgumentError, MissingExtraError, StateError
from .common import Progress, one_thread
from .cover import evaluate_cover
from .drawn import faces, labelled, textured
from .text_model import text_detector

FRACTION = 0.3
SHAPE, TEXT_SHAPE = (720, 1280), (480, 640)
FACES = "haarcascade_frontalface_default.xml"
DETECTORS: Mapping[str, tuple[Callable[[], Detector], tuple[int, int]]] = {
    "sift": (Sift, SHAPE),
    "akaze": (Akaze, SHAPE),
    "kaze": (Kaze, SHAPE),
    "orb": (Orb, SHAPE),
    "brisk": (Brisk, SHAPE),
    # The same with what makes their pyramids sample a tile as they sample the image.
    "orb_2": (lambda: Orb(scaleFactor=2.0, nlevels=3), SHAPE),
    "brisk_48": (Brisk, (720, 1248)),
}
"""Who is measured, and the size of the images."""

Recovered = Callable[[Detections, Detections, NDArray[np.int32]], tuple[int, int]]


@dataclass
class Measured:
    """Of one detector, over all images."""

    full: list[float] = field(default_factory=list)
    attended: list[float] = field(default_factory=list)
    expected: int = 0
    recovered: int = 0
    read: list[float] = field(default_factory=list)

    def figures(self) -> dict[str, Any]:
        """Medians and shares; a share of nothing is None."""
        full, attended = float(np.median(self.full)), float(np.median(self.attended))
        return {
            "ratio": attended / full,
            "recovered": self.recovered / self.expected if self.expected else None,
            "expected": self.expected,
            "full_ms": full,
            "attended_ms": attended,
            "pixels_read": float(np.mean(self.read)),
        }


def evaluate_regions(
    *,
    images: int = 5,
    rounds: int = 3,
    seed: int = 0,
    text_model: Path | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run each detector on the whole of drawn images and on one compact tile of 30 % of the pixels.

    Both sides run on one thread, in turn, and return keypoints with descriptors, or boxes. Times are of the
    processor.

    Args:
        images: textures of 1280 x 720 for the keypoints; labels and faces, four times as many of 640 x 480.
        rounds: timed runs of each side on each image.
        seed: of images and tiles.
        text_model: the .onnx file of the text detector; None takes the one that was fetched at set-up.
        progress: shows how far it is.

    Returns:
        For each of :data:`DETECTORS`, ``text`` and ``cascade``: ratio (median time attended over that of the
        full frame), recovered (share of what the full run found inside the tile), expected (how many those
        are), full_ms, attended_ms, pixels_read (share, with halo). Keypoints are recovered within 0.1 px, 2 %
        in size and 2 degrees; boxes, that the full run scored 0.6 or more and that lie wholly inside, by an
        intersection over union of 0.7, faces of any score. A detector that is not installed has None and the
        reason. ``cover``: see :func:`evaluate_cover`.
    """
    images, rounds = integer("images", images, at_least=1), integer("rounds", rounds, at_least=1)
    progress = progress or Progress()
    result: dict[str, Any] = {"seed": seed, "images": images, "rounds": rounds, "fraction": FRACTION}
    with one_thread():
        for name, (make, shape) in DETECTORS.items():
            scenes = [(textured(rng, shape), rng) for rng in _generators(seed, images)]
            result[name] = _measure(name, make, scenes, same_keypoints, rounds, progress)
        scenes = [(labelled(rng, TEXT_SHAPE)[0], rng) for rng in _generators(seed, 4 * images)]
        result["text"] = _measure(
            "text", lambda: text_detector(text_model), scenes, same_boxes, rounds, progress
        )
        scenes = [(faces(rng, TEXT_SHAPE)[0], rng) for rng in _generators(seed, 4 * images)]
        result["cascade"] = _measure("cascade", lambda: Cascade(FACES), scenes, any_box, rounds, progress)
    result["cover"] = evaluate_cover(20 * images, seed)
    return result


def compact_tile(
    rng: np.random.Generator, shape: tuple[int, int], align: int, fraction: float = FRACTION
) -> NDArray[np.int32]:
    """A box (1, 4) anywhere in an image, at most half as high as wide or the reverse.

    It begins and ends at multiples of ``align`` and is hardly larger than ``fraction``, never smaller.

    Raises:
        ArgumentError: there is no such box in the image.
    """
    area = fraction * shape[0] * shape[1]
    low, high = np.sqrt(area / 2), np.sqrt(area * 2)
    heights = np.arange(align, shape[0] + 1, align)
    widths = (np.ceil(area / heights / align) * align).astype(int)
    fitting = (heights >= low) & (heights <= high) & (widths <= shape[1])
    if not fitting.any():
        raise ArgumentError(f"align: a box of {fraction:.0%} of {shape} at multiples of {align} px: none")
    sizes = np.column_stack([heights, widths])[fitting]
    areas = sizes.prod(axis=1)
    height, width = rng.choice(sizes[areas <= 1.02 * areas.min()])
    u = int(rng.integers(0, (shape[1] - width) // align + 1)) * align
    v = int(rng.integers(0, (shape[0] - height) // align + 1)) * align
    return np.array([[u, v, u + width, v + height]], dtype=np.int32)


def same_keypoints(full: Detections, part: Detections, box: NDArray[np.int32]) -> tuple[int, int]:
    """How many keypoints the full run has in ``box``, and how many of those ``part`` has too."""
    assert isinstance(full, Keypoints) and isinstance(part, Keypoints)
    u, v = np.rint(full.points["u"]), np.rint(full.points["v"])
    inside = full.points[(u >= box[0]) & (u < box[2]) & (v >= box[1]) & (v < box[3])]
    others = part.points[np.argsort(part.points["u"], kind="stable")]
    first = np.searchsorted(others["u"], inside["u"] - 0.1)
    end = np.searchsorted(others["u"], inside["u"] + 0.1, side="right")
    return len(inside), sum(_has(others[a:b], one) for a, b, one in zip(first, end, inside, strict=True))


def _has(points: Structured, one: Any) -> bool:
    turn = np.abs(points["angle"] - one["angle"]) % (2 * np.pi)
    near = np.hypot(points["u"] - one["u"], points["v"] - one["v"]) <= 0.1
    near &= np.abs(points["size"] - one["size"]) <= 0.02 * one["size"]
    return bool((near & (np.minimum(turn, 2 * np.pi - turn) <= np.deg2rad(2.0))).any())


def same_boxes(
    full: Detections, part: Detections, box: NDArray[np.int32], *, score: float = 0.6
) -> tuple[int, int]:
    """How many sure boxes the full run has wholly inside ``box``, and how many of those ``part`` has too."""
    inside = (full.boxes[:, :2] >= box[:2]).all(axis=1) & (full.boxes[:, 2:] <= box[2:]).all(axis=1)
    sure = full.boxes[inside & (full.scores >= score)]
    found = [bool((intersection_over_union(one, part.boxes) >= 0.7).any()) for one in sure]
    return len(sure), sum(found)


def any_box(full: Detections, part: Detections, box: NDArray[np.int32]) -> tuple[int, int]:
    """As :func:`same_boxes`, whatever the score, which is no share with a cascade."""
    return same_boxes(full, part, box, score=-np.inf)


def _measure(
    name: str,
    make: Callable[[], Detector],
    scenes: list[tuple[NDArray[np.uint8], np.random.Generator]],
    same: Recovered,
    rounds: int,
    progress: Progress,
) -> dict[str, Any]:
    """One detector on all images, full and attended in turn."""
    try:
        detector = make()
    except (MissingExtraError, StateError) as error:
        return {"ratio": None, "recovered": None, "reason": str(error)}
    align = int(getattr(detector, "align", 1))
    measured = Measured()
    for image, rng in progress.over(scenes, name):
        box = compact_tile(rng, image.shape[:2], align)
        where = Tiles(box)
        full, part = detector.detect(image, Everywhere()), detector.detect(image, where)
        expected, recovered = same(full, part, box[0])
        measured.expected += expected
        measured.recovered += recovered
        measured.read.append(part.attended / full.attended)
        for _ in range(rounds):
            measured.attended.append(_milliseconds(detector, image, where))
            measured.full.append(_milliseconds(detector, image, Everywhere()))
    return measured.figures()


def _milliseconds(detector: Detector, image: NDArray[np.uint8], where: Where) -> float:
    """Processor time of this thread, which other programs on a busy machine do not add to."""
    start = time.thread_time_ns()
    detector.detect(image, where)
    return (time.thread_time_ns() - start) / 1e6


def _generators(seed: int, count: int) -> list[np.random.Generator]:
    return [np.random.default_rng([seed, k]) for k in range(count)]
