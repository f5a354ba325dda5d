"""Attentional landscapes: where to look, how much of it, and which pixels to start from.

A landscape is a C-contiguous float32 array (H, W), never negative and exactly 0 outside its support. Pixels
are (u, v), u to the right and v down, with centres at integers; ``shape`` is (height, width), as in NumPy.

Small arguments (points, means, factors, widths, weights) may be float32 or float64 arrays or plain lists of
numbers; landscapes must be float32 or float64 arrays. Integer arrays are refused, since a rounded pixel is
nearly always a mistake. Any memory layout is read correctly; the fast one is C-contiguous. No argument is
ever changed but ``out``, and every error is a :class:`motorprime.Error` that names the argument, what was
expected and what was given.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import ArgumentError, ArgumentTypeError
from .tiling import regions, tiles

__all__ = [
    "gaussian_landscape",
    "gaussian_landscapes",
    "gibbs_sample",
    "kernel_landscape",
    "kernel_landscapes",
    "regions",
    "sample",
    "threshold",
    "tiles",
]

Numbers: TypeAlias = npt.NDArray[np.floating[Any]] | Sequence[float]
"""A float32 or float64 array, or a sequence of numbers."""

Rows: TypeAlias = npt.NDArray[np.floating[Any]] | Sequence[Sequence[float]]
"""A float32 or float64 array of two dimensions, or a sequence of rows."""

Width: TypeAlias = float | tuple[float, float] | npt.NDArray[np.floating[Any]]
"""A kernel width [px]: one number, (horizontal, vertical), or an array with a width or a pair per point."""

Landscape: TypeAlias = npt.NDArray[np.float32]
"""A float32 array (H, W), >= 0."""

Seed: TypeAlias = int | np.random.Generator | None
"""An int in [0, 2^64), a NumPy generator, or None for a seed from the operating system."""

KernelName: TypeAlias = Literal["triangular", "gaussian"]
ThresholdMethod: TypeAlias = Literal["select", "quicksort"]


def gaussian_landscape(
    mean: Numbers,
    chol: Numbers,
    shape: tuple[int, int],
    *,
    cutoff: float = 3.0,
    mixing: float = 1.0,
    out: Landscape | None = None,
) -> Landscape:
    """Peripersonal landscape: a Gaussian, computed only inside its ellipse.

    With ``z = L^-1 (p - mean)`` and ``L = [[L1, 0], [L2, L3]]`` a pixel ``p`` inside the ellipse
    ``|z| <= cutoff``, border included, gets ``mixing * exp(-|z|^2 / 2) + (1 - mixing) * m``. Every other
    pixel is 0. The uniform level ``m = 2 (1 - exp(-cutoff^2 / 2)) / cutoff^2`` is the mean of the Gaussian
    over the whole ellipse, so both parts of the mixture carry the same mass. Before mixing the mean has
    the value 1.

    Source: Lukic, Billard and Santos-Victor, *Motor-primed Visual Attention for Humanoid Robots*,
    Eq. 2-5 with C = 1, and Eq. 10.

    Args:
        mean: (2,) mean (u, v) [px]. It may lie outside the image, then little or nothing is left.
        chol: (3,) Cholesky factor (L1, L2, L3) [px] of the covariance ``L L^T``; L1 and L3 positive.
        shape: (height, width) of the image.
        cutoff: Radius of the ellipse in standard deviations, sigma of Eq. 5.
        mixing: Share pi of the Gaussian in [0, 1]; less than 1 flattens the landscape for sampling (Eq. 10).
        out: (H, W) C-contiguous float32 array to write to, instead of a new one.

    Returns:
        (H, W) float32; ``out`` itself if it was given.

    Raises:
        ArgumentError: A number is NaN, infinite or outside its domain, or a shape is wrong.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.gaussian_landscape(mean, chol, shape, cutoff, mixing, out)


def gaussian_landscapes(
    means: Rows,
    chols: Rows,
    shape: tuple[int, int],
    *,
    cutoff: float = 3.0,
    mixing: float = 1.0,
    out: Sequence[Landscape] | None = None,
) -> list[Landscape]:
    """Several of :func:`gaussian_landscape` side by side, one per camera.

    Args:
        means: (K, 2) means (u, v) [px].
        chols: (K, 3) Cholesky factors (L1, L2, L3) [px].
        shape: (height, width) of every image.
        cutoff: As for one landscape, the same for all.
        mixing: As for one landscape, the same for all.
        out: K arrays (H, W) to write to.

    Returns:
        K arrays (H, W) float32, bit for bit those of the single calls, whatever the number of threads.

    Raises:
        ArgumentError: As for one landscape; the message names the row, for example ``chols[1]``.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.gaussian_landscapes(means, chols, shape, cutoff, mixing, out)


def kernel_landscape(
    points: Rows,
    shape: tuple[int, int],
    *,
    width: Width,
    kernel: KernelName = "triangular",
    weights: Numbers | None = None,
    out: Landscape | None = None,
) -> Landscape:
    """Motor-plan landscape: the mean of product kernels on the points of a projected trajectory.

    Eq. 7: ``1 / (N h_h h_v) * sum_n k((u - u_n) / h_h) k((v - v_n) / h_v)``, a density per pixel. The
    profile is ``k(z) = 1 - |z|`` for ``|z| <= 1`` ("triangular", Eq. 9), or ``exp(-z^2 / 2) / sqrt(2 pi)``
    for ``|z| <= 5`` ("gaussian"); beyond it is exactly 0. N counts all points, also those outside the
    image.

    With ``weights`` it is the weighted mean, ``sum_n w_n K_n / sum_n w_n``.

    As an extension of the paper, ``width`` may be an array with one width or one pair per point:
    ``1 / N * sum_n K_n / (h_h,n h_v,n)``. Every kernel keeps its unit mass, so the nearer a point is to the
    camera, the wider and lower its kernel: this is what a width given in metres becomes in the image.

    Source: Lukic, Billard and Santos-Victor, Section III-C2, Eq. 7-9.

    Args:
        points: (N, 2) points (u, v) [px], N >= 1, finite. Any number of them may lie outside the image.
        shape: (height, width) of the image.
        width: Kernel width [px], positive: a number, a tuple (horizontal, vertical), or an array (N,) or
            (N, 2) with a width or a pair for each point. A tuple is always a pair and an array is always
            per point, so that nothing hangs on N being 2.
        kernel: "triangular" or "gaussian".
        weights: (N,) weights of the points, >= 0 and not all 0.
        out: (H, W) C-contiguous float32 array to write to, instead of a new one.

    Returns:
        (H, W) float32; ``out`` itself if it was given.

    Raises:
        ArgumentError: No point, a number that is NaN, infinite or outside its domain, a wrong shape, an
            unknown kernel, or a width for which float32 cannot hold the density (1 / (N h_h h_v) outside
            1e-30 ... 1e37).
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.kernel_landscape(points, shape, width, kernel, weights, out)


def kernel_landscapes(
    points: Sequence[Rows],
    shape: tuple[int, int],
    *,
    width: Width | list[Width],
    kernel: KernelName = "triangular",
    weights: Sequence[Numbers | None] | None = None,
    out: Sequence[Landscape] | None = None,
) -> list[Landscape]:
    """Several of :func:`kernel_landscape` side by side, one per camera.

    Args:
        points: K trajectories (N_k, 2) of (u, v) [px]; they may differ in length.
        shape: (height, width) of every image.
        width: A number or a tuple (horizontal, vertical) for all, or a list with an entry for each
            trajectory in any form that one landscape takes.
        kernel: "triangular" or "gaussian", the same for all.
        weights: K weights (N_k,) or None.
        out: K arrays (H, W) to write to.

    Returns:
        K arrays (H, W) float32, bit for bit those of the single calls, whatever the number of threads.

    Raises:
        ArgumentError: As for one landscape; the message names the trajectory, for example ``points[1]``.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.kernel_landscapes(points, shape, width, kernel, weights, out)


def threshold(
    landscape: npt.NDArray[np.floating[Any]],
    *,
    fraction: float | None = None,
    count: int | None = None,
    method: ThresholdMethod = "select",
    stride: int = 1,
) -> float:
    """Threshold that leaves a given number of the most relevant pixels.

    The largest d such that at least the wanted number of pixels have ``landscape >= d``. Where fewer
    pixels are positive than wanted, d is the smallest positive value. The mask is
    ``(landscape >= d) & (landscape > 0)``.

    Source: Lukic, Billard and Santos-Victor, Section IV-A; ``stride=4`` gives their 4800 subsampled pixels
    of 320 x 240.

    Args:
        landscape: (H, W) float32 or float64. The pixels that are read must be finite and >= 0.
        fraction: Wanted share of the pixels in (0, 1]: ``ceil(fraction * size - 1e-9)`` of them.
        count: Wanted number of pixels, at least 1. Exactly one of ``fraction`` and ``count`` is given.
        method: "select" finds the one value; "quicksort" sorts all of them, as the paper does. Both give
            the same number.
        stride: Reads ``landscape[::stride, ::stride]`` only, for an approximate answer; no other pixel is
            looked at, nor checked. ``count`` still counts pixels of the full image: it is divided by stride^2
            and rounded up.

    Returns:
        The threshold d > 0, exactly one of the pixel values.

    Raises:
        ArgumentError: Of the pixels that are read, one is negative or not finite or all are zero, or another
            argument is outside its domain.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.threshold(landscape, fraction, count, method, stride)


def gibbs_sample(
    landscape: npt.NDArray[np.floating[Any]],
    n: int,
    *,
    seed: Seed = None,
    start: tuple[int, int] | None = None,
    burn_in: int = 0,
    thin: int = 1,
    out: npt.NDArray[np.int32] | None = None,
) -> npt.NDArray[np.int32]:
    """Pixels drawn from a landscape by Gibbs sampling, as centres of scanning windows.

    One sample is one sweep: u is drawn from row v of the landscape, then v from column u, both by inverse
    transform sampling with look-up tables. The landscape need not be normalised.

    The chain moves along rows and columns. Where a landscape has two modes that share neither a row nor a
    column, it cannot cross from one to the other. With ``start=None`` a call begins at an exact draw from
    the landscape: over many calls each mode gets its mass, but all samples of one call lie in one mode.

    Source: Lukic, Billard and Santos-Victor, Section IV-B.

    Args:
        landscape: (H, W) float32 or float64, finite and >= 0, not zero everywhere. Computed in float32.
        n: Number of samples; 0 gives an empty array.
        seed: An int in [0, 2^64) seeds the generator directly, a NumPy generator gives one draw of 64 bits
            (and so advances), None takes entropy from the operating system. The same seed gives the same
            samples on every machine.
        start: Pixel (u, v) from which the first sweep begins; None for an exact draw from the landscape.
        burn_in: Number of sweeps to drop at the beginning, of use with a ``start``.
        thin: Keeps every thin-th sweep only: ``burn_in + n * thin`` sweeps in all.
        out: (n, 2) C-contiguous int32 array to write to, instead of a new one.

    Returns:
        (n, 2) int32 pixels (u, v), all of them on positive pixels of the landscape; ``out`` itself if it was
        given.

    Raises:
        ArgumentError: The landscape is zero everywhere or has a pixel that is negative or not finite, the
            start is outside the image or on a row of zeros, or another argument is outside its domain.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.gibbs_sample(landscape, n, random_bits(seed), start, burn_in, thin, out)


def sample(
    landscape: npt.NDArray[np.floating[Any]],
    n: int,
    *,
    seed: Seed = None,
    min_distance: float = 0.0,
    out: npt.NDArray[np.int32] | None = None,
) -> npt.NDArray[np.int32]:
    """Pixels drawn from a landscape independently of each other, as centres of scanning windows.

    Every pixel is drawn with probability proportional to its value, exactly and without a chain: the modes of
    a landscape get their share in every call. One number of the generator makes one sample, by inverse
    transform sampling over blocks.

    With a ``min_distance`` the windows do not crowd: each sample is drawn from the pixels that are at least
    so far from all samples before it, again in proportion to their values.

    An extension of Lukic, Billard and Santos-Victor, Section IV-B, which samples by a chain.

    Args:
        landscape: (H, W) float32 or float64, finite and >= 0, not zero everywhere. Computed in float32.
        n: Number of samples; 0 gives an empty array.
        seed: As in :func:`gibbs_sample`.
        min_distance: Smallest distance between samples [px], from centre to centre; 0 sets none and a pixel
            may be drawn twice.
        out: (n, 2) C-contiguous int32 array to write to, instead of a new one.

    Returns:
        (n, 2) int32 pixels (u, v). Fewer rows where no positive pixel is left at that distance; then it is
        the beginning of ``out`` if that was given.

    Raises:
        ArgumentError: The landscape is zero everywhere or has a pixel that is negative or not finite, or
            another argument is outside its domain.
        ArgumentTypeError: An argument has the wrong type or dtype.
    """
    return _core.sample(landscape, n, random_bits(seed), min_distance, out)


def random_bits(seed: Seed) -> int:
    """The 64 bits that start the kernels' generator."""
    if seed is None:
        return int.from_bytes(os.urandom(8), "little")
    if isinstance(seed, np.random.Generator):
        return int(seed.integers(0, 2**64 - 1, dtype=np.uint64, endpoint=True))
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if 0 <= seed < 2**64:
            return int(seed)
        raise ArgumentError(f"seed must be in [0, 2^64), got {seed}")
    raise ArgumentTypeError(
        f"seed must be an int, a numpy.random.Generator or None, got {type(seed).__name__}"
    )
