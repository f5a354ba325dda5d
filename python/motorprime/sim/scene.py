"""The scene: a table in reach, a red glass, other kitchenware, a textured room; all from one seed."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..errors import ArgumentError, StateError
from .glass import Glass, StandingGlass
from .meshes import write_lathe, write_plane
from .world import World, pybullet, rub

TABLE_HEIGHT = -0.06  # of the table's top in the root frame [m]: elbow height of an upright iCub
TABLE_THICKNESS = 0.03
REGION = ((-0.34, -0.22), (0.0, 0.20))  # x and y where a drawn glass stands [m]
HAND_ROOM = 0.16  # depth of the free strip beside and before the glass, from its axis [m]: fingers are long
TABLE_X, TABLE_Y = (-0.62, -0.15), (-0.45, 0.45)


SMALL_GLASS = Glass(radius=0.014, height=0.056)
CANISTER = Glass(radius=0.03, height=0.13, rgb=(0.04, 0.58, 0.62), mass=0.4)
"""What may stand in the way: of a colour that nothing else has."""


@dataclass(frozen=True)
class Thing:
    """A piece of kitchenware: a lathe profile of (radius, height) points [m] and a colour."""

    name: str
    profile: tuple[tuple[float, float], ...]
    rgb: tuple[float, float, float]
    mass: float = 0.2

    @property
    def radius(self) -> float:
        """Largest radius [m]."""
        return max(radius for radius, _ in self.profile)


KITCHENWARE = (
    Thing("mug", ((0.034, 0.0), (0.036, 0.01), (0.036, 0.085)), (0.13, 0.32, 0.68)),
    Thing("bowl", ((0.025, 0.0), (0.045, 0.02), (0.058, 0.05)), (0.92, 0.78, 0.20)),
    Thing("bottle", ((0.028, 0.0), (0.03, 0.09), (0.012, 0.13), (0.012, 0.16)), (0.10, 0.42, 0.18)),
    Thing("jar", ((0.03, 0.0), (0.032, 0.06), (0.026, 0.07), (0.028, 0.085)), (0.80, 0.42, 0.12)),
    Thing("cup", ((0.02, 0.0), (0.032, 0.05), (0.034, 0.07)), (0.93, 0.92, 0.88)),
    Thing("tin", ((0.027, 0.0), (0.027, 0.09)), (0.45, 0.20, 0.55)),
)


@dataclass(frozen=True)
class Layout:
    """Where things stand: the glass's axis (x, y) [m], and kitchenware at (x, y)."""

    glass: Glass
    glass_xy: tuple[float, float]
    clutter: tuple[tuple[Thing, tuple[float, float]], ...] = ()
    textures: int = 0


def draw_layout(
    generator: np.random.Generator,
    *,
    glass: Glass | None = None,
    at: tuple[float, float] | None = None,
    clutter: int = 4,
) -> Layout:
    """A random layout with room for a hand beside the glass.

    Args:
        generator: draws everything.
        glass: the target; default a glass of 6.5 x 10 cm.
        at: the glass's x and y [m] in the root frame; drawn within the arm's reach if not given.
        clutter: pieces of kitchenware.

    Raises:
        ArgumentError: ``at`` is not on the table.
        StateError: that many things do not fit.
    """
    glass = glass or Glass()
    drawn = np.array([generator.uniform(*bounds) for bounds in REGION])
    place = drawn if at is None else _on_table(at, glass)
    placed: list[tuple[Thing, Floats]] = []
    order = generator.permutation(len(KITCHENWARE))
    for k in range(clutter):
        thing = KITCHENWARE[order[k % len(KITCHENWARE)]]
        for _ in range(500):
            spot = np.array(
                [
                    generator.uniform(TABLE_X[0] + 0.07, TABLE_X[1] - 0.07),
                    generator.uniform(TABLE_Y[0] + 0.07, TABLE_Y[1] - 0.07),
                ]
            )
            if _has_room(spot, thing, place, glass, placed):
                placed.append((thing, spot))
                break
        else:
            raise StateError(
                f"clutter: {clutter} things do not fit on the table beside the glass; ask for fewer"
            )
    return Layout(
        glass,
        (float(place[0]), float(place[1])),
        tuple((thing, (float(spot[0]), float(spot[1]))) for thing, spot in placed),
        int(generator.integers(2**31)),
    )


def _on_table(at: tuple[float, float], glass: Glass) -> Floats:
    """``at`` when the whole foot of the glass stands on the table there."""
    for value, (low, high), axis in zip(at, (TABLE_X, TABLE_Y), "xy", strict=True):
        if not low + glass.radius <= value <= high - glass.radius:
            raise ArgumentError(
                f"at: {axis} = {value} m is not on the table; from {low + glass.radius:.3f} to "
                f"{high - glass.radius:.3f} m the glass stands on it"
            )
    return np.array(at, dtype=np.float64)


def _has_room(
    spot: Floats, thing: Thing, glass_at: Floats, glass: Glass, placed: Sequence[tuple[Thing, Floats]]
) -> bool:
    if any(np.linalg.norm(spot - other) < thing.radius + t.radius + 0.03 for t, other in placed):
        return False
    offset = spot - glass_at
    if np.linalg.norm(offset) < glass.radius + thing.radius + 0.05:
        return False
    # The eyes look from the near side, and the hand comes from the right: keep both free, the latter up to
    # the table's edge: kitchenware is none of the obstacles that the robot has a detector for.
    if offset[0] > -HAND_ROOM - thing.radius and offset[1] > -glass.radius - thing.radius:
        return False
    return not (offset[0] > -0.02 and np.linalg.norm(offset) < 0.24)


class Scene:
    """A layout that stands in a world.

    The object poses here are the truth. Nothing above the simulator may steer by them; they serve to build
    experiments and to judge them.

    Attributes:
        folder: of meshes and textures, as long as the scene stands.
    """

    def __init__(self, world: World, layout: Layout) -> None:
        self.world, self.layout = world, layout
        self._files = tempfile.TemporaryDirectory(prefix="motorprime-")
        folder = self.folder = Path(self._files.name)
        generator = np.random.default_rng(layout.textures)
        self.glass: int | None = StandingGlass(
            world, layout.glass, layout.glass_xy, TABLE_HEIGHT, folder / "glass.obj"
        ).body
        self.obstacle: int | None = None
        self.clutter = [
            _stand_thing(world, folder, thing, spot, k) for k, (thing, spot) in enumerate(layout.clutter)
        ]
        # Last, because what is hidden by earlier bodies costs the renderer no shading.
        self.table = _build_room(world, folder, generator)
        world.step(24)

    def glass_pose(self) -> tuple[Floats, Floats]:
        """True centre (3,) [m] of the glass and the direction (3,) of its axis.

        Raises:
            StateError: the scene has no glass.
        """
        if self.glass is None:
            raise StateError("the scene has no glass")
        place, turn = self.world.bullet.getBasePositionAndOrientation(self.glass)
        axis = np.reshape(self.world.bullet.getMatrixFromQuaternion(turn), (3, 3))[:, 2]
        return np.array(place), axis

    def name_of(self, body: int) -> str:
        """What a body is: 'glass', 'obstacle', 'table', the name of a piece of kitchenware, or 'room'."""
        if body == self.glass:
            return "glass"
        if body == self.obstacle:
            return "obstacle"
        if body == self.table:
            return "table"
        if body in self.clutter:
            return self.layout.clutter[self.clutter.index(body)][0].name
        return "room"

    def on_table(self, at: Floats, radius: float) -> bool:
        """Whether a foot of that radius at x, y (2,) [m] stands on the table as a whole."""
        bounds = zip(at, (TABLE_X, TABLE_Y), strict=True)
        return all(low + radius <= value <= high - radius for value, (low, high) in bounds)

    def stand_obstacle(self, shape: Glass, at: tuple[float, float]) -> None:
        """Let an obstacle appear at x, y [m] on the table.

        Raises:
            StateError: there is one already.
        """
        if self.obstacle is not None:
            raise StateError("the scene has an obstacle already")
        place = _on_table(at, shape)
        mesh = self.folder / "obstacle.obj"
        self.obstacle = StandingGlass(self.world, shape, place.tolist(), TABLE_HEIGHT, mesh).body

    def remove_obstacle(self) -> None:
        """Take the obstacle away."""
        if self.obstacle is not None:
            self.world.bullet.removeBody(self.obstacle)
            self.obstacle = None

    def touching_glass(self) -> set[str]:
        """Names of what touches the glass now, but for the robot."""
        others = set() if self.glass is None else self.world.touching(self.glass)
        return {self.name_of(body) for body in others - {self.world.body}}

    def move_glass(self, at: tuple[float, float]) -> None:
        """Put the glass, at rest and upright, at x, y [m] on the table: somebody has moved it.

        Raises:
            StateError: the scene has no glass.
            ArgumentError: that is not on the table.
        """
        if self.glass is None:
            raise StateError("the scene has no glass")
        x, y = _on_table(at, self.layout.glass)
        bullet = self.world.bullet
        height = TABLE_HEIGHT + self.layout.glass.height / 2
        bullet.resetBasePositionAndOrientation(self.glass, (x, y, height), (0, 0, 0, 1))
        bullet.resetBaseVelocity(self.glass, (0, 0, 0), (0, 0, 0))

    def remove_glass(self) -> None:
        """Take the glass away."""
        if self.glass is not None:
            self.world.bullet.removeBody(self.glass)
            self.glass = None

    def close(self) -> None:
        """Remove the textures' folder."""
        self._files.cleanup()


def _mesh(world: World, path: Path, rgb: Sequence[float]) -> int:
    return int(world.bullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(path), rgbaColor=[*rgb, 1]))


def _body(
    world: World,
    visual: int,
    collision: int,
    at: Sequence[float],
    mass: float = 0.0,
) -> int:
    return int(
        world.bullet.createMultiBody(
            baseMass=mass,
            baseVisualShapeIndex=visual,
            baseCollisionShapeIndex=collision,
            basePosition=list(at),
        )
    )


def _stand_thing(world: World, folder: Path, thing: Thing, spot: tuple[float, float], k: int) -> int:
    mesh = str(write_lathe(folder / f"{thing.name}-{k}.obj", thing.profile))
    bullet = world.bullet
    return _body(
        world,
        _mesh(world, Path(mesh), thing.rgb),
        bullet.createCollisionShape(pybullet.GEOM_MESH, fileName=mesh),
        (*spot, TABLE_HEIGHT + 0.0005),
        mass=thing.mass,
    )


def _build_room(world: World, folder: Path, generator: np.random.Generator) -> int:
    """Table, floor and walls; returns the table."""
    bullet = world.bullet
    depth, width = TABLE_X[1] - TABLE_X[0], TABLE_Y[1] - TABLE_Y[0]
    half = (depth / 2, width / 2, TABLE_THICKNESS / 2)
    middle = (sum(TABLE_X) / 2, sum(TABLE_Y) / 2, TABLE_HEIGHT - TABLE_THICKNESS / 2)
    top = write_plane(folder / "top.obj", (half[0], -half[1], half[2]), (0, width, 0), (-depth, 0, 0))
    wood = _wood(generator)
    table = _body(
        world,
        _mesh(world, top, (1, 1, 1)),
        bullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half),
        middle,
    )
    rub(bullet, table)
    _paint(world, table, folder / "top.png", wood)
    near, far, left, right, low = (
        TABLE_X[1],
        TABLE_X[0],
        TABLE_Y[0],
        TABLE_Y[1],
        TABLE_HEIGHT - TABLE_THICKNESS,
    )
    edge = (wood * 0.6).astype(np.uint8)
    # corner, edge along, edge up: seen from the side of along x up
    surfaces = {
        "near-edge": ((near, left, low), (0, width, 0), (0, 0, TABLE_THICKNESS), edge),
        "far-edge": ((far, right, low), (0, -width, 0), (0, 0, TABLE_THICKNESS), edge),
        "left-edge": ((far, left, low), (depth, 0, 0), (0, 0, TABLE_THICKNESS), edge),
        "right-edge": ((near, right, low), (-depth, 0, 0), (0, 0, TABLE_THICKNESS), edge),
        "back": ((-1.7, -1.9, -0.75), (0, 3.8, 0), (0, 0, 2.0), _wallpaper(generator)),
        "front": ((0.9, 1.9, -0.75), (0, -3.8, 0), (0, 0, 2.0), _wallpaper(generator)),
        "left": ((0.9, -1.9, -0.75), (-2.6, 0, 0), (0, 0, 2.0), _wallpaper(generator)),
        "right": ((-1.7, 1.9, -0.75), (2.6, 0, 0), (0, 0, 2.0), _wallpaper(generator)),
        "floor": ((0.9, -1.9, -0.75), (0, 3.8, 0), (-2.6, 0, 0), _wallpaper(generator)),
    }
    for name, (corner, along, up, texture) in surfaces.items():
        mesh = write_plane(folder / f"{name}.obj", corner, along, up)
        _paint(
            world, _body(world, _mesh(world, mesh, (1, 1, 1)), -1, (0, 0, 0)), folder / f"{name}.png", texture
        )
    stand = write_lathe(folder / "stand.obj", ((0.16, -0.75), (0.05, -0.73), (0.05, -0.12)))
    _body(world, _mesh(world, stand, (0.3, 0.32, 0.35)), -1, (0, 0, 0))
    return table


def _paint(world: World, body: int, path: Path, texture: NDArray[np.uint8]) -> None:
    if not cv2.imwrite(str(path), texture[..., ::-1]):
        raise StateError(f"could not write the texture {path}")
    world.bullet.changeVisualShape(body, -1, textureUniqueId=world.bullet.loadTexture(str(path)))


def _smooth_noise(generator: np.random.Generator, cells: tuple[int, int], size: tuple[int, int]) -> Floats:
    coarse = generator.uniform(-1.0, 1.0, cells)
    return np.asarray(cv2.resize(coarse, size[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.float64)


def _wood(generator: np.random.Generator) -> NDArray[np.uint8]:
    """Planks with grain, in a dull brown."""
    grain = _smooth_noise(generator, (128, 4), (256, 256)) + 0.5 * _smooth_noise(
        generator, (256, 12), (256, 256)
    )
    base = np.array([146.0, 126.0, 104.0]) + generator.uniform(-12, 12, 3)
    return np.clip(base + 10.0 * grain[..., None], 0, 255).astype(np.uint8)


def _wallpaper(generator: np.random.Generator) -> NDArray[np.uint8]:
    """Blotches and rectangles in muted colours."""
    base = generator.uniform(120, 185) + generator.uniform(-14, 14, 3)
    texture = base + 9.0 * np.stack([_smooth_noise(generator, (8, 8), (256, 256)) for _ in range(3)], -1)
    for _ in range(14):
        corner, extent = generator.integers(0, 220, 2), generator.integers(10, 50, 2)
        tone = generator.uniform(70, 205) + generator.uniform(-25, 25, 3)
        rows, columns = (slice(int(c), int(c + e)) for c, e in zip(corner, extent, strict=True))
        texture[rows, columns] = 0.35 * texture[rows, columns] + 0.65 * tone
    return np.clip(texture, 0, 255).astype(np.uint8)
