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
from ..errors import NotInViewError
from ..kinematics import Chain
from ..robot import Robot

MARGIN = 4.0
"""What is this much [px] outside an image still counts as in view, for predictions that are not exact."""
BATCH = 64
ATTEMPTS = 400  # batches


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

    def in_view(self, posture: Posture) -> dict[str, bool]:
        """Whether each camera has the whole ball in its image, grown by the margin."""
        seen = self._in_view(posture.gaze[None], posture.point[None])
        return {name: bool(value[0]) for name, value in seen.items()}

    def _draw(self, generator: np.random.Generator, count: int) -> tuple[Floats, Floats, Floats]:
        def uniform(limits: Floats) -> Floats:
            return generator.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))

        gaze, arm = uniform(self._gaze_limits), uniform(self._arm_limits)
        hands = self._chest.forward(gaze) @ self.robot.arm_chain.forward(arm)
        return gaze, arm, (hands @ self._tip)[:, :3]

    def _in_view(self, gaze: Floats, points: Floats) -> dict[str, npt.NDArray[np.bool_]]:
        seen = {}
        for name, chain in self._eyes.items():
            poses, camera = chain.forward(gaze), self.robot.cameras[name].camera
            local = np.einsum("nji,nj->ni", poses[:, :3, :3], points - poses[:, :3, 3])
            pixels, (height, width) = camera.project(local), camera.shape
            # Half the width and height of the ball's image, to first order in the radius.
            half = self.radius * np.linalg.norm(camera.jacobian(local), axis=2)
            low, high = -0.5 - MARGIN, (width - 0.5 + MARGIN, height - 0.5 + MARGIN)
            seen[name] = ((pixels - half >= low) & (pixels + half <= high)).all(axis=1)
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
