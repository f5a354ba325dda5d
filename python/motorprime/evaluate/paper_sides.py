"""The two sides of the paper's experiments: a detector that looks everywhere, and one that attends.

Both give centres of detections (N, 2) in each eye, and say where their time went.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..detectors import Everywhere, HistogramDetector, Mask, PlanarDetector, Surf
from ..detectors.base import Where
from ..detectors.colours import bin_indices, window_hits
from ..detectors.merging import merge_hits
from ..intersections import intersections
from ..peripersonal_model import PeripersonalModel
from ..projection import NeuralProjection
from ..step import Attended, attention_step
from ..tasks.timing import Stages
from .paper_moments import Image, PaperMoment, printed

WINDOW, WINDOWS, HIT = 20, 50, 0.6
"""Side of the histogram's windows [px], how many are drawn for each eye, and the intersection of a hit."""
GAP = WINDOW  # between hits on one thing, at most [px]: windows that are drawn are not everywhere
FRACTION, THRESHOLD, MATCHES = 0.3, 300.0, 7
"""Share of the pixels that SURF looks at, its Hessian threshold, and keypoints that must agree."""
MIXING = 0.2  # pi of Eq. 10
STRIDE = 4  # of the landscape that windows are drawn from [px]

Found = Mapping[str, Floats]
"""Centres (N, 2) of (u, v) of what was found in each camera."""


class Side(Protocol):
    """A detector that looks at both images, everywhere or where it is told."""

    def everywhere(self, images: Mapping[str, Image], stages: Stages) -> Found:
        """What is found in the whole of the images."""
        ...

    def attended(self, images: Mapping[str, Image], where: Mapping[str, Attended], stages: Stages) -> Found:
        """What is found where a landscape says."""
        ...


@dataclass
class Histogram:
    """Windows whose histogram shares enough with the target's, merged where they overlap."""

    detector: HistogramDetector

    def everywhere(self, images: Mapping[str, Image], stages: Stages) -> Found:
        """Every window of the images."""
        found, target = {}, self.detector.model.ravel()
        for camera, image in images.items():
            with stages.time("colours"):
                bins = bin_indices(image)
            with stages.time("scan"):
                scores = intersections(bins, target, (WINDOW, WINDOW))
            with stages.time("merging"):
                found[camera] = _centres(merge_hits(scores, HIT, WINDOW, gap=GAP))
        return found

    def attended(self, images: Mapping[str, Image], where: Mapping[str, Attended], stages: Stages) -> Found:
        """The windows that were drawn."""
        found, target = {}, self.detector.model.ravel()
        for camera, look in where.items():
            assert look.centres is not None
            with stages.time("windows and merging"):
                boxes = window_hits(images[camera], look.centres, WINDOW, target, HIT, gap=GAP)
                found[camera] = _centres(boxes)
        return found


@dataclass
class BackProjection:
    """The short cut for full frames: pixels of the target's colours, and their largest region."""

    detector: HistogramDetector

    def everywhere(self, images: Mapping[str, Image], stages: Stages) -> Found:
        """The largest region."""
        found = {}
        with stages.time("back-projection"):
            for camera, image in images.items():
                box = self.detector.largest_region(image)
                found[camera] = np.zeros((0, 2)) if box is None else _centres(np.array([box]))
        return found


@dataclass
class Keypoints:
    """A printed card by its SURF keypoints, on one thread."""

    detector: PlanarDetector = field(
        default_factory=lambda: PlanarDetector(
            printed(), surf=Surf(THRESHOLD, threads=1), min_matches=MATCHES
        )
    )

    def everywhere(self, images: Mapping[str, Image], stages: Stages) -> Found:
        """Every pixel."""
        return {camera: self._detect(image, Everywhere(), stages) for camera, image in images.items()}

    def attended(self, images: Mapping[str, Image], where: Mapping[str, Attended], stages: Stages) -> Found:
        """The pixels of the masks."""
        found = {}
        for camera, look in where.items():
            assert look.mask is not None
            found[camera] = self._detect(images[camera], Mask(look.mask), stages)
        return found

    def _detect(self, image: Image, where: Where, stages: Stages) -> Floats:
        with stages.time("SURF"):
            boxes = self.detector.detect(image, where).boxes
        return _centres(boxes)


@dataclass
class Gaze:
    """Where to look, by the networks that come with the package.

    Attributes:
        projection: of plans.
        reachable: ellipses of the reachable space.
    """

    projection: NeuralProjection
    reachable: PeripersonalModel

    def where(
        self, moment: PaperMoment, stages: Stages, *, masks: bool, seed: int, kept: dict[str, Attended]
    ) -> Mapping[str, Attended]:
        """Windows, or masks, in each camera that has something of the plan or of the reachable space in view.

        Args:
            moment: with the plan, if there is one.
            stages: times it.
            masks: whether a share of the pixels is to be looked at, instead of windows.
            seed: draws windows.
            kept: arrays of earlier cycles, to be written again.
        """
        shapes = self.projection.shapes
        windows, fraction, stride = (None, FRACTION, 1) if masks else (WINDOWS, None, STRIDE)
        if moment.path is None:
            with stages.time("landscape and choice"):
                seen = attention_step(
                    self.reachable.maps,
                    shapes,
                    joints=self.reachable.inputs_of(moment.joints),
                    mixing=MIXING,
                    seed=seed,
                    out=kept,
                    windows=windows,
                    fraction=fraction,
                    stride=stride,
                )
        else:
            with stages.time("projection, landscape and choice"):
                seen = attention_step(
                    self.projection.maps,
                    shapes,
                    points=moment.path,
                    joints=moment.joints,
                    seed=seed,
                    out=kept,
                    windows=windows,
                    fraction=fraction,
                    stride=stride,
                )
        kept |= seen
        return seen


def _centres(boxes: NDArray[np.generic]) -> Floats:
    """Of half-open boxes (N, 4), in pixels whose centres are integers."""
    whole = np.asarray(boxes, dtype=np.float64)
    return (whole[:, :2] + whole[:, 2:] - 1.0) / 2.0
