"""The whole step of attention as a case: plan and joints in, landscapes and windows of both eyes out."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from ..landscape import gibbs_sample, kernel_landscape
from ..step import Attended
from ..step import attention_step as fused
from . import checks
from .cases import SEEDS, Case, Contender, counted_seeds, covered, network_of
from .peers.sampling import chain_uniforms
from .peers.step import Step
from .scene import LAYERS, WINDOWS, Scene
from .timing import Call

WIDTH = 40.0
EYES = ("left", "right")


def attention_step(scene: Scene, name: str) -> Case:
    """Both eyes: a network projects the plan, a landscape of width 40, 50 windows by Gibbs sampling."""
    plan, joints, generator = scene.plan, scene.joints, np.random.default_rng([scene.seed, 6])
    truth = _landscapes(scene)

    def peer(groups: int) -> Contender:
        step = Step(scene, WIDTH, groups)

        def answer() -> Any:
            # The kernels seed the second eye with the next number.
            looks = [
                step(
                    plan,
                    joints,
                    [chain_uniforms(look, seed + eye, WINDOWS) for eye, look in enumerate(truth)],
                )
                for seed in SEEDS
            ]
            return [relevance for relevance, _ in looks[0]], [w for eyes in looks for _, w in eyes]

        return Contender(lambda: step(plan, joints, generator.random((2, 2 * WINDOWS + 1)).tolist()), answer)

    products = sum(before * after for before, after in pairwise(LAYERS))
    under = sum(covered(scene, points, scene.width(WIDTH)) for points in _projected(scene))
    return Case(
        name,
        f"both eyes: network, plan of {len(plan)} points, {WINDOWS} windows",
        _ours(scene),
        {"NumPy, 3 rectangles": peer(3), "NumPy, plain": peer(1)},
        lambda: _call_by_call(scene),
        checks.same_looks,
        2 * 2 * 4 * scene.pixels,
        2 * (2 * len(plan) * products + under),
        beside={"two_threads": step_call(scene, threads=True)},
    )


def step_call(scene: Scene, *, threads: bool = False) -> Call:
    """The step as a control loop calls it: every cycle writes to the arrays of the one before."""
    step, seeds = _step(scene, threads), counted_seeds()
    kept: dict[str, Attended] = {}

    def run() -> None:
        nonlocal kept
        kept = step(seeds(), kept)

    return run


def _ours(scene: Scene) -> Contender:
    step = _step(scene, threads=False)

    def answer() -> Any:
        looks = [list(step(seed, None).values()) for seed in SEEDS]
        windows = [look.centres for eyes in looks for look in eyes]
        return [look.landscape for look in looks[0]], windows

    return Contender(step_call(scene), answer)


def _step(scene: Scene, threads: bool) -> Callable[[int, dict[str, Attended] | None], dict[str, Attended]]:
    maps = {name: network_of(scene.network(eye)) for eye, name in enumerate(EYES)}
    shapes = dict.fromkeys(EYES, scene.shape)
    width = scene.width(WIDTH)
    return lambda seed, out: fused(
        maps,
        shapes,
        scene.plan,
        scene.joints,
        windows=WINDOWS,
        width=width,
        seed=seed,
        threads=threads,
        out=out,
    )


def _projected(scene: Scene) -> list[Any]:
    inputs = np.hstack([scene.plan, np.broadcast_to(scene.joints, (len(scene.plan), len(scene.joints)))])
    return [network_of(scene.network(eye))(inputs) for eye in range(2)]


def _call_by_call(scene: Scene) -> Any:
    """The landscapes of both eyes, and the windows of every seed and eye, by the library's single calls."""
    looks = _landscapes(scene)
    windows = [
        gibbs_sample(relevance, WINDOWS, seed=seed + eye)
        for seed in SEEDS
        for eye, relevance in enumerate(looks)
    ]
    return looks, windows


def _landscapes(scene: Scene) -> list[Any]:
    return [kernel_landscape(points, scene.shape, width=scene.width(WIDTH)) for points in _projected(scene)]
