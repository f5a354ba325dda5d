"""What a reach reports of itself: its settings, and a record of every vision cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, integer, not_negative, positive
from ..attention import Look
from ..cylinder import Cylinder, Located, Polygon
from ..errors import ArgumentError
from .explore import Sight


@dataclass(frozen=True)
class Settings:
    """How the task looks and moves.

    Attributes:
        windows: fresh windows per eye and cycle; their ``size`` [px].
        mixing: pi of Eq. 10 for the peripersonal search.
        width: kernel width of the motor plan [px]; None for 40 at 320 x 240, scaled.
        patience: cycles in one posture before the robot looks elsewhere.
        postures: postures to search from before giving up.
        slack: how far [px] the projection may be off. If at all, the target is taken to stand on the bench,
            of which the robot knows better how high it is.
        compare: run the full-frame scan beside every cycle; its result is never used.
    """

    windows: int = 50
    size: int = 20
    mixing: float = 0.2
    width: float | None = None
    patience: int = 6
    postures: int = 12
    slack: float = 0.0
    compare: bool = True

    def __post_init__(self) -> None:
        for name in ("windows", "size", "patience", "postures"):
            integer(name, getattr(self, name), at_least=1)
        if not 0.0 <= self.mixing <= 1.0:
            raise ArgumentError(f"mixing: from 0 to 1 expected, got {self.mixing}")
        not_negative("slack", self.slack)
        if self.width is not None:
            positive("width", self.width)


@dataclass(frozen=True)
class FullFrame:
    """The full-frame scan beside a cycle.

    Attributes:
        seconds: time of the scan [s].
        back_projection: time of the short cut, a back-projection of both images with its largest region [s].
        located: what the scan located.
    """

    seconds: float
    back_projection: float
    located: Located | None


@dataclass(frozen=True)
class Cycle:
    """One vision cycle.

    Attributes:
        phase: 'search', 'fixate', 'survey', 'reach', 'grasp' or 'lift'.
        time: since the start [s].
        joints: gaze posture [rad].
        images: what the eyes saw.
        looks: the landscape in each camera that has one.
        sight: where was looked and what was found.
        path: planned points of the hand (N, 3) [m], and the same in each image.
        estimate: where the target is believed to be (3,) [m].
        palm: the palm's place by the encoders (3,) [m].
        goal: where the palm is to end (3,) [m].
        obstacles: what is known to stand in the way: centre (3,) [m] and shape.
        outlines: of these in each image, each (M, 2) of (u, v); those that are in front of it.
        legs: where the palm is to be at the end of each leg that is left of the plan, (3,) [m].
        opening: of the hand, as commanded; None before the hand has a plan.
        event: what somebody has done to the scene since the last cycle; mostly empty.
        seconds: time of each stage [s].
        full: the full-frame scan beside it.
    """

    phase: str
    time: float
    joints: Floats
    images: Mapping[str, NDArray[np.uint8]]
    looks: Mapping[str, Look]
    sight: Sight
    palm: Floats
    seconds: Mapping[str, float]
    path: Floats | None = None
    path_pixels: Mapping[str, Floats] = field(default_factory=dict)
    estimate: Floats | None = None
    goal: Floats | None = None
    obstacles: tuple[tuple[Floats, Cylinder], ...] = ()
    outlines: Mapping[str, tuple[Polygon, ...]] = field(default_factory=dict)
    legs: tuple[Floats, ...] = ()
    opening: float | None = None
    event: str = ""
    full: FullFrame | None = None
