"""Meshes of revolution and spheres, written as Wavefront files that pybullet reads with smooth normals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

SIDES = 32


def write_lathe(path: Path, profile: Sequence[tuple[float, float]], *, sides: int = SIDES) -> Path:
    """Write the solid that a profile of (radius, height) points [m] sweeps around z, closed at both ends."""
    import trimesh

    line = np.array([(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])])
    mesh = trimesh.creation.revolve(line, sections=sides)
    mesh.export(path)
    return path


def write_sphere(path: Path, radius: float, *, subdivisions: int = 4) -> Path:
    """Write a sphere of 20 * 4**subdivisions faces [m]."""
    import trimesh

    trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius).export(path)
    return path


def write_plane(path: Path, corner: Sequence[float], along: Sequence[float], up: Sequence[float]) -> Path:
    """Write a textured rectangle: one corner and two edges from it [m], seen from the side of along x up.

    A box would cost the software renderer its hidden faces too.
    """
    a, e, f = (np.asarray(vector, dtype=np.float64) for vector in (corner, along, up))
    normal = np.cross(e, f) / np.linalg.norm(np.cross(e, f))
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in (a, a + e, a + e + f, a + f)]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vn {:.6f} {:.6f} {:.6f}".format(*normal)]
    lines += ["f 1/1/1 2/2/1 3/3/1", "f 1/1/1 3/3/1 4/4/1"]
    path.write_text("\n".join(lines) + "\n")
    return path
