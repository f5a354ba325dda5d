"""Peripersonal attention (section III-B): the reachable space, projected into the eyes.

The cloud of reachable palm positions is drawn once, in the chest's frame. For a posture it is projected and
each camera gets the Gaussian of the projections (Eq. 2, 3), from which the landscape is computed (Eq. 4, 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, generator, image_shape, integer, numbers
from .errors import ArgumentError, NotInViewError
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
        inside: points of the cloud that lie inside the image.
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

    Attributes:
        points: (size, 3) [m] in the chest's frame.
    """

    def __init__(self, robot: Robot, *, size: int = 4000, seed: int | np.random.Generator | None = 0) -> None:
        size = integer("size", size, at_least=MIN_INSIDE)
        self.robot = robot
        limits = robot.limits(robot.arm)
        angles = generator(seed).uniform(limits[:, 0], limits[:, 1], (size, len(limits)))
        poses = robot.arm_chain.forward(angles) @ robot.palm.frame
        self.points: Floats = poses[:, :3, 3]

    def in_root(self, joints: npt.ArrayLike) -> Floats:
        """The cloud (size, 3) [m] in the root frame, moved by the torso joints of a gaze posture."""
        posture = self.robot.gaze_posture(joints)
        chain = self.robot.chest_chain
        return apply(chain.forward(self.robot.urdf_angles(chain.names, posture)), self.points)


def fit_gaussian(
    pixels: npt.ArrayLike, depths: npt.ArrayLike, shape: tuple[int, int], *, camera: str = ""
) -> ProjectedGaussian:
    """Gaussian (Eq. 2, 3) of a projected cloud.

    Args:
        pixels: (N, 2) (u, v); NaN rows are dropped.
        depths: (N,) [m]; points nearer than 5 cm are dropped.
        shape: (height, width) of the image; points outside three image sizes around its centre are dropped.
        camera: its name, for the message.

    Raises:
        ArgumentError: the arrays do not belong together.
        NotInViewError: fewer than 50 of the points that are left lie inside the image.
    """
    height, width = (integer("shape", side, at_least=1) for side in image_shape("shape", shape))
    pixels, depths = numbers("pixels", pixels), numbers("depths", depths)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise ArgumentError(f"pixels: expected shape (N, 2), got {pixels.shape}")
    if depths.shape != pixels.shape[:1]:
        raise ArgumentError(f"depths: expected shape {pixels.shape[:1]}, got {depths.shape}")
    with np.errstate(invalid="ignore"):
        offset = np.abs((pixels - ((width - 1) / 2, (height - 1) / 2)) / (width, height))
        kept = (depths > MIN_DEPTH) & (offset <= EXTENT / 2).all(axis=1)
        inside = int((offset[kept] <= 0.5).all(axis=1).sum())
    if inside < MIN_INSIDE:
        raise NotInViewError(
            f"the reachable space is not in view of camera '{camera}': {inside} of {len(pixels)} points "
            f"project into its image, at least {MIN_INSIDE} are needed; look elsewhere"
        )
    points = pixels[kept]
    factor = np.asarray(np.linalg.cholesky(np.cov(points.T) + 1e-6 * np.eye(2)), dtype=np.float64)
    return ProjectedGaussian(points.mean(axis=0), factor[[0, 1, 1], [0, 0, 1]], inside)


def fit_peripersonal(
    cloud: ReachCloud, projection: Projection, joints: npt.ArrayLike
) -> dict[str, ProjectedGaussian]:
    """The Gaussian of the reachable space in each camera that has it in view, for one posture.

    Raises:
        NotInViewError: no camera has the reachable space in view.
    """
    points = cloud.in_root(joints)
    pixels, depths = projection.project(points, joints), projection.depths(points, joints)
    fits: dict[str, ProjectedGaussian] = {}
    reasons: list[str] = []
    for camera, shape in projection.shapes.items():
        try:
            fits[camera] = fit_gaussian(pixels[camera], depths[camera], shape, camera=camera)
        except NotInViewError as error:
            reasons.append(str(error))
    if not fits:
        raise NotInViewError("; ".join(reasons))
    return fits
