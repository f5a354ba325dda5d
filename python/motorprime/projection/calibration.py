"""What a robot differs in from its model, as numbers that can be estimated, saved and applied."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, fixed, numbers, rows
from ..camera import Camera
from ..errors import ArgumentError, ArgumentTypeError
from ..kinematics import Joint
from ..robot import Robot


@dataclass(frozen=True, eq=False)
class Calibration:
    """Corrections of a robot's model; what is not named is as the model says.

    Args:
        robot: name of the robot that it belongs to.
        offsets: {variable: angle [rad]} added to what the encoder says; variables of gaze and arm.
        links: {joint of the URDF: (3,) [m]} added to the joint's origin, in the frame of its parent.
        mountings: {camera: (6,)} pose of the camera in the frame of its link: a rotation vector [rad], then a
            translation [m].
        cameras: {camera: Camera} intrinsics and distortion, in place of the robot's own.
        hand: (K, 3) [m] points of the hand in the palm's frame, (0, 0, 0) unless given.
        covariance: (P, P) of all parameters, in the order of :func:`motorprime.projection.parameter_names`:
            what is known of them, from which a later calibration goes on. None for a calibration that was
            written down and not estimated.

    Raises:
        ArgumentError, ArgumentTypeError: wrong shapes, NaN or infinity; the message names the entry.
    """

    robot: str
    offsets: Mapping[str, float] = field(default_factory=dict)
    links: Mapping[str, Floats] = field(default_factory=dict)
    mountings: Mapping[str, Floats] = field(default_factory=dict)
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    hand: Floats = field(default_factory=lambda: np.zeros((1, 3)))
    covariance: Floats | None = None

    def __post_init__(self) -> None:
        for name, shape in (("offsets", ()), ("links", (3,)), ("mountings", (6,))):
            given = _mapping(name, getattr(self, name))
            checked = {key: fixed(f"{name}['{key}']", value, shape) for key, value in given.items()}
            object.__setattr__(
                self, name, {k: float(v) if shape == () else _frozen(v) for k, v in checked.items()}
            )
        for key, camera in _mapping("cameras", self.cameras).items():
            if not isinstance(camera, Camera):
                raise ArgumentTypeError(f"cameras['{key}']: expected a Camera, got {type(camera).__name__}")
        object.__setattr__(self, "cameras", dict(self.cameras))
        hand = rows("hand", self.hand, 3)
        if len(hand) == 0:
            raise ArgumentError("hand: expected at least one point, got none")
        object.__setattr__(self, "hand", _frozen(hand))
        if self.covariance is not None:
            size = numbers("covariance", self.covariance).shape[:1]
            object.__setattr__(self, "covariance", _frozen(fixed("covariance", self.covariance, size * 2)))

    def check(self, robot: Robot) -> None:
        """Make sure that the corrections are of this robot.

        Raises:
            ArgumentError: another robot's, or a variable, joint or camera that it does not have, or an image
                of another size.
        """
        if self.robot != robot.name:
            raise ArgumentError(
                f"calibration: expected one of robot '{robot.name}', got one of '{self.robot}'"
            )
        _known("variable", self.offsets, (*robot.gaze, *robot.arm))
        _known("joint", self.links, tuple(joint.name for joint in corrected_joints(robot)))
        _known("camera", self.mountings, tuple(robot.cameras))
        _known("camera", self.cameras, tuple(robot.cameras))
        for name, camera in self.cameras.items():
            own = robot.cameras[name].camera
            if (camera.width, camera.height) != (own.width, own.height):
                raise ArgumentError(
                    f"calibration: camera '{name}' has {own.width} x {own.height} px, the calibration's has "
                    f"{camera.width} x {camera.height}"
                )

    def camera(self, robot: Robot, name: str) -> Camera:
        """The corrected camera of a name."""
        return self.cameras.get(name, robot.cameras[name].camera)

    def arrays(self) -> dict[str, Floats]:
        """Its numbers, for a model file; :meth:`about` says which is which."""
        arrays = {
            "offsets": np.array(list(self.offsets.values()), dtype=np.float64),
            "links": np.reshape(list(self.links.values()), (-1, 3)).astype(np.float64),
            "mountings": np.reshape(list(self.mountings.values()), (-1, 6)).astype(np.float64),
            "hand": self.hand,
        }
        return arrays if self.covariance is None else arrays | {"covariance": self.covariance}

    def about(self) -> dict[str, Any]:
        """Names that go with :meth:`arrays`, and the cameras, as JSON can hold them."""
        names = {key: list(getattr(self, key)) for key in ("offsets", "links", "mountings")}
        return {"robot": self.robot, **names, "cameras": {k: asdict(v) for k, v in self.cameras.items()}}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any]) -> Calibration:
        """The calibration that :meth:`arrays` and :meth:`about` describe.

        Raises:
            ArgumentError: something is missing or does not belong together.
        """
        try:
            named = {
                key: dict(zip(about[key], arrays[key], strict=True))
                for key in ("offsets", "links", "mountings")
            }
            cameras = {k: Camera(**v) for k, v in about["cameras"].items()}
            return cls(
                about["robot"], **named, cameras=cameras, hand=arrays["hand"],
                covariance=arrays.get("covariance"),
            )  # fmt: skip
        except (KeyError, TypeError, AttributeError) as error:
            raise ArgumentError(f"calibration: the file lacks or garbles {error}") from None
        except ValueError as error:
            raise ArgumentError(f"calibration: {error}") from None


def corrected_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints of the URDF on the way to the cameras and to the palm, each once."""
    chains = (*robot.camera_chains.values(), robot.reach_chain)
    return tuple({joint.name: joint for chain in chains for joint in chain.joints}.values())


def _known(what: str, given: Iterable[str], known: tuple[str, ...]) -> None:
    unknown = [name for name in given if name not in known]
    if unknown:
        raise ArgumentError(f"calibration: no {what} '{unknown[0]}'; there are {', '.join(known)}")


def _mapping(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ArgumentTypeError(f"{name}: expected a mapping, got {type(value).__name__}")
    return value


def _frozen(array: Floats) -> Floats:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy
