"""``motorprime evaluate budget``: does a detector end in the time it is given, and use that time?"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..attention import Look
from ..budget import Budgeted
from ..costs import Clock, calibrate_costs
from ..detectors import Everywhere, HistogramDetector, Windows
from ..detectors.colours import bin_indices
from ..landscape import kernel_landscape
from .common import Progress

SHAPE, SIZE = (240, 320), 20
SHORTEST, LONGEST, SLACK = 2.0, 50.0, 10.0  # [ms]
SCENES = 20
TABLE = {"320x240": (240, 320), "640x480": (480, 640)}

RED = (205, 40, 45)

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Cycle:
    """One cycle: its budget and what it took [s], what was looked at and what was left."""

    budget: float
    seconds: float
    looked: float
    skipped: float

    @property
    def overshoot(self) -> float:
        """Time over the budget, as a share of it or of 10 ms."""
        return (self.seconds - self.budget) / max(self.budget, SLACK / 1000.0)


def evaluate_budget(
    *,
    cycles: int = 2000,
    repeats: int = 15,
    seed: int = 0,
    clock: Clock = time.perf_counter,
    own_clock: Clock = time.thread_time,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Windows of 20 x 20 from landscapes of drawn scenes, with budgets of 2 to 50 ms, one after another.

    Args:
        cycles: how many.
        repeats: of each way in the table of the histogram's ways; 0 leaves it out.
        seed: of scenes, windows and budgets.
        clock: the time [s].
        own_clock: the time [s] that this thread had the processor.
        progress: shows how far it is.

    Returns:
        cycles, overshoot_p99 (99th percentile of (t - b) / max(b, 10 ms)), used_median (median of t / b over
        the cycles that left something), misses (cycles that took longer than their budget), missed (their
        share), late (share with an overshoot of more than 0.1), skipped (mean share of the landscape's mass
        not looked at), looked (mean fraction of the image), costs (calibrated, in microseconds), learned
        (factor and reserve at the end); own_time, the same figures of a quarter as many cycles on a clock
        that stands still while other programs have the processor, which tells what they do to the figures
        above; histogram (milliseconds of the detector's ways).
    """
    progress = progress or Progress()
    integer("cycles", cycles, at_least=1)
    integer("repeats", repeats, at_least=0)
    generator = np.random.default_rng(seed)
    scenes = [draw_scene(SHAPE, generator) for _ in range(SCENES)]
    detector = _detector()
    costs = calibrate_costs(detector, scenes[0][0], clock=clock, kinds=["windows"], size=SIZE, seed=generator)
    prices = {"call_us": costs.call * 1e6, "window_us": costs.window * 1e6}

    def run(count: int, clock: Clock, what: str) -> dict[str, Any]:
        timely = Budgeted(detector, costs, clock=clock, size=SIZE, seed=generator)
        budgets = generator.uniform(SHORTEST, LONGEST, count).tolist()
        ran = [
            _cycle(timely, *scenes[k % SCENES], budget)
            for k, budget in enumerate(progress.over(budgets, what))
        ]
        learned = {"factor": timely.pace.factor, "reserve_ms": timely.pace.reserve * 1e3}
        return {"cycles": count, **_figures(ran), "learned": learned}

    result = {"seed": seed, **run(cycles, clock, "cycles"), "costs": prices}
    result["own_time"] = run(max(cycles // 4, 1), own_clock, "cycles on the own clock")
    if repeats:
        result["histogram"] = histogram_ways(repeats, generator, clock=clock, progress=progress)
    return result


def draw_scene(shape: tuple[int, int], generator: np.random.Generator) -> tuple[Image, Look]:
    """A grey scene with a red target among things of other colours, and the landscape of a reach to it."""
    height, width = shape
    scale = width / 320.0
    grey = generator.integers(60, 180, shape, dtype=np.uint8)
    image = np.ascontiguousarray(np.stack([grey] * 3, axis=2))
    spots = generator.uniform((0.2, 0.2), (0.8, 0.8), (7, 2)) * (width, height)
    for k, spot in enumerate(spots):
        colour = RED if k == 0 else generator.integers(0, 256, 3)
        radius = round(float(generator.uniform(9.0, 18.0)) * scale)
        cv2.circle(image, [round(float(x)) for x in spot], radius, [int(c) for c in colour], -1)
    noise = generator.normal(0.0, 6.0, image.shape)
    start = generator.uniform((0.1, 0.9), (0.9, 1.0)) * (width, height)
    path = start + np.linspace(0.0, 1.0, 60)[:, None] * (spots[0] - start)
    landscape = kernel_landscape(path, shape, width=40.0 * scale)
    return np.clip(image + noise, 0, 255).astype(np.uint8), Look(landscape)


def histogram_ways(
    repeats: int, generator: np.random.Generator, *, clock: Clock, progress: Progress | None = None
) -> dict[str, dict[str, float]]:
    """Milliseconds (medians, in turns) of the ways to find a target by its histogram in one image."""
    progress = progress or Progress()
    table = {}
    for name, shape in TABLE.items():
        image, look = draw_scene(shape, generator)
        ways = _ways(image, look.windows(50, size=SIZE, seed=generator))
        times: dict[str, list[float]] = {way: [] for way in ways}
        for run in ways.values():
            run()
        for _ in progress.over(range(repeats), f"histogram, {name}"):
            for way, run in ways.items():
                before = clock()
                run()
                times[way].append((clock() - before) * 1e3)
        table[name] = {way: statistics.median(taken) for way, taken in times.items()}
    return table


def _ways(image: Image, windows: Windows) -> dict[str, Callable[[], object]]:
    sliding, scan, projection = (_detector(way) for way in ("windows", "scan", "back-projection"))
    return {
        "sliding_stride4_ms": lambda: sliding.detect(image, Everywhere()),
        "windows50_ms": lambda: sliding.detect(image, windows),
        "scan_stride1_ms": lambda: scan.detect(image, Everywhere()),
        "scan_scores_ms": lambda: scan.scores(image),
        "boxes_scores_ms": lambda: _boxes(image, scan),
        "back_projection_ms": lambda: projection.detect(image, Everywhere()),
        "back_projection_scores_ms": lambda: projection.scores(image),
    }


def _boxes(image: Image, detector: HistogramDetector) -> NDArray[np.float32]:
    """The scores of the scan with OpenCV and NumPy: a box filter for each bin."""
    index, scores = bin_indices(image), np.zeros(image.shape[:2], dtype=np.float32)
    for k, share in enumerate(detector.model.ravel()):
        if share > 0.0:
            inside = (index == k).astype(np.float32)
            scores += np.minimum(cv2.boxFilter(inside, -1, (SIZE, SIZE), anchor=(0, 0)), share)
    return scores[: 1 - SIZE, : 1 - SIZE]


def _detector(way: Any = "windows") -> HistogramDetector:
    """Of the red thing of :func:`draw_scene`, learned from noisy pixels."""
    pixels = np.random.default_rng(0).normal(RED, 6.0, (400, 3)).clip(0, 255).astype(np.uint8)
    return HistogramDetector(pixels, window=SIZE, way=way)


def _cycle(timely: Budgeted, image: Image, look: Look, milliseconds: float) -> Cycle:
    glance = timely.detect(image, look, milliseconds)
    return Cycle(glance.budget, glance.seconds, glance.looked, glance.skipped)


def _figures(ran: list[Cycle]) -> dict[str, Any]:
    overshoots = np.array([cycle.overshoot for cycle in ran])
    more = [cycle.seconds / cycle.budget for cycle in ran if cycle.skipped > 0.0]
    misses = sum(cycle.seconds > cycle.budget for cycle in ran)
    return {
        "overshoot_p99": float(np.quantile(overshoots, 0.99)),
        "used_median": statistics.median(more) if more else None,
        "misses": misses,
        "missed": misses / len(ran),
        "late": float(np.mean(overshoots > 0.1)),
        "skipped": statistics.fmean(cycle.skipped for cycle in ran),
        "looked": statistics.fmean(cycle.looked for cycle in ran),
    }
