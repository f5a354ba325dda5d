"""Projection through the robot's kinematics: the classical way, exact when the model is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, numbers
from ..camera import Camera, PosedCamera
from ..errors import ArgumentError
from ..model_files import read_model, write_model
from ..robot import Robot
from ..samples import Samples
from .base import PosedProjection
from .calibration import Calibration
from .corrected import corrected_cameras, corrected_palm
from .estimation import calibrate
from .parameters import Priors

KIND = "kinematic projection"


class KinematicProjection(PosedProjection):
    """Cameras carried by a kinematic chain (Eq. 1 with the chain written out).

    Args:
        robot: with its URDF; ``joints`` of every method are its gaze variables (len(robot.gaze),) [rad],
            for the iCub the 9 of torso, neck and eyes.
        calibration: corrections of the robot's model; None for the model as it is.

    Raises:
        ArgumentError: a calibration of another robot.
    """

    def __init__(self, robot: Robot, calibration: Calibration | None = None) -> None:
        calibration = Calibration(robot.name) if calibration is None else calibration
        calibration.check(robot)
        super().__init__({name: calibration.camera(robot, name) for name in robot.cameras})
        self.robot, self.calibration = robot, calibration
        self._chains = corrected_cameras(robot, calibration)
        self._palm = corrected_palm(robot, calibration)

    def posed(self, joints: npt.ArrayLike | None = None) -> dict[str, PosedCamera]:
        """The cameras at a posture."""
        if joints is None:
            raise ArgumentError(f"joints: a posture of {self.robot.gaze} is needed, got None")
        q = self.robot.gaze_posture(joints)
        return {
            name: PosedCamera(self._cameras[name], chain.forward(q)) for name, chain in self._chains.items()
        }

    def camera(self, name: str) -> Camera:
        """The corrected camera of a name."""
        return self._cameras[name]

    def hand_pixels(self, joints: npt.ArrayLike) -> dict[str, Floats]:
        """Where the hand appears, from encoders alone: {camera: (K, 2)}, rows as in :meth:`project`.

        Args:
            joints: (gaze + arm,) [rad], those of ``robot.gaze`` and then those of ``robot.arm``; for the iCub
                9 + 7. Or (N, gaze + arm), and the result is {camera: (N, K, 2)}.

        Raises:
            ArgumentError: another shape, NaN or infinity.
        """
        points = self.hand_points(joints)
        local = self.in_cameras(points, np.asarray(joints)[..., : len(self.robot.gaze)])
        return {
            name: self._cameras[name].project(part.reshape(-1, 3)).reshape(*part.shape[:-1], 2)
            for name, part in local.items()
        }

    def hand_points(self, joints: npt.ArrayLike) -> Floats:
        """Where the hand is in the root frame, (K, 3) or (N, K, 3) [m]; joints as for :meth:`hand_pixels`."""
        q = finite("joints", numbers("joints", joints))
        size = len(self.robot.gaze) + len(self.robot.arm)
        if q.ndim not in (1, 2) or q.shape[-1] != size:
            raise ArgumentError(f"joints: expected shape ({size},) or (N, {size}), got {q.shape}")
        palm = self._palm.forward(q)
        places: Floats = self.calibration.hand @ palm[..., :3, :3].swapaxes(-1, -2) + palm[..., None, :3, 3]
        return places

    def in_cameras(self, points: Floats, joints: Floats) -> dict[str, Floats]:
        """Points in each camera's frame {camera: (..., K, 3)} [m].

        Args:
            points: (..., K, 3) [m] in the root frame.
            joints: (..., gaze) [rad], one posture for each K of them.
        """
        local = {}
        for name, chain in self._chains.items():
            pose = chain.forward(joints)
            local[name] = (points - pose[..., None, :3, 3]) @ pose[..., :3, :3]
        return local

    def adapt(self, samples: Samples, *, priors: Priors | None = None) -> KinematicProjection:
        """A projection calibrated by samples; this one stays as it is.

        It goes on from what earlier samples told, unless ``priors`` are given; see
        :func:`motorprime.projection.calibrate`, which also tells how well it fits.

        Raises:
            ArgumentError: samples of which :func:`calibrate` cannot make anything.
        """
        result = calibrate(self.robot, samples, priors=priors, start=self.calibration)
        return KinematicProjection(self.robot, result.calibration)

    def save(self, path: str | Path) -> None:
        """Write the calibration to a file (safetensors); the robot's URDF is not in it.

        Raises:
            ArgumentError: the file cannot be written.
        """
        write_model(path, KIND, self.calibration.arrays(), self.calibration.about())

    @classmethod
    def load(cls, path: str | Path, robot: Robot) -> KinematicProjection:
        """Read what :meth:`save` wrote for this robot.

        Raises:
            ArgumentError: no such file, cut off, of another kind or of another robot.
        """
        arrays, about = read_model(path, KIND)
        try:
            return cls(robot, Calibration.from_arrays(arrays, about))
        except ArgumentError as error:
            raise ArgumentError(f"path: {path}: {error}") from None
