"""How far a cost model is off at this moment, learned from every call: other programs come and go."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ._arrays import fixed, not_negative, positive
from .errors import ArgumentError

_STEP, _FIRST = 0.05, 0.7  # at most, of the factor's logarithm, by every batch and by the first one
_LIMIT = math.log(50.0)


@dataclass(eq=False)
class Pace:
    """Two running estimates. Both move by steps of a limited size, so that no outlier carries them away.

    Attributes:
        quantile: share of the cycles that are to end in time, in [0.5, 1).
        step: by which the reserve grows with a cycle that was late [s]; one that was not lets it shrink by
            (1 - quantile) / quantile of that, and so the late ones come to their share.
        factor: how many times as long as the model says a batch takes as a rule.
        reserve: time [s] to be kept free at the end of a cycle, for what comes on top of the batches: the
            clock, the merging, and another program that takes the processor away.
        share: of a budget that is kept free at most, in [0, 1): where programs crowd so much that this is too
            little, no more time is given away for them.

    Raises:
        ArgumentError: a number outside its domain.
    """

    quantile: float = 0.99
    step: float = 0.00025
    factor: float = 1.0
    reserve: float = 0.0
    share: float = 0.125
    _batches: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.5 <= float(fixed("quantile", self.quantile, ())) < 1.0:
            raise ArgumentError(f"quantile: a share in [0.5, 1) expected, got {self.quantile}")
        positive("step", self.step)
        positive("factor", self.factor)
        not_negative("reserve", self.reserve)
        if not 0.0 <= float(fixed("share", self.share, ())) < 1.0:
            raise ArgumentError(f"share: a share in [0, 1) expected, got {self.share}")

    def usable(self, budget: float) -> float:
        """How much of a budget [s] is for looking."""
        return budget - min(self.reserve, self.share * budget)

    def ran(self, predicted: float, seconds: float) -> None:
        """A batch that was predicted to take so long took ``seconds``."""
        self._batches += 1
        # Large at first: what the first cycles are late by is the model's fault, and no matter of a reserve.
        step = max(_STEP, _FIRST / math.sqrt(self._batches))
        log = math.log(self.factor)
        off = min(max(math.log(max(seconds / predicted, 1e-9)) - log, -step), step)
        self.factor = math.exp(min(max(log + off, -_LIMIT), _LIMIT))

    def ended(self, budget: float, seconds: float) -> None:
        """A cycle with this budget took ``seconds``."""
        if seconds <= budget:
            shrink = self.step * (1.0 - self.quantile) / self.quantile
            self.reserve = max(self.reserve - shrink, 0.0)
        elif self.reserve < self.share * budget:  # more than can be kept free would only have to shrink again
            self.reserve += self.step
