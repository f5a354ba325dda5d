"""What the outputs of common networks mean: boxes in rows, boxes in columns, and maps of text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import not_negative
from ..errors import ArgumentError
from .base import Detections
from .merging import check_overlap, suppress

Declared: TypeAlias = Sequence[Any]
"""Shape of an output as the model declares it: an int, or a name or None where it may vary."""


class Layout(Protocol):
    """How to read one output of a network."""

    @property
    def says(self) -> str:
        """The shape that is read, in words."""
        ...

    def fits(self, shape: Declared) -> bool:
        """Whether an output of this shape can be read so."""
        ...

    def read(self, output: NDArray[np.float32], size: tuple[int, int]) -> Detections:
        """Findings in an image of ``size`` (height, width) from what the network gave for it."""
        ...


@dataclass(frozen=True)
class Boxes:
    """What every layout of boxes is told.

    Args:
        labels: names of the C classes.
        score: weaker boxes are dropped.
        overlap: of boxes of one class that overlap so, intersection over union, the best stays.

    Raises:
        ArgumentError: no labels, a negative score, or an overlap outside (0, 1].
    """

    labels: tuple[str, ...]
    score: float = 0.25
    overlap: float = 0.45

    def __post_init__(self) -> None:
        _check_boxes(self.labels, self.score, self.overlap)


@dataclass(frozen=True)
class RowBoxes(Boxes):
    """Boxes as YOLO up to version 5 and 7 writes them: (1, N, 5 + C).

    A row is the box's centre, width and height in pixels of the input, how likely it holds an object, and how
    likely that is of each class; the score is the product.

    Args:
        labels, score, overlap: as of :class:`Boxes`.
    """

    @property
    def says(self) -> str:
        """The shape that is read, in words."""
        return f"(1, N, {5 + len(self.labels)})"

    def fits(self, shape: Declared) -> bool:
        """Whether an output of this shape can be read so."""
        return len(shape) == 3 and _may_be(shape[2], 5 + len(self.labels))

    def read(self, output: NDArray[np.float32], size: tuple[int, int]) -> Detections:
        """Findings in an image of ``size`` from ``output`` (N, 5 + C)."""
        return _boxes(
            output[:, :4], output[:, 5:] * output[:, 4:5], self.labels, self.score, self.overlap, size
        )


@dataclass(frozen=True)
class ColumnBoxes(Boxes):
    """Boxes as YOLO from version 8 on writes them: (1, 4 + C, N).

    A column is the box's centre, width and height in pixels of the input, and the score of each class.

    Args:
        labels, score, overlap: as of :class:`Boxes`.
    """

    @property
    def says(self) -> str:
        """The shape that is read, in words."""
        return f"(1, {4 + len(self.labels)}, N)"

    def fits(self, shape: Declared) -> bool:
        """Whether an output of this shape can be read so."""
        return len(shape) == 3 and _may_be(shape[1], 4 + len(self.labels))

    def read(self, output: NDArray[np.float32], size: tuple[int, int]) -> Detections:
        """Findings in an image of ``size`` from ``output`` (4 + C, N)."""
        return _boxes(output[:4].T, output[4:].T, self.labels, self.score, self.overlap, size)


@dataclass(frozen=True)
class TextMap:
    """How likely each pixel is text, (1, 1, H, W), as networks with differentiable binarisation give it.

    Every connected region of likely pixels is a line of text, shrunk by the network's training. Its smallest
    rectangle, of area A and circumference L, grows again by ``unclip * A / L`` to every side. The upright box
    around that is returned; the score is the mean of the map in the rectangle before it grew.

    Source: Liao et al., *Real-time Scene Text Detection with Differentiable Binarization*, 2020.

    Args:
        level: likelihood from which a pixel is text.
        score: weaker lines are dropped.
        unclip: how much a region grows.
        side: thinner regions [px] are dropped.
        label: of every line.
    """

    level: float = 0.3
    score: float = 0.5
    unclip: float = 1.6
    side: float = 3.0
    label: str = "text"

    def __post_init__(self) -> None:
        for name in ("level", "score", "unclip", "side"):
            not_negative(name, getattr(self, name))

    @property
    def says(self) -> str:
        """The shape that is read, in words."""
        return "(1, 1, H, W)"

    def fits(self, shape: Declared) -> bool:
        """Whether an output of this shape can be read so."""
        return len(shape) == 4 and _may_be(shape[1], 1)

    def read(self, output: NDArray[np.float32], size: tuple[int, int]) -> Detections:
        """Findings in an image of ``size`` from ``output`` (1, H, W), which may be coarser than the image."""
        likely = output[0]
        text = (likely > self.level).astype(np.uint8)
        contours, _ = cv2.findContours(text, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
        coarse = np.array([size[1] / likely.shape[1], size[0] / likely.shape[0]])
        boxes, scores = [], []
        for contour in contours:
            centre, sides, angle = cv2.minAreaRect(contour)
            if min(sides) < self.side:
                continue
            score = _mean_inside(likely, np.float32(cv2.boxPoints((centre, sides, angle))))
            if score < self.score:
                continue
            grow = self.unclip * sides[0] * sides[1] / (sides[0] + sides[1])  # to both sides: 2 A / L
            corners = cv2.boxPoints((centre, (sides[0] + grow, sides[1] + grow), angle))
            # The last pixel of a half-open box lies within it.
            boxes.append([*corners.min(axis=0) * coarse, *(corners.max(axis=0) + 1.0) * coarse])
            scores.append(score)
        return Detections(
            _clip(np.array(boxes, dtype=np.float32).reshape(-1, 4), size),
            np.array(scores, dtype=np.float32),
            (self.label,) * len(boxes),
        )


def _may_be(declared: Any, wanted: int) -> bool:
    return not isinstance(declared, int) or declared == wanted


def _check_boxes(labels: tuple[str, ...], score: float, overlap: float) -> None:
    if not labels:
        raise ArgumentError("labels: the names of the network's classes expected, got none")
    not_negative("score", score)
    check_overlap(overlap)


def _boxes(
    places: NDArray[np.float32],
    likely: NDArray[np.float32],
    labels: tuple[str, ...],
    score: float,
    overlap: float,
    size: tuple[int, int],
) -> Detections:
    """Boxes (N, 4) of centre, width and height, with scores (N, C), as findings without duplicates."""
    classes = likely.argmax(axis=1)
    scores = likely[np.arange(len(likely)), classes]
    strong = np.flatnonzero(scores >= score)
    classes, scores = classes[strong], scores[strong]
    centres, half = places[strong, :2], places[strong, 2:] * np.float32(0.5)
    boxes = np.hstack([centres - half, centres + half])
    kept: list[int] = []
    for one in np.unique(classes):
        same = np.flatnonzero(classes == one)
        kept.extend(same[suppress(boxes[same], scores[same], overlap)])
    return Detections(_clip(boxes[kept], size), scores[kept], tuple(labels[c] for c in classes[kept]))


def _clip(boxes: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    height, width = size
    return np.clip(boxes, 0.0, np.array([width, height, width, height], dtype=np.float32))


def _mean_inside(likely: NDArray[np.float32], corners: NDArray[np.float32]) -> float:
    """Mean of the map in a rectangle of any direction."""
    last = np.array([likely.shape[1] - 1, likely.shape[0] - 1])
    low = np.clip(np.floor(corners.min(axis=0)), 0, last).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), 0, last).astype(int)
    inside = np.zeros((high[1] - low[1] + 1, high[0] - low[0] + 1), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(corners - low).astype(np.int32)], (1,))
    return float(cv2.mean(likely[low[1] : high[1] + 1, low[0] : high[0] + 1], inside)[0])
