"""The instruction sets: the environment sets an upper limit, and every one gives the same bytes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

NEEDED = {"baseline": "", "avx2": "avx2", "avx512": "avx512f"}
"""The sets and a flag of the processors that have them."""

PROGRAM = """
import hashlib
import math
import numpy as np
import motorprime as mp
from motorprime import _core
from motorprime import Mlp

digest = hashlib.sha256()
rng = np.random.default_rng(0)


def add(name, *results):
    for result in results:
        digest.update(np.ascontiguousarray(result).tobytes())
    print(name, digest.hexdigest())


print(mp._core.instruction_set())

images = []
for shape in ((1, 1), (17, 33), (48, 64), (61, 129), (240, 320)):
    points = rng.uniform(-20, 1.1 * shape[1] + 20, (70, 2))
    weights = rng.uniform(0, 1, 70)
    for kernel in ("triangular", "gaussian"):
        for width in (0.7, 5.3, 40.0, (3.0, 90.0), rng.uniform(1, 20, 70), rng.uniform(1, 20, (70, 2))):
            images.append(mp.kernel_landscape(points, shape, width=width, kernel=kernel))
            images.append(mp.kernel_landscape(points, shape, width=width, kernel=kernel, weights=weights))
    for chol in ((0.1, 0.0, 0.1), (30.0, -20.0, 4.0), (1e3, 10.0, 1e3), (0.01, 900.0, 25.0)):
        mean = rng.uniform(0, shape[0], 2)
        images.append(mp.gaussian_landscape(mean, chol, shape))
        images.append(mp.gaussian_landscape(mean, chol, shape, cutoff=1.3, mixing=0.2))
    images.append(rng.random(shape, dtype=np.float32))
add("landscapes", *images)

images = [image for image in images if image.any()]
for image in images:
    add("gibbs", mp.gibbs_sample(image, 30, seed=5, thin=2))
    add("sample", mp.sample(image, 30, seed=5))
    add("sample apart", mp.sample(image, 10, seed=5, min_distance=6.5))
    for pixels in (image, image.astype(np.float64) / 3):
        for fraction in (0.01, 0.2, 0.9):
            add("threshold", mp.threshold(pixels, fraction=fraction))
            add("quicksort", mp.threshold(pixels, fraction=fraction, method="quicksort"))
        if pixels[::3, ::3].any():
            add("stride", mp.threshold(pixels, fraction=0.3, stride=3))

for sizes in ((1, 1), (3, 5, 2), (12, 25, 25, 2), (7, 33, 40, 5), (12, 64, 2)):
    layers = list(zip(sizes[1:], sizes[:-1]))
    weights = [rng.normal(0, 1 / math.sqrt(i), (o, i)) for o, i in layers]
    biases = [rng.normal(0, 1, o) for o, _ in layers]
    scales = [rng.normal(0, 1, sizes[0]), rng.uniform(0.5, 2, sizes[0])]
    scales += [rng.normal(0, 1, sizes[-1]), rng.uniform(0.5, 2, sizes[-1])]
    mlp = Mlp(weights, biases, *scales)
    for rows in (1, 3, 4, 5, 16, 60, 131):
        x = rng.normal(0, 2, (rows, sizes[0]))
        add("mlp", mlp(x), mlp(x.astype(np.float32)), mlp.jacobian(x))

for shape, window in (((7, 9), (3, 2)), ((190, 83), (20, 20)), ((400, 300), (300, 280))):
    bins = rng.integers(0, 30, shape).astype(np.uint16)
    wanted = rng.random((shape[0] - window[0] + 1, shape[1] - window[1] + 1)) < 0.1
    target = rng.random(25) / 20
    add("intersections", mp.intersections(bins, target, window))
    add("wanted", mp.intersections(bins, target, window, wanted=wanted))
    add("intersections", mp.intersections(bins.astype(np.uint8), target, window, stride=3))

picture = rng.integers(0, 256, (70, 150, 3)).astype(np.uint8)
corners = rng.integers(0, (131, 51), (30, 2)).astype(np.int32)
add("bins", _core.hue_saturation_bins(picture, (30, 16), 70, 25, None))
add("windows", _core.window_intersections(picture, corners, rng.random(480), (20, 20), (30, 16), 70, 25))

matrix = np.array([[60.0, 0, 31.5, 0], [0, 60.0, 23.5, 0], [0, 0, 1.0, 0]])
layers = [(25, 12), (25, 25), (2, 25)]
weights = [rng.normal(0, 1 / math.sqrt(i), (o, i)) for o, i in layers]
eye = Mlp(weights, [np.zeros(o) for o, _ in layers], np.zeros(12), np.ones(12), [160.0, 120.0], [80.0, 60.0])
shapes = {"left": (48, 64), "right": (240, 320)}
path, joints = rng.uniform([-0.3, -0.3, 0.7], [0.3, 0.3, 1.5], (60, 3)), rng.normal(0, 1, 9)
for kernel in ("triangular", "gaussian"):
    for look in ({"windows": 40}, {"fraction": 0.1}):
        maps = {"left": matrix, "right": eye}
        seen = mp.attention_step(maps, shapes, path, joints, kernel=kernel, seed=3, **look)
        for camera, one in seen.items():
            add("step " + camera, one.landscape, one.centres if one.mask is None else one.mask)
"""


def flags():
    """What the processor says it can do, where the system tells."""
    file = Path("/proc/cpuinfo")
    found = re.search(r"^flags\s*:(.*)$", file.read_text(), re.M) if file.exists() else None
    return set(found.group(1).split()) if found else set()


def run(limit):
    """The digests of a run of the program under that limit, None for a run without one."""
    environment = {name: value for name, value in os.environ.items() if name != "MOTORPRIME_SIMD"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    if limit is not None:
        environment["MOTORPRIME_SIMD"] = limit
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def best():
    return run(None)


@pytest.mark.parametrize("name", NEEDED)
def test_every_instruction_set_gives_the_same_bytes(name, best):
    if NEEDED[name] and NEEDED[name] not in flags():
        pytest.skip(f"this processor has no {name}")
    used, *digests = run(name)
    assert used == name
    # The digests are running ones: the first line that differs names what went apart.
    for given, wanted in zip(digests, best[1:], strict=True):
        assert given == wanted


@pytest.mark.parametrize("name", ["sse9", "\u00e4"])
def test_an_unknown_name_falls_back_to_the_best_set(name, best):
    assert run(name) == best
