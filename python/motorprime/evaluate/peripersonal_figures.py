"""Learned peripersonal attention against the direct fit: overlap of the ellipses, and time to infer them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator, integer
from ..errors import StateError
from ..learning.posture_ellipses import PostureEllipses, fit_postures, random_head_eye
from ..peripersonal import ReachCloud
from ..peripersonal_model import PeripersonalModel
from ..projection import KinematicProjection
from ..robot import Robot
from .common import Progress

CUTOFF = 3.0
"""The ellipses are those of three standard deviations (Eq. 5)."""
LEAST_SHARE = 0.1
"""Postures are judged with at least this share of the cloud inside an image."""
_ROUND, _ROUNDS = 1000, 50  # postures drawn at a time, and how often
_CALLS = 10000
_CHORDS = 2048


def evaluate_peripersonal(
    model: PeripersonalModel,
    robot: Robot,
    seed: int = 0,
    postures: int = 500,
    *,
    cloud: ReachCloud | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Learned Gaussians against direct fits, over unseen uniform head and eye postures.

    Postures count that have at least 10 % of the cloud in the image of a camera, and of these the cameras
    that do; where the model says that such a camera sees nothing, the overlap is zero.

    Args:
        model: of this robot.
        robot: with its URDF.
        seed: draws the postures.
        postures: to judge.
        cloud: the reachable space; by default :class:`ReachCloud` of the robot, as for learning.
        progress: shows how far it is.

    Returns:
        postures; ellipses, that were compared in all cameras; iou_mean, iou_p05, iou_min of the ellipses of
        three standard deviations in the plane, not clipped to the image; view_agreement, the share of all
        drawn postures and cameras for which the model tells in view from out of view as the direct fit does;
        infer_us, median time [us] of :meth:`PeripersonalModel.ellipses` where all cameras have the space in
        view, None without such a posture.

    Raises:
        StateError: too few uniform postures have the reachable space in view.
    """
    postures = integer("postures", postures, at_least=1)
    progress = progress or Progress()
    rng = generator(seed)
    cloud = ReachCloud(robot) if cloud is None else cloud
    drawn, fits = _draw(cloud, rng, postures, progress)
    counts = np.column_stack([_counts(fits[camera], cloud) for camera in model.cameras])
    judged = np.flatnonzero(counts.any(axis=1))[:postures]
    overlaps: list[float] = []
    for k in progress.over(judged, "comparing ellipses"):
        learned = model.ellipses(drawn[k]) if any(model.visible(drawn[k]).values()) else {}
        for camera, counted in zip(model.cameras, counts[k], strict=True):
            if not counted:
                continue
            direct, found = fits[camera], learned.get(camera)
            overlaps.append(
                0.0 if found is None else overlap(direct.mean[k], direct.chol[k], found.mean, found.chol)
            )
    agree = [
        [seen == fits[camera].in_view[k] for camera, seen in model.visible(joints).items()]
        for k, joints in enumerate(drawn)
    ]
    everywhere = np.all([fits[camera].in_view for camera in model.cameras], axis=0)
    return {
        "seed": seed,
        "postures": postures,
        "ellipses": len(overlaps),
        "iou_mean": float(np.mean(overlaps)),
        "iou_p05": float(np.percentile(overlaps, 5)),
        "iou_min": float(np.min(overlaps)),
        "view_agreement": float(np.mean(agree)),
        "infer_us": _microseconds(model, drawn[everywhere]),
    }


def overlap(mean: Floats, chol: Floats, other_mean: Floats, other_chol: Floats) -> float:
    """Intersection over union of the 3-sigma ellipses of two Gaussians: means (2,), factors (3,) [px].

    Seen from where the first is the unit circle, both areas change alike. The other is there the ellipse of
    a centre (x0, y0) and a covariance S; at the abscissa x = sin t its chord has the middle
    y0 + S_xy / S_xx (x - x0) and half the length sqrt((S_yy - S_xy^2 / S_xx) (1 - (x - x0)^2 / S_xx)). What
    the chords share is summed over t.
    """
    factor = CUTOFF * _lower(chol)
    x0, y0 = np.linalg.solve(factor, other_mean - mean)
    other = np.linalg.solve(factor, CUTOFF * _lower(other_chol))
    (xx, xy), (_, yy) = other @ other.T
    t = np.pi * ((np.arange(_CHORDS) + 0.5) / _CHORDS - 0.5)
    half, x = np.cos(t), np.sin(t)
    middle = y0 + xy / xx * (x - x0)
    other_half = np.sqrt(np.maximum((yy - xy * xy / xx) * (1.0 - (x - x0) ** 2 / xx), 0.0))
    shared = np.minimum(half, middle + other_half) - np.maximum(-half, middle - other_half)
    common = float(np.sum(np.maximum(shared, 0.0) * half) * np.pi / _CHORDS)
    return common / (np.pi * (1.0 + abs(float(np.linalg.det(other)))) - common)


def _lower(chol: Floats) -> Floats:
    return np.array([[chol[0], 0.0], [chol[1], chol[2]]])


def _counts(fit: PostureEllipses, cloud: ReachCloud) -> npt.NDArray[np.bool_]:
    """(N,) whether the ellipse of each posture is one to be judged."""
    return np.asarray(fit.in_view & (fit.inside >= LEAST_SHARE * len(cloud.points)))


def _draw(
    cloud: ReachCloud, rng: np.random.Generator, wanted: int, progress: Progress
) -> tuple[Floats, dict[str, PostureEllipses]]:
    """Uniform postures and their fits, until enough have a share of the cloud in an image."""
    projection = KinematicProjection(cloud.robot)
    drawn: list[Floats] = []
    parts: list[dict[str, PostureEllipses]] = []
    found = 0

    def rounds() -> Iterator[int]:
        while found < wanted and len(parts) < _ROUNDS:
            yield len(parts)

    for _ in progress.over(rounds(), "fitting postures"):
        drawn.append(random_head_eye(cloud.robot, _ROUND, rng))
        parts.append(fit_postures(cloud, projection, drawn[-1]))
        found += int(np.any([_counts(fit, cloud) for fit in parts[-1].values()], axis=0).sum())
    if found < wanted:
        raise StateError(
            f"postures: {wanted} are wanted, but of {len(parts) * _ROUND} uniform ones only {found} have "
            f"{LEAST_SHARE:.0%} of the reachable space in an image"
        )
    fits = {
        camera: PostureEllipses(
            *(np.concatenate([getattr(part[camera], field) for part in parts]) for field in _FIELDS)
        )
        for camera in parts[0]
    }
    return np.concatenate(drawn), fits


_FIELDS = ("mean", "chol", "inside")


def _microseconds(model: PeripersonalModel, postures: Floats) -> float | None:
    """Median time [us] of one inference for all cameras."""
    seen = [joints for joints in postures if all(model.visible(joints).values())]
    if not seen:
        return None
    times = []
    for k in range(_CALLS):
        joints = seen[k % len(seen)]
        start = time.perf_counter_ns()
        model.ellipses(joints)
        times.append(time.perf_counter_ns() - start)
    return float(np.median(times)) / 1e3
