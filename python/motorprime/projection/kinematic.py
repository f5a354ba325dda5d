"""Projection through the robot's kinematics: the classical way, exact when the URDF is."""

from __future__ import annotations

import numpy.typing as npt

from ..camera import PosedCamera
from ..errors import ArgumentError
from ..robot import Robot
from .base import PosedProjection


class KinematicProjection(PosedProjection):
    """Cameras carried by a kinematic chain (Eq. 1 with the chain written out).

    Args:
        robot: with its URDF; ``joints`` of every method are its gaze variables (len(robot.gaze),) [rad],
            for the iCub the 9 of torso, neck and eyes.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__({name: mount.camera for name, mount in robot.cameras.items()})
        self.robot = robot

    def posed(self, joints: npt.ArrayLike | None = None) -> dict[str, PosedCamera]:
        """The cameras at a posture."""
        if joints is None:
            raise ArgumentError(f"joints: a posture of {self.robot.gaze} is needed, got None")
        q = self.robot.gaze_posture(joints)
        return {
            name: PosedCamera(
                self.robot.cameras[name].camera, chain.forward(self.robot.urdf_angles(chain.names, q))
            )
            for name, chain in self.robot.camera_chains.items()
        }
