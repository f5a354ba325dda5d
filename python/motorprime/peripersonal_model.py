"""Peripersonal attention, learned: from the posture to each camera's Gaussian in microseconds.

One network per camera gives lambda = g(q) = (u, v, ln L1, L2, ln L3) of Eq. 2, 3 for the joints q of neck and
eyes, so that L L^T is a covariance for every posture. One more gives how much of the space each camera sees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, finite, fixed, image_shape, integer
from ._core import Mlp
from .errors import ArgumentError, ArgumentTypeError, NotInViewError
from .learning.network import Network
from .learning.side_by_side import of_raw_inputs, side_by_side
from .model_files import read_model, write_model
from .peripersonal import MIN_INSIDE, ProjectedGaussian
from .projection.neural import check_robot

KIND = "peripersonal model"
LOG_LIMIT = 12.0
"""Logarithms are clipped to this on both sides, as :func:`motorprime.attention_step` does."""
_IN_VIEW = math.log(MIN_INSIDE - 0.5)  # a count that rounds to enough


class PeripersonalModel:
    """Gaussians of the reachable space, learned over random head and eye postures (section III-B2).

    Args:
        ellipses: {camera: network (inputs) -> (u, v, ln L1, L2, ln L3)}.
        view: network (inputs) -> ln of the number of the cloud's points inside each camera's image.
        shapes: {camera: (height, width)} of the images.
        joints: names of the gaze variables, in the order in which postures are given.
        inputs: those of them that move the cameras against the chest, in the networks' order.
        robot: name of the robot.

    Raises:
        ArgumentError: networks, shapes and joints that do not belong together, networks of different depths.

    The fused cycle takes :attr:`maps` and :meth:`inputs_of` of a posture::

        seen = model.visible(joints)
        maps = {camera: network for camera, network in model.maps.items() if seen[camera]}
        attention_step(maps, model.shapes, joints=model.inputs_of(joints), windows=50, mixing=0.2)
    """

    def __init__(
        self,
        ellipses: Mapping[str, Network],
        view: Network,
        shapes: Mapping[str, tuple[int, int]],
        joints: tuple[str, ...],
        inputs: tuple[str, ...],
        *,
        robot: str,
    ) -> None:
        for name, value in (("ellipses", ellipses), ("shapes", shapes)):
            if not isinstance(value, Mapping):
                raise ArgumentTypeError(f"{name}: expected a mapping of cameras, got {type(value).__name__}")
        if not ellipses or list(ellipses) != list(shapes):
            raise ArgumentError(
                f"ellipses, shapes: expected the same cameras, got {list(ellipses)} and {list(shapes)}"
            )
        self.joints, self.inputs, self.robot = tuple(joints), tuple(inputs), robot
        unknown = [name for name in self.inputs if name not in self.joints]
        if unknown or len(set(self.inputs)) < len(self.inputs):
            raise ArgumentError(f"inputs: expected different ones of {self.joints}, got {self.inputs}")
        self.ellipse_networks, self.view = dict(ellipses), view
        named = {f"ellipses['{camera}']": (network, 5) for camera, network in ellipses.items()}
        for name, (network, outputs) in (named | {"view": (view, len(ellipses))}).items():
            if (network.sizes[0], network.sizes[-1]) != (len(self.inputs), outputs):
                raise ArgumentError(
                    f"{name}: a network from {len(self.inputs)} joints to {outputs} outputs expected, "
                    f"got sizes {network.sizes}"
                )
        self._shapes = {camera: _size(f"shapes['{camera}']", shape) for camera, shape in shapes.items()}
        unscaled = {camera: of_raw_inputs(network) for camera, network in ellipses.items()}
        self._maps = {camera: network.mlp() for camera, network in unscaled.items()}
        # All in one call: a number for each camera's view, then five for each camera's ellipse.
        self._all = side_by_side([of_raw_inputs(view), *unscaled.values()]).mlp()
        self._starts = tuple(range(len(ellipses), 6 * len(ellipses), 5))
        self._posture = (len(self.joints),)
        self._at = np.array([self.joints.index(name) for name in self.inputs], dtype=np.intp)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(self._maps)

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each camera's image."""
        return dict(self._shapes)

    @property
    def maps(self) -> dict[str, Mlp]:
        """The networks as kernels, for :func:`motorprime.attention_step`."""
        return dict(self._maps)

    def inputs_of(self, joints: npt.ArrayLike) -> Floats:
        """The networks' inputs (len(inputs),) [rad] of a gaze posture (len(joints),).

        Raises:
            ArgumentError: a posture of another length or with NaN, be it in the torso.
        """
        if isinstance(joints, np.ndarray) and joints.dtype == np.float64 and joints.shape == self._posture:
            posture: Floats = joints
            # Plain Python is five times faster than NumPy on so few numbers.
            if not all(map(math.isfinite, posture.tolist())):
                finite("joints", posture)
        else:
            posture = fixed("joints", joints, self._posture)
        inputs: Floats = posture[self._at]
        return inputs

    def visible(self, joints: npt.ArrayLike) -> dict[str, bool]:
        """Whether each camera has the reachable space in view: 50 points of its cloud inside the image.

        Raises:
            ArgumentError: as for :meth:`inputs_of`.
        """
        values = self._all(self.inputs_of(joints)[None]).tolist()[0]
        return {camera: log >= _IN_VIEW for camera, log in zip(self._maps, values, strict=False)}

    def ellipses(self, joints: npt.ArrayLike) -> dict[str, ProjectedGaussian]:
        """The Gaussian in each camera that has the reachable space in view, for one gaze posture [rad].

        It is what :func:`motorprime.fit_peripersonal` gives, some hundred times faster.

        Raises:
            ArgumentError: as for :meth:`inputs_of`.
            NotInViewError: no camera has the reachable space in view.
        """
        values = self._all(self.inputs_of(joints)[None]).tolist()[0]
        fits = {}
        for camera, log, at in zip(self._maps, values, self._starts, strict=False):
            if log >= _IN_VIEW:
                u, v, log1, l2, log3 = values[at : at + 5]
                gaussian = np.array((u, v, _exp(log1), l2, _exp(log3)))
                fits[camera] = ProjectedGaussian(gaussian[:2], gaussian[2:], round(_exp(log)))
        if not fits:
            raise NotInViewError(
                f"the reachable space is in view of none of the cameras {', '.join(self._maps)}; "
                "look elsewhere"
            )
        return fits

    def resized(self, shapes: Mapping[str, tuple[int, int]]) -> PeripersonalModel:
        """The model of the same cameras' images resized to other shapes (height, width).

        With s_u and s_v the factors, u' = (u + 0.5) s_u - 0.5, L1' = s_u L1, L2' = s_v L2, L3' = s_v L3, and
        v as u.

        Raises:
            ArgumentError: other cameras.
        """
        if set(shapes) != set(self._shapes):
            raise ArgumentError(
                f"shapes: expected cameras {', '.join(self._shapes)}, got {', '.join(shapes)}"
            )
        networks = {}
        for camera, network in self.ellipse_networks.items():
            (tall, wide), (height, width) = self._shapes[camera], _size(f"shapes['{camera}']", shapes[camera])
            across, down = width / wide, height / tall
            factor = np.array([across, down, 1.0, down, 1.0])
            mean = network.output_mean * factor
            mean += (0.5 * across - 0.5, 0.5 * down - 0.5, math.log(across), 0.0, math.log(down))
            networks[camera] = replace(network, output_mean=mean, output_std=network.output_std * factor)
        sizes = {camera: shapes[camera] for camera in self._shapes}
        return PeripersonalModel(networks, self.view, sizes, self.joints, self.inputs, robot=self.robot)

    def save(self, path: str | Path) -> None:
        """Write everything to a file (safetensors); it is replaced at once or not at all.

        Raises:
            ArgumentError: the file cannot be written.
        """
        arrays = self.view.arrays("view.")
        for camera, network in self.ellipse_networks.items():
            arrays |= network.arrays(f"{camera}.ellipse.")
        about = {
            "robot": self.robot,
            "joints": list(self.joints),
            "inputs": list(self.inputs),
            "cameras": {camera: list(shape) for camera, shape in self._shapes.items()},
        }
        write_model(path, KIND, arrays, about)

    @classmethod
    def load(cls, path: str | Path, *, robot: str | None = None) -> PeripersonalModel:
        """Read what :meth:`save` wrote.

        Args:
            path: the file.
            robot: name of the robot that it must belong to; None for any.

        Raises:
            ArgumentError: the file is missing, cut off, of another kind or of another robot.
        """
        arrays, about = read_model(path, KIND)
        check_robot(path, about.get("robot"), robot)
        try:
            cameras = {camera: tuple(shape) for camera, shape in about["cameras"].items()}
            return cls(
                {camera: Network.from_arrays(arrays, f"{camera}.ellipse.") for camera in cameras},
                Network.from_arrays(arrays, "view."),
                cameras,
                tuple(about["joints"]),
                tuple(about["inputs"]),
                robot=about["robot"],
            )
        except (KeyError, ValueError, TypeError, AttributeError) as error:
            raise ArgumentError(f"path: {path} does not hold a whole {KIND}: {error}") from None


def _exp(log: float) -> float:
    """The clipped exponential; it is the C library's, as in the kernels, so that not a bit differs."""
    if log > LOG_LIMIT:
        log = LOG_LIMIT
    elif log < -LOG_LIMIT:
        log = -LOG_LIMIT
    return math.exp(log)


def _size(name: str, shape: object) -> tuple[int, int]:
    height, width = image_shape(name, shape)
    return integer(name, height, at_least=1), integer(name, width, at_least=1)
