"""Kinematics, and small networks for what they leave: a lens or an arm that is not as any model says."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, rows
from ..errors import ArgumentError, ArgumentTypeError
from ..learning.network import Network
from ..model_files import read_model, write_model
from ..robot import Robot
from ..samples import Samples
from .base import Projection
from .calibration import Calibration
from .kinematic import KinematicProjection
from .residual import SURE, Form, better, fit_residual, folds, forms

KIND = "hybrid projection"
MEMORY = 1000
"""Samples that are kept for adapting again, the latest."""


class HybridProjection(Projection):
    """A kinematic projection plus, for each camera that needs it, a network's correction in pixels.

    A network's inputs are the pixel (u, v) and the inverse depth [1/m] by kinematics, then the joints [rad].
    Kinematics say what is in front of the camera and where; the networks' corrections are bounded, and only
    :meth:`adapt` makes them.

    Args:
        kinematic: the projection to correct.
        residuals: {camera: network from 3 + len(gaze) inputs to 2 pixels}.
        memory: samples that the networks were made of.

    Raises:
        ArgumentError: a camera that the robot does not have, or a network of other sizes.
    """

    def __init__(
        self,
        kinematic: KinematicProjection,
        residuals: Mapping[str, Network] | None = None,
        memory: Samples | None = None,
    ) -> None:
        if not isinstance(kinematic, KinematicProjection):
            raise ArgumentTypeError(
                f"kinematic: expected a KinematicProjection, got {type(kinematic).__name__}"
            )
        self.kinematic, self.residuals, self.memory = kinematic, dict(residuals or {}), memory
        inputs = 3 + len(kinematic.robot.gaze)
        for name, network in self.residuals.items():
            if name not in kinematic.cameras:
                raise ArgumentError(
                    f"residuals: no camera '{name}'; there are {', '.join(kinematic.cameras)}"
                )
            if (network.sizes[0], network.sizes[-1]) != (inputs, 2):
                raise ArgumentError(
                    f"residuals['{name}']: a network from {inputs} inputs to 2 pixels expected, "
                    f"got sizes {network.sizes}"
                )
        self._mlps = {name: network.mlp() for name, network in self.residuals.items()}

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return self.kinematic.cameras

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each camera's image."""
        return self.kinematic.shapes

    def project(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Project points (N, 3) to pixels {name: (N, 2)}; see :meth:`Projection.project`."""
        points = rows("points", points, 3)
        return {
            name: self._pixels(name, camera.to_camera(points), np.asarray(joints, dtype=np.float64))
            for name, camera in self.kinematic.posed(joints).items()
        }

    def hand_pixels(self, joints: npt.ArrayLike) -> dict[str, Floats]:
        """Where the hand appears, from encoders alone; see :meth:`KinematicProjection.hand_pixels`."""
        points = self.kinematic.hand_points(joints)
        gaze = np.asarray(joints, dtype=np.float64)[..., : len(self.kinematic.robot.gaze)]
        repeated = np.repeat(np.atleast_2d(gaze), points.shape[-2], axis=0)
        return {
            name: self._pixels(name, local.reshape(-1, 3), repeated).reshape(*local.shape[:-1], 2)
            for name, local in self.kinematic.in_cameras(points, gaze).items()
        }

    def _pixels(self, name: str, local: Floats, joints: Floats) -> Floats:
        """Pixels (N, 2) of points (N, 3) in the camera's frame; joints (J,) or (N, J)."""
        pixels = self.kinematic.camera(name).project(local)
        if name in self._mlps:
            seen = ~np.isnan(pixels[:, 0])
            x = _inputs(pixels[seen], local[seen], joints if joints.ndim == 1 else joints[seen])
            pixels[seen] += self._mlps[name](x)
        return pixels

    def jacobian(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Derivatives {name: (N, 2, 3)} [px / m] of ``project`` by the points.

        With w the inverse depth and a the optical axis, dw/dx = -w^2 a^T.
        """
        points = rows("points", points, 3)
        slopes = {}
        for name, camera in self.kinematic.posed(joints).items():
            local = camera.to_camera(points)
            pixels = camera.camera.project(local)
            slope = camera.camera.jacobian(local) @ camera.pose[:3, :3].T
            if name in self._mlps:
                seen = ~np.isnan(pixels[:, 0])
                x = _inputs(pixels[seen], local[seen], np.asarray(joints, dtype=np.float64))
                by_input = self._mlps[name].jacobian(x)
                by_depth = -(x[:, 2, None] ** 2) * camera.pose[:3, 2]
                slope[seen] += by_input[:, :, :2] @ slope[seen] + by_input[:, :, 2:3] * by_depth[:, None, :]
            slopes[name] = slope
        return slopes

    def depths(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Return the depth along each optical axis {name: (N,)} [m], by kinematics."""
        return self.kinematic.depths(points, joints)

    def adapt(self, samples: Samples) -> HybridProjection:
        """A projection adapted by samples; this one stays as it is.

        First the kinematics are calibrated. Then a camera gets a network if, on samples held out from it and
        from this calibration, it is better than none by more than chance. Adapting again goes on from the
        calibration, and makes new networks of the latest 1000 samples; samples without points, which are of
        the hand, and samples with points are not kept together.

        Raises:
            ArgumentError: samples of which :func:`motorprime.projection.calibrate` cannot make anything.
        """
        if not isinstance(samples, Samples):
            raise ArgumentTypeError(f"samples: expected Samples, got {type(samples).__name__}")
        kinematic = self.kinematic.adapt(samples)
        pool = _joined(self.memory, samples, self.kinematic)
        residuals = {}
        for name, form in self._chosen_forms(pool, min(len(samples), MEMORY)).items():
            x, errors = _left_over(kinematic, pool, name)
            residuals[name] = fit_residual(x, errors, form)
        return HybridProjection(kinematic, residuals, pool)

    def _chosen_forms(self, pool: Samples, new: int) -> dict[str, Form]:
        """The best form for each camera that is better off with a network; the last ``new`` rows are new."""
        tried = forms((2, 3, 3 + len(self.kinematic.robot.gaze)))
        without: dict[str, list[Floats]] = {name: [] for name in pool.cameras}
        with_it: dict[str, list[list[Floats]]] = {name: [] for name in pool.cameras}
        is_new = np.arange(len(pool)) >= len(pool) - new
        for held_out in folds(len(pool)):
            kinematic = self._calibrated(pool.take(is_new & ~held_out))
            if kinematic is None:
                return {}
            for name in pool.cameras:
                x, errors = _left_over(kinematic, pool.take(~held_out), name)
                unseen, left = _left_over(kinematic, pool.take(held_out), name)
                if len(x) == 0:
                    continue
                without[name].append(np.linalg.norm(left, axis=1))
                networks = [fit_residual(x, errors, form) for form in tried]
                with_it[name].append([np.linalg.norm(left - n.forward(unseen), axis=1) for n in networks])
        chosen = {}
        for name, parts in without.items():
            if not parts:
                continue
            alone = np.concatenate(parts)
            gains = [
                better(alone, np.concatenate([fold[k] for fold in with_it[name]])) for k in range(len(tried))
            ]
            if max(gains) > SURE:
                chosen[name] = tried[int(np.argmax(gains))]
        return chosen

    def _calibrated(self, samples: Samples) -> KinematicProjection | None:
        """The kinematics adapted; as they are where the samples are too few, and None if nothing is known."""
        try:
            return self.kinematic.adapt(samples)
        except ArgumentError:
            return None if self.kinematic.calibration.covariance is None else self.kinematic

    def save(self, path: str | Path) -> None:
        """Write calibration, networks and the samples kept to a file (safetensors).

        Raises:
            ArgumentError: the file cannot be written.
        """
        calibration, memory = self.kinematic.calibration, self.memory
        arrays = dict(calibration.arrays())
        for name, network in self.residuals.items():
            arrays |= network.arrays(f"{name}.residual.")
        if memory is not None:
            arrays |= {"memory.joints": memory.joints}
            arrays |= {} if memory.points is None else {"memory.points": memory.points}
            arrays |= {f"memory.pixels.{name}": pixels for name, pixels in memory.pixels.items()}
        about = calibration.about() | {
            "residuals": list(self.residuals),
            "memory": None if memory is None else {"names": memory.names, "cameras": memory.cameras},
        }
        write_model(path, KIND, arrays, about)

    @classmethod
    def load(cls, path: str | Path, robot: Robot) -> HybridProjection:
        """Read what :meth:`save` wrote for this robot.

        Raises:
            ArgumentError: no such file, cut off, of another kind or of another robot.
        """
        arrays, about = read_model(path, KIND)
        try:
            kinematic = KinematicProjection(robot, Calibration.from_arrays(arrays, about))
            residuals = {
                name: Network.from_arrays(arrays, f"{name}.residual.") for name in about["residuals"]
            }
            kept, memory = about["memory"], None
            if kept is not None:
                memory = Samples(
                    tuple(kept["names"]),
                    arrays["memory.joints"],
                    {name: arrays[f"memory.pixels.{name}"] for name in kept["cameras"]},
                    arrays.get("memory.points"),
                )
            return cls(kinematic, residuals, memory)
        except (KeyError, TypeError, ValueError) as error:
            raise ArgumentError(f"path: {path} does not hold a whole {KIND}: {error}") from None

    def _starts(self, pixels: Mapping[str, Floats], joints: npt.ArrayLike | None) -> list[Floats]:
        return self.kinematic._starts(pixels, joints)


def _inputs(pixels: Floats, local: Floats, joints: Floats) -> Floats:
    """Inputs (N, 3 + joints) of a network; joints (J,) or (N, J)."""
    x = np.empty((len(pixels), 3 + joints.shape[-1]))
    x[:, :2], x[:, 2], x[:, 3:] = pixels, 1.0 / local[:, 2], joints
    return x


def _left_over(kinematic: KinematicProjection, samples: Samples, name: str) -> tuple[Floats, Floats]:
    """Inputs (M, in) of one camera's network and what kinematics leave of the labels (M, 2) [px]."""
    robot, points = kinematic.robot, samples.points
    joints = samples.columns(robot.gaze)
    places = (
        kinematic.hand_points(samples.columns(_joints(robot, samples))) if points is None else points[:, None]
    )
    local = kinematic.in_cameras(places, joints)[name][:, 0]
    pixels = kinematic.camera(name).project(local)
    good = samples.seen(name) & ~np.isnan(pixels[:, 0])
    return _inputs(pixels[good], local[good], joints[good]), samples.pixels[name][good] - pixels[good]


def _joined(memory: Samples | None, samples: Samples, kinematic: KinematicProjection) -> Samples:
    """The latest of both, in the robot's order of joints; a camera that one of them lacks saw nothing."""
    parts = [samples]
    if memory is not None and (memory.points is None) == (samples.points is None):
        parts = [memory, samples]
    names = _joints(kinematic.robot, samples)
    blind = {len(part): np.full((len(part), 2), np.nan) for part in parts}
    points = [part.points for part in parts if part.points is not None]
    return Samples(
        names,
        np.concatenate([part.columns(names) for part in parts])[-MEMORY:],
        {
            name: np.concatenate([part.pixels.get(name, blind[len(part)]) for part in parts])[-MEMORY:]
            for name in kinematic.cameras
        },
        np.concatenate(points)[-MEMORY:] if points else None,
    )


def _joints(robot: Robot, samples: Samples) -> tuple[str, ...]:
    """The joints that count: where the samples are of the hand, the arm's too."""
    return robot.gaze if samples.points is not None else (*robot.gaze, *robot.arm)
