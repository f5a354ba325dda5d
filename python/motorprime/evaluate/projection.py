"""``motorprime evaluate projection``: rendered balls against the projection of their outline."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import sphere_outline_centre
from ..errors import StateError
from ..kinematics import apply
from ..projection import KinematicProjection
from ..robot import Robot
from ..sim.cameras import Eyes
from ..sim.meshes import write_sphere
from ..sim.world import World
from ..tasks.staging import random_posture
from .common import Progress

RADIUS, NEAREST, FARTHEST = 0.02, 0.2, 0.7
ATTEMPTS = 20000


def evaluate_projection(
    robot: Robot, *, poses: int = 200, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Render a ball of 2 cm radius in ``poses`` random postures, fully visible in both eyes, 0.2-0.7 m deep.

    The ball's segmented centroid is held against the centre of its projected outline, an ellipse; the
    projection of the ball's own centre is up to a pixel off that.

    Returns:
        poses, median_px, p95_px over both eyes.
    """
    progress = progress or Progress()
    generator = np.random.default_rng(seed)
    projection = KinematicProjection(robot)
    offsets: list[float] = []
    with World(robot) as world, tempfile.TemporaryDirectory(prefix="motorprime-") as folder:
        eyes = Eyes(world)
        mesh = write_sphere(Path(folder) / "ball.obj", RADIUS)
        ball = world.add_marker(mesh, (0.1, 0.8, 0.2, 1.0))
        for _ in progress.over(range(poses), "rendering balls"):
            offsets += _one_pose(world, eyes, projection, ball, generator)
    return {
        "seed": seed,
        "poses": poses,
        "median_px": float(np.median(offsets)),
        "p95_px": float(np.percentile(offsets, 95)),
    }


def _one_pose(
    world: World, eyes: Eyes, projection: KinematicProjection, ball: int, generator: np.random.Generator
) -> list[float]:
    """Offsets [px] of both eyes at a random posture with the ball fully visible in both."""
    robot = world.robot
    for _ in range(ATTEMPTS):
        world.place(dict(zip(robot.gaze, random_posture(robot, generator), strict=True)))
        joints = world.gaze()
        views = projection.posed(joints)
        # Drawn in the view of one eye; the other must see it too.
        camera = views["left"].camera
        depth = generator.uniform(NEAREST, FARTHEST)
        pixel = generator.uniform((0, 0), (camera.width, camera.height))
        place = apply(views["left"].pose, depth * camera.rays(pixel[None]))[0]
        centres = {}
        for name, view in views.items():
            u, v = view.project(place[None])[0]
            margin = 1.2 * RADIUS / max(view.depth(place[None])[0], 1e-3) * view.camera.fx + 2.0
            height, width = view.camera.shape
            if not (margin < u < width - 1 - margin and margin < v < height - 1 - margin):
                break
            if not NEAREST <= view.depth(place[None])[0] <= FARTHEST:
                break
            centres[name] = sphere_outline_centre(view.camera, view.to_camera(place[None])[0], RADIUS)
        if len(centres) < len(views):
            continue
        world.put(ball, place)
        frames = eyes.capture()
        offsets = []
        for name, frame in frames.items():
            rows, columns = np.nonzero(frame.body == ball)
            # The arm or the chest may hide a part of the ball: such a pose is not fully visible.
            area = np.pi * (RADIUS * views[name].camera.fx / views[name].depth(place[None])[0]) ** 2
            if len(rows) < 0.93 * area:
                break
            offsets.append(
                float(np.linalg.norm([columns.mean() - centres[name][0], rows.mean() - centres[name][1]]))
            )
        if len(offsets) == len(frames):
            return offsets
    raise StateError("posture: no random one has the ball fully visible in both eyes")
