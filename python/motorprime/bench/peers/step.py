"""The whole step of attention without motorprime: plan in, landscapes and windows of both eyes out."""

from __future__ import annotations

from collections.abc import Sequence

from ..scene import WINDOWS, Floats32, Scene
from . import sampling
from .landscapes import Matmul
from .networks import Augmented


class Step:
    """For each eye: a network projects the plan, a landscape is made of it, Gibbs sampling draws windows.

    Args:
        scene: Where the networks and the size of the image come from.
        width: Kernel width of the plan at 320 x 240 [px].
        groups: Groups of points in the landscape's product.
    """

    def __init__(self, scene: Scene, width: float, groups: int) -> None:
        count = len(scene.plan)
        self.networks = [Augmented(scene.network(eye), count) for eye in range(2)]
        self.landscapes = [Matmul(count, scene.shape, scene.width(width), groups) for _ in range(2)]

    def __call__(
        self, plan: Floats32, joints: Floats32, draws: Sequence[Sequence[float]]
    ) -> list[tuple[Floats32, sampling.Samples]]:
        """(landscape, windows) for each eye, from ``2 n + 1`` uniform numbers for each."""
        looks = []
        for network, landscape, draw in zip(self.networks, self.landscapes, draws, strict=True):
            network.inputs[:, :3], network.inputs[:, 3:-1] = plan, joints
            relevance = landscape(network.filled())
            looks.append((relevance, sampling.gibbs(relevance, WINDOWS, draw)))
        return looks
