"""A detector within a budget of time: it looks at the most relevant places first, as long as there is time.

Three lines make a slow detector end in time::

    costs = calibrate_costs(detector, image, clock=time.perf_counter)
    timely = Budgeted(detector, costs, clock=time.perf_counter)
    glance = timely.detect(image, look, milliseconds=10)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ._arrays import generator, integer, not_negative
from .attention import Look
from .costs import Clock, CostModel, read_clock
from .detectors.base import Detections, Detector, Tiles, Where, Windows, check_image
from .detectors.merging import check_overlap, suppress
from .errors import ArgumentError, ArgumentTypeError
from .looking import Strategy
from .pace import Pace
from .portions import DrawnWindows, Listed, Portions, TopPixels, paint

By: TypeAlias = Literal["windows", "mask"]

FEW = 8  # windows or tiles: fewer are not worth a call of their own as long as there is more time


@dataclass(frozen=True, eq=False)
class Glance:
    """What was found in the time there was.

    Attributes:
        detections: what all portions found, each thing once. Pixels of two portions count twice in its
            ``attended``; see :attr:`looked`.
        seconds: that it took.
        budget: that it was given [s].
        missed: whether it took longer.
        looks: where it looked, portion by portion.
        failure: what the detector raised, which ended this frame; None when it did not.
    """

    detections: Detections
    seconds: float
    budget: float
    looks: tuple[Where, ...]
    failure: Exception | None
    _shape: tuple[int, int]
    _portions: Portions

    @property
    def missed(self) -> bool:
        """Whether it took longer than it was given."""
        return self.seconds > self.budget

    @cached_property
    def pixels(self) -> NDArray[np.bool_]:
        """(H, W) the pixels that were asked for."""
        return paint(self.looks, self._shape)

    @property
    def looked(self) -> float:
        """Which fraction of the image they are."""
        return float(np.count_nonzero(self.pixels)) / self.pixels.size

    @property
    def rest(self) -> Where:
        """What was not looked at: windows or tiles at the end of the list, or pixels of the landscape."""
        return self._portions.rest(self.pixels)[0]

    @property
    def skipped(self) -> float:
        """Which share that is: of the landscape's mass, or of the windows or tiles that were given."""
        return self._portions.rest(self.pixels)[1]


class Budgeted:
    """A detector that ends in time.

    It looks at portions and reads the clock between them. Each takes about half of the time that is left, so
    that the last ones are short and a model that is off by a factor of two does no harm; how far it is off,
    and how much time must be kept free at the end, is learned from cycle to cycle (see :class:`Pace`).

    Without any time it still looks at the most relevant window, tile or pixel, and so misses the budget.

    Args:
        detector: any. What it raises ends the frame and is reported; the next frame is a new one.
        costs: of the detector, see :func:`calibrate_costs`.
        clock: seconds that only grow, such as ``time.perf_counter``.
        by: how to look at a landscape: 'windows' drawn from it, one portion after another, or 'mask', its
            most relevant pixels in one call, which nothing can interrupt.
        size: of the windows [px].
        strategy: how the windows are drawn, see :data:`motorprime.looking.Strategy`.
        overlap: intersection over union from which two boxes of a label are one thing, found twice.
        pace: what was learned; it may be shared by detectors or kept.
        seed: draws the windows.

    Raises:
        ArgumentError: a number outside its domain, or ``costs`` without a price for what is looked at.
        ArgumentTypeError: an argument has the wrong type.
    """

    def __init__(
        self,
        detector: Detector,
        costs: CostModel,
        *,
        clock: Clock,
        by: By = "windows",
        size: int = 20,
        strategy: Strategy = "independent",
        overlap: float = 0.5,
        pace: Pace | None = None,
        seed: int | np.random.Generator | None = None,
    ) -> None:
        if not isinstance(detector, Detector):
            raise ArgumentTypeError(
                f"detector: an object with detect(image, where) expected, got {detector!r}"
            )
        if not isinstance(costs, CostModel):
            raise ArgumentTypeError(f"costs: a CostModel expected, got {type(costs).__name__}")
        if not callable(clock):
            raise ArgumentTypeError(f"clock: a function expected, got {clock!r}")
        if by not in get_args(By):
            raise ArgumentError(f"by: one of {', '.join(get_args(By))} expected, got {by!r}")
        if strategy not in get_args(Strategy):
            raise ArgumentError(
                f"strategy: one of {', '.join(get_args(Strategy))} expected, got {strategy!r}"
            )
        self.detector, self.costs = detector, costs
        self.pace = pace or Pace()
        self._clock, self._by, self._overlap = clock, by, check_overlap(overlap)
        self._strategy: Strategy = strategy
        self._size, self._seed = integer("size", size, at_least=1), generator(seed)

    def detect(self, image: NDArray[np.uint8], look: Look | Windows | Tiles, milliseconds: float) -> Glance:
        """Detect in ``image`` (H, W, 3) uint8 RGB for so many milliseconds, counted from this call.

        Args:
            image: the frame.
            look: a landscape; or windows or tiles in the order in which they matter.
            milliseconds: the budget, 0 or more.

        Raises:
            ArgumentError: a budget that is negative or not finite, a landscape of another size or zero
                everywhere, an image smaller than a window, a tile that is empty or not inside the image.
            ArgumentTypeError: an argument has the wrong type, or the detector returns no Detections.
            StateError: the clock went back.
        """
        started = now = read_clock(self._clock)
        budget = not_negative("milliseconds", milliseconds) / 1000.0
        shape = (check_image(image).shape[0], image.shape[1])
        portions = self._portions(look, shape)
        looks: list[Where] = []
        found: list[Detections] = []
        failure = None
        while True:
            now = read_clock(self._clock, now)
            count = self._affordable(portions, started + self.pace.usable(budget) - now)
            if looks and not count:
                break
            where = portions.take(count)
            if where is None:
                break
            looks.append(where)
            before = now
            try:
                one = self.detector.detect(image, where)
            except Exception as error:
                failure = error
                break
            found.append(_checked(one))
            now = read_clock(self._clock, now)
            self.pace.ran(self.costs.of(where, shape), now - before)
        detections = _together(found, self._overlap)
        seconds = read_clock(self._clock, now) - started
        if budget > 0.0 and failure is None:
            self.pace.ended(budget, seconds)
        return Glance(detections, seconds, budget, tuple(looks), failure, shape, portions)

    def _portions(self, look: Look | Windows | Tiles, shape: tuple[int, int]) -> Portions:
        kind = self._by if isinstance(look, Look) else "windows" if isinstance(look, Windows) else "tiles"
        prices = {"windows": ("window",), "mask": ("pixel",), "tiles": ("tile", "pixel")}[kind]
        if not any(getattr(self.costs, price) for price in prices):
            raise ArgumentError(
                f"costs: a price for each {' or '.join(prices)} expected, it is 0; "
                f"calibrate_costs(..., kinds=['{kind}']) measures it"
            )
        if isinstance(look, Windows):
            look.corners(shape)
            return Listed(look)
        if isinstance(look, Tiles):
            return Listed(look.within(shape))
        if not isinstance(look, Look):
            raise ArgumentTypeError(f"look: a Look, Windows or Tiles expected, got {type(look).__name__}")
        if look.landscape.shape != shape:
            raise ArgumentError(f"look: a landscape of shape {shape} expected, got {look.landscape.shape}")
        if look.is_empty:
            raise ArgumentError("look: the landscape is zero everywhere: there is nothing to look at")
        if self._by == "mask":
            return TopPixels(look)
        if min(shape) < self._size:
            raise ArgumentError(f"image: {shape[1]} x {shape[0]} is smaller than a window of {self._size} px")
        return DrawnWindows(look, self._size, self._strategy, self._seed)

    def _affordable(self, portions: Portions, seconds: float) -> int:
        """How much the next portion takes: all there is time for, or half of it if enough will be left."""
        seconds /= self.pace.factor
        if not portions.whole:
            half = portions.affordable(seconds / 2.0, self.costs)
            if half >= FEW:
                return half
        return portions.affordable(seconds, self.costs)


def _checked(found: object) -> Detections:
    if not isinstance(found, Detections):
        raise ArgumentTypeError(f"detector: detect should return Detections, got {type(found).__name__}")
    return found


def _together(found: list[Detections], overlap: float) -> Detections:
    """All of them, the best first; of boxes of one label that overlap, the one with the best score."""
    boxes = np.concatenate([np.zeros((0, 4), np.float32), *(one.boxes for one in found)])
    scores = np.concatenate([np.zeros(0, np.float32), *(one.scores for one in found)])
    labels = np.array([label for one in found for label in one.labels], dtype=object)
    alike = [np.flatnonzero(labels == label) for label in dict.fromkeys(labels.tolist())]
    kept = np.concatenate(
        [np.zeros(0, np.intp), *(part[suppress(boxes[part], scores[part], overlap)] for part in alike)]
    )
    kept = np.sort(kept)
    kept = kept[np.argsort(-scores[kept], kind="stable")]
    return Detections(
        boxes=boxes[kept],
        scores=scores[kept],
        labels=tuple(labels[kept].tolist()),
        attended=sum(one.attended for one in found),
    )
