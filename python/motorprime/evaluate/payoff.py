"""``motorprime evaluate payoff``: by detector, size of the image and part attended, where attention pays."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, integer
from ..detectors import Detector, Everywhere, HistogramDetector, Mask, PlanarDetector, Surf
from ..detectors.base import Where
from ..detectors.opencv import Orb, Sift
from ..errors import ArgumentError, MissingExtraError, StateError
from ..step import attention_step
from .common import Progress, one_thread
from .drawn import textured
from .text_model import text_detector

SIZES = ((240, 320), (480, 640), (720, 1280), (1080, 1920))
"""(height, width) of the images."""
FRACTIONS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""Parts of the image that are attended."""
USUAL = 0.3
"""The part for which the break-even price is told."""
STRIDE = 4  # of the landscape [px]
POINTS = 50  # of the path
RED = (200, 40, 40)

Make = Callable[[], Detector]


def makers(text_model: Path | None = None) -> dict[str, Make]:
    """Detectors by name, from the cheapest to the most expensive."""
    target = np.full((100, 3), RED, np.uint8)
    card = textured(np.random.default_rng(0), (120, 90))
    return {
        "back_projection": lambda: HistogramDetector(target, way="back-projection"),
        "histogram_scan": lambda: HistogramDetector(target, way="scan"),
        "orb": Orb,
        "surf": lambda: PlanarDetector(card, surf=Surf(300.0, threads=1)),
        "sift": Sift,
        "text": lambda: text_detector(text_model),
    }


def evaluate_payoff(
    *,
    sizes: Sequence[tuple[int, int]] = SIZES,
    rounds: int = 5,
    seed: int = 0,
    text_model: Path | None = None,
    clock: Callable[[], float] = time.thread_time,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Each detector on the whole of a drawn image, and on the most relevant pixels of a motor plan.

    The attended side's time begins with the projected path and holds the landscape, the choice of pixels and
    the detector. Both sides run on one thread, in turn.

    Args:
        sizes: (height, width) of the images.
        rounds: timed runs, of which the median counts.
        seed: of images and paths.
        text_model: the .onnx file of the text detector; None takes the one that was fetched at set-up.
        clock: the time [s].
        progress: shows how far it is.

    Returns:
        ``sizes``: for each size, as "320x240": attention_ms at a part of :data:`USUAL`, and
        break_even_ns_per_pixel, the price of a detector of full frames below which even one whose time is
        proportional to its pixels is better off without attention; and for each of :func:`makers` full_ms,
        full_ns_per_pixel, speedup by part and pays_up_to, the part up to which attention is no loss (0 where
        it always is). A detector that is not installed has the reason instead.

    Raises:
        ArgumentError: no rounds, or an image too small for a detector.
    """
    rounds = integer("rounds", rounds, at_least=1)
    progress = progress or Progress()
    result: dict[str, Any] = {"seed": seed, "rounds": rounds, "fractions": list(FRACTIONS), "sizes": {}}
    with one_thread():
        detectors: dict[str, Detector] = {}
        missing: dict[str, Any] = {}
        for name, make in makers(text_model).items():
            try:
                detectors[name] = make()
            except (MissingExtraError, StateError) as error:
                missing[name] = {"reason": str(error)}
        jobs = [(shape, name) for shape in sizes for name in detectors]
        for shape, name in progress.over(jobs, "where attention pays"):
            height, width = (integer("sizes", side, at_least=1) for side in shape)
            rng = np.random.default_rng([seed, height, width])
            image, path = textured(rng, (height, width)), _path(rng, (height, width))
            row = result["sizes"].setdefault(f"{width}x{height}", {})
            if not row:
                row |= _attention(path, (height, width), rounds, clock)
            row[name] = _measure(detectors[name], image, path, rounds, clock)
        for row in result["sizes"].values():
            row |= missing
    return result


def pays_up_to(speedup: Mapping[float, float]) -> float:
    """The part of the image at which the speed-up first falls below 1; between measured ones it is a line.

    Raises:
        ArgumentError: no speed-ups.
    """
    if not speedup:
        raise ArgumentError("speedup: at least one expected, got none")
    parts = sorted(speedup)
    if speedup[parts[0]] < 1.0:
        return 0.0
    for low, high in pairwise(parts):
        if speedup[high] < 1.0:
            share = (speedup[low] - 1.0) / (speedup[low] - speedup[high])
            return low + share * (high - low)
    return parts[-1]


def _path(rng: np.random.Generator, shape: tuple[int, int]) -> Floats:
    """Pixels (N, 2) of a straight way through the image."""
    ends = rng.uniform(0.1, 0.9, (2, 2)) * (shape[1], shape[0])
    along = np.linspace(0.0, 1.0, POINTS)[:, None]
    return np.asarray(ends[0] + along * (ends[1] - ends[0]))


def _attend(path: Floats, shape: tuple[int, int], fraction: float) -> Mask:
    """The most relevant pixels; kernels so wide that all of the image is relevant, be it a little."""
    seen = attention_step(
        None,
        {"eye": shape},
        pixels={"eye": path},
        fraction=fraction,
        width=float(max(shape)),
        stride=STRIDE,
    )
    mask = seen["eye"].mask
    assert mask is not None
    return Mask(mask)


def _attention(
    path: Floats, shape: tuple[int, int], rounds: int, clock: Callable[[], float]
) -> dict[str, float]:
    seconds = _median(lambda: _attend(path, shape, USUAL), 4 * rounds, clock)
    price = seconds / (1.0 - USUAL) / (shape[0] * shape[1])
    return {"attention_ms": 1e3 * seconds, "break_even_ns_per_pixel": 1e9 * price}


def _measure(
    detector: Detector, image: NDArray[np.uint8], path: Floats, rounds: int, clock: Callable[[], float]
) -> dict[str, Any]:
    shape = image.shape[0], image.shape[1]

    def attended(fraction: float) -> Callable[[], object]:
        return lambda: detector.detect(image, _attend(path, shape, fraction))

    everywhere: Where = Everywhere()
    looks = {fraction: attended(fraction) for fraction in FRACTIONS}
    taken: dict[float, list[float]] = {fraction: [] for fraction in FRACTIONS}
    full: list[float] = []
    detector.detect(image, everywhere)
    for _ in range(rounds):
        full.append(_seconds(lambda: detector.detect(image, everywhere), clock))
        for fraction, look in looks.items():
            taken[fraction].append(_seconds(look, clock))
    whole = float(np.median(full))
    speedup = {fraction: whole / float(np.median(seconds)) for fraction, seconds in taken.items()}
    return {
        "full_ms": 1e3 * whole,
        "full_ns_per_pixel": 1e9 * whole / (shape[0] * shape[1]),
        "speedup": {str(fraction): ratio for fraction, ratio in speedup.items()},
        "pays_up_to": pays_up_to(speedup),
    }


def _median(work: Callable[[], object], rounds: int, clock: Callable[[], float]) -> float:
    work()
    return float(np.median([_seconds(work, clock) for _ in range(rounds)]))


def _seconds(work: Callable[[], object], clock: Callable[[], float]) -> float:
    start = clock()
    work()
    return clock() - start
