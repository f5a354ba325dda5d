"""Random postures of gaze and arm, and where the palm would then appear: motor babbling without a robot.

Everything is drawn uniformly within the joint limits. Few of all postures have the palm in view of an eye, so
``draw_in_view`` draws gaze and arm together again and again until one has, which gives the uniform
distribution on the condition of being in view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, positive
from ..camera import Camera
from ..errors import NotInViewError
from ..kinematics import Chain
from ..robot import Robot

MARGIN = 4.0
"""What is this much [px] outside an image still counts as in view, for predictions that are not exact."""
BATCH = 64
ATTEMPTS = 400  # batches
_AROUND = 16  # points of an outline


@dataclass(frozen=True, eq=False)
class Posture:
    """A random posture.

    Attributes:
        gaze: (len(robot.gaze),) [rad].
        arm: (len(robot.arm),) [rad].
        point: (3,) [m] in the root frame, the point on the hand.
    """

    gaze: Floats
    arm: Floats
    point: Floats


class Postures:
    """Draws postures of a robot.

    Args:
        robot: with its URDF.
        radius: of the ball round that point that is to be in view [m].
        offset: the point on the hand, in the palm's frame (3,) [m].
    """

    def __init__(self, robot: Robot, *, radius: float, offset: npt.ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.robot, self.radius = robot, positive("radius", radius)
        self._tip = robot.palm.frame @ np.append(fixed("offset", offset, (3,)), 1.0)
        self._gaze_limits, self._arm_limits = robot.limits(robot.gaze), robot.limits(robot.arm)
        self._chest = _GazeChain(robot, robot.chest_chain)
        self._eyes = {name: _GazeChain(robot, chain) for name, chain in robot.camera_chains.items()}

    def draw(self, generator: np.random.Generator) -> Posture:
        """One posture, uniform within the limits."""
        return self._take(*self._draw(generator, 1), 0)

    def draw_in_view(self, generator: np.random.Generator) -> Posture:
        """One posture that has the whole ball in view of at least one camera, uniform among those.

        Raises:
            NotInViewError: none was found; the robot cannot look at its hand.
        """
        for _ in range(ATTEMPTS):
            gaze, arm, points = self._draw(generator, BATCH)
            seen = np.logical_or.reduce(list(self._in_view(gaze, points).values()))
            if seen.any():
                return self._take(gaze, arm, points, int(np.argmax(seen)))
        raise NotInViewError(
            f"posture: none of {ATTEMPTS * BATCH} random ones has the hand of robot '{self.robot.name}' "
            "in view of a camera"
        )

    def in_view(self, gaze: Floats, point: Floats) -> dict[str, bool]:
        """Whether each camera has the whole ball round ``point`` (3,) [m] in its image and margin."""
        seen = self._in_view(gaze[None], point[None])
        return {name: bool(value[0]) for name, value in seen.items()}

    def place(self, gaze: Floats, arm: Floats) -> Floats:
        """Where the kinematics put the point: postures (..., n) and (..., m) [rad] -> (..., 3) [m]."""
        hands = self._chest.forward(gaze) @ self.robot.arm_chain.forward(arm)
        places: Floats = (hands @ self._tip)[..., :3]
        return places

    def _draw(self, generator: np.random.Generator, count: int) -> tuple[Floats, Floats, Floats]:
        def uniform(limits: Floats) -> Floats:
            return generator.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))

        gaze, arm = uniform(self._gaze_limits), uniform(self._arm_limits)
        return gaze, arm, self.place(gaze, arm)

    def _in_view(self, gaze: Floats, points: Floats) -> dict[str, npt.NDArray[np.bool_]]:
        seen = {}
        for name, chain in self._eyes.items():
            poses, camera = chain.forward(gaze), self.robot.cameras[name].camera
            local = np.einsum("nji,nj->ni", poses[:, :3, :3], points - poses[:, :3, 3])
            found = _inside(camera, camera.project(local))
            rim = camera.project(_rim(local[found], self.radius).reshape(-1, 3)).reshape(-1, _AROUND, 2)
            found[found] = _inside(camera, rim).all(axis=1)
            seen[name] = found
        return seen

    @staticmethod
    def _take(gaze: Floats, arm: Floats, points: Floats, k: int) -> Posture:
        return Posture(gaze[k], arm[k], points[k])


class _GazeChain:
    """A chain as a function of many gaze postures at once; couplings are linear, so one matrix holds them."""

    def __init__(self, robot: Robot, chain: Chain) -> None:
        self._chain = chain
        self._couplings = np.array([robot.urdf_angles(chain.names, unit) for unit in np.eye(len(robot.gaze))])

    def forward(self, gaze: Floats) -> Floats:
        return self._chain.forward(gaze @ self._couplings)


def _inside(camera: Camera, pixels: Floats) -> npt.NDArray[np.bool_]:
    """Whether pixels (..., 2) lie in the image and its margin: (...); NaN does not."""
    height, width = camera.shape
    low, high = -0.5 - MARGIN, (width - 0.5 + MARGIN, height - 0.5 + MARGIN)
    return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=-1))


def _rim(centres: Floats, radius: float) -> Floats:
    """Points of spheres that are seen as their outlines: centres (N, 3) in the camera frame -> (N, k, 3) [m].

    With d the distance and s = radius / d, rays from the origin touch the sphere at
    (1 - s^2) C + radius sqrt(1 - s^2) (cos t a + sin t b), a and b unit vectors across C. Where the origin
    is inside the sphere the points lie behind the camera.
    """
    distance = np.linalg.norm(centres, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.sqrt(1.0 - (radius / distance) ** 2)
        across = np.cross(centres, (0.0, 1.0, 0.0))
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        upward = np.cross(centres / distance, across)
        turn = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)[:, None]
        circle = np.cos(turn) * across[:, None] + np.sin(turn) * upward[:, None]
        rim: Floats = (cosine**2 * centres)[:, None] + radius * cosine[:, None] * circle
    return np.where(np.isfinite(rim).all(axis=(1, 2), keepdims=True), rim, (0.0, 0.0, -1.0))
