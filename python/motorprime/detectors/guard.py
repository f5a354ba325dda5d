"""A detector that fails in the middle of a frame ends that frame, not the loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentTypeError
from ..where import Where
from .base import Detections, Detector


class Guarded:
    """A detector whose errors are reported in what it returns.

    A frame in which it raises, or returns something else than Detections, has no findings, and its
    ``failure`` names what happened. The next frame is tried as usual.

    Args:
        detector: what detects.
        report: called with each error, for a log.

    Attributes:
        failures: frames that failed so far.
        error: the last error, with its traceback; None before the first.
    """

    def __init__(self, detector: Detector, report: Callable[[Exception], None] | None = None) -> None:
        if not isinstance(detector, Detector):
            raise ArgumentTypeError(
                f"detector: something with detect(image, where) expected, got {type(detector).__name__}"
            )
        self.detector, self.report = detector, report
        self.failures = 0
        self.error: Exception | None = None

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect, or say in ``failure`` why not."""
        try:
            found = self.detector.detect(image, where)
            if not isinstance(found, Detections):
                raise ArgumentTypeError(
                    f"detections: {type(self.detector).__name__} returned {type(found).__name__}"
                )
            return found
        except Exception as error:  # whatever a detector may raise: that is what this is for
            self.failures += 1
            self.error = error
            if self.report is not None:
                self.report(error)
            return Detections(failure=f"{type(error).__name__}: {error}")
