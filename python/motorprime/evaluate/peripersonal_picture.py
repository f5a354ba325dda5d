"""A picture of peripersonal attention: the projected cloud, the ellipse fitted to it, and the learned one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Floats, generator, integer
from ..errors import NotInViewError, StateError
from ..learning.posture_ellipses import random_head_eye
from ..peripersonal import EXTENT, ProjectedGaussian, ReachCloud, fit_peripersonal
from ..peripersonal_model import PeripersonalModel
from ..projection import KinematicProjection
from ..report.plots import FULL, INK, LINE, check_plots, styled
from ..robot import Robot
from .peripersonal_figures import CUTOFF, LEAST_SHARE, overlap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEARNED = "#d9480f"
_ATTEMPTS = 2000  # postures drawn to find those in view
_SHOWN = 5.6  # of the plane, in image sizes: the ellipses are whole


def draw_peripersonal(
    model: PeripersonalModel,
    robot: Robot,
    seed: int | np.random.Generator | None = 0,
    postures: int = 3,
    *,
    cloud: ReachCloud | None = None,
) -> Figure:
    """Draw random postures, a row each, that have 10 % of the reachable space in the image of every camera.

    Args:
        model: of this robot.
        robot: with its URDF.
        seed: draws the postures.
        postures: to draw.
        cloud: the reachable space; by default :class:`ReachCloud` of the robot.

    Raises:
        MissingExtraError: matplotlib is missing.
        StateError: too few uniform postures have the reachable space in view.
    """
    check_plots()
    from matplotlib.figure import Figure

    postures = integer("postures", postures, at_least=1)
    cloud = ReachCloud(robot) if cloud is None else cloud
    projection = KinematicProjection(robot)
    chosen = _in_view(cloud, projection, generator(seed), postures)
    with styled():
        columns = len(model.cameras)
        figure = Figure(figsize=(4.6 * columns, 3.5 * postures + 1.0), layout="constrained")
        grid = figure.subplots(postures, columns, squeeze=False)
        for row, joints in zip(grid, chosen, strict=True):
            pixels = projection.project(cloud.in_root(joints), joints)
            direct = fit_peripersonal(cloud, projection, joints)
            try:
                learned = model.ellipses(joints)
            except NotInViewError:
                learned = {}
            for axes, camera in zip(row, model.cameras, strict=True):
                fit, found = direct[camera], learned.get(camera)
                _draw_camera(axes, model.shapes[camera], pixels[camera], fit, found)
                axes.set_title(f"{camera} camera\n{_words(fit, found, len(cloud.points))}", fontsize=9)
        for axes in grid[-1]:
            axes.set_xlabel("u [px]")
        for axes in grid[:, 0]:
            axes.set_ylabel("v [px]")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncol=2, markerscale=5)
        return figure


def _in_view(
    cloud: ReachCloud, projection: KinematicProjection, rng: np.random.Generator, wanted: int
) -> list[Floats]:
    found: list[Floats] = []
    for joints in random_head_eye(cloud.robot, _ATTEMPTS, rng):
        try:
            fits = fit_peripersonal(cloud, projection, joints)
        except NotInViewError:
            continue
        least = LEAST_SHARE * len(cloud.points)
        if len(fits) == len(projection.cameras) and all(fit.inside >= least for fit in fits.values()):
            found.append(joints)
            if len(found) == wanted:
                return found
    raise StateError(
        f"postures: {wanted} are wanted, but of {_ATTEMPTS} uniform ones only {len(found)} have "
        f"{LEAST_SHARE:.0%} of the reachable space in every image"
    )


def _words(direct: ProjectedGaussian, learned: ProjectedGaussian | None, size: int) -> str:
    share = f"{direct.inside / size:.0%} of the positions in the image"
    if learned is None:
        return f"{share}; learned as out of view"
    common = overlap(direct.mean, direct.chol, learned.mean, learned.chol)
    return f"{share}; ellipses overlap {common:.1%}"


def _draw_camera(
    axes: Axes,
    shape: tuple[int, int],
    pixels: Floats,
    direct: ProjectedGaussian,
    learned: ProjectedGaussian | None,
) -> None:
    """The plane around one image, a little farther than points count for the fit."""
    from matplotlib.patches import Rectangle

    height, width = shape
    size, centre = np.array([width, height]), np.array([(width - 1) / 2, (height - 1) / 2])
    for times, face, line, label in (
        (EXTENT, "none", ":", "positions within it count for the fit"),
        (1.0, "#fff3d6", "-", "the image"),
    ):
        corner = centre - times / 2 * size
        patch = Rectangle(tuple(corner), *(times * size), fc=face, ec=INK, ls=line, lw=1.5, zorder=0)
        patch.set_label(label)
        axes.add_patch(patch)
    axes.plot(*pixels.T, ".", ms=1.2, color=FULL, zorder=1, label="reachable positions of the palm")
    axes.plot(*_outline(direct), color=LINE, lw=2.4, label="ellipse fitted to them (3 sigma)")
    if learned is not None:
        axes.plot(*_outline(learned), color=LEARNED, lw=1.6, ls=(0, (4, 3)), label="ellipse learned")
    low, high = centre - _SHOWN / 2 * size, centre + _SHOWN / 2 * size
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    axes.set_aspect("equal")


def _outline(fit: ProjectedGaussian) -> Floats:
    """(2, 181) pixels of the ellipse (Eq. 5)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    l1, l2, l3 = fit.chol
    outline: Floats = CUTOFF * np.array([[l1, 0.0], [l2, l3]]) @ [np.cos(angle), np.sin(angle)]
    return outline + fit.mean[:, None]
