"""A plain NumPy twin of every kernel: clear, slow, in float64.

Nothing here is shared with the library, so that a mistake would have to be made twice. The sampler's twin
repeats its generator too, and so gives the very same samples.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
MASK64 = 2**64 - 1


def gaussian_landscape(
    mean: Any, chol: Any, shape: tuple[int, int], cutoff: float = 3.0, mixing: float = 1.0
) -> Floats:
    """Eq. 2-5 and 10, the whole image at once."""
    l1, l2, l3 = chol
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    z1 = (u - mean[0]) / l1
    z2 = ((v - mean[1]) - l2 * z1) / l3
    square = z1 * z1 + z2 * z2
    uniform = 2 * -np.expm1(-(cutoff**2) / 2) / cutoff**2
    inside = square <= cutoff**2 * (1 + 1e-12)
    return np.where(inside, mixing * np.exp(-square / 2) + (1 - mixing) * uniform, 0.0)


def profile(kernel: str, offset: Floats, width: Floats | float) -> Floats:
    """k(offset / width) of Eq. 8 and 9."""
    if kernel == "triangular":
        return np.where(np.abs(offset) < width, 1 - np.abs(offset) / width, 0.0)
    inside = np.abs(offset) <= 5 * np.asarray(width)
    return np.where(inside, np.exp(-((offset / width) ** 2) / 2) / math.sqrt(2 * math.pi), 0.0)


def pairs(width: Any, count: int) -> Floats:
    """Widths (N, 2) from any form that the library accepts."""
    if isinstance(width, np.ndarray) and width.ndim == 1:
        width = np.stack([width, width], axis=1)
    return np.broadcast_to(np.asarray(width, dtype=float), (count, 2))


def kernel_landscape(
    points: Any, shape: tuple[int, int], width: Any, kernel: str = "triangular", weights: Any = None
) -> Floats:
    """Eq. 7 as a triple sum over points, rows and columns."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    widths = pairs(width, len(points))
    weights = np.ones(len(points)) if weights is None else np.asarray(weights, dtype=float)
    rows, columns = np.arange(shape[0], dtype=float), np.arange(shape[1], dtype=float)
    total = np.zeros(shape)
    for (u, v), (wide, high), weight in zip(points, widths, weights, strict=True):
        across, down = profile(kernel, columns - u, wide), profile(kernel, rows - v, high)
        total += weight / wide / high * np.outer(down, across)
    return total / weights.sum()


def kernel_peak(points: Any, width: Any, kernel: str = "triangular") -> float:
    """The largest peak of one point, K(0) / (N h_h h_v): the unit in which errors are measured."""
    peak = 1.0 if kernel == "triangular" else 1 / (2 * math.pi)
    return peak / len(points) / float(np.prod(pairs(width, len(points)), axis=1).min())


def threshold(
    landscape: npt.NDArray[Any],
    fraction: float | None = None,
    count: int | None = None,
    stride: int = 1,
) -> float:
    """The definition, read off a full sort."""
    pixels = np.sort(landscape[::stride, ::stride], axis=None)[::-1]
    wanted = (
        math.ceil(fraction * pixels.size - 1e-9) if fraction is not None else -(-(count or 0) // stride**2)
    )
    positive = pixels[pixels > 0]
    return float(positive[min(max(wanted, 1), len(positive)) - 1])


class Generator:
    """xoshiro256++ filled by splitmix64, in Python integers."""

    def __init__(self, seed: int) -> None:
        self.state = []
        for _ in range(4):
            seed = (seed + 0x9E3779B97F4A7C15) & MASK64
            z = seed
            z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK64
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK64
            self.state.append(z ^ (z >> 31))

    def uniform(self) -> float:
        """A float in [0, 1) from the 53 upper bits of the next number."""
        s = self.state
        result = (_rotate((s[0] + s[3]) & MASK64, 23) + s[0]) & MASK64
        t = (s[1] << 17) & MASK64
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = _rotate(s[3], 45)
        return (result >> 11) * 2.0**-53


def _rotate(x: int, k: int) -> int:
    return ((x << k) | (x >> (64 - k))) & MASK64


def _invert(masses: npt.NDArray[Any], x: float) -> int:
    cumulative = np.cumsum(masses, dtype=np.float64)
    return int(np.searchsorted(cumulative, x * cumulative[-1], side="right"))


def gibbs_sample(
    landscape: npt.NDArray[Any],
    n: int,
    seed: int,
    start: tuple[int, int] | None = None,
    burn_in: int = 0,
    thin: int = 1,
) -> npt.NDArray[np.int32]:
    """Sweep after sweep, u from the row and then v from the column; by default from the row of a draw."""
    generator = Generator(seed)
    pixels = landscape.astype(np.float32).astype(np.float64)
    if start is None:
        order = _block_order(pixels.shape)
        start = (0, int(order[_invert(pixels.ravel()[order], generator.uniform())]) // pixels.shape[1])
    v = start[1]
    chain = []
    for _ in range(burn_in + n * thin):
        u = _invert(pixels[v], generator.uniform())
        v = _invert(pixels[:, u], generator.uniform())
        chain.append((u, v))
    kept = chain[burn_in + thin - 1 :: thin]
    return np.array(kept, dtype=np.int32).reshape(n, 2)


BLOCK = 16
"""Rows of a block: the sampler's inversion goes over pixels in the order block of rows, column, row."""

REFUSALS = 32
"""Draws in a row that fall too near to earlier samples before the masses that are left are summed anew."""


def _block_order(shape: tuple[int, int]) -> npt.NDArray[np.int64]:
    """Flat indices of the pixels in the order of the inversion."""
    index = np.arange(shape[0] * shape[1]).reshape(shape)
    return np.concatenate([index[top : top + BLOCK].T.ravel() for top in range(0, shape[0], BLOCK)])


def too_near(shape: tuple[int, int], pixel: tuple[int, int], distance: float) -> npt.NDArray[np.bool_]:
    """The pixels nearer to (u, v) than `distance`; for a distance > 0 the pixel itself always."""
    v, u = np.mgrid[: shape[0], : shape[1]]
    square = (u - pixel[0]) ** 2 + (v - pixel[1]) ** 2
    return (square < distance * distance) | ((square == 0) & (distance > 0))


def sample(
    landscape: npt.NDArray[Any], n: int, seed: int, min_distance: float = 0.0
) -> npt.NDArray[np.int32]:
    """One number, one pixel; what is too near is refused, and after too many refusals taken out."""
    generator = Generator(seed)
    pixels = landscape.astype(np.float32).astype(np.float64)
    order = _block_order(pixels.shape)
    masses = pixels.ravel()[order]
    taken = np.zeros(pixels.shape, dtype=bool)
    drawn: list[tuple[int, int]] = []
    refusals = 0
    while len(drawn) < n:
        if refusals == REFUSALS:
            masses = np.where(taken, 0.0, pixels).ravel()[order]
            if not masses.any():
                break
            refusals = 0
        v, u = divmod(int(order[_invert(masses, generator.uniform())]), pixels.shape[1])
        if taken[v, u]:
            refusals += 1
            continue
        refusals = 0
        drawn.append((u, v))
        if min_distance > 0:
            taken |= too_near(pixels.shape, (u, v), min_distance)
    return np.array(drawn, dtype=np.int32).reshape(-1, 2)


def attention_step(
    pixels: dict[str, Any],
    shapes: dict[str, tuple[int, int]],
    width: float,
    kernel: str = "triangular",
    windows: int | None = None,
    fraction: float | None = None,
    count: int | None = None,
    seed: int = 0,
) -> dict[str, tuple[Floats, Any]]:
    """The twins one after the other: {camera: (landscape, centres or mask)} of projected paths."""
    seen = {}
    for k, (camera, places) in enumerate(pixels.items()):
        places = places[~np.isnan(places).any(axis=1)]
        landscape = kernel_landscape(places, shapes[camera], width, kernel) if len(places) else np.zeros(1)
        if not landscape.astype(np.float32).any():
            continue
        if windows is not None:
            seen[camera] = landscape, gibbs_sample(landscape, windows, (seed + k) & MASK64)
        else:
            level = threshold(landscape, fraction, count)
            seen[camera] = landscape, (landscape >= level) & (landscape > 0)
    return seen


def project(matrix: Floats, points: Floats) -> Floats:
    """(u, v) of points (N, 3), NaN where they are less than 0.01 m in front of the camera."""
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    ahead = homogeneous[:, 2:] >= 0.01
    return np.where(ahead, homogeneous[:, :2] / np.where(ahead, homogeneous[:, 2:], 1.0), np.nan)


def ellipse(output: Floats) -> tuple[Floats, Floats]:
    """Mean and Cholesky factor of (u, v, ln L1, L2, ln L3), the logarithms clipped to +-12."""
    l1, l3 = np.exp(np.clip(output[[2, 4]], -12.0, 12.0))
    return output[:2], np.array([l1, output[3], l3])


def mlp(
    x: Floats,
    weights: list[Floats],
    biases: list[Floats],
    input_scale: tuple[Floats, Floats],
    output_scale: tuple[Floats, Floats],
) -> Floats:
    """tanh on every layer but the last, between a scaled input and a scaled output."""
    y = (x - input_scale[0]) / input_scale[1]
    for w, b in zip(weights[:-1], biases[:-1], strict=True):
        y = np.tanh(y @ w.T + b)
    y = y @ weights[-1].T + biases[-1]
    return y * output_scale[1] + output_scale[0]


def intersections(
    bins: npt.NDArray[Any],
    target: Any,
    window: tuple[int, int],
    stride: int = 1,
    wanted: npt.NDArray[np.bool_] | None = None,
) -> Floats:
    """Every window counted alone: the sum of min(share of the window's pixels, target) over the bins."""
    target, (high, wide) = np.asarray(target, float), window
    scores = np.zeros([(size - side) // stride + 1 for size, side in zip(bins.shape, window, strict=True)])
    for i, j in np.ndindex(*scores.shape):
        if wanted is None or wanted[i, j]:
            v, u = i * stride, j * stride
            inside = bins[v : v + high, u : u + wide].astype(int).ravel()
            counts = np.bincount(inside[inside < len(target)], minlength=len(target))
            scores[i, j] = np.minimum(counts / (high * wide), target).sum()
    return scores


def merge_windows(corners: Any, size: int) -> set[tuple[int, ...]]:
    """Boxes around the windows that touch: the connected blocks of the pixels that they cover."""
    corners = np.asarray(corners, int).reshape(-1, 2)
    if not len(corners):
        return set()
    covered = np.zeros(corners.max(axis=0)[::-1] + size, np.uint8)
    for u, v in corners:
        covered[v : v + size, u : u + size] = 1
    blocks = cv2.connectedComponentsWithStats(covered, connectivity=8)[2][1:]
    return {(int(u), int(v), int(u + w), int(v + h)) for u, v, w, h, _ in blocks}


def chi_square_bound(degrees: int, sigmas: float = 5.0) -> float:
    """Wilson-Hilferty: exceeded about as rarely as a normal variable exceeds `sigmas`."""
    spread = 2 / (9 * degrees)
    return degrees * (1 - spread + sigmas * math.sqrt(spread)) ** 3


def _weights(mixture: Any, x: Floats) -> Floats:
    """Shares of the Gaussians of (weights, means, covariances) at one point, by logarithms."""
    logs = []
    for weight, mean, covariance in zip(*mixture, strict=True):
        off = x - mean
        square = off @ np.linalg.solve(covariance, off)
        logs.append(math.log(weight) - 0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * square)
    shares = np.exp(np.array(logs) - max(logs))
    return shares / shares.sum()


def _velocity(system: Any, x: Floats) -> Floats:
    """sum_k g_k(x) A_k x of (weights, means, covariances, matrices)."""
    *mixture, matrices = system
    shares = _weights(mixture, x[: mixture[1].shape[1]])
    return sum(share * matrix @ x for share, matrix in zip(shares, matrices, strict=True))


def _expected(coupling: Any, psi: float) -> float:
    """Conditional mean of the second coordinate given the first, and its way to 0."""
    weights, means, covariances, near = coupling
    shares = _weights((weights, means[:, :1], covariances[:, :1, :1]), np.array([psi]))
    lines = [m[1] + c[1, 0] / c[0, 0] * (psi - m[0]) for m, c in zip(means, covariances, strict=True)]
    return float(shares @ np.array(lines)) * min(1.0, psi / near)


def coupled_roll_out(
    eye: Any,
    arm: Any,
    hand: Any,
    eye_arm: Any,
    arm_hand: Any,
    alpha: Any,
    beta: Any,
    close: float,
    state: Any,
    amplitude: float,
    dt: float,
    steps: int,
) -> Floats:
    """States (steps + 1, 10) of eye, arm and hand by Euler steps; all as the kernel takes it."""
    states = [np.array(state, dtype=float)]
    for _ in range(steps):
        e, a, h = states[-1][:3], states[-1][3:9], states[-1][9:]
        distance = float(np.linalg.norm(a[:3]))
        rho = max(0.0, _expected(eye_arm, float(np.linalg.norm(e))))
        gate = 1.0 - min(1.0, rho / max(distance, close))
        asked = amplitude * min(1.0, max(0.0, _expected(arm_hand, distance)))
        e = e + dt * alpha[0] * _velocity(eye, beta[0] * e)
        a = a + dt * alpha[1] * _velocity(arm, beta[1] * gate * a)
        h = h + dt * alpha[2] * _velocity(hand, beta[2] * (h - asked))
        angle = float(np.linalg.norm(a[3:]))
        if angle > math.pi:
            a[3:] = a[3:] / angle * (angle - 2.0 * math.pi)
        states.append(np.concatenate([e, a, h]))
    return np.array(states)


def surf(
    gray: Any, threshold: float, octaves: int = 4, layers: int = 3, *, upright: bool = False
) -> tuple[Floats, Floats]:
    """SURF of a small image: rows (u, v, size, angle, response, octave, laplacian), descriptors (N, 64)."""
    image = np.asarray(gray, dtype=float)
    sums = np.zeros((image.shape[0] + 1, image.shape[1] + 1))
    sums[1:, 1:] = image.cumsum(axis=0).cumsum(axis=1)
    found, described = [], []
    for octave in range(octaves):
        step = 2**octave
        sizes = [(9 + 6 * layer) * step for layer in range(layers + 2)]
        responses = [surf_hessian(sums, size, step) for size in sizes]
        determinants = np.array([determinant for determinant, _ in responses])
        for layer in range(1, layers + 1):
            for i, j in np.argwhere(determinants[layer] > threshold):
                cube = determinants[layer - 1 : layer + 2, max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
                if cube.shape != (3, 3, 3) or np.isnan(cube).any():
                    continue
                others = np.delete(cube.ravel(), 13)
                offset = surf_offset(cube)
                if cube[1, 1, 1] <= others.max() or offset is None or np.abs(offset).max() > 1:
                    continue
                u, v = step * (j + offset[0]) + (step - 1) / 2, step * (i + offset[1]) + (step - 1) / 2
                size = float(np.rint(sizes[layer] + offset[2] * 6 * step))
                angle = 1.5 * np.pi if upright else surf_angle(sums, u, v, size)
                if angle is None:
                    continue
                sign = np.sign(responses[layer][1][i, j])
                found.append((u, v, size, angle, cube[1, 1, 1], octave, sign))
                described.append(surf_descriptor(image, u, v, size, angle))
    order = np.argsort([-row[4] for row in found], kind="stable")
    return np.array(found).reshape(-1, 7)[order], np.array(described).reshape(-1, 64)[order]


def surf_hessian(sums: Floats, size: int, step: int) -> tuple[Floats, Floats]:
    """Determinant and trace at samples every ``step`` pixels; NaN where the filter does not fit."""
    height, width = (length - 1 for length in sums.shape)
    shape = height // step, width // step
    determinant, trace = np.full(shape, np.nan), np.full(shape, np.nan)
    ninths = [round(k * size / 9) for k in range(10)]
    margin = size // 2 // step
    for i in range(margin, shape[0] - margin):
        for j in range(margin, shape[1] - margin):
            top, left = (i - margin) * step, (j - margin) * step

            def box(x0: int, y0: int, x1: int, y1: int, left: int = left, top: int = top) -> float:
                a, b, c, d = left + ninths[x0], top + ninths[y0], left + ninths[x1], top + ninths[y1]
                return float(sums[d, c] - sums[d, a] - sums[b, c] + sums[b, a])

            area = size / 3 * (ninths[7] - ninths[2])
            xx = (box(0, 2, 9, 7) - 3 * box(3, 2, 6, 7)) / area
            yy = (box(2, 0, 7, 9) - 3 * box(2, 3, 7, 6)) / area
            xy = (box(1, 1, 4, 4) + box(5, 5, 8, 8) - box(5, 1, 8, 4) - box(1, 5, 4, 8)) / (size / 3) ** 2
            determinant[i, j], trace[i, j] = xx * yy - 0.81 * xy * xy, xx + yy
    return determinant, trace


def surf_offset(cube: Floats) -> Floats | None:
    """Maximum of the parabola through 3 x 3 x 3 samples (scale, down, across): across, down, scale."""
    slope, hessian = np.zeros(3), np.zeros((3, 3))
    axes = (2, 1, 0)
    centre = np.array([1, 1, 1])
    unit = np.eye(3, dtype=int)

    def at(shift: Any) -> float:
        return float(cube[tuple(centre + shift)])

    for a in range(3):
        one = unit[axes[a]]
        slope[a] = (at(one) - at(-one)) / 2
        hessian[a, a] = at(one) - 2 * at(0 * one) + at(-one)
        for b in range(a):
            other = unit[axes[b]]
            mixed = (at(one + other) - at(one - other) - at(other - one) + at(-one - other)) / 4
            hessian[a, b] = hessian[b, a] = mixed
    if np.linalg.det(hessian) == 0.0:
        return None
    return np.asarray(-np.linalg.solve(hessian, slope))


def surf_angle(sums: Floats, u: float, v: float, size: float) -> float | None:
    """Direction of the longest sum of weighted gradients in a window of 60 degrees; None without samples."""
    scale = size * 1.2 / 9
    side = 2 * round(2 * scale)
    gradients = []
    for x in range(-6, 7):
        for y in range(-6, 7):
            left = int(np.rint(u + x * scale - (side - 1) / 2))
            top = int(np.rint(v + y * scale - (side - 1) / 2))
            inside = min(left, top) >= 0 and left + side < sums.shape[1] and top + side < sums.shape[0]
            if x * x + y * y > 36 or not inside:
                continue
            block = np.diff(np.diff(sums[top : top + side + 1, left : left + side + 1], axis=0), axis=1)
            half, weight = side // 2, np.exp(-(x * x + y * y) / (2 * 2.5**2))
            across = block[:, half:].sum() - block[:, :half].sum()
            down = block[half:].sum() - block[:half].sum()
            gradients.append((across * weight, down * weight))
    if not gradients:
        return None
    vectors = np.array(gradients)
    degrees = np.rint(np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0]))) % 360
    best = max(
        (
            vectors[np.abs((degrees - window + 180) % 360 - 180) < 30].sum(axis=0)
            for window in range(0, 360, 5)
        ),
        key=lambda total: float(total @ total),
    )
    return float(np.arctan2(best[1], best[0]) % (2 * np.pi))


def surf_descriptor(image: Floats, u: float, v: float, size: float, angle: float) -> Floats:
    """64 sums of the gradients between 21 x 21 means of the turned square, 20 scales wide."""
    scale = size * 1.2 / 9
    count = int(21 * scale)
    line = np.arange(count) - (count - 1) / 2
    across, down = np.meshgrid(line, line)
    x = np.clip(u + across * np.cos(angle) - down * np.sin(angle), 0, image.shape[1] - 1)
    y = np.clip(v + across * np.sin(angle) + down * np.cos(angle), 0, image.shape[0] - 1)
    left, top = np.minimum(x.astype(int), image.shape[1] - 2), np.minimum(y.astype(int), image.shape[0] - 2)
    a, b = x - left, y - top
    above = (1 - a) * image[top, left] + a * image[top, left + 1]
    below = (1 - a) * image[top + 1, left] + a * image[top + 1, left + 1]
    samples = (1 - b) * above + b * below
    # Row k: how much of each sample lies in square k.
    edges = np.arange(22) * count / 21
    share = np.clip(np.minimum(np.arange(count) + 1, edges[1:, None]), 0, None) - np.maximum(
        np.arange(count), edges[:-1, None]
    )
    share = np.maximum(share, 0) * 21 / count
    patch = np.rint(share @ samples @ share.T)
    along = np.exp(-((np.arange(20) - 9.5) ** 2) / (2 * 3.3**2))
    weight = np.outer(along, along)
    dx = (patch[:-1, 1:] - patch[:-1, :-1] + patch[1:, 1:] - patch[1:, :-1]) * weight
    dy = (patch[1:, :-1] - patch[:-1, :-1] + patch[1:, 1:] - patch[:-1, 1:]) * weight
    cells = [
        [part.sum(), other.sum(), np.abs(part).sum(), np.abs(other).sum()]
        for part, other in (
            (dx[i : i + 5, j : j + 5], dy[i : i + 5, j : j + 5])
            for i in range(0, 20, 5)
            for j in range(0, 20, 5)
        )
    ]
    flat = np.ravel(cells)
    return np.asarray(flat / max(np.linalg.norm(flat), 1e-12))
