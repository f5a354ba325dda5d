"""The parameters of a calibration as one vector, and what is known of them beforehand."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from .._arrays import Floats, fixed
from ..camera import Camera
from ..errors import ArgumentError
from ..robot import Robot
from .calibration import Calibration, corrected_joints

_INTRINSICS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


@dataclass(frozen=True)
class Priors:
    """Standard deviations of a robot's differences from its model; 0 holds a group fixed.

    Args:
        offsets: [rad] of the gaze's joint offsets.
        arm_offsets: [rad] of the arm's.
        links: [m], each coordinate of a joint's origin.
        turn: [rad], each component of a camera's rotation on its link.
        shift: [m], each component of its translation.
        focal: relative to the focal length, each of fx and fy.
        centre: of the principal point, relative to the focal length.
        radial, tangential: of the distortion k1, k2 and p1, p2.
        hand: [m], each coordinate of the hand's point in the palm's frame.
    """

    offsets: float = float(np.deg2rad(3.0))
    arm_offsets: float = float(np.deg2rad(3.0))
    links: float = 0.005
    turn: float = float(np.deg2rad(1.0))
    shift: float = 0.003
    focal: float = 0.03
    centre: float = 0.02
    radial: float = 0.1
    tangential: float = 0.01
    hand: float = 0.03

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = float(fixed(f"priors.{entry.name}", getattr(self, entry.name), ()))
            if value < 0.0:
                raise ArgumentError(f"priors.{entry.name}: expected >= 0, got {value}")
            object.__setattr__(self, entry.name, value)


class Parameters:
    """Where each correction of a robot stands in the vector of all of them.

    The vector is zero for the nominal robot. Offsets [rad] of gaze and arm, translations [m] of the moving
    joints, mountings, intrinsics (logarithms of the ratios of fx and fy, differences of the others) and the
    hand's point [m].
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        # A fixed joint's translation is one of the next moving joint's, or of the mounting.
        joints = [joint.name for joint in corrected_joints(robot) if joint.moves]
        self.offsets = {name: i for i, name in enumerate((*robot.gaze, *robot.arm))}
        size = len(self.offsets)
        self.links, size = _slices(joints, 3, size)
        self.mountings, size = _slices(list(robot.cameras), 6, size)
        self.intrinsics, size = _slices(list(robot.cameras), 8, size)
        self.hand, self.size = slice(size, size + 3), size + 3

    @property
    def names(self) -> tuple[str, ...]:
        """What each number of the vector is, as 'eyes_tilt offset' or 'left k1'."""
        mounting = ("turn x", "turn y", "turn z", "shift x", "shift y", "shift z")
        return (
            *(f"{name} offset" for name in self.offsets),
            *(f"{name} {axis}" for name in self.links for axis in "xyz"),
            *(f"{name} {part}" for name in self.mountings for part in mounting),
            *(f"{name} {part}" for name in self.intrinsics for part in _INTRINSICS),
            *(f"hand {axis}" for axis in "xyz"),
        )

    def sigmas(self, priors: Priors) -> Floats:
        """Standard deviations (size,) of the vector."""
        sigma = np.zeros(self.size)
        for name, i in self.offsets.items():
            sigma[i] = priors.offsets if name in self.robot.gaze else priors.arm_offsets
        for where in self.links.values():
            sigma[where] = priors.links
        for where in self.mountings.values():
            sigma[where] = 3 * [priors.turn] + 3 * [priors.shift]
        for name, where in self.intrinsics.items():
            centre = priors.centre * self.robot.cameras[name].camera.fx
            sigma[where] = 2 * [priors.focal] + 2 * [centre] + 2 * [priors.radial] + 2 * [priors.tangential]
        sigma[self.hand] = priors.hand
        return sigma

    def pack(self, calibration: Calibration) -> Floats:
        """The vector (size,) of a calibration."""
        vector = np.zeros(self.size)
        for name, value in calibration.offsets.items():
            vector[self.offsets[name]] = value
        for name, shift in calibration.links.items():
            if name not in self.links:
                raise ArgumentError(
                    f"start: joint '{name}' is fixed; its translation goes into the next moving joint's"
                )
            vector[self.links[name]] = shift
        for name, mounting in calibration.mountings.items():
            vector[self.mountings[name]] = mounting
        for name, camera in calibration.cameras.items():
            vector[self.intrinsics[name]] = _difference(camera, self.robot.cameras[name].camera)
        if len(calibration.hand) != 1:
            raise ArgumentError(
                f"start: samples show one point of the hand, the calibration has {len(calibration.hand)}"
            )
        vector[self.hand] = calibration.hand[0]
        return vector

    def unpack(self, vector: Floats, like: Calibration) -> Calibration:
        """The calibration of a vector; what it does not say (further distortion) is that of ``like``."""
        cameras = {}
        for name, where in self.intrinsics.items():
            own = self.robot.cameras[name].camera
            cameras[name] = _changed(like.camera(self.robot, name), own, vector[where])
        return Calibration(
            self.robot.name,
            offsets={name: vector[i] for name, i in self.offsets.items()},
            links={name: vector[where] for name, where in self.links.items()},
            mountings={name: vector[where] for name, where in self.mountings.items()},
            cameras=cameras,
            hand=vector[None, self.hand],
        )


def parameter_names(robot: Robot) -> tuple[str, ...]:
    """What each row and column of :attr:`Calibration.covariance` is, as 'eyes_tilt offset' or 'left k1'."""
    return Parameters(robot).names


def _slices(names: list[str], width: int, start: int) -> tuple[dict[str, slice], int]:
    ends = start + width * len(names)
    return {n: slice(i, i + width) for n, i in zip(names, range(start, ends, width), strict=True)}, ends


def _difference(camera: Camera, own: Camera) -> Floats:
    bent = _four(camera) - _four(own)
    return np.array(
        [
            np.log(camera.fx / own.fx),
            np.log(camera.fy / own.fy),
            camera.cx - own.cx,
            camera.cy - own.cy,
            *bent,
        ]
    )


def _changed(camera: Camera, own: Camera, change: Floats) -> Camera:
    distortion = tuple((_four(own) + change[4:]).tolist())
    return replace(
        camera,
        fx=own.fx * np.exp(change[0]),
        fy=own.fy * np.exp(change[1]),
        cx=own.cx + change[2],
        cy=own.cy + change[3],
        distortion=(distortion if any(distortion) else ()) if len(camera.distortion) <= 4
        else (*distortion, *camera.distortion[4:]),
    )  # fmt: skip


def _four(camera: Camera) -> Floats:
    """k1, k2, p1, p2."""
    return np.array((*camera.distortion, 0.0, 0.0, 0.0, 0.0)[:4] if camera.distortion else 4 * (0.0,))
