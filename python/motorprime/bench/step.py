"""The whole step of attention as a case: plan and joints in, landscapes and windows of both eyes out."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..landscape import gibbs_sample, kernel_landscape
from . import checks
from .cases import SEEDS, Case, Contender, covered, network_of
from .peers.sampling import first_uniforms
from .peers.step import Step
from .scene import LAYERS, WINDOWS, Scene

WIDTH = 40.0


def attention_step(scene: Scene, name: str) -> Case:
    """Both eyes: a network projects the plan, a landscape of width 40, 50 windows by Gibbs sampling."""
    plan, joints, generator = scene.plan, scene.joints, np.random.default_rng([scene.seed, 6])
    given = [first_uniforms(seed, 2 * WINDOWS + 1) for seed in SEEDS]

    def peer(groups: int, dtype: Any) -> Contender:
        step = Step(scene, WIDTH, groups, dtype)

        def answer() -> Any:
            looks = [step(plan, joints, [draw, draw]) for draw in given]
            return [relevance for relevance, _ in looks[0]], [w for eyes in looks for _, w in eyes]

        return Contender(lambda: step(plan, joints, generator.random((2, 2 * WINDOWS + 1)).tolist()), answer)

    products = sum(before * after for before, after in pairwise(LAYERS))
    under = sum(covered(scene, points, scene.width(WIDTH)) for points in _projected(scene))
    return Case(
        name,
        f"both eyes: network, plan of {len(plan)} points, {WINDOWS} windows",
        _ours(scene),
        {"NumPy, 3 rectangles": peer(3, np.float32), "NumPy, plain": peer(1, np.float64)},
        lambda: _call_by_call(scene),
        checks.same_looks,
        2 * 2 * 4 * scene.pixels,
        2 * (2 * len(plan) * products + under),
    )


def _ours(scene: Scene) -> Contender | None:
    """The step as one call of the library; None as long as it takes several."""
    return None


def _projected(scene: Scene) -> list[Any]:
    inputs = np.hstack([scene.plan, np.broadcast_to(scene.joints, (len(scene.plan), len(scene.joints)))])
    return [network_of(scene.network(eye))(inputs) for eye in range(2)]


def _call_by_call(scene: Scene) -> Any:
    """The landscapes of both eyes, and the windows of every seed and eye, by the library's single calls."""
    looks = [kernel_landscape(points, scene.shape, width=scene.width(WIDTH)) for points in _projected(scene)]
    return looks, [gibbs_sample(relevance, WINDOWS, seed=seed) for seed in SEEDS for relevance in looks]
