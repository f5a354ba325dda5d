"""Search for a known object with the eyes still: fresh windows every cycle until both eyes have it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..attention import Look
from ..cylinder import Cylinder, Located, locate_cylinder
from ..detectors import Everywhere, HistogramDetector, Silhouette, Where, Windows
from ..detectors.histogram import Search
from ..detectors.silhouettes import merge
from ..errors import NotInViewError
from ..motorplan import pixel_landscapes
from ..views import Views
from .timing import Stages

MIN_EXPLAINED, MIN_VISIBLE = 0.8, 0.4
"""A position is reported when in every eye its outline covers this fraction of what was segmented, and this
fraction of its outline was segmented: the rest may be hidden."""

THINNED = 20  # of so many places one marks an epipolar line

Images = Mapping[str, NDArray[np.uint8]]


@dataclass(frozen=True)
class Target:
    """What the robot looks for: its shape, and a detector of its colour."""

    shape: Cylinder
    detector: HistogramDetector


@dataclass(frozen=True)
class Sight:
    """What one cycle of looking gave.

    Attributes:
        located: the object's position once every eye has it.
        where: where each camera looked.
        searches: what was found there.
        attended: fraction of all pixels that were looked at.
    """

    located: Located | None
    where: Mapping[str, Where]
    searches: Mapping[str, Search]
    attended: float


@dataclass
class Finder:
    """Looks at images where it is told and reports the target's position.

    Hits are remembered per eye while the posture stays, see :meth:`forget`.

    Attributes:
        level: z [m] at which the middle of the target is known to be; None where it is not.
        slack: how far [px] the projection may be off.
        memory: regions hit so far in each camera, the largest first.
        reported: the silhouettes behind the last report.
    """

    target: Target
    stages: Stages = field(default_factory=Stages)
    level: float | None = None
    slack: float = 0.0
    memory: dict[str, tuple[Silhouette, ...]] = field(default_factory=dict)
    reported: Mapping[str, Silhouette] = field(default_factory=dict)

    def forget(self) -> None:
        """Drop the hits of earlier cycles: the eyes have moved."""
        self.memory.clear()

    def look(self, images: Images, views: Views, where: Mapping[str, Where]) -> Sight:
        """One cycle.

        Args:
            images: {camera: (H, W, 3) uint8 RGB}.
            views: the cameras at the present posture, as the robot believes them to see.
            where: where to look; cameras without an entry are not looked at.
        """
        searches: dict[str, Search] = {}
        with self.stages.time("detection"):
            for camera, there in where.items():
                searches[camera] = self.target.detector.search(images[camera], there)
                self._remember(camera, searches[camera].silhouettes)
        with self.stages.time("triangulation"):
            located = self._locate(views)
        pixels = sum(image.shape[0] * image.shape[1] for image in images.values())
        looked = sum(int(np.count_nonzero(search.attended)) for search in searches.values())
        return Sight(located, where, searches, looked / pixels)

    def complete(
        self, looks: Mapping[str, Look], views: Views, places: Callable[[], Floats]
    ) -> dict[str, Look]:
        """Give a camera without a landscape one along the epipolar line of what another camera has hit.

        A camera has none when hardly any of the reachable space is in its view; the target may be.

        Args:
            looks: the landscapes that there are.
            views: the cameras at the present posture.
            places: gives places (N, 3) [m] where the target may be, when a line is to be drawn; it gets as
                long as their depths are spread.
        """
        completed = dict(looks)
        for camera in views.cameras:
            hits = [other for other in views.cameras if other != camera and self.memory.get(other)]
            if camera in looks or not hits:
                continue
            points = views.along(hits[0], self.memory[hits[0]][0].centroid, places()[::THINNED])
            with contextlib.suppress(NotInViewError):
                line = {camera: views.project(points)[camera]}
                look = Look(pixel_landscapes(line, views.shapes)[camera])
                if not look.is_empty:
                    completed[camera] = look
        return completed

    def _remember(self, camera: str, found: Sequence[Silhouette]) -> None:
        """Keep regions that are new; one that grew, because something moved away, replaces its old self."""
        old = self.memory.get(camera, ())
        fresh = [s for s in found if not any(_contains(o, s.centroid) and o.area >= s.area for o in old)]
        kept = [o for o in old if not any(_contains(s, o.centroid) for s in fresh)]
        if fresh:
            self.memory[camera] = tuple(sorted([*kept, *fresh], key=lambda s: -s.area))

    def _locate(self, views: Views) -> Located | None:
        """The position that explains the hits: of all nearby pieces together, else of the largest alone."""
        cameras = views.cameras
        if any(not self.memory.get(camera) for camera in cameras):
            return None
        together = {camera: merge(self.memory[camera]) for camera in cameras}
        alone = {camera: self.memory[camera][0] for camera in cameras}
        for silhouettes in (
            (together,) if all(together[c] is alone[c] for c in cameras) else (together, alone)
        ):
            located = locate_cylinder(
                views, silhouettes, self.target.shape, level=self.level, slack=self.slack
            )
            if located and located.explained >= MIN_EXPLAINED and located.visible >= MIN_VISIBLE:
                self.reported = silhouettes
                return located
        return None


def _contains(silhouette: Silhouette, pixel: NDArray[np.float64]) -> bool:
    u, v = np.rint(pixel).astype(int) - silhouette.corner
    height, width = silhouette.mask.shape
    return bool(0 <= u < width and 0 <= v < height and silhouette.mask[v, u])


def windows_from(
    looks: Mapping[str, Look], count: int, size: int, generator: np.random.Generator
) -> dict[str, Where]:
    """``count`` fresh windows per camera, sampled from its landscape."""
    return {camera: look.windows(count, size=size, seed=generator) for camera, look in looks.items()}


def windows_anywhere(
    shapes: Mapping[str, tuple[int, int]], count: int, size: int, generator: np.random.Generator
) -> dict[str, Where]:
    """``count`` windows per camera, uniform over the whole image: looking without attention."""
    return {
        camera: Windows(generator.integers((0, 0), (width, height), (count, 2)).astype(np.int32), size)
        for camera, (height, width) in shapes.items()
    }


def everywhere(shapes: Mapping[str, tuple[int, int]]) -> dict[str, Where]:
    """The full scan."""
    return {camera: Everywhere() for camera in shapes}
