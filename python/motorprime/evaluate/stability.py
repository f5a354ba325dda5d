"""``motorprime evaluate stability``: from where eye, arm and hand come to rest, and in which order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Floats, generator, integer, positive
from ..control.cds import CoupledDynamics, Ends, Tolerance
from ..rotations import rotation_matrices, rotation_vectors
from .common import Progress

SIDE = 1.0
"""Side [m] of the cube around the goal in which palm, fixation and moved goal lie."""
OPENINGS = (0.2, 1.2)
EARLY = (0.1, 0.02)
"""A hand that is open less than this while the palm is farther than this [m] has closed early."""
LAST_JUMP = 5.0
"""The goal moves at an instant [s] before this one."""
FAR = (1e3, 1e6)
"""Distances [m] at which every density of the mixtures underflows."""
_BATCH = 500


@dataclass(frozen=True)
class _Batch:
    """Random starts (N, 10), and another goal for each: when (N,), where (N, 3), turned how (N, 3, 3)."""

    starts: Floats
    instants: Floats
    places: Floats
    turns: Floats

    @classmethod
    def draw(cls, rng: np.random.Generator, count: int) -> _Batch:
        starts = np.empty((count, 10))
        starts[:, :6] = rng.uniform(-SIDE / 2, SIDE / 2, (count, 6))
        starts[:, 6:9] = _turns(rng, count)
        starts[:, 9] = rng.uniform(*OPENINGS, count)
        places = rng.uniform(-SIDE / 2, SIDE / 2, (count, 3))
        instants = rng.uniform(0.0, LAST_JUMP, count)
        return cls(starts, instants, places, rotation_matrices(_turns(rng, count)))

    def after_the_jump(self, states: Floats) -> Floats:
        """States (N, 10) as seen from the other goals; the point to look at moves along with the goal."""
        seen: Floats = states.copy()
        for part in (slice(0, 3), slice(3, 6)):
            seen[:, part] = ((states[:, part] - self.places)[:, None] @ self.turns)[:, 0]
        back = self.turns.transpose(0, 2, 1)
        seen[:, 6:9] = rotation_vectors(back @ rotation_matrices(states[:, 6:9]))
        return seen


def evaluate_stability(
    model: CoupledDynamics,
    *,
    starts: int = 10_000,
    seconds: float = 60.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Roll out from random starts, and see where everything comes to rest.

    A movement has converged when the fixation point is within 1 mm of the goal's, the palm within 1 mm and 1
    degree, and the hand within 1 % of its opening.

    Args:
        model: the coupled systems.
        starts: how many.
        seconds: of model time that each has.
        seed: draws the starts, and the instants, places and rotations of the moved goals.
        progress: shows how far it is.

    Returns:
        starts, converged, converged_after_jump; closed_early_coupled and closed_early_uncoupled, movements
        whose hand was less than 0.1 open while the palm was farther than 2 cm, with the hand coupled and with
        its expected opening set to 0; median_s and slowest_s, times to converge of those that did;
        far_starts, far_finite and far_nearer, starts from 1 km and 1,000 km, those without NaN or infinity,
        and those whose eye and arm are nearer in their own metrics after the time.
    """
    starts, rng = integer("starts", starts, at_least=1), generator(seed)
    seconds = positive("seconds", seconds)
    dt = min(0.01, model.largest_step)
    plain: list[Ends] = []
    jumped: list[Ends] = []
    free: list[Ends] = []
    for first in (progress or Progress()).over(range(0, starts, _BATCH), "rolling out"):
        batch = _Batch.draw(rng, min(_BATCH, starts - first))
        plain.append(model.ends(batch.starts, dt=dt, seconds=seconds, early=EARLY))
        free.append(model.ends(batch.starts, amplitude=0.0, dt=dt, seconds=seconds, early=EARLY))
        instants = np.minimum(batch.instants, seconds)
        moving = model.ends(batch.starts, dt=dt, seconds=instants, tolerance=Tolerance(0.0, 0.0, 0.0, 0.0))
        seen = batch.after_the_jump(moving.relative)
        jumped.append(model.ends(seen, dt=dt, seconds=seconds - instants))
    times = np.concatenate([ends.arrived for ends in plain])
    after = np.concatenate([ends.arrived for ends in jumped])
    there = np.isfinite(times)
    return {
        "seed": seed,
        "starts": starts,
        "converged": int(there.sum()),
        "converged_after_jump": int(np.isfinite(after).sum()),
        "closed_early_coupled": int(sum(ends.closed_early.sum() for ends in plain)),
        "closed_early_uncoupled": int(sum(ends.closed_early.sum() for ends in free)),
        "median_s": float(np.median(times[there])) if there.any() else None,
        "slowest_s": float(times[there].max()) if there.any() else None,
        **_far(model, rng, dt, seconds),
    }


def _far(model: CoupledDynamics, rng: np.random.Generator, dt: float, seconds: float) -> dict[str, int]:
    batch = _Batch.draw(rng, 100)
    starts = np.concatenate([batch.starts, batch.starts])
    scale = np.repeat(FAR, 100)[:, None]
    for part in (slice(0, 3), slice(3, 6)):
        starts[:, part] *= scale / np.linalg.norm(starts[:, part], axis=1, keepdims=True)
    last = model.ends(starts, dt=dt, seconds=seconds).relative
    nearer = np.ones(len(starts), dtype=bool)
    for part, system in ((slice(0, 3), model.eye), (slice(3, 9), model.arm)):
        nearer &= _energy(last[:, part], system.lyapunov) < _energy(starts[:, part], system.lyapunov)
    finite = np.isfinite(last).all(axis=1)
    return {"far_starts": len(starts), "far_finite": int(finite.sum()), "far_nearer": int(nearer.sum())}


def _energy(states: Floats, metric: Floats) -> Floats:
    energy: Floats = ((states @ metric) * states).sum(axis=1)
    return energy


def _turns(rng: np.random.Generator, count: int) -> Floats:
    """Rotation vectors (N, 3): any axis, any angle up to half a turn."""
    axes = rng.normal(size=(count, 3))
    turns: Floats = rng.uniform(0.0, np.pi, (count, 1)) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return turns
