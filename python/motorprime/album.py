"""The pictures of a run that tell its story, kept as JPEG while it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from .errors import StateError
from .report import Shot
from .viz import Picture

if TYPE_CHECKING:
    from .tasks.cycle import Cycle

QUALITY = 88  # of JPEG pictures
LEAD = "On the way"
HAPPENING = "Something happens"  # until it is known what

_ALONG = "Attention follows the planned path from the hand to the target"
_MOMENTS = {
    "Search": "Fresh windows every cycle, sampled from the space that the arm can reach",
    "Still searching": "The last look before the search ended",
    "Found": "Windows hit the target in both eyes; its position is triangulated",
    "Fixation": "The eyes have turned to the target and look again from there",
    "Survey": "A mental simulation says which way the hand would take; the robot looks along it for what "
    "stands there",
    "Reach begins": "The plan leads past what was seen, where anything was; attention follows it from the "
    "hand to the target",
    LEAD: _ALONG,
    HAPPENING: "What the robot knew is no longer so; it looks, and plans anew",
    "Arrival": "The palm is beside the target, and hides part of it",
    "Grasp": "The hand has closed around the target; what it leaves free is still seen",
    "Lift": "Thumb and fingers hold the target by friction alone",
}
"""Moments of a run in their order, and what happens in each."""

_OUTSIDE = {
    "Start": "The robot looks for the glass",
    "Reach begins": "The hand sets out",
    LEAD: "The hand is on its way",
    "Arrival": "The hand is in place",
    "Grasp": "The hand has closed",
    "Lift": "The hand has lifted what it holds",
}
"""The same as a bystander sees them."""


class Album:
    """Keeps the pictures of a run that tell its story; the latest of a moment, unless its first counts."""

    def __init__(self) -> None:
        self._eyes: dict[str, bytes] = {}
        self._views: dict[str, bytes] = {}
        self._frames: dict[str, bytes] = {}
        self._event = HAPPENING
        self._reach: list[tuple[int, bytes, bytes | None, bytes | None]] = []

    def keep(self, cycle: Cycle, panel: Picture, frame: Picture | None, view: Picture | None) -> None:
        """Keep what a cycle has to tell.

        Args:
            cycle: of a task.
            panel: what both eyes saw.
            frame: of the video.
            view: the bystander's.
        """
        eyes, shown, seen = (None if each is None else jpeg(each) for each in (panel, frame, view))
        assert eyes is not None
        if cycle.phase == "reach":
            self._reach.append((len(cycle.legs), eyes, shown, seen))
        moment, first = self._moment(cycle)
        if seen is not None:
            self._views.setdefault("Start", seen)
        if cycle.event:
            self._eyes[HAPPENING], self._event = eyes, cycle.event
        for pictures, picture in ((self._eyes, eyes), (self._frames, shown), (self._views, seen)):
            if picture is not None and not (first and moment in pictures):
                pictures[moment] = picture

    def _moment(self, cycle: Cycle) -> tuple[str, bool]:
        """Which moment a cycle belongs to, and whether the first of it is kept."""
        if cycle.phase == "reach":
            return ("Arrival", False) if len(self._reach) > 1 else ("Reach begins", True)
        if cycle.phase != "search":
            named = {"fixate": "Fixation", "survey": "Survey", "grasp": "Grasp", "lift": "Lift"}
            return named.get(cycle.phase, cycle.phase), False
        if cycle.sight.located is not None:
            return "Found", True
        return ("Still searching", False) if "Search" in self._eyes else ("Search", True)

    def _on_the_way(self) -> tuple[int, bytes, bytes | None, bytes | None] | None:
        """The middle of a reach, and where a via-point is passed, the end of the way there."""
        if len(self._reach) < 3:
            return None
        around = [k for k, (legs, *_) in enumerate(self._reach) if legs > 2]
        return self._reach[around[-1] if around else len(self._reach) // 2]

    @property
    def poster(self) -> bytes | None:
        """What the video shows before it plays."""
        middle = self._on_the_way()
        frames = [None if middle is None else middle[2], *self._frames.values()]
        return next((frame for frame in frames if frame is not None), None)

    def shots(self) -> list[Shot]:
        """What the eyes saw, in the order of the run."""
        kept, middle = dict(self._eyes), self._on_the_way()
        if "Found" in kept:
            kept.pop("Still searching", None)
        if middle is not None:
            kept[LEAD] = middle[1]
        titled = {moment: self._event if moment == HAPPENING else moment for moment in _MOMENTS}
        return [
            _shot(titled[moment], told, f"What both eyes saw. {titled[moment]}: {told}.", kept[moment])
            for moment, told in _MOMENTS.items()
            if moment in kept
        ]

    def outside(self) -> list[Shot]:
        """What a bystander saw, in the order of the run; nothing without a bystander."""
        kept, middle = dict(self._views), self._on_the_way()
        if middle is not None and middle[3] is not None:
            kept[LEAD] = middle[3]
        return [
            _shot(moment, told, f"The robot from outside. {told}.", kept[moment])
            for moment, told in _OUTSIDE.items()
            if moment in kept
        ]


def _shot(moment: str, told: str, alt: str, picture: bytes) -> Shot:
    return Shot(moment, f"{told}.", alt, picture, "image/jpeg", lead=moment == LEAD)


def jpeg(picture: Picture) -> bytes:
    """A picture (H, W, 3) as JPEG."""
    done, encoded = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:  # pragma: no cover - OpenCV without JPEG
        raise StateError("picture: this OpenCV cannot encode JPEG")
    return encoded.tobytes()
