"""``motorprime evaluate rollout``: how long it takes to imagine a movement."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from .._arrays import Floats, integer
from ..bench.peers.dynamics import NumpyCoupledDynamics
from ..bench.timing import Call, Effort, interleave
from ..control.cds import CoupledDynamics
from ..control.movement import Goal, State, Tolerance
from ..rotations import rotation_matrices
from .common import Progress

NEVER = Tolerance(0.0, 0.0, 0.0, 0.0)


def evaluate_rollout(
    model: CoupledDynamics,
    *,
    steps: int = 200,
    seed: int = 0,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Time a roll-out of all five blocks, from one random start, beside the same in NumPy.

    Args:
        model: the coupled systems.
        steps: Euler steps of the roll-out; it is not ended where it arrives.
        seed: of the start.
        effort: how often everything is repeated.
        progress: shows that it is at work.

    Returns:
        Medians of processor time [us]: rust_us, the public call; kernel_us, the kernel without changing
        frames; numpy_us, the peer of the public call. ratio, of numpy_us to rust_us, and kernel_ratio, to
        kernel_us; max_difference, the largest distance of two states divided by the largest of the movement,
        over place, rotation vector, fixation and opening.
    """
    steps = integer("steps", steps, at_least=1)
    effort = effort or Effort(rounds=60, batch_us=2000.0)
    rng = np.random.default_rng(seed)
    goal = Goal(rng.uniform(-0.4, 0.4, 3), _pose(rng, 0.4))
    # Half a metre at most, like a reach, and any rotation.
    start = State(rng.uniform(-0.4, 0.4, 3), _pose(rng, 0.4), float(rng.uniform(0.2, 1.2)))
    dt = min(0.01, model.largest_step)
    seconds = steps * dt
    peer = NumpyCoupledDynamics(model)
    relative, kernel, never = goal.relative(start), model.kernel, NEVER.array()
    calls: dict[str, Call] = {
        "rust_us": lambda: model.roll_out(start, goal, dt=dt, seconds=seconds, tolerance=NEVER),
        "kernel_us": lambda: kernel.roll_out(relative, goal.amplitude, dt, steps, never),
        "numpy_us": lambda: peer.roll_out(start, goal, dt=dt, seconds=seconds, tolerance=NEVER),
    }
    for _ in (progress or Progress()).over(range(1), "rolling out"):
        # Of a busy machine the long calls lose more of the clock's time than the short ones.
        times = interleave(calls, effort, clock=time.thread_time_ns)
    ours, _ = kernel.roll_out(relative, goal.amplitude, dt, steps, never)
    theirs, _ = peer.states(relative, goal.amplitude, dt, steps, NEVER)
    figures = {name: taken.median for name, taken in times.items()}
    return {
        "seed": seed,
        "steps": len(ours) - 1,
        "components": [len(system.weights) for system in model.systems.values()],
        **figures,
        "ratio": times["numpy_us"].over(times["rust_us"]),
        "kernel_ratio": times["numpy_us"].over(times["kernel_us"]),
        "max_difference": difference(ours, theirs),
    }


def difference(ours: Floats, theirs: Floats) -> float:
    """Largest difference of states (N, 10), of each part relative to how far that part ever was."""
    parts = (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 10))
    apart = [np.linalg.norm(ours[:, part] - theirs[:, part], axis=1).max() for part in parts]
    far = [np.linalg.norm(theirs[:, part], axis=1).max() for part in parts]
    return float(np.max(np.array(apart) / np.array(far)))


def _pose(rng: np.random.Generator, reach: float) -> Floats:
    axis = rng.normal(size=3)
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrices(rng.uniform(0.0, np.pi) * axis / np.linalg.norm(axis))
    pose[:3, 3] = rng.uniform(-reach, reach, 3)
    return pose
