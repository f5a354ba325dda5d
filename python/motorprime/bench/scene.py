"""What the kernels are measured on: a reach across the image, an ellipse, small networks, random floats."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ..landscape import kernel_landscape

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]

SMALL, LARGE = (240, 320), (1080, 1920)  # (height, width)
WINDOWS = 50
FRACTION = 0.3
STRIDE = 4
CUTOFF = 3.0
LAYERS = (12, 25, 25, 2)


@dataclass(frozen=True)
class Network:
    """Weights of a small tanh network, as :class:`motorprime.Mlp` takes them."""

    weights: list[Floats]
    biases: list[Floats]
    input_mean: Floats
    input_std: Floats
    output_mean: Floats
    output_std: Floats


@dataclass(frozen=True)
class Scene:
    """The inputs at one size of image: all lengths are those of 320 x 240, stretched with the image.

    Args:
        shape: (height, width) of the image.
        seed: Draws the networks, the random floats and everything else that is random.
    """

    shape: tuple[int, int] = SMALL
    seed: int = 0

    @property
    def stretch(self) -> tuple[float, float]:
        """(horizontal, vertical) by how much the image is larger than 320 x 240."""
        return self.shape[1] / SMALL[1], self.shape[0] / SMALL[0]

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.shape[0] * self.shape[1]

    def points(self, count: int = 100) -> Floats:
        """(count, 2) points of a reach across the image, in a gentle arc."""
        along = np.linspace(0.0, 1.0, count)
        arc = np.stack([40.3 + 230.0 * along, 190.7 - 400.0 * along * (1.0 - 0.7 * along)], axis=1)
        return np.asarray(arc * self.stretch)

    def width(self, pixels: float) -> tuple[float, float]:
        """(horizontal, vertical) width of the kernels."""
        return pixels * self.stretch[0], pixels * self.stretch[1]

    @property
    def ellipse(self) -> tuple[tuple[float, float], tuple[float, float, float]]:
        """Mean and Cholesky factor of a Gaussian whose ellipse covers a third of the image."""
        across, down = self.stretch
        return (150.2 * across, 130.6 * down), (36.9 * across, 9.8 * down, 24.5 * down)

    @cached_property
    def landscape(self) -> Floats32:
        """The landscape of the reach of 100 points, width 40."""
        return kernel_landscape(self.points(), self.shape, width=self.width(40.0))

    @cached_property
    def noise(self) -> Floats32:
        """Random floats, the worst landscape to sort."""
        return np.random.default_rng([self.seed, 0]).random(self.shape, dtype=np.float32)

    @cached_property
    def inputs(self) -> Floats32:
        """(50, 12) inputs of the network that is measured alone."""
        return np.random.default_rng([self.seed, 1]).random((50, LAYERS[0]), dtype=np.float32)

    def network(self, number: int = 0) -> Network:
        """A random network whose outputs lie in the image; eyes have networks of their own."""
        draw = np.random.default_rng([self.seed, 2, number])
        pairs = list(pairwise(LAYERS))
        height, width = self.shape
        return Network(
            weights=[draw.uniform(-1.0, 1.0, (after, before)) / np.sqrt(before) for before, after in pairs],
            biases=[draw.uniform(-0.2, 0.2, after) for _, after in pairs],
            input_mean=np.full(LAYERS[0], 0.5),
            input_std=np.full(LAYERS[0], 0.3),
            output_mean=np.array([0.5 * width, 0.5 * height]),
            output_std=np.array([0.25 * width, 0.25 * height]),
        )

    @cached_property
    def joints(self) -> Floats32:
        """(9,) joints of the gaze."""
        return np.random.default_rng([self.seed, 3]).random(9, dtype=np.float32)

    @cached_property
    def plan(self) -> Floats32:
        """(100, 3) points of a planned path, in the unit of the networks' inputs."""
        along = np.linspace(0.0, 1.0, 100)
        return np.stack([along, 0.2 + 0.5 * along**2, 0.9 - 0.6 * along], axis=1).astype(np.float32)
