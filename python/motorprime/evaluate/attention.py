"""``motorprime evaluate attention``: how much must be looked at to see what the task needs, by method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats, integer
from ..robot import Robot
from .attention_moments import METHODS, Map, Moment, moments
from .common import Progress
from .trials import each

RECALL = 0.95
GRID = 1000
"""Fractions of the image at which recall is taken: 1 / GRID apart."""
SALIENCY = ("spectral_residual", "fine_grained")
ROUNDS = 12  # of replacing scenes in which the robot did not set out


@dataclass(frozen=True)
class _Asked:
    robot: Robot
    seed: int
    number: int


def evaluate_attention(
    robot: Robot, *, scenes: int = 200, seed: int = 0, workers: int = 1, progress: Progress | None = None
) -> dict[str, Any]:
    """Recall of task-relevant pixels against the part of the image that is looked at, with reaches under way.

    Relevant are the pixels of the glass, of the obstacle on the way to it, and of the own palm and fingers.
    The motor plan is all that the plan involves: the palm's path, the own hand by its encoders, and target
    and obstacle where the robot has located them; palm_path is the path alone, as the paper has it.
    Each method ranks all pixels of an image, and ties are broken at random; the first part of each image is
    looked at. A scene's recall is that of both images together.

    Args:
        robot: with its URDF.
        scenes: how many in which the robot set out.
        seed: of scenes, moments and ties.
        workers: processes.
        progress: shows how far it is.

    Returns:
        scenes, refused (scenes in which it did not set out, replaced), relevant (their mean share of the
        pixels), for each method ``pixels_for_95`` (the part of the pixels at which the mean recall over the
        scenes reaches 0.95) and ``auc`` (the mean recall over all parts from 0 to 1), best_saliency,
        ratio_to_saliency (of the motor plan's pixels_for_95 to that map's), and under ``details`` the mean
        curves at every hundredth.
    """
    progress = progress or Progress()
    scenes = integer("scenes", scenes, at_least=1)
    done: dict[int, tuple[dict[str, Floats], float] | None] = {}
    first = 0
    for _ in range(ROUNDS):
        missing = scenes - sum(result is not None for result in done.values())
        if not missing:
            break
        asked = [_Asked(robot, seed, first + k) for k in range(missing)]
        first += missing
        for one, result in each(_run, asked, "reaching", progress, workers=workers):
            done[one.number] = result
    kept = [result for _, result in sorted(done.items()) if result is not None]
    curves = {name: np.mean([curve[name] for curve, _ in kept], axis=0) for name in METHODS}
    figures = {name: figures_of(curve) for name, curve in curves.items()}
    best = min(SALIENCY, key=lambda name: figures[name]["pixels_for_95"])
    return {
        "seed": seed,
        "scenes": len(kept),
        "refused": len(done) - len(kept),
        "relevant": float(np.mean([share for _, share in kept])),
        **figures,
        "best_saliency": best,
        "ratio_to_saliency": figures["motorplan"]["pixels_for_95"] / figures[best]["pixels_for_95"],
        "details": {name: curve[:: GRID // 100].round(4).tolist() for name, curve in curves.items()},
    }


def figures_of(curve: Floats) -> dict[str, float]:
    """Where a mean recall (GRID + 1,) reaches 95 %, linear in between, and its mean."""
    reached = int(np.argmax(curve >= RECALL))
    low, high = curve[max(reached - 1, 0)], curve[reached]
    part = 0.0 if high <= low else (RECALL - low) / (high - low)
    return {
        "pixels_for_95": float((reached - 1 + part) / GRID) if reached else 0.0,
        "auc": float(np.trapezoid(curve, dx=1.0 / GRID)),
    }


def recalls(seen: Sequence[Moment], generator: np.random.Generator) -> dict[str, Floats]:
    """Recall (GRID + 1,) at every part of the images, for each method.

    Args:
        seen: the images of one scene.
        generator: breaks ties.
    """
    total = sum(int(moment.relevant.sum()) for moment in seen)
    counts = {
        name: [found(moment.maps[name], moment.relevant, generator) for moment in seen] for name in METHODS
    }
    return {name: np.sum(parts, axis=0) / total for name, parts in counts.items()}


def found(values: Map, relevant: NDArray[np.bool_], generator: np.random.Generator) -> Floats:
    """How many relevant pixels are among the first k / GRID of an image, k = 0 .. GRID.

    Args:
        values: (H, W), the larger the earlier; of equal ones a random one comes first.
        relevant: (H, W) bool.
        generator: draws which.
    """
    order = np.lexsort((generator.random(values.size), -values.ravel()))
    counts = np.concatenate([[0], np.cumsum(relevant.ravel()[order])])
    last = np.ceil(np.linspace(0.0, 1.0, GRID + 1) * values.size - 1e-9).astype(np.intp)
    return counts[last].astype(np.float64)


def _run(asked: _Asked) -> tuple[dict[str, Floats], float] | None:
    seen = moments(asked.robot, asked.seed, asked.number)
    if not seen:
        return None
    generator = np.random.default_rng([asked.seed, asked.number, 2])
    return recalls(seen, generator), float(np.mean([moment.relevant.mean() for moment in seen]))
