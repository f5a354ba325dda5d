"""Attention inside a control loop: one call per cycle, into the same arrays, for both cameras.

The hand reaches for a target that moves; every cycle the rest of the path is planned anew and asked for the
windows where a detector shall look. The cameras are projection matrices; an ``Mlp`` per camera, learned from
the robot's own motion, takes the joints as well and goes in the same place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import motorprime as mp

SHAPE = (240, 320)


def rig() -> dict[str, NDArray[np.float64]]:
    """Two cameras 8 cm apart, looking along z."""
    intrinsics = np.array([[260.0, 0.0, 159.5], [0.0, 260.0, 119.5], [0.0, 0.0, 1.0]])
    return {
        name: intrinsics @ np.column_stack([np.eye(3), [-x, 0.0, 0.0]])
        for name, x in {"left": -0.04, "right": 0.04}.items()
    }


def main() -> None:
    """Reach, and look along what is left of the way."""
    cameras, shapes = rig(), {"left": SHAPE, "right": SHAPE}
    hand = np.array([0.2, 0.15, 0.5])
    kept: dict[str, mp.Attended] = {}  # arrays of every camera that ever saw some of a path
    draws = np.random.default_rng(0)
    for cycle in range(100):
        target = np.array([-0.1, 0.02 * np.sin(cycle / 10), 0.7])
        path = np.linspace(hand, target, 40)
        seen = mp.attention_step(cameras, shapes, path, windows=50, seed=draws, out=kept)
        kept |= seen
        hand = path[2]  # the arm follows the plan
        if cycle % 25 == 0:
            looks = ", ".join(f"{name} {look.centres.mean(axis=0).round()}" for name, look in seen.items())
            print(f"cycle {cycle:2d}: {np.linalg.norm(target - hand):.2f} m to go, windows around {looks}")


if __name__ == "__main__":
    main()
