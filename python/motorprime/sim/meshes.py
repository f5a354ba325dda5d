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


def write_wrapped(path: Path, profile: Sequence[tuple[float, float]], *, sides: int = SIDES) -> Path:
    """Write the solid that a profile of (radius, height) points [m] sweeps around z, a picture around it.

    The picture's columns go once around, its middle at +x, so that it reads from left to right from outside;
    its rows go from the highest to the lowest point. With 4 sides the solid is a box that faces +x.
    """
    flat = sides < 8  # of a box each side has its own normal
    # Corners half a side before and behind +x: a box faces it. Its back shows the picture's first column.
    angles = -np.pi + 2.0 * np.pi * np.arange(sides + 1) / sides - (np.pi / sides if flat else 0.0)
    columns = np.clip((angles + np.pi) / (2.0 * np.pi), 0.0, 1.0)
    radii, heights = np.array(profile, dtype=np.float64).T
    rows = (heights - heights.min()) / np.ptp(heights)
    lines: list[str] = []
    faces: list[str] = []
    count = 0
    for k in range(sides):
        middle = (angles[k] + angles[k + 1]) / 2.0
        for j in range(len(profile) - 1):
            corners = ((k, j), (k + 1, j), (k + 1, j + 1), (k, j + 1))
            for a, b in corners:
                turn = middle if flat else angles[a]
                place = (radii[b] * np.cos(angles[a]), radii[b] * np.sin(angles[a]), heights[b])
                lines.append("v {:.6f} {:.6f} {:.6f}".format(*place))
                lines.append(f"vt {columns[a]:.6f} {rows[b]:.6f}")
                lines.append(f"vn {np.cos(turn):.6f} {np.sin(turn):.6f} 0")
            faces += _fan(count, 4)
            count += 4
    for j, up in ((0, -1), (len(profile) - 1, 1)):  # closed below and above
        for a in range(sides)[::up]:
            place = (radii[j] * np.cos(angles[a]), radii[j] * np.sin(angles[a]), heights[j])
            lines += ["v {:.6f} {:.6f} {:.6f}".format(*place), f"vt 0.01 {rows[j]:.6f}", f"vn 0 0 {up}"]
        faces += _fan(count, sides)
        count += sides
    path.write_text("\n".join([*lines, *faces]) + "\n")
    return path


def _fan(first: int, corners: int) -> list[str]:
    """Triangles of a polygon whose vertices, texture points and normals follow each other."""
    start = first + 1  # the format counts from 1
    return [
        "f " + " ".join(f"{n}/{n}/{n}" for n in (start, start + k, start + k + 1))
        for k in range(1, corners - 1)
    ]
