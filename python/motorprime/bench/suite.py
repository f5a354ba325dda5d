"""Which kernels are measured, by the names of the JSON, and what is asked of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import ArgumentError
from . import cases
from .scene import STRIDE, Scene
from .step import attention_step

Build = Callable[[Scene], list[cases.Case]]

SUITE: dict[str, Build] = {
    "triangular": lambda s: [cases.triangular(s, "triangular", 100, 40.0)],
    "triangular_wide": lambda s: [cases.triangular(s, "triangular_wide", 100, 120.0)],
    "triangular_400": lambda s: [cases.triangular(s, "triangular_400", 400, 40.0)],
    "gaussian": lambda s: [cases.gaussian(s, "gaussian")],
    "gibbs": lambda s: [cases.gibbs(s, "gibbs")],
    "sample": lambda s: [cases.sample(s, "sample")],
    "threshold": lambda s: [cases.threshold(s, "threshold", content) for content in ("landscape", "random")],
    "threshold_quicksort_4800": lambda s: [
        cases.threshold(s, "threshold_quicksort_4800", stride=STRIDE, method="quicksort")
    ],
    "threshold_select_4800": lambda s: [cases.threshold(s, "threshold_select_4800", stride=STRIDE)],
    "mlp": lambda s: [cases.mlp(s, "mlp")],
    "attention_step": lambda s: [attention_step(s, "attention_step")],
}
"""Builders of every kernel's cases, one for each input."""

SIZED = (
    "triangular",
    "triangular_wide",
    "triangular_400",
    "gaussian",
    "gibbs",
    "sample",
    "threshold",
    "attention_step",
)
"""Kernels whose work grows with the image; they are measured at 1920 x 1080 as well."""

MAY_LOSE = ("threshold_quicksort_4800",)
"""Kernels that are there because the paper has them, not because they are the fastest."""


@dataclass(frozen=True)
class Target:
    """A limit on a figure of a kernel's entry: ``memcpy_ratio``, ``speedup``, ``growth`` or ``beside``."""

    figure: str
    limit: float

    @property
    def at_least(self) -> bool:
        """Whether more is better."""
        return self.figure == "speedup"

    def judge(self, seen: float | None) -> dict[str, Any]:
        """The target beside what was seen."""
        met = None if seen is None else (seen >= self.limit if self.at_least else seen <= self.limit)
        return {"figure": self.figure, "limit": self.limit, "seen": seen, "met": met}


def _targets(
    copies: float | None = None, faster: float | None = None, beside: float | None = None
) -> list[Target]:
    figures = {"memcpy_ratio": copies, "speedup": faster, "times_triangular": beside}
    return [Target(figure, limit) for figure, limit in figures.items() if limit is not None]


TARGETS: dict[str, list[Target]] = {
    "triangular": _targets(8.0, 8.0),
    "triangular_wide": _targets(beside=1.6),
    "triangular_400": _targets(beside=3.0),
    "gaussian": _targets(4.0, 4.0),
    "gibbs": _targets(6.0, 20.0),
    "sample": _targets(6.0, 5.0),
    "threshold": _targets(12.0, 2.5),
    "threshold_quicksort_4800": [],
    "threshold_select_4800": _targets(2.0, 1.5),
    "mlp": _targets(faster=1.5),
    "attention_step": _targets(34.0, 10.0),
}
GROWTH = Target("growth", 1.5)


def chosen(names: Sequence[str]) -> list[str]:
    """The kernels of these names in the suite's order; all without a name.

    Raises:
        ArgumentError: there is no kernel of that name.
    """
    for name in names:
        if name not in SUITE:
            raise ArgumentError(f"kernel: one of {', '.join(SUITE)} expected, got '{name}'")
    return [name for name in SUITE if not names or name in names]
