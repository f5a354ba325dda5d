"""A glass that can be lifted: an upright cylinder with a weight, drawn from a seed and stood on the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._arrays import Floats, fixed, generator, positive
from .meshes import write_lathe
from .world import World, pybullet, rub

MASSES = (0.080, 0.300)  # [kg]
DIAMETERS = (0.060, 0.075)  # [m]
HEIGHTS = (0.095, 0.105)  # [m]


@dataclass(frozen=True)
class Glass:
    """A straight glass: radius, height [m], mass [kg] and colour."""

    radius: float = 0.0325
    height: float = 0.10
    mass: float = 0.15
    rgb: tuple[float, float, float] = (0.80, 0.06, 0.09)

    def __post_init__(self) -> None:
        for name in ("radius", "height", "mass"):
            positive(name, getattr(self, name))


def draw_glass(seed: int | np.random.Generator | None = None) -> Glass:
    """A glass of 80 to 300 g, 60 to 75 mm wide, about 10 cm high, each drawn uniformly."""
    drawn = generator(seed)
    mass, diameter, height = (float(drawn.uniform(*bounds)) for bounds in (MASSES, DIAMETERS, HEIGHTS))
    return Glass(radius=diameter / 2, height=height, mass=mass)


class StandingGlass:
    """A glass in a world; its poses are the truth, for those who build and judge experiments.

    Args:
        world: with a table top at ``table`` [m].
        glass: what stands there.
        xy: (2,) of its axis [m] in the root frame.
        table: height of what it stands on [m].
        mesh: file to write its mesh to.
    """

    def __init__(self, world: World, glass: Glass, xy: Sequence[float], table: float, mesh: Path) -> None:
        self.world, self.glass, self.table = world, glass, table
        x, y = fixed("xy", list(xy), (2,))
        half, bullet = glass.height / 2, world.bullet
        write_lathe(mesh, ((glass.radius, -half), (glass.radius, half)), sides=48)
        self.body = int(
            bullet.createMultiBody(
                baseMass=glass.mass,
                baseVisualShapeIndex=bullet.createVisualShape(
                    pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[*glass.rgb, 1]
                ),
                baseCollisionShapeIndex=bullet.createCollisionShape(
                    pybullet.GEOM_CYLINDER, radius=glass.radius, height=glass.height
                ),
                basePosition=(x, y, table + half),
            )
        )
        rub(bullet, self.body)

    def pose(self) -> tuple[Floats, Floats]:
        """Centre (3,) [m] and the direction (3,) of the axis."""
        place, turn = self.world.bullet.getBasePositionAndOrientation(self.body)
        axis = np.reshape(self.world.bullet.getMatrixFromQuaternion(turn), (3, 3))[:, 2]
        return np.array(place), axis

    def tilt(self) -> float:
        """Angle [rad] of the axis from upright."""
        return float(np.arccos(np.clip(self.pose()[1][2], -1.0, 1.0)))

    def clearance(self) -> float:
        """Height [m] of the lowest point above the table."""
        (_, _, z), axis = self.pose()
        sine = float(np.hypot(axis[0], axis[1]))
        lowest = z - abs(float(axis[2])) * self.glass.height / 2 - sine * self.glass.radius
        return float(lowest) - self.table

    def touched_by(self) -> set[int]:
        """Bodies that touch the glass now."""
        return self.world.touching(self.body)


def add_table(world: World, top: float, xs: tuple[float, float], ys: tuple[float, float]) -> int:
    """Add a bare table, 3 cm thick, that spans ``xs`` and ``ys`` [m] with its top at ``top`` [m]."""
    half = ((xs[1] - xs[0]) / 2, (ys[1] - ys[0]) / 2, 0.015)
    bullet = world.bullet
    table = int(
        bullet.createMultiBody(
            baseCollisionShapeIndex=bullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half),
            basePosition=(sum(xs) / 2, sum(ys) / 2, top - half[2]),
        )
    )
    rub(bullet, table)
    return table
