"""Projection by networks that babbling taught (Eq. 1): no kinematics, no calibrated cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, fixed, integer, numbers, positive, rows
from .._core import Mlp
from ..errors import ArgumentError, ArgumentTypeError
from ..learning.network import Network
from ..model_files import read_model, write_model
from ..samples import Samples
from .adaptation import Correction, adapt_networks
from .base import Projection

KIND = "neural projection"
UNSEEN = -0.7
"""Below this judgement a point is taken as far out of view, where the network for pixels knows nothing. What
is in view and judged lower is 0.1 to 0.8 % of the points; near the border the pixel itself tells better."""

KNOWN = 5.0
"""Points farther from the mean of those seen in training, in their standard deviations, are not known."""
ABSURD = 10.0
"""So far off its mean in training is no joint and no point of samples that are in radians and metres."""


@dataclass(frozen=True, eq=False)
class LearnedCamera:
    """What was learned about one camera.

    Attributes:
        shape: (height, width) of its images.
        place: network (x, y, z, joints) -> (u, v).
        sight: network (x, y, z, joints) -> 1 where the camera sees the point, -1 where it does not.
        error: median error [px] of ``place`` on samples that it was not trained on.
    """

    shape: tuple[int, int]
    place: Network
    sight: Network
    error: float


class NeuralProjection(Projection):
    """Where points appear, learned: one network for the pixel and one for the view in each camera.

    Args:
        learned: what is known of each camera, by name.
        joints: names of the joints, in the order in which postures are given.
        robot: name of the robot that babbled.
        points: (S, 3) [m] places from which triangulation starts, among those seen in training.
        correction: what adapting has learned so far, see :meth:`adapt`.

    Raises:
        ArgumentError: networks whose inputs are not three coordinates and the joints, an error that is no
            positive number, no points.
    """

    def __init__(
        self,
        learned: Mapping[str, LearnedCamera],
        joints: tuple[str, ...],
        *,
        robot: str,
        points: npt.ArrayLike,
        correction: Correction | None = None,
    ) -> None:
        if not isinstance(learned, Mapping):
            raise ArgumentTypeError(f"learned: expected a mapping of cameras, got {type(learned).__name__}")
        if not learned:
            raise ArgumentError("learned: expected at least one camera, got none")
        self.joints, self.robot = tuple(joints), robot
        self.learned = dict(learned)
        inputs = 3 + len(self.joints)
        for camera, part in self.learned.items():
            for name, network, outputs in (("place", part.place, 2), ("sight", part.sight, 1)):
                if (network.sizes[0], network.sizes[-1]) != (inputs, outputs):
                    raise ArgumentError(
                        f"learned['{camera}'].{name}: a network from 3 coordinates and {len(self.joints)} "
                        f"joints to {outputs} expected, got sizes {network.sizes}"
                    )
            positive(f"learned['{camera}'].error", part.error)
        self._starting = rows("points", points, 3)
        if len(self._starting) == 0:
            raise ArgumentError("points: expected at least one place, got none")
        places = [part.place for part in self.learned.values()]
        low = np.min([p.input_mean[:3] - KNOWN * p.input_std[:3] for p in places], axis=0)
        high = np.max([p.input_mean[:3] + KNOWN * p.input_std[:3] for p in places], axis=0)
        self._middle, self._reach = (low + high) / 2.0, (high - low) / 2.0
        first = places[0]
        self.correction = correction or Correction.none(first, tuple(self.learned))
        self._places = {
            name: self.correction.apply_to_pixels(name, part.place).mlp()
            for name, part in self.learned.items()
        }
        # From here on negative means unseen.
        self._sights = {
            name: self.correction.apply(
                replace(part.sight, output_mean=part.sight.output_mean - UNSEEN)
            ).mlp()
            for name, part in self.learned.items()
        }
        self._maps = {name: (place, self._sights[name]) for name, place in self._places.items()}

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(self.learned)

    @property
    def shapes(self) -> dict[str, tuple[int, int]]:
        """(height, width) [px] of each camera's image."""
        return {name: part.shape for name, part in self.learned.items()}

    @property
    def maps(self) -> dict[str, tuple[Mlp, Mlp]]:
        """The networks {camera: (place, sight)} for ``attention_step(projection.maps, projection.shapes,
        points=path, joints=joints)``, which projects as :meth:`project` does, but for points that are far
        from all that was babbled: it takes them as they come.
        """
        return dict(self._maps)

    def project(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Project points (N, 3) to pixels {name: (N, 2)}; see :meth:`Projection.project`.

        A row is NaN where the point is far out of the camera's view, be it behind it, or far from all that
        was babbled: the networks have learned from what was seen, and elsewhere say anything.
        """
        x = self._inputs(points, joints)
        far = self._far(x[:, :3])
        pixels: dict[str, Floats] = {}
        for name, place in self._places.items():
            there = place(x).astype(np.float64)
            unseen = self._sights[name](x)[:, 0] < 0.0
            there[unseen if far is None else unseen | far] = np.nan
            pixels[name] = there
        return pixels

    def triangulate(self, pixels: Mapping[str, npt.ArrayLike], joints: npt.ArrayLike | None = None) -> Floats:
        """Return the points (N, 3) [m] that appear at pixels; see :meth:`Projection.triangulate`.

        A row is NaN where the pixels lead far from all that was babbled, too.
        """
        points = super().triangulate(pixels, joints)
        far = self._far(points)
        if far is not None:
            points[far] = np.nan
        return points

    def _far(self, points: Floats) -> npt.NDArray[np.bool_] | None:
        """Which of the points (N, 3) are far from those of training; None where none is."""
        beyond = np.abs(points - self._middle) > self._reach
        return np.asarray(beyond.any(axis=1)) if beyond.any() else None

    def jacobian(self, points: npt.ArrayLike, joints: npt.ArrayLike | None = None) -> dict[str, Floats]:
        """Derivatives {name: (N, 2, 3)} [px / m] of ``project`` by the points."""
        x = self._inputs(points, joints)
        return {name: place.jacobian(x)[:, :, :3].astype(np.float64) for name, place in self._places.items()}

    def adapt(self, samples: Samples) -> NeuralProjection:
        """A projection adapted to another robot, or to this one as it is, by about 100 samples.

        The networks stay as they are; their inputs and outputs are corrected, see
        :func:`motorprime.projection.adaptation.adapt_networks`. Adapting again goes on from the knowledge of
        all samples before.

        Raises:
            ArgumentError: other joints or cameras, samples without points, or too few of them.
        """
        if not isinstance(samples, Samples):
            raise ArgumentTypeError(f"samples: expected Samples, got {type(samples).__name__}")
        unknown = [camera for camera in samples.cameras if camera not in self.learned]
        if unknown:
            raise ArgumentError(f"samples: no camera '{unknown[0]}'; there are {', '.join(self.learned)}")
        x = self.inputs_of(samples)
        self._check_units(x)
        networks = {name: part.place for name, part in self.learned.items()}
        pixels = {name: samples.pixels[name] for name in self.cameras if name in samples.pixels}
        errors = {name: part.error for name, part in self.learned.items()}
        correction = adapt_networks(networks, errors, self.correction, x, pixels)
        return NeuralProjection(
            self.learned, self.joints, robot=self.robot, points=self._starting, correction=correction
        )

    def resized(self, shapes: Mapping[str, tuple[int, int]]) -> NeuralProjection:
        """The projection into the same cameras' images resized to other shapes (height, width).

        Pixel centres are at integers, so with s = new width / width, u' = (u + 0.5) s - 0.5.

        Raises:
            ArgumentError: a camera is missing, or the projection was adapted; resize first, then adapt.
        """
        if self.correction.samples:
            raise ArgumentError("shapes: this projection was adapted to images of its own size; resize first")
        learned = {}
        for name, part in self.learned.items():
            if name not in shapes:
                raise ArgumentError(f"shapes: no camera '{name}'; there are {', '.join(shapes)}")
            height, width = (integer("shapes", side, at_least=1) for side in shapes[name])
            scale = np.array([width / part.shape[1], height / part.shape[0]])
            place = replace(
                part.place,
                output_mean=(part.place.output_mean + 0.5) * scale - 0.5,
                output_std=part.place.output_std * scale,
            )
            error = part.error * float(np.sqrt(scale.prod()))
            learned[name] = LearnedCamera((height, width), place, part.sight, error)
        return NeuralProjection(learned, self.joints, robot=self.robot, points=self._starting)

    def inputs_of(self, samples: Samples) -> Floats:
        """The networks' inputs (N, 3 + joints) of samples.

        Raises:
            ArgumentError: samples without points, or of a robot without these joints.
        """
        return inputs_of(samples, self.joints)

    def _check_units(self, x: Floats) -> None:
        """Raise an :class:`ArgumentError` for degrees or millimetres."""
        place = next(iter(self.learned.values())).place
        off = np.abs((x - place.input_mean) / place.input_std)
        off[:, list(place.constant)] = 0.0
        if (off > ABSURD).any():
            row, column = (int(k) for k in np.argwhere(off > ABSURD)[0])
            name = ("x", "y", "z", *self.joints)[column]
            raise ArgumentError(
                f"samples: {name} = {x[row, column]:g} in row {row} is far from all that was babbled; "
                "metres and radians expected"
            )

    def save(self, path: str | Path) -> None:
        """Write everything to a file (safetensors); it is replaced at once or not at all.

        Raises:
            ArgumentError: the file cannot be written.
        """
        arrays: dict[str, Floats] = {"points": self._starting, **self.correction.arrays()}
        for name, part in self.learned.items():
            arrays |= part.place.arrays(f"{name}.place.") | part.sight.arrays(f"{name}.sight.")
        about = {
            "robot": self.robot,
            "joints": list(self.joints),
            "cameras": {
                name: {"shape": list(part.shape), "error": part.error} for name, part in self.learned.items()
            },
        }
        write_model(path, KIND, arrays, about)

    @classmethod
    def load(cls, path: str | Path, *, robot: str | None = None) -> NeuralProjection:
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
            learned = {}
            for name, camera in about["cameras"].items():
                height, width = camera["shape"]
                learned[name] = LearnedCamera(
                    (integer("height", height, at_least=1), integer("width", width, at_least=1)),
                    Network.from_arrays(arrays, f"{name}.place."),
                    Network.from_arrays(arrays, f"{name}.sight."),
                    camera["error"],
                )
            joints = tuple(about["joints"])
            correction = Correction.from_arrays(arrays, 3 + len(joints), tuple(learned))
            return cls(learned, joints, robot=about["robot"], points=arrays["points"], correction=correction)
        except (KeyError, ValueError, TypeError, AttributeError) as error:
            raise ArgumentError(f"path: {path} does not hold a whole {KIND}: {error}") from None

    def _inputs(self, points: npt.ArrayLike, joints: npt.ArrayLike | None) -> Floats:
        if joints is None:
            raise ArgumentError(f"joints: a posture of {self.joints} is needed, got None")
        place, posture = numbers("points", points), numbers("joints", joints)
        if place.ndim != 2 or place.shape[1] != 3 or posture.shape != (len(self.joints),):
            (
                rows("points", place, 3),
                fixed("joints", posture, (len(self.joints),)),
            )  # one of them says what is wrong
        x = np.empty((len(place), 3 + len(self.joints)))
        x[:, :3] = place
        x[:, 3:] = posture
        # Plain Python is faster than NumPy on so few joints.
        if not all(map(math.isfinite, posture.tolist())):
            finite("joints", posture)
        # The sum of squares is finite only where all are, and cheaper; one that overflows is looked at again.
        if not math.isfinite(np.vdot(place, place)):
            finite("points", place)
        return x

    _finest = 1e-6  # the kernels are in single precision

    def _linearise(
        self, points: Floats, joints: npt.ArrayLike | None
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        x = self._inputs(points, joints)
        return {name: place(x).astype(np.float64) for name, place in self._places.items()}, self.jacobian(
            points, joints
        )

    def _starts(self, pixels: Mapping[str, Floats], joints: npt.ArrayLike | None) -> list[Floats]:
        stacked = np.stack(list(pixels.values()))
        determined = (~np.isnan(stacked[..., 0])).sum(axis=0) >= 2
        return [np.where(determined[:, None], place, np.nan) for place in self._starting]


def inputs_of(samples: Samples, joints: tuple[str, ...]) -> Floats:
    """Inputs (N, 3 + len(joints)) of networks: the points, then these joints, of samples.

    Raises:
        ArgumentError: samples without points, or without one of the joints.
    """
    if samples.points is None:
        raise ArgumentError("samples: without the points' places a network for them cannot learn")
    return finite("samples", np.hstack([samples.points, samples.columns(joints)]))


def check_robot(path: str | Path, found: object, expected: str | None) -> None:
    """Raise an :class:`ArgumentError` where a model file belongs to another robot than expected."""
    if expected is not None and found != expected:
        raise ArgumentError(f"path: {path} belongs to robot '{found}', not to '{expected}'")
