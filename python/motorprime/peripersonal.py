"""Peripersonal attention (section III-B): the reachable space, projected into the eyes.

The cloud of reachable palm positions is drawn once, in the chest's frame. For a posture it is projected and
each camera gets the Gaussian of the projections (Eq. 2, 3), from which the landscape is computed (Eq. 4, 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, generator, image_shape, integer, numbers, rigid, rows
from .errors import ArgumentError, NotInViewError, StateError
from .kinematics import apply
from .projection import Projection
from .robot import Robot

MIN_DEPTH = 0.05
"""Points nearer to a camera [m] are left out: their projections explode."""
EXTENT = 3.0
"""Points count that project into this many image sizes, centred on the image. A fit to all points in front
of the camera is useless: its sigma exceeds 300 px, because a near point may land thousands of pixels away."""
MIN_INSIDE = 50
"""With fewer points inside the image, the reachable space is not in view."""


@dataclass(frozen=True, eq=False)
class ProjectedGaussian:
    """A bivariate Gaussian over an image.

    Attributes:
        mean: (2,) (u, v) [px].
        chol: (3,) L1, L2, L3 [px] of the lower Cholesky factor [[L1, 0], [L2, L3]] of the covariance.
        inside: points of the cloud that lie inside the image; an estimate where the Gaussian was learned.
    """

    mean: Floats
    chol: Floats
    inside: int


class ReachCloud:
    """Reachable positions of the palm, drawn by random arm postures (section III-B1).

    Args:
        robot: with its URDF.
        size: points to draw.
        seed: for the draw.
        tool: (4, 4) pose of a held tool's tip in the palm's frame; the cloud is then of the tip's positions.

    Attributes:
        points: (size, 3) [m] in the chest's frame.

    Raises:
        ArgumentError: fewer than 50 points, or a tool whose pose is no rigid motion.
        StateError: the robot has no URDF.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        size: int = 4000,
        seed: int | np.random.Generator | None = 0,
        tool: npt.ArrayLike | None = None,
    ) -> None:
        size = integer("size", size, at_least=MIN_INSIDE)
        self.robot = robot
        tip = robot.palm.frame if tool is None else robot.palm.frame @ rigid("tool", tool)
        limits = robot.limits(robot.arm)
        angles = generator(seed).uniform(limits[:, 0], limits[:, 1], (size, len(limits)))
        poses = robot.arm_chain.forward(angles) @ tip
        self.points: Floats = poses[:, :3, 3]

    @classmethod
    def from_points(cls, robot: Robot, points: npt.ArrayLike) -> ReachCloud:
        """The cloud of positions (N, 3) [m] in the chest's frame that arm babbling has stored.

        Raises:
            ArgumentError: fewer than 50 points, another shape, NaN or infinity.
        """
        points = rows("points", points, 3)
        if len(points) < MIN_INSIDE:
            raise ArgumentError(f"points: expected at least {MIN_INSIDE}, got {len(points)}")
        cloud = cls.__new__(cls)
        cloud.robot, cloud.points = robot, points.copy()
        return cloud

    def in_root(self, joints: npt.ArrayLike) -> Floats:
        """The cloud (size, 3) [m] in the root frame, moved by the torso joints of a gaze posture."""
        posture = self.robot.gaze_posture(joints)
        chain = self.robot.chest_chain
        return apply(chain.forward(self.robot.urdf_angles(chain.names, posture)), self.points)


def fit_gaussian(
    pixels: npt.ArrayLike, depths: npt.ArrayLike | None, shape: tuple[int, int], *, camera: str = ""
) -> ProjectedGaussian:
    """Gaussian (Eq. 2, 3) of a projected cloud.

    Args:
        pixels: (N, 2) (u, v); NaN rows are dropped.
        depths: (N,) [m]; points nearer than 5 cm are dropped. None where they are not known: then only NaN
            rows say which points lie too near or behind.
        shape: (height, width) of the image; points outside three image sizes around its centre are dropped.
        camera: its name, for the message.

    Raises:
        ArgumentError: the arrays do not belong together.
        NotInViewError: fewer than 50 of the points that are left lie inside the image.
    """
    height, width = (integer("shape", side, at_least=1) for side in image_shape("shape", shape))
    pixels = numbers("pixels", pixels)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise ArgumentError(f"pixels: expected shape (N, 2), got {pixels.shape}")
    if depths is not None:
        depths = numbers("depths", depths)
        if depths.shape != pixels.shape[:1]:
            raise ArgumentError(f"depths: expected shape {pixels.shape[:1]}, got {depths.shape}")
    mean, chol, inside = moments(pixels, depths, (height, width))
    if inside < MIN_INSIDE:
        raise NotInViewError(
            f"the reachable space is not in view of camera '{camera}': {inside} of {len(pixels)} points "
            f"project into its image, at least {MIN_INSIDE} are needed; look elsewhere"
        )
    return ProjectedGaussian(mean, chol, int(inside))


def moments(
    pixels: Floats, depths: Floats | None, shape: tuple[int, int]
) -> tuple[Floats, Floats, npt.NDArray[np.intp]]:
    """Means and Cholesky factors (Eq. 2, 3) of any number of projected clouds at once.

    Args:
        pixels: (..., N, 2); depths: (..., N) or None; shape: as for :func:`fit_gaussian`.

    Returns:
        means (..., 2), factors (..., 3) [px], and the number of points inside the image (...,). Of fewer than
        two points that count there is no covariance: NaN.
    """
    height, width = shape
    centre = ((width - 1) / 2, (height - 1) / 2)
    offset = pixels - centre
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.maximum(np.abs(offset[..., 0]) / width, np.abs(offset[..., 1]) / height)
        kept = share <= EXTENT / 2
        if depths is not None:
            kept &= depths > MIN_DEPTH
        inside = (kept & (share <= 0.5)).sum(axis=-1)
        u, v = np.where(kept, offset[..., 0], 0.0), np.where(kept, offset[..., 1], 0.0)
        count = kept.sum(axis=-1).astype(np.float64)
        mean_u, mean_v = u.sum(axis=-1) / count, v.sum(axis=-1) / count

        def covariance(a: Floats, b: Floats, product: Floats) -> Floats:
            products: Floats = (np.einsum("...n,...n", a, b) - count * product) / (count - 1.0)
            return products

        # A millionth of a square pixel keeps the factor of a cloud on one pixel, or on a line, positive.
        l1 = np.sqrt(np.maximum(covariance(u, u, mean_u * mean_u), 0.0) + 1e-6)
        l2 = covariance(u, v, mean_u * mean_v) / l1
        l3 = np.sqrt(np.maximum(covariance(v, v, mean_v * mean_v) - l2 * l2, 0.0) + 1e-6)
    return np.stack([mean_u, mean_v], axis=-1) + centre, np.stack([l1, l2, l3], axis=-1), inside


def fit_peripersonal(
    cloud: ReachCloud, projection: Projection, joints: npt.ArrayLike
) -> dict[str, ProjectedGaussian]:
    """The Gaussian of the reachable space in each camera that has it in view, for one posture.

    A projection without depths, as a learned one, places only what is about in view. Its Gaussians are of
    those points alone, and so much narrower than by the rule of three image sizes: for the iCub a third of
    the area. A :class:`motorprime.PeripersonalModel` learned through kinematics avoids that.

    Raises:
        NotInViewError: no camera has the reachable space in view.
    """
    points = cloud.in_root(joints)
    pixels, depths = projection.project(points, joints), depths_of(projection, points, joints)
    fits: dict[str, ProjectedGaussian] = {}
    reasons: list[str] = []
    for camera, shape in projection.shapes.items():
        try:
            fits[camera] = fit_gaussian(pixels[camera], depths.get(camera), shape, camera=camera)
        except NotInViewError as error:
            reasons.append(str(error))
    if not fits:
        raise NotInViewError("; ".join(reasons))
    return fits


def depths_of(projection: Projection, points: Floats, joints: npt.ArrayLike) -> dict[str, Floats]:
    """Depths {camera: (N,)} [m], empty where the projection knows of no optical axes."""
    try:
        return projection.depths(points, joints)
    except StateError:
        return {}
