"""Every kernel that is measured, with its peers: what is called, what must come out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from .. import landscape as kernels
from .._core import Mlp
from . import checks
from .peers import landscapes, networks, sampling
from .peers.thresholds import Ranked
from .scene import CUTOFF, FRACTION, LAYERS, WINDOWS, Network, Scene
from .timing import Call

SEEDS = range(1, 11)  # of the chains that are compared
DRAWN = 4000  # samples whose distribution is compared


@dataclass(frozen=True)
class Contender:
    """One way to the result.

    Args:
        run: What is timed.
        answer: Gives what is compared; ``run`` itself unless that draws random numbers.
    """

    run: Call
    answer: Call

    @classmethod
    def plain(cls, run: Call) -> Contender:
        """One that is compared by what is timed."""
        return cls(run, run)


@dataclass(frozen=True)
class Case:
    """A kernel on an input.

    Args:
        name: As in the JSON.
        what: The input in words.
        ours: The kernel, called from Python; None where this build has none.
        peers: Others that give the same result.
        truth: What the answers are compared with.
        agree: Says what is wrong with an answer, given the truth; empty if nothing.
        moved: Bytes that must at least pass through memory.
        operations: Additions and multiplications of the direct evaluation, 0 where they are not counted.
        variant: Tells several inputs of one kernel apart.
        beside: Other calls to be timed in the same rounds, by what the kernel is then compared with.
        absent: Peers that cannot be measured here, and why.
    """

    name: str
    what: str
    ours: Contender | None
    peers: Mapping[str, Contender]
    truth: Call
    agree: Callable[[Any, Any], str]
    moved: int
    operations: int = 0
    variant: str = ""
    beside: Mapping[str, Call] = field(default_factory=dict)
    absent: Mapping[str, str] = field(default_factory=dict)

    def check(self, *, peers: Sequence[str] | None = None) -> None:
        """Compare the kernel and its peers (or those that are named) with the truth.

        Raises:
            InexactPeerError: one of them gives something else.
        """
        truth = self.truth()
        asked = {name: p for name, p in self.peers.items() if peers is None or name in peers}
        for name, contender in ({"motorprime": self.ours} | asked).items():
            if contender is not None and (wrong := self.agree(truth, contender.answer())):
                raise checks.InexactPeerError(self.name, name, wrong)


def triangular(scene: Scene, name: str, count: int, pixels: float) -> Case:
    """The landscape of a plan."""
    points, width = scene.points(count), scene.width(pixels)
    ours = plan_call(scene, count, pixels)
    matmul, grouped = (landscapes.Matmul(count, scene.shape, width, groups) for groups in (1, 3))
    boxes = landscapes.Boxes(scene.shape, width)
    return Case(
        name,
        f"{count} points, width {pixels:g}",
        Contender.plain(ours),
        {
            "NumPy matmul": Contender.plain(lambda: matmul(points)),
            "NumPy matmul, 3 rectangles": Contender.plain(lambda: grouped(points)),
            "OpenCV boxFilter twice": Contender.plain(lambda: boxes(points)),
        },
        ours,
        checks.close,
        4 * scene.pixels,
        2 * covered(scene, points, width),
        beside={} if name == "triangular" else {"triangular": plan_call(scene, 100, 40.0)},
    )


def plan_call(scene: Scene, count: int, pixels: float) -> Call:
    """The kernel on a plan, with an array to write to."""
    points, width, out = scene.points(count), scene.width(pixels), np.empty(scene.shape, np.float32)
    same_width = width[0] if width[0] == width[1] else width
    return lambda: kernels.kernel_landscape(points, scene.shape, width=same_width, out=out)


def covered(scene: Scene, points: Any, width: tuple[float, float]) -> int:
    """Pixels under all the points' kernels."""
    sides = []
    for axis in range(2):
        low = np.maximum(np.ceil(points[:, axis] - width[axis]), 0)
        high = np.minimum(np.floor(points[:, axis] + width[axis]), scene.shape[1 - axis] - 1)
        sides.append(np.maximum(high - low + 1, 0))
    return int((sides[0] * sides[1]).sum())


def gaussian(scene: Scene, name: str) -> Case:
    """The landscape of the reachable space."""
    (mean, chol), out = scene.ellipse, np.empty(scene.shape, np.float32)

    def ours() -> Any:
        return kernels.gaussian_landscape(mean, chol, scene.shape, cutoff=CUTOFF, out=out)

    twins = {
        label: landscapes.Gaussian(scene.shape, CUTOFF, opencv=opencv)
        for label, opencv in (("NumPy matmul, exp", False), ("NumPy matmul, OpenCV exp", True))
    }
    return Case(
        name,
        "ellipse over a third of the image",
        Contender.plain(ours),
        {label: Contender.plain(partial(twin, mean, chol)) for label, twin in twins.items()},
        ours,
        checks.close,
        4 * scene.pixels,
    )


def gibbs(scene: Scene, name: str) -> Case:
    """Windows by Gibbs sampling; the peers are compared on the kernel's own uniform numbers."""
    image, generator = scene.landscape, np.random.default_rng([scene.seed, 4])
    seeds = counted_seeds()
    given = [sampling.chain_uniforms(image, seed, WINDOWS) for seed in SEEDS]

    def truth() -> list[Any]:
        return [kernels.gibbs_sample(image, WINDOWS, seed=seed) for seed in SEEDS]

    def peer(sampler: Callable[[Any], Any]) -> Contender:
        return Contender(
            lambda: sampler(generator.random(2 * WINDOWS + 1).tolist()),
            lambda: [sampler(numbers) for numbers in given],
        )

    return Case(
        name,
        f"{WINDOWS} windows from the plan",
        Contender(lambda: kernels.gibbs_sample(image, WINDOWS, seed=seeds()), truth),
        {
            "NumPy, tables as needed": peer(lambda x: sampling.gibbs(image, WINDOWS, x)),
            "NumPy, all tables": peer(lambda x: sampling.gibbs_all_tables(image, WINDOWS, x)),
        },
        truth,
        checks.same_chains,
        4 * scene.pixels,
    )


def sample(scene: Scene, name: str) -> Case:
    """Independent windows; their distribution is compared with the landscape itself."""
    image, generator = scene.landscape, np.random.default_rng([scene.seed, 5])
    seeds = counted_seeds()

    def peer(sampler: Callable[[int], Any]) -> Contender:
        return Contender(lambda: sampler(WINDOWS), lambda: sampler(DRAWN))

    out = np.empty((WINDOWS, 2), np.int32)
    return Case(
        name,
        f"{WINDOWS} independent windows from the plan",
        Contender(
            lambda: kernels.sample(image, WINDOWS, seed=seeds(), out=out),
            lambda: kernels.sample(image, DRAWN, seed=1),
        ),
        {
            "NumPy by rows": peer(lambda n: sampling.by_rows(image, generator.random((2, n)))),
            "NumPy by rows, compared": peer(
                lambda n: sampling.by_rows_compared(image, generator.random((2, n)))
            ),
            "NumPy, one table": peer(lambda n: sampling.flat(image, generator.random(n))),
            "NumPy Generator.choice": peer(lambda n: sampling.choice(image, n, generator)),
        },
        lambda: image,
        checks.distributed,
        4 * scene.pixels,
    )


def threshold(
    scene: Scene,
    name: str,
    variant: str = "",
    stride: int = 1,
    method: Literal["select", "quicksort"] = "select",
) -> Case:
    """The threshold that leaves the top 30 % of the pixels."""
    image = scene.noise if variant == "random" else scene.landscape
    ranked = Ranked(scene.shape, FRACTION, stride)

    def ours() -> float:
        return kernels.threshold(image, fraction=FRACTION, stride=stride, method=method)

    ways: dict[str, Callable[[Any], float]] = {
        "NumPy sort": lambda x: ranked.sort(x, "quicksort"),
        "NumPy partition": ranked.partition,
        "NumPy partition of the positive": ranked.positive,
        "NumPy bincount, then partition": ranked.histogram,
        "NumPy stable sort": lambda x: ranked.sort(x, "stable"),
        "NumPy quantile": ranked.quantile,
    }
    if method == "quicksort":
        ways = {"NumPy sort": ways["NumPy sort"]}
    return Case(
        name,
        f"top {FRACTION:.0%} of {ranked.flat.size:,} pixels" + (f", {method}" if stride > 1 else ""),
        Contender.plain(ours),
        {label: Contender.plain(partial(way, image)) for label, way in ways.items()},
        ours,
        checks.same,
        4 * scene.pixels // stride,
        variant=variant,
    )


def mlp(scene: Scene, name: str) -> Case:
    """A projection's network on the points of a plan."""
    network, x = scene.network(), scene.inputs
    ours, count = _mlp_call(network_of(network), x), len(x)
    layers, augmented = networks.Layers(network, count), networks.Augmented(network, count)
    dnn = networks.opencv(network, count)
    peers = {
        "NumPy": Contender.plain(lambda: layers(x)),
        "NumPy, biases in the product": Contender.plain(lambda: augmented(x)),
        "OpenCV dnn": Contender.plain(lambda: dnn(x)),
    }
    absent = {}
    if networks.onnxruntime_installed():
        runtime = networks.onnxruntime(network, count)
        peers["ONNX Runtime"] = Contender.plain(lambda: runtime(x))
    else:
        absent["ONNX Runtime"] = "onnxruntime is not installed"
    products = sum(before * after for before, after in pairwise(LAYERS))
    return Case(
        name,
        f"{'-'.join(map(str, LAYERS))}, {count} points",
        Contender.plain(ours),
        peers,
        ours,
        checks.close,
        4 * (count * (LAYERS[0] + LAYERS[-1]) + products),
        2 * count * products,
        absent=absent,
    )


def _mlp_call(network: Any, x: Any) -> Call:
    """The network on ``x``, with an array to write to if this build takes one."""
    out = np.empty((len(x), LAYERS[-1]), np.float32)
    try:
        network(x, out=out)
    except TypeError:
        return lambda: network(x)
    return lambda: network(x, out=out)


def network_of(network: Network) -> Mlp:
    """The kernel of a network."""
    return Mlp(
        network.weights,
        network.biases,
        network.input_mean,
        network.input_std,
        network.output_mean,
        network.output_std,
    )


def counted_seeds() -> Callable[[], int]:
    """Another seed for every call, so that no draw is ever predicted."""
    numbers = iter(range(1, 2**62))
    return lambda: next(numbers)
