"""Kinematic chains of a robot with a calibration applied."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from .._arrays import Floats
from ..kinematics import Chain, transform
from ..robot import Robot
from .calibration import Calibration


@dataclass(frozen=True, eq=False)
class CorrectedChain:
    """A chain whose angles are linear in the robot's variables: angles = variables @ couplings + bias.

    Attributes:
        chain: with the links' corrections in its origins.
        couplings: (variables, angles).
        bias: (angles,) [rad] of the offsets.
        end: (4, 4) pose of the tip in the frame of the chain's last link.
    """

    chain: Chain
    couplings: Floats
    bias: Floats
    end: Floats

    def angles(self, variables: Floats) -> Floats:
        """Angles (..., n) [rad] of the joints at variables (..., v)."""
        turned: Floats = variables @ self.couplings + self.bias
        return turned

    def forward(self, variables: Floats) -> Floats:
        """Pose (..., 4, 4) of the tip in the root frame."""
        return self.chain.forward(self.angles(variables)) @ self.end


def corrected_cameras(robot: Robot, calibration: Calibration) -> dict[str, CorrectedChain]:
    """Chains from the root to each camera; their variables are the gaze's."""
    return {
        name: _corrected(chain, _gaze_couplings(robot, chain), robot.gaze, calibration, mounting)
        for name, chain in robot.camera_chains.items()
        for mounting in [mounting_pose(calibration.mountings.get(name, np.zeros(6)))]
    }


def corrected_palm(robot: Robot, calibration: Calibration) -> CorrectedChain:
    """Chain from the root to the palm; its variables are the gaze's and then the arm's."""
    torso, arm = robot.chest_chain, robot.arm_chain
    couplings = np.zeros((len(robot.gaze) + len(robot.arm), len(torso.names) + len(arm.names)))
    couplings[: len(robot.gaze), : len(torso.names)] = _gaze_couplings(robot, torso)
    for k, name in enumerate(arm.names):
        couplings[len(robot.gaze) + robot.arm.index(name), len(torso.names) + k] = 1.0
    return _corrected(robot.reach_chain, couplings, (*robot.gaze, *robot.arm), calibration, robot.palm.frame)


def mounting_pose(mounting: Floats) -> Floats:
    """Pose (4, 4) of a mounting (6,): a rotation vector [rad], then a translation [m]."""
    return transform(cv2.Rodrigues(np.asarray(mounting[:3]))[0], mounting[3:])


def _gaze_couplings(robot: Robot, chain: Chain) -> Floats:
    return robot.urdf_angles(chain.names, np.eye(len(robot.gaze)))


def _corrected(
    chain: Chain, couplings: Floats, variables: tuple[str, ...], calibration: Calibration, end: Floats
) -> CorrectedChain:
    offsets = np.array([calibration.offsets.get(name, 0.0) for name in variables])
    joints = []
    for joint in chain.joints:
        origin = joint.origin.copy()
        origin[:3, 3] += calibration.links.get(joint.name, 0.0)
        joints.append(replace(joint, origin=origin))
    return CorrectedChain(Chain(tuple(joints)), couplings, offsets @ couplings, end)
