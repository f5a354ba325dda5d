"""Babbling computed instead of moved: postures, places of the hand, and their pixels by kinematics."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, generator, integer, not_negative, numbers
from ..errors import ArgumentError, StateError
from ..projection.base import inside
from ..robot import Robot
from ..samples import Samples

BATCH = 8192
"""Postures that are drawn at once. A part of the result: another batch gives other samples for a seed."""
BARREN = 200
"""Batches in a row without a single sample in view, after which there is nothing to wait for."""


def draw_samples(
    robot: Robot,
    nominal: Robot,
    count: int,
    seed: int | np.random.Generator | None,
    noise: float = 0.0,
    *,
    arm: bool = False,
    nearest: float = 0.05,
) -> Samples:
    """Draw samples as babbling gives them: the hand seen by a robot whose model is another one.

    Gaze and arm are drawn uniformly from their ranges, and drawn again until at least one camera sees the
    palm. Fewer samples of the same seed are the first ones of more.

    Args:
        robot: the robot as it is, whose cameras see.
        nominal: the robot as its model says, whose ranges are drawn from.
        count: samples, >= 1.
        seed: for the draw.
        noise: standard deviation [px] of the labels, in u and in v.
        arm: False, and ``points`` is where the palm is, exactly, by the nominal model, and ``joints`` are the
            gaze's. True, and the palm is where the arm of ``robot`` brings it, ``points`` is None, and
            ``joints`` are the gaze's and then the arm's.
        nearest: palms nearer to an eye than this depth [m] count as not seen by it.

    Raises:
        ArgumentError: wrong numbers, or robots of other joints or cameras.
        StateError: the hand is never in view.
    """
    count = integer("count", count, at_least=1)
    noise, nearest = not_negative("noise", noise), not_negative("nearest", nearest)
    if (robot.gaze, robot.arm, tuple(robot.cameras)) != (nominal.gaze, nominal.arm, tuple(nominal.cameras)):
        raise ArgumentError(
            f"nominal: expected the joints and cameras of robot '{robot.name}', got those of '{nominal.name}'"
        )
    rng = generator(seed)
    joints, points, pixels, found, barren = [], [], [], 0, 0
    while found < count:
        posture, reach = _uniform(rng, nominal, nominal.gaze), _uniform(rng, nominal, nominal.arm)
        place = palm_points(robot if arm else nominal, posture, reach)
        uv = {name: _seen(robot, name, posture, place, nearest) for name in robot.cameras}
        errors = rng.normal(0.0, noise, (len(uv), BATCH, 2))
        kept = np.any([~np.isnan(value[:, 0]) for value in uv.values()], axis=0)
        joints.append(np.hstack([posture, reach])[kept] if arm else posture[kept])
        points.append(place[kept])
        pixels.append([(value + error)[kept] for value, error in zip(uv.values(), errors, strict=True)])
        found += int(kept.sum())
        barren = 0 if kept.any() else barren + 1
        if barren == BARREN:
            raise StateError(
                f"robot '{robot.name}': the hand was in view in none of {BARREN * BATCH} postures"
            )
    labels = np.concatenate(pixels, axis=1)[:, :count]
    return Samples(
        names=(*robot.gaze, *robot.arm) if arm else robot.gaze,
        joints=np.concatenate(joints)[:count],
        pixels=dict(zip(robot.cameras, labels, strict=True)),
        points=None if arm else np.concatenate(points)[:count],
    )


def palm_points(robot: Robot, gaze: npt.ArrayLike, arm: npt.ArrayLike) -> Floats:
    """Places (N, 3) [m] of the palm's origin in the root frame, by the robot's model.

    Args:
        robot: with its URDF.
        gaze: (N, len(robot.gaze)) [rad]; only the torso's part matters.
        arm: (N, len(robot.arm)) [rad].
    """
    chain = robot.chest_chain
    posture = finite("gaze", numbers("gaze", gaze))
    if posture.ndim != 2 or posture.shape[1] != len(robot.gaze):
        raise ArgumentError(f"gaze: expected shape (N, {len(robot.gaze)}), got {posture.shape}")
    chest = chain.forward(robot.urdf_angles(chain.names, posture))
    palm: Floats = (chest @ robot.arm_chain.forward(arm) @ robot.palm.frame)[:, :3, 3]
    return palm


def _uniform(rng: np.random.Generator, robot: Robot, variables: tuple[str, ...]) -> Floats:
    limits = robot.limits(variables)
    return rng.uniform(limits[:, 0], limits[:, 1], (BATCH, len(limits)))


def _seen(robot: Robot, name: str, posture: Floats, points: Floats, nearest: float) -> Floats:
    """Pixels (N, 2) in one camera, each point at its own posture; NaN where it does not see the point."""
    chain, camera = robot.camera_chains[name], robot.cameras[name].camera
    pose = chain.forward(robot.urdf_angles(chain.names, posture))
    local = np.einsum("nji,nj->ni", pose[:, :3, :3], points - pose[:, :3, 3])
    pixels = camera.project(local)
    return np.where((inside(pixels, camera.shape) & (local[:, 2] >= nearest))[:, None], pixels, np.nan)
