"""Ways to choose the windows of a search: those of :mod:`motorprime.looking`, with and without a memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..attention import Look
from ..detectors import Where, Windows
from ..looking import Memory, Strategy, choose_windows
from ..tasks.explore import Finder


@dataclass(eq=False)
class Chooser:
    """Chooses the windows of each cycle of one search, in which the eyes are still.

    Attributes:
        finder: that looks; what it has hit is not in vain.
        looks: the landscapes of a cycle.
        strategy: how windows are drawn.
        remember: whether what was looked at in vain is kept off.
        count: windows per camera and cycle.
        size: of the windows [px].
        generator: draws them.
    """

    finder: Finder
    looks: Callable[[], Mapping[str, Look]]
    strategy: Strategy
    remember: bool
    count: int
    size: int
    generator: np.random.Generator
    _memories: dict[str, Memory] = field(default_factory=dict, init=False)
    _last: dict[str, Windows] = field(default_factory=dict, init=False)

    def __call__(self) -> Mapping[str, Where]:
        """The windows of the next cycle."""
        for camera, windows in self._last.items():
            self._memories[camera].note(self._in_vain(camera, windows))
        self._last.clear()
        chosen = {}
        for camera, look in self.looks().items():
            memory = None
            if self.remember:
                memory = self._memories.setdefault(camera, Memory(_shape(look)))
            chosen[camera] = choose_windows(
                look, self.count, size=self.size, strategy=self.strategy, memory=memory, seed=self.generator
            )
            if self.remember:
                self._last[camera] = chosen[camera]
        return chosen

    def _in_vain(self, camera: str, windows: Windows) -> Windows:
        """The windows that hold nothing of what was hit in this camera so far."""
        corners = windows.corners(
            (self._memories[camera].seen.shape[0], self._memories[camera].seen.shape[1])
        )
        held = np.zeros(len(corners), dtype=np.bool_)
        for silhouette in self.finder.memory.get(camera, ()):
            held |= silhouette.touches(corners, windows.size)
        return Windows(windows.centres[~held], windows.size)


def _shape(look: Look) -> tuple[int, int]:
    return look.landscape.shape[0], look.landscape.shape[1]
