"""``motorprime evaluate surf``: what a mask saves, and whether the keypoints are right."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import integer
from ..bench.timing import Call, Effort, Times, interleave
from ..detectors.surf import Surf
from ..errors import ArgumentError
from .common import Progress
from .surf_pairs import compare_golden, evaluate_pair
from .surf_rival import rival
from .textures import draw_texture

Masks = dict[str, NDArray[np.bool_]]

SIZES = {"mask30": 0.3, "mask10": 0.1}
EFFORT = Effort(rounds=7, batch_us=1.0, least=1, most=1)


def evaluate_surf(
    *,
    images: int = 4,
    shape: tuple[int, int] = (480, 640),
    threshold: float = 300.0,
    seed: int = 0,
    golden: Sequence[Path] = (),
    opencv342: Path | None = None,
    graf: Path | None = None,
    effort: Effort = EFFORT,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Time SURF on drawn textures with and without masks, and compare what it finds.

    Args:
        images: textures.
        shape: their (height, width).
        threshold: of the Hessian's determinant.
        seed: of textures and masks.
        golden: files of keypoints that OpenCV 3.4.2 found.
        opencv342: an interpreter that has OpenCV 3.4.2, to be timed in turn.
        graf: a folder with graf1.png, graf3.png and H1to3p.xml.
        effort: how often every call is timed.
        progress: shows how far it is.

    Returns:
        full_ms: median of processor time of a whole image on one thread; mask30, mask10 and scattered30:
        ratios to it with a square of 30 and 10 % of the pixels and with blobs that cover 30 %; two_threads:
        how many times as fast two threads are, by the clock on the wall, which a busy machine spoils;
        two_threads_caller: how many times less processor time the calling thread then needs; identical:
        whether every keypoint and descriptor that was compared had the same bits as in the whole image, and
        compared: how many;
        golden, opencv342_ratio (how many times as fast as that) and graf, or None without their files.
    """
    images = integer("images", images, at_least=1)
    detectors = {1: Surf(threshold, threads=1), 2: Surf(threshold, threads=2)}
    rng = np.random.default_rng(seed)
    rounds: list[dict[str, Times]] = []
    wall: list[float] = []
    faster: list[float] = []
    keypoints: list[int] = []
    same, compared = True, 0
    with rival(opencv342, threshold) if opencv342 is not None else nullcontext() as other:
        for index in (progress or Progress()).over(range(images), "looking for keypoints"):
            image = draw_texture(seed * 1000 + index, *shape)
            masks = draw_masks(rng, shape)
            calls: dict[str, Call] = {
                name: _call(detectors[1], image, mask) for name, mask in {"full": None, **masks}.items()
            }
            calls["helped"] = _call(detectors[2], image, None)
            rounds.append(interleave(calls, effort, clock=time.thread_time_ns))
            times = interleave({name: calls[name] for name in ("full", "helped")}, effort)
            wall.append(times["full"].over(times["helped"]))
            if other is not None:
                faster.append(other.over(calls["full"], image, effort.rounds))
            right, count = compare_masks(image, masks | odd_masks(rng, shape), threshold)
            same, compared = same and right, compared + count
            keypoints.append(len(detectors[1].detect(image)[0]))
    return {
        "seed": seed,
        "images": images,
        "shape": list(shape),
        "keypoints": float(np.mean(keypoints)),
        "full_ms": float(np.median([times["full"].median for times in rounds])) / 1e3,
        **{
            name: float(np.median([times[name].over(times["full"]) for times in rounds]))
            for name in (*SIZES, "scattered30")
        },
        "two_threads": float(np.median(wall)) if (os.cpu_count() or 1) > 1 else None,
        "two_threads_caller": float(np.median([times["full"].over(times["helped"]) for times in rounds])),
        "identical": same,
        "compared": compared,
        "golden": compare_golden(golden) if golden else None,
        "opencv342_ratio": float(np.median(faster)) if faster else None,
        "graf": evaluate_pair(graf, threshold) if graf is not None else None,
    }


def draw_masks(rng: np.random.Generator, shape: tuple[int, int]) -> Masks:
    """The masks that are timed: rectangles as the image at random places, and discs."""
    height, width = shape
    masks: Masks = {}
    for name, share in SIZES.items():
        mask = np.zeros(shape, dtype=np.bool_)
        high, wide = round(height * share**0.5), round(width * share**0.5)
        v, u = rng.integers(0, height - high + 1), rng.integers(0, width - wide + 1)
        mask[v : v + high, u : u + wide] = True
        masks[name] = mask
    blobs = np.zeros(shape, dtype=np.bool_)
    rows, columns = np.ogrid[:height, :width]
    while blobs.mean() < 0.3:
        radius = rng.integers(height // 40 + 1, height // 10 + 2)
        blobs |= (columns - rng.integers(width)) ** 2 + (rows - rng.integers(height)) ** 2 <= radius**2
    return {**masks, "scattered30": blobs}


def odd_masks(rng: np.random.Generator, shape: tuple[int, int]) -> Masks:
    """Masks that are hard to get right: single pixels, lines, noise."""
    height, width = shape
    pixels = np.zeros(shape, dtype=np.bool_)
    pixels[rng.integers(0, height, 200), rng.integers(0, width, 200)] = True
    lines = np.zeros(shape, dtype=np.bool_)
    lines[rng.integers(0, height, 5)] = True
    lines[:, rng.integers(0, width, 5)] = True
    return {"pixels": pixels, "lines": lines, "noise": rng.random(shape) < 0.3}


def compare_masks(image: NDArray[np.uint8], masks: Mapping[str, Any], threshold: float) -> tuple[bool, int]:
    """Whether all masks have the bits of the whole image, and how many keypoints were compared."""
    same, count = True, 0
    for upright, extended in ((False, False), (True, True)):
        surf = Surf(threshold, upright=upright, extended=extended)
        keypoints, descriptors = surf.detect(image)
        u, v = np.rint(keypoints["u"]).astype(int), np.rint(keypoints["v"]).astype(int)
        for mask in masks.values():
            inside = mask[v, u]
            found, described = surf.detect(image, mask)
            same &= found.tobytes() == keypoints[inside].tobytes()
            same &= described.tobytes() == descriptors[inside].tobytes()
            count += int(np.count_nonzero(inside))
    return same, count


def golden_files() -> list[Path]:
    """The keypoints of OpenCV 3.4.2 that are stored with the tests; none in an installed package."""
    return sorted((Path(__file__).parents[3] / "tests" / "golden").glob("surf-*.npz"))


def check_folder(graf: Path) -> None:
    """Make sure that the pair is there.

    Raises:
        ArgumentError: a file of it is missing.
    """
    for name in ("graf1.png", "graf3.png", "H1to3p.xml"):
        if not (graf / name).is_file():
            raise ArgumentError(f"graf: {graf / name} expected, there is no such file")


def _call(surf: Surf, image: NDArray[np.uint8], mask: NDArray[np.bool_] | None) -> Call:
    return lambda: surf.detect(image, mask)
