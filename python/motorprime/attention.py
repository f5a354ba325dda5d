"""The cycle: posture or plan -> landscape per camera -> where to look.

:class:`Attention` is all that a robot with its own cameras and its own detector needs; see the README.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ._arrays import Floats
from .detectors.base import Mask, Tiles, Windows
from .errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from .landscape import KernelName, gaussian_landscape, gibbs_sample, regions, threshold
from .motorplan import motorplan_landscape, pixel_landscapes
from .peripersonal import ProjectedGaussian, ReachCloud, fit_peripersonal
from .peripersonal_model import PeripersonalModel
from .projection import Projection
from .step import attention_step


@dataclass(frozen=True, eq=False)
class Look:
    """Where to look in one camera's image.

    Attributes:
        landscape: (H, W) float32, >= 0.

    Raises:
        ArgumentTypeError: the landscape is no float32 array of two dimensions.
    """

    landscape: NDArray[np.float32]

    def __post_init__(self) -> None:
        kind = getattr(self.landscape, "dtype", type(self.landscape).__name__)
        if kind != np.float32 or np.ndim(self.landscape) != 2:
            raise ArgumentTypeError(
                f"landscape: a float32 array (H, W) expected, got {kind} {np.shape(self.landscape)}"
            )

    @property
    def covered(self) -> float:
        """Fraction of the image where the landscape is positive."""
        return float(np.count_nonzero(self.landscape)) / self.landscape.size

    @property
    def is_empty(self) -> bool:
        """Whether the landscape is zero everywhere: nothing motor-relevant lies in this image."""
        return not bool(self.landscape.any())

    def windows(
        self, count: int, *, size: int = 20, seed: int | np.random.Generator | None = None
    ) -> Windows:
        """``count`` windows whose centres are Gibbs samples of the landscape (section IV-B).

        Raises:
            ArgumentError: the landscape is zero everywhere, or ``count`` is negative.
        """
        return Windows(gibbs_sample(self.landscape, count, seed=seed), size)

    def mask(self, *, fraction: float | None = None, count: int | None = None) -> Mask:
        """The most relevant pixels (section IV-A): ``fraction`` of the image, or ``count`` of them.

        Raises:
            ArgumentError: the landscape is zero everywhere, or not exactly one of the two is given.
        """
        level = threshold(self.landscape, fraction=fraction, count=count)
        return Mask((self.landscape >= level) & (self.landscape > 0.0))

    def regions(self, *, fraction: float | None = None, halo: int = 0, align: int = 1) -> Tiles:
        """Rectangles over the most relevant pixels that are cheap to read; see :func:`regions`.

        Raises:
            ArgumentError: the landscape is zero everywhere, or a number is outside its domain.
        """
        return regions(self.landscape, fraction=fraction, halo=halo, align=align)


class Attention:
    """Motor-primed attention over the images of a set of cameras.

    Args:
        projection: from points in the root frame to pixels.
        cloud: the reachable space, for peripersonal attention; motor plans need none.
        peripersonal: what was learned of the reachable space. With it peripersonal attention takes
            microseconds, works with projections that know of no depths, and does not look at ``cloud``.

    Raises:
        ArgumentError: the model was learned for cameras or images that the projection does not have.
    """

    def __init__(
        self,
        projection: Projection,
        *,
        cloud: ReachCloud | None = None,
        peripersonal: PeripersonalModel | None = None,
    ) -> None:
        if peripersonal is not None:
            _check_model(peripersonal, projection)
        self.projection, self.cloud, self.model = projection, cloud, peripersonal

    def peripersonal(self, joints: npt.ArrayLike, *, mixing: float = 1.0) -> dict[str, Look]:
        """Attention to the reachable space (Eq. 4, 5, 10) in each camera that has it in view.

        Args:
            joints: gaze posture [rad].
            mixing: pi of Eq. 10; 1 for thresholds, about 0.2 for windows.

        Raises:
            NotInViewError: the reachable space is in no camera's view.
            StateError: this attention has neither a reach cloud nor a learned model.
        """
        return self.peripersonal_from(self.gaussians(joints), mixing=mixing)

    def peripersonal_from(
        self, gaussians: Mapping[str, ProjectedGaussian], *, mixing: float = 1.0
    ) -> dict[str, Look]:
        """The second half of :meth:`peripersonal`: landscapes of the Gaussians of each camera.

        Raises:
            ArgumentError: a Gaussian of a camera that the projection does not have.
            NotInViewError: every Gaussian's ellipse lies outside its image.
        """
        shapes = self.projection.shapes
        unknown = [camera for camera in gaussians if camera not in shapes]
        if unknown:
            raise ArgumentError(f"gaussians: unknown camera '{unknown[0]}'; there are {', '.join(shapes)}")
        looks = _seen(
            {
                camera: gaussian_landscape(fit.mean, fit.chol, shapes[camera], mixing=mixing)
                for camera, fit in gaussians.items()
            }
        )
        if not looks:
            raise NotInViewError("the reachable space's ellipse lies outside every camera's image")
        return looks

    def gaussians(self, joints: npt.ArrayLike) -> dict[str, ProjectedGaussian]:
        """The Gaussians (Eq. 2, 3) behind :meth:`peripersonal`: learned ones, or else fits to the cloud."""
        if self.model is not None:
            return self.model.ellipses(joints)
        if self.cloud is None:
            raise StateError(
                "cloud: peripersonal attention needs a ReachCloud or a PeripersonalModel; "
                "this Attention has none"
            )
        return fit_peripersonal(self.cloud, self.projection, joints)

    def motor_plan(
        self,
        path: npt.ArrayLike,
        joints: npt.ArrayLike | None = None,
        *,
        width: float | None = None,
        metres: float | None = None,
        kernel: KernelName = "triangular",
    ) -> dict[str, Look]:
        """Attention to a planned path (N, 3) [m] (Eq. 6-9); see :func:`motorplan_landscape`.

        Cameras in whose image the path leaves no trace are left out: all of them, and the result is empty,
        when the path lies in front of the cameras and beside every image.

        Raises:
            ArgumentError: an empty path, NaN, or both widths given.
            NotInViewError: no camera has any of the path in front of it.
        """
        landscapes = motorplan_landscape(
            path, self.projection, joints, width=width, metres=metres, kernel=kernel
        )
        return _seen(landscapes)

    def motor_plan_from(
        self, pixels: Mapping[str, Floats], *, width: float | None = None, kernel: KernelName = "triangular"
    ) -> dict[str, Look]:
        """The second half of :meth:`motor_plan`: landscapes of projected paths {camera: (N, 2)} [px]."""
        return _seen(pixel_landscapes(pixels, self.projection.shapes, width=width, kernel=kernel))

    def step(
        self,
        pixels: Mapping[str, Floats],
        *,
        windows: int,
        size: int = 20,
        width: float | None = None,
        kernel: KernelName = "triangular",
        seed: int | np.random.Generator | None = None,
    ) -> tuple[dict[str, Look], dict[str, Windows]]:
        """:meth:`motor_plan_from` and :meth:`Look.windows` in one call, see :func:`attention_step`.

        Args:
            pixels: {camera: (N, 2)} projected path; NaN rows are points that the camera does not see.
            windows: number of windows per camera.
            size: of the windows [px].
            width: kernel width [px]; default 40 at 320 x 240, scaled with the image.
            kernel: 'triangular' or 'gaussian'.
            seed: as in :func:`attention_step`.

        Returns:
            {camera: look} and {camera: windows}, of the cameras in whose image the path leaves a trace.

        Raises:
            ArgumentError: an unknown camera, or pixels of another shape.
            NotInViewError: only NaN rows in every camera.
        """
        shapes = self.projection.shapes
        attended = attention_step(
            None, shapes, pixels=pixels, windows=windows, width=width, kernel=kernel, seed=seed
        )
        looks, where = {}, {}
        for camera, seen in attended.items():
            assert seen.centres is not None
            looks[camera], where[camera] = Look(seen.landscape), Windows(seen.centres, size)
        return looks, where


def _check_model(model: PeripersonalModel, projection: Projection) -> None:
    if not isinstance(model, PeripersonalModel):
        raise ArgumentTypeError(f"peripersonal: expected a PeripersonalModel, got {type(model).__name__}")
    shapes = projection.shapes
    for camera, shape in model.shapes.items():
        if shapes.get(camera) != shape:
            raise ArgumentError(
                f"peripersonal: it was learned for camera '{camera}' with images {shape}; "
                f"the projection has {shapes}"
            )


def _seen(landscapes: Mapping[str, NDArray[np.float32]]) -> dict[str, Look]:
    looks = {camera: Look(landscape) for camera, landscape in landscapes.items()}
    return {camera: look for camera, look in looks.items() if not look.is_empty}
