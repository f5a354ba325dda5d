"""What babbling gives: joint states, the places of a point, and its pixels in each camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, rows
from .errors import ArgumentError, ArgumentTypeError


@dataclass(frozen=True, eq=False)
class Samples:
    """N observations of a point by cameras on a robot.

    Args:
        names: the J joints, in the order of the columns of ``joints``.
        joints: (N, J) encoder values [rad].
        pixels: {camera: (N, 2)} (u, v); a NaN row where the camera did not see the point.
        points: (N, 3) [m] in the root frame; None where only the joints say where the point is, as for a
            point on the hand.

    Raises:
        ArgumentError: shapes that do not belong together, names that come twice, NaN or infinity in joints or
            points, half a NaN row of pixels.
    """

    names: tuple[str, ...]
    joints: Floats
    pixels: Mapping[str, Floats]
    points: Floats | None = None

    def __post_init__(self) -> None:
        names = tuple(self.names)
        if len(set(names)) < len(names):
            raise ArgumentError(f"names: a joint comes twice in {names}")
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "joints", rows("joints", self.joints, len(names)))
        if self.points is not None:
            object.__setattr__(self, "points", rows("points", self.points, 3))
        if not isinstance(self.pixels, Mapping):
            raise ArgumentTypeError(
                f"pixels: expected a mapping of cameras, got {type(self.pixels).__name__}"
            )
        if not self.pixels:
            raise ArgumentError("pixels: expected at least one camera, got none")
        pixels = {}
        for camera, value in self.pixels.items():
            name = f"pixels['{camera}']"
            pixels[camera] = rows(name, value, 2, nan=True)
            halves = np.isnan(pixels[camera]).sum(axis=1) == 1
            if halves.any():
                raise ArgumentError(
                    f"{name}: row {int(np.argmax(halves))} has one NaN; both or none expected"
                )
        object.__setattr__(self, "pixels", pixels)
        lengths = {name: len(value) for name, value in pixels.items()} | {"joints": len(self.joints)}
        if self.points is not None:
            lengths["points"] = len(self.points)
        if len(set(lengths.values())) > 1:
            raise ArgumentError(f"samples: expected the same number of rows everywhere, got {lengths}")

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(self.pixels)

    def seen(self, camera: str) -> npt.NDArray[np.bool_]:
        """(N,) whether the camera saw the point."""
        return np.asarray(~np.isnan(self.pixels[camera][:, 0]))

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_] | slice) -> Samples:
        """The samples of an index, a boolean mask or a slice."""
        return Samples(
            self.names,
            self.joints[index],
            {camera: pixels[index] for camera, pixels in self.pixels.items()},
            None if self.points is None else self.points[index],
        )

    def joined(self, other: Samples) -> Samples:
        """These samples and then the other's, of the same joints and cameras.

        Raises:
            ArgumentError: other joints or cameras, or points in one of the two only.
        """
        if (self.names, set(self.cameras)) != (other.names, set(other.cameras)):
            raise ArgumentError(
                f"other: joints {self.names} and cameras {self.cameras} expected, "
                f"got {other.names} and {other.cameras}"
            )
        if (self.points is None) != (other.points is None):
            raise ArgumentError("other: points in one of the two samples only")
        return Samples(
            self.names,
            np.concatenate([self.joints, other.joints]),
            {camera: np.concatenate([uv, other.pixels[camera]]) for camera, uv in self.pixels.items()},
            None
            if self.points is None or other.points is None
            else np.concatenate([self.points, other.points]),
        )

    def columns(self, names: tuple[str, ...]) -> Floats:
        """Columns (N, len(names)) of the joints, in the order asked for.

        Raises:
            ArgumentError: there is no such joint.
        """
        missing = [name for name in names if name not in self.names]
        if missing:
            raise ArgumentError(f"samples: no joint '{missing[0]}'; there are {', '.join(self.names)}")
        return self.joints[:, [self.names.index(name) for name in names]]
