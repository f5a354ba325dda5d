"""What happens to the scene while the robot reaches: the experimenter's side, which knows the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from .._arrays import Floats
from ..errors import StateError
from ..sim.glass import Glass
from ..sim.scene import REGION, Scene
from .cycle import Cycle

JUMP = 0.10  # of the glass [m]
ATTEMPTS = 100  # at a place
TRIED = 4  # of these that have room, whether the glass can still be grasped
GLASS_ROOM = 0.08  # between the surfaces of glass and obstacle [m]: the hand's fingers close there
HAND_ROOM = 0.08  # between the palm and the surface of an obstacle that appears [m]
ROOM = 0.02  # between the surfaces of the obstacle and any other thing [m]
BESIDE = 0.03  # an obstacle is at most so far from the straight way [m]
BETWEEN = (0.35, 0.7)  # part of the way from palm to glass


@dataclass
class Disturbance:
    """Lets the glass jump or an obstacle appear, once, some time after the hand has set out.

    Attributes:
        after: seconds from the first cycle of the reach.
        obstacle: what appears; None lets the glass jump.
        leaves_room: as of :func:`spot_between`; for a glass that jumps, whether it can be grasped at a place.
        happened: whether it did.
    """

    generator: np.random.Generator
    after: float
    obstacle: Glass | None
    leaves_room: Callable[[tuple[float, float]], bool]
    happened: bool = field(default=False, init=False)
    _since: float | None = field(default=None, init=False)

    def watch(self, cycle: Cycle, scene: Scene, palm: Floats) -> None:
        """Called after every cycle of the task."""
        if cycle.phase != "reach" or self.happened:
            return
        if self._since is None:
            self._since = cycle.time
        if cycle.time - self._since < self.after:
            return
        try:
            if self.obstacle is None:
                scene.move_glass(spot_beside(scene, palm, self.generator, self.leaves_room))
            else:
                spot = spot_between(scene, self.obstacle, palm, self.generator, self.leaves_room)
                scene.stand_obstacle(self.obstacle, spot)
        except StateError:
            return  # no room now; perhaps at the next cycle
        self.happened = True


def spot_beside(
    scene: Scene,
    palm: Floats,
    generator: np.random.Generator,
    leaves_room: Callable[[tuple[float, float]], bool],
) -> tuple[float, float]:
    """A place in reach, :data:`JUMP` from where the glass stands, with room for it and not under the hand.

    Args:
        scene: with the glass.
        palm: where the hand is (3,) [m].
        generator: draws.
        leaves_room: says of a place whether the glass can be grasped there.

    Raises:
        StateError: none was found.
    """
    here, radius = scene.glass_pose()[0][:2], scene.layout.glass.radius

    def spots() -> Iterator[Floats]:
        for angle in generator.uniform(0.0, 2.0 * np.pi, ATTEMPTS):
            spot = here + JUMP * np.array([np.cos(angle), np.sin(angle)])
            inside = all(low <= value <= high for value, (low, high) in zip(spot, REGION, strict=True))
            away = float(np.linalg.norm(spot - palm[:2])) - radius
            if inside and away > HAND_ROOM and _room(scene, spot, radius, GLASS_ROOM):
                yield spot

    return _first(spots(), leaves_room, "glass: no place 10 cm off is free and in reach")


def spot_between(
    scene: Scene,
    shape: Glass,
    palm: Floats,
    generator: np.random.Generator,
    leaves_room: Callable[[tuple[float, float]], bool],
) -> tuple[float, float]:
    """A place for an obstacle on the way from the palm (3,) [m] to the glass, with room around it.

    Args:
        scene: with the glass.
        shape: of the obstacle.
        palm: where the hand is.
        generator: draws.
        leaves_room: says of a place whether the glass can still be grasped when something stands there.

    Raises:
        StateError: none was found.
    """
    glass, radius = scene.glass_pose()[0][:2], scene.layout.glass.radius
    way = glass - palm[:2]
    length = float(np.linalg.norm(way))
    if length < 1e-6:
        raise StateError("obstacle: the palm is over the glass")
    across = np.array([-way[1], way[0]]) / length

    def spots() -> Iterator[Floats]:
        for _ in range(ATTEMPTS):
            spot = palm[:2] + generator.uniform(*BETWEEN) * way + generator.uniform(-BESIDE, BESIDE) * across
            apart = float(np.linalg.norm(spot - glass)) - radius - shape.radius
            hand = float(np.linalg.norm(spot - palm[:2])) - shape.radius
            roomy = apart > GLASS_ROOM and hand > HAND_ROOM and _room(scene, spot, shape.radius, ROOM)
            if roomy and scene.on_table(spot, shape.radius):
                yield spot

    return _first(spots(), leaves_room, "obstacle: there is no room for one between the hand and the glass")


def spot_anywhere(
    scene: Scene, generator: np.random.Generator, leaves_room: Callable[[tuple[float, float]], bool]
) -> tuple[float, float]:
    """A place in reach for the glass, with room around it; as :func:`spot_beside` otherwise.

    Raises:
        StateError: none was found.
    """
    radius = scene.layout.glass.radius

    def spots() -> Iterator[Floats]:
        for _ in range(ATTEMPTS):
            spot = np.array([generator.uniform(*bounds) for bounds in REGION])
            if _room(scene, spot, radius, ROOM):
                yield spot

    return _first(spots(), leaves_room, "glass: no place in reach is free")


def _first(
    spots: Iterator[Floats], leaves_room: Callable[[tuple[float, float]], bool], why: str
) -> tuple[float, float]:
    """The first of a few places that leaves room."""
    for spot in islice(spots, TRIED):
        place = float(spot[0]), float(spot[1])
        if leaves_room(place):
            return place
    raise StateError(why)


def _room(scene: Scene, spot: Floats, radius: float, apart: float) -> bool:
    """Whether a thing of that radius would keep ``apart`` [m] off kitchenware."""
    return all(
        float(np.linalg.norm(spot - np.array(at))) - radius - thing.radius > apart
        for thing, at in scene.layout.clutter
    )
