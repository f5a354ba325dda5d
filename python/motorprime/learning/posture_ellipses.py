"""The reachable space's Gaussians in the cameras, for thousands of head and eye postures at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator, integer, rows
from ..errors import ArgumentError
from ..peripersonal import MIN_INSIDE, ReachCloud, depths_of, moments
from ..projection import KinematicProjection, Projection
from ..robot import Robot

_BLOCK = 16  # postures whose clouds are projected at a time; they fit the processor's cache


@dataclass(frozen=True, eq=False)
class PostureEllipses:
    """The Gaussians of N postures in one camera, as :func:`motorprime.fit_peripersonal` fits them.

    Attributes:
        mean: (N, 2) (u, v) [px].
        chol: (N, 3) L1, L2, L3 [px] of the lower Cholesky factor. Where the space is not in view, mean and
            factor are of the few points there are, or NaN.
        inside: (N,) points of the cloud that lie inside the image.
    """

    mean: Floats
    chol: Floats
    inside: npt.NDArray[np.intp]

    @property
    def in_view(self) -> npt.NDArray[np.bool_]:
        """(N,) whether the reachable space is in view."""
        return np.asarray(self.inside >= MIN_INSIDE)


def head_eye_joints(robot: Robot) -> tuple[str, ...]:
    """The gaze variables that move the cameras against the chest, where the reach cloud lives: q of g_i.

    Raises:
        ArgumentError: a camera does not hang below the chest, or nothing moves it against the chest.
    """
    needed: set[str] = set()
    for mount in robot.cameras.values():
        for name in robot.tree.chain(robot.chest, mount.link).names:
            needed.update(robot.couplings.get(name, {name: 1.0}))
    joints = tuple(name for name in robot.gaze if name in needed)
    if not joints:
        raise ArgumentError(f"robot: nothing moves a camera of '{robot.name}' against its chest")
    return joints


def random_head_eye(robot: Robot, count: int, seed: int | np.random.Generator | None = None) -> Floats:
    """Postures (count, len(robot.gaze)) [rad]: head and eyes uniform within their limits, the torso at rest.

    Raises:
        ArgumentError: as for :func:`head_eye_joints`, or ``count`` < 1.
    """
    count = integer("count", count, at_least=1)
    joints = head_eye_joints(robot)
    postures = np.tile(robot.resting(robot.gaze), (count, 1))
    limits = robot.limits(joints)
    at = [robot.gaze.index(name) for name in joints]
    postures[:, at] = generator(seed).uniform(limits[:, 0], limits[:, 1], (count, len(joints)))
    return postures


def fit_postures(
    cloud: ReachCloud, projection: Projection, postures: npt.ArrayLike
) -> dict[str, PostureEllipses]:
    """The Gaussian of the reachable space in each camera, for many postures (N, len(robot.gaze)) [rad].

    Through a :class:`KinematicProjection` of the cloud's robot this is vectorised; any other projection is
    asked posture by posture.

    Raises:
        ArgumentError: postures of another shape or with NaN.
    """
    postures = rows("postures", postures, len(cloud.robot.gaze))
    if type(projection) is KinematicProjection and projection.robot is cloud.robot:
        return _fit_kinematic(cloud, postures)
    return _fit_one_by_one(cloud, projection, postures)


def _fit_one_by_one(
    cloud: ReachCloud, projection: Projection, postures: Floats
) -> dict[str, PostureEllipses]:
    fits = {
        name: PostureEllipses(
            np.empty((len(postures), 2)), np.empty((len(postures), 3)), np.empty(len(postures), np.intp)
        )
        for name in projection.cameras
    }
    shapes = projection.shapes
    for k, joints in enumerate(postures):
        points = cloud.in_root(joints)
        pixels, depths = projection.project(points, joints), depths_of(projection, points, joints)
        for name, fit in fits.items():
            fit.mean[k], fit.chol[k], fit.inside[k] = moments(pixels[name], depths.get(name), shapes[name])
    return fits


def _fit_kinematic(cloud: ReachCloud, postures: Floats) -> dict[str, PostureEllipses]:
    """In the chest's frame, where the cloud stands still and the torso does not matter."""
    robot = cloud.robot
    fits = {}
    for name, mount in robot.cameras.items():
        chain = robot.tree.chain(robot.chest, mount.link)
        # Couplings are linear: a row for each variable of the gaze.
        coupling = np.array([robot.urdf_angles(chain.names, unit) for unit in np.eye(len(robot.gaze))])
        poses = chain.forward(postures @ coupling)
        blocks = []
        for at in range(0, len(postures), _BLOCK):
            pose = poses[at : at + _BLOCK]
            points = (cloud.points - pose[:, None, :3, 3]) @ pose[:, :3, :3]
            pixels = mount.camera.project(points.reshape(-1, 3)).reshape(*points.shape[:2], 2)
            blocks.append(moments(pixels, points[..., 2], mount.camera.shape))
        mean, chol, inside = (np.concatenate(part) for part in zip(*blocks, strict=True))
        fits[name] = PostureEllipses(mean, chol, inside)
    return fits
