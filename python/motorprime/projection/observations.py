"""Pixels that a calibrated robot predicts for samples, and their derivatives by every parameter."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays import Floats
from ..camera import Camera
from ..samples import Samples
from .calibration import Calibration
from .corrected import CorrectedChain, corrected_cameras, corrected_palm, mounting_pose
from .parameters import Parameters


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one camera should show.

    Attributes:
        pixels: (M, 2) of the samples that the camera saw; NaN where the model says that it cannot.
        slopes: (M, 2, P) derivatives by the parameters, zero in those rows.
    """

    pixels: Floats
    slopes: Floats


class Observations:
    """Samples prepared for being predicted again and again.

    Args:
        parameters: of the robot.
        samples: of some of its cameras; without points they are of the hand, and have the arm's joints.
    """

    def __init__(self, parameters: Parameters, samples: Samples) -> None:
        robot = parameters.robot
        self.parameters, self.points = parameters, samples.points
        names = robot.gaze if samples.points is not None else (*robot.gaze, *robot.arm)
        self.joints = samples.columns(names)
        self.rows: dict[str, npt.NDArray[np.intp]] = {
            c: np.flatnonzero(samples.seen(c)) for c in samples.cameras
        }
        self.labels = {c: samples.pixels[c][rows] for c, rows in self.rows.items()}

    def predict(self, calibration: Calibration) -> dict[str, Prediction]:
        """Pixels and slopes of each camera."""
        robot, size = self.parameters.robot, self.parameters.size
        cameras = corrected_cameras(robot, calibration)
        if self.points is None:
            points, by_parameters = self._hand(corrected_palm(robot, calibration), calibration)
        else:
            points, by_parameters = self.points, np.zeros((len(self.joints), 3, size))
        return {
            name: self._camera(name, cameras[name], calibration, points[rows], by_parameters[rows])
            for name, rows in self.rows.items()
        }

    def _hand(self, chain: CorrectedChain, calibration: Calibration) -> tuple[Floats, Floats]:
        """Places (N, 3) [m] of the hand's point and their derivatives (N, 3, P)."""
        pose = chain.forward(self.joints)
        places: Floats = pose[:, :3, :3] @ calibration.hand[0] + pose[:, :3, 3]
        slopes = _chain_slopes(self.parameters, chain, self.joints, places)
        slopes[:, :, self.parameters.hand] = pose[:, :3, :3]
        return places, slopes

    def _camera(
        self, name: str, chain: CorrectedChain, calibration: Calibration, points: Floats, slopes: Floats
    ) -> Prediction:
        """One camera's rows; ``slopes`` (M, 3, P) are those of the points.

        With the camera's pose [R, c] the point in its frame is R^T (x - c); a motion of the camera's links by
        dx at x moves it by -R^T dx.
        """
        parameters, camera = self.parameters, calibration.camera(self.parameters.robot, name)
        joints = self.joints[self.rows[name], : len(parameters.robot.gaze)]
        pose = chain.forward(joints)
        back = pose[:, :3, :3].transpose(0, 2, 1)
        local = (back @ (points - pose[:, :3, 3])[:, :, None])[:, :, 0]
        moved = back @ (slopes - _chain_slopes(parameters, chain, joints, points))
        mounting = calibration.mountings.get(name, np.zeros(6))
        moved[:, :, parameters.mountings[name]] += _mounting_slopes(mounting, local)
        pixels = camera.project(local)
        result = camera.jacobian(local) @ moved
        result[:, :, parameters.intrinsics[name]] += _intrinsic_slopes(camera, local, pixels)
        return Prediction(pixels, np.where(np.isnan(pixels[:, :1, None]), 0.0, result))


def _chain_slopes(parameters: Parameters, chain: CorrectedChain, variables: Floats, points: Floats) -> Floats:
    """How points (N, 3) [m] that the chain's tip carries move with its offsets and links, (N, 3, P).

    Turning joint k moves them by z_k x (x - p_k), z_k its axis and p_k its place; shifting its origin moves
    them by the axes of its parent's frame.
    """
    angles = chain.angles(variables)
    slopes = np.zeros((len(points), 3, parameters.size))
    by_angle = np.empty((len(points), 3, angles.shape[1]))
    pose, moving = np.broadcast_to(np.eye(4), (len(points), 4, 4)), 0
    for joint in chain.chain.joints:
        parent = pose[:, :3, :3]
        pose = pose @ joint.origin
        if joint.moves:
            axis = pose[:, :3, :3] @ joint.axis
            by_angle[:, :, moving] = np.cross(axis, points - pose[:, :3, 3])
            slopes[:, :, parameters.links[joint.name]] = parent
            pose = pose @ joint.turn(angles[:, moving])
            moving += 1
    # Gaze first and then the arm: a chain's variables are the first of the offsets.
    slopes[:, :, : variables.shape[1]] = by_angle @ chain.couplings.T
    return slopes


def _mounting_slopes(mounting: Floats, local: Floats) -> Floats:
    """Derivatives (M, 3, 6) of points in the camera's frame by its mounting.

    With the mounting [T, t] and a point y of the link's frame the point is T^T (y - t).
    """
    turn = mounting_pose(mounting)[:3, :3]
    by_vector = cv2.Rodrigues(np.asarray(mounting[:3]))[1].reshape(3, 3, 3)  # [i] = dT / dr_i
    slopes = np.empty((len(local), 3, 6))
    slopes[:, :, :3] = np.einsum("ijk,mj->mki", by_vector, local @ turn.T)
    slopes[:, :, 3:] = -turn.T
    return slopes


def _intrinsic_slopes(camera: Camera, local: Floats, pixels: Floats) -> Floats:
    """Derivatives (M, 2, 8) of pixels by log fx, log fy, cx, cy, k1, k2, p1, p2, as in motorprime.lens."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        x, y = (local[:, :2] / local[:, 2:]).T
        s = x * x + y * y
        k4, k5, k6 = (*camera.distortion, *14 * (0.0,))[5:8]
        radial = s / (1.0 + s * (k4 + s * (k5 + s * k6)))
        slopes = np.zeros((len(local), 2, 8))
        slopes[:, 0, 0], slopes[:, 1, 1] = pixels[:, 0] - camera.cx, pixels[:, 1] - camera.cy
        slopes[:, 0, 2] = slopes[:, 1, 3] = 1.0
        slopes[:, 0, 4:] = camera.fx * np.stack(
            [x * radial, x * s * radial, 2.0 * x * y, s + 2.0 * x * x], axis=1
        )
        slopes[:, 1, 4:] = camera.fy * np.stack(
            [y * radial, y * s * radial, s + 2.0 * y * y, 2.0 * x * y], axis=1
        )
    return slopes
