"""What a detector costs on this machine: measured once, written down, and asked before every look.

Section IV-A of the paper: measure the time of an image, and "from this value estimate cost per pixel".
"""

from __future__ import annotations

import itertools
import math
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ._arrays import Floats, generator, integer, not_negative
from .detectors.base import Detector, Everywhere, Mask, Tiles, Where, Windows, check_image
from .errors import ArgumentError, ArgumentTypeError, StateError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Clock: TypeAlias = Callable[[], float]
"""Seconds that only grow, such as ``time.perf_counter``."""

Kind: TypeAlias = Literal["windows", "mask", "tiles"]
"""The ways to tell a detector where to look that have a price of their own."""

_COUNTS = (1, 4, 16, 64)
_FRACTIONS = (0.02, 0.1, 0.3, 1.0)
_TILES = ((1, 0.05), (1, 0.3), (3, 0.05), (6, 0.02))


@dataclass(frozen=True)
class CostModel:
    """Seconds that a call of a detector takes: ``call + window n + tile m + pixel p``, in a unit each [s].

    Pixels are counted for masks and tiles; the windows of a call have one size, and so one price each.

    Attributes:
        call: once for every call.
        window: for every window.
        tile: for every tile.
        pixel: for every pixel of a mask, of the tiles, or of the whole image.

    Raises:
        ArgumentError: a price is negative or not finite, or all are 0.
        ArgumentTypeError: a price is no number.
    """

    call: float = 0.0
    window: float = 0.0
    tile: float = 0.0
    pixel: float = 0.0

    def __post_init__(self) -> None:
        for price in fields(self):
            object.__setattr__(self, price.name, not_negative(price.name, getattr(self, price.name)))
        if not any(asdict(self).values()):
            raise ArgumentError("call, window, tile, pixel: one of them greater than 0 expected, all are 0")

    def seconds(self, *, windows: int = 0, tiles: int = 0, pixels: int = 0) -> float:
        """What one call takes [s]."""
        return self.call + self.window * windows + self.tile * tiles + self.pixel * pixels

    def of(self, where: Where, shape: tuple[int, int]) -> float:
        """What a call takes [s] that looks ``where`` in an image of ``shape`` (height, width)."""
        return float(_amounts(where, shape) @ [self.call, self.window, self.tile, self.pixel])

    def save(self, path: str | Path) -> None:
        """Write the prices as TOML: four numbers that one may read, compare and correct.

        Raises:
            ArgumentError: the file cannot be written.
        """
        lines = [f"{name} = {value!r}\n" for name, value in asdict(self).items()]
        try:
            Path(path).write_text("".join(["# What a detector costs [s].\n[costs]\n", *lines]))
        except OSError as error:
            raise ArgumentError(f"path: cannot write {path}: {error.strerror}") from None

    @classmethod
    def load(cls, path: str | Path) -> CostModel:
        """Read what :meth:`save` wrote.

        Raises:
            ArgumentError: there is no such file, it is no TOML, or it does not hold the prices.
        """
        try:
            content = tomllib.loads(Path(path).read_text())
        except OSError as error:
            raise ArgumentError(f"path: cannot read {path}: {error.strerror}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ArgumentError(f"path: {path} is no TOML file: {error}") from None
        prices = content.get("costs")
        names = [price.name for price in fields(cls)]
        if not isinstance(prices, dict) or sorted(prices) != sorted(names):
            raise ArgumentError(f"path: {path} should hold [costs] with {', '.join(names)} and nothing else")
        try:
            return cls(**prices)
        except (ArgumentError, ArgumentTypeError) as error:
            raise ArgumentError(f"path: {path}: {error}") from None


def calibrate_costs(
    detector: Detector,
    image: NDArray[np.uint8],
    *,
    clock: Clock,
    kinds: Sequence[Kind] = ("windows", "mask", "tiles"),
    size: int = 20,
    repeats: int = 7,
    seed: int | np.random.Generator | None = 0,
) -> CostModel:
    """Measure what a detector costs: a few dozen calls.

    Each kind of look is tried with little and with much; of each the median over ``repeats`` runs is taken,
    in turns, so that a busy moment of the machine spoils none of them. The prices are the non-negative
    least squares of the relative errors.

    Args:
        detector: to be measured.
        image: (H, W, 3) uint8 RGB, a usual one: what is on it may matter.
        clock: seconds that only grow, such as ``time.perf_counter``.
        kinds: what the detector shall be told: the prices of what is not tried are 0.
        size: of the windows [px].
        repeats: runs of each look.
        seed: where the windows are.

    Raises:
        ArgumentError: an image, kind, size or number outside its domain, a window larger than the image.
        StateError: the clock went back or stood still.
        Exception: whatever the detector raises: it may not know one of the kinds.
    """
    shape = check_image(image).shape[:2]
    repeats = integer("repeats", repeats, at_least=1)
    looks = _looks(kinds, (shape[0], shape[1]), integer("size", size, at_least=1), generator(seed))
    for where in looks:  # the first call of anything is a slow one
        detector.detect(image, where)
    runs: list[list[float]] = [[] for _ in looks]
    for _ in range(repeats):
        for where, times in zip(looks, runs, strict=True):
            before = read_clock(clock)
            detector.detect(image, where)
            times.append(read_clock(clock, before) - before)
    taken = np.array([statistics.median(times) for times in runs])
    if not taken.all():
        raise StateError("clock: it stood still while the detector ran; a finer one is needed")
    amounts = np.array([_amounts(where, (shape[0], shape[1])) for where in looks])
    return CostModel(*_non_negative(amounts / taken[:, None], np.ones(len(looks))).tolist())


def read_clock(clock: Clock, before: float = -math.inf) -> float:
    """The time now [s], not earlier than ``before``.

    Raises:
        StateError: it is, or it is no finite number.
    """
    now = float(clock())
    if not math.isfinite(now):
        raise StateError(f"clock: finite seconds expected, it said {now}")
    if now < before:
        raise StateError(
            f"clock: it went back from {before} to {now} s; one that only grows is needed, "
            "such as time.perf_counter"
        )
    return now


def _amounts(where: Where, shape: tuple[int, int]) -> Floats:
    """(4,) calls, windows, tiles and pixels of a look."""
    if isinstance(where, Windows):
        return np.array([1.0, len(where.centres), 0.0, 0.0])
    if isinstance(where, Tiles):
        boxes = np.asarray(where.boxes, dtype=np.float64)
        pixels = ((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])).sum()
        return np.array([1.0, 0.0, len(boxes), pixels])
    if isinstance(where, Mask):
        return np.array([1.0, 0.0, 0.0, np.count_nonzero(where.mask)])
    if isinstance(where, Everywhere):
        return np.array([1.0, 0.0, 0.0, shape[0] * shape[1]])
    raise ArgumentTypeError(f"where: Everywhere, Mask, Windows or Tiles expected, got {type(where).__name__}")


def _looks(
    kinds: Sequence[Kind], shape: tuple[int, int], size: int, draw: np.random.Generator
) -> list[Where]:
    """Little and much of each kind."""
    known = get_args(Kind)
    if isinstance(kinds, str) or not kinds or set(kinds) - set(known):
        raise ArgumentError(f"kinds: some of {', '.join(known)} expected, got {kinds!r}")
    height, width = shape
    looks: list[Where] = []
    if "windows" in kinds:
        if min(shape) < size:
            raise ArgumentError(
                f"size: a window of {size} px does not fit into an image of {width} x {height}"
            )
        drawn = (draw.integers((0, 0), (width, height), (n, 2), dtype=np.int32) for n in _COUNTS)
        looks += [Windows(centres, size) for centres in drawn]
    if "mask" in kinds:
        for u0, v0, u1, v1 in (_box(shape, fraction, 0.5) for fraction in _FRACTIONS):
            mask = np.zeros(shape, dtype=np.bool_)
            mask[v0:v1, u0:u1] = True
            looks.append(Mask(mask))
    if "tiles" in kinds:
        for count, fraction in _TILES:
            looks.append(Tiles(np.array([_box(shape, fraction, (k + 0.5) / count) for k in range(count)])))
    return looks


def _box(shape: tuple[int, int], fraction: float, along: float) -> list[int]:
    """A rectangle of this fraction of the image, so far along its diagonal."""
    height, width = (max(1, round(side * math.sqrt(fraction))) for side in shape)
    v, u = round(along * (shape[0] - height)), round(along * (shape[1] - width))
    return [u, v, u + width, v + height]


def _non_negative(matrix: Floats, wanted: Floats) -> Floats:
    """argmin ||matrix x - wanted|| over x >= 0, by trying which of the few numbers are not 0."""
    best, least = np.zeros(matrix.shape[1]), math.inf
    used = [k for k in range(matrix.shape[1]) if matrix[:, k].any()]
    for count in range(1, len(used) + 1):
        for chosen in map(list, itertools.combinations(used, count)):
            x = np.linalg.lstsq(matrix[:, chosen], wanted, rcond=None)[0]
            error = float(np.square(matrix[:, chosen] @ x - wanted).sum())
            # A larger set must be better, and not by rounding only.
            if (x >= 0.0).all() and error < least * (1.0 - 1e-9):
                best, least = np.zeros(matrix.shape[1]), error
                best[chosen] = x
    return best
