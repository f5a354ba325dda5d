"""SURF held against stored keypoints of OpenCV 3.4.2, and on a pair of views with a known homography."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats
from ..detectors.surf import Surf
from ..errors import ArgumentError

NEAR, SIMILAR, ALIKE = 1.0, 0.1, 0.98  # [px], share of the size, cosine
TOLERANCE = 3.0  # [px]


def compare_golden(files: Sequence[Path]) -> dict[str, Any]:
    """Shares of the stored keypoints that are found, and how alike the descriptors of these are.

    Raises:
        ArgumentError: a file that holds something else.
    """
    found: list[NDArray[np.bool_]] = []
    cosines: list[Floats] = []
    for path in files:
        try:
            with np.load(path) as stored:
                image, parameters = stored["image"], stored["parameters"]
                keypoints, descriptors = stored["keypoints"], stored["descriptors"].astype(np.float64)
        except (OSError, KeyError, ValueError) as error:
            raise ArgumentError(f"golden: {path} holds no keypoints: {error}") from None
        threshold, octaves, layers, upright, extended = parameters.tolist()
        surf = Surf(threshold, int(octaves), int(layers), bool(upright), bool(extended))
        has, cosine = agreement(*surf.detect(image), keypoints, descriptors)
        found.append(has)
        cosines.append(cosine)
    all_found, all_cosines = np.concatenate(found), np.concatenate(cosines)
    return {
        "keypoints": len(all_found),
        "found": float(all_found.mean()),
        "cosine_mean": float(all_cosines.mean()),
        "cosine_min": float(all_cosines.min()),
        "cosine_share": float((all_cosines >= ALIKE).mean()),
    }


def agreement(
    keypoints: NDArray[np.void], descriptors: NDArray[np.float32], theirs: Floats, described: Floats
) -> tuple[NDArray[np.bool_], Floats]:
    """Which of their keypoints (N, 7) are among ours, and the cosine of the descriptors of those that are."""
    distance = np.hypot(keypoints["u"] - theirs[:, :1], keypoints["v"] - theirs[:, 1:2])
    sizes = np.abs(keypoints["size"] / theirs[:, 2:3] - 1.0)
    distance = np.where((distance <= NEAR) & (sizes <= SIMILAR), distance, np.inf)
    has = np.isfinite(distance.min(axis=1))
    nearest = descriptors[distance.argmin(axis=1)[has]].astype(np.float64)
    lengths = np.linalg.norm(nearest, axis=1) * np.linalg.norm(described[has], axis=1)
    return has, (nearest * described[has]).sum(axis=1) / lengths


def evaluate_pair(folder: Path, threshold: float) -> dict[str, Any]:
    """Repeatability and matching between graf1.png and graf3.png, whose homography is in H1to3p.xml.

    Only keypoints of the part that both views show count; ``smaller`` is the smaller of their numbers.
    repeatability: keypoints of the first with one of the second within 3 px, over ``smaller``. matching:
    keypoints whose nearest descriptor in the second is within 3 px of where they should be, over
    ``smaller``; mutual: those of them that are the nearest of their nearest, over ``smaller``; precision:
    the share of right ones among all mutual nearest neighbours.
    """
    homography = _matrix(folder / "H1to3p.xml")
    images = [_gray(folder / name) for name in ("graf1.png", "graf3.png")]
    surf = Surf(threshold)
    first, second = (surf.detect(image) for image in images)
    here, there = _places(first[0]), _places(second[0])
    mapped, back = _mapped(here, homography), _mapped(there, np.linalg.inv(homography))
    common, other = _inside(mapped, images[1].shape), _inside(back, images[0].shape)
    distance = np.linalg.norm(mapped[common][:, None] - there[other][None], axis=2)
    unlike = -(first[1][common] @ second[1][other].T)
    nearest = unlike.argmin(axis=1)
    each = np.arange(len(nearest))
    right = distance[each, nearest] <= TOLERANCE
    mutual = unlike.argmin(axis=0)[nearest] == each
    smaller = min(distance.shape)
    return {
        "smaller": smaller,
        "repeatability": float((distance.min(axis=1) <= TOLERANCE).sum() / smaller),
        "matching": float(right.sum() / smaller),
        "mutual": float((right & mutual).sum() / smaller),
        "precision": float((right & mutual).sum() / mutual.sum()),
    }


def _matrix(path: Path) -> Floats:
    """The 3 x 3 matrix that an XML file of OpenCV's begins with."""
    wrong = ArgumentError(f"graf: a 3 x 3 matrix expected in {path}")
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        matrix = np.asarray(storage.getFirstTopLevelNode().mat(), dtype=np.float64)
        storage.release()
    except (cv2.error, SystemError, TypeError):
        raise wrong from None
    if matrix.shape != (3, 3):
        raise wrong
    return matrix


def _gray(path: Path) -> NDArray[np.uint8]:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ArgumentError(f"graf: an image expected, cannot read {path}")
    return np.asarray(image, dtype=np.uint8)


def _places(keypoints: NDArray[np.void]) -> Floats:
    return np.column_stack([keypoints["u"], keypoints["v"]]).astype(np.float64)


def _mapped(points: Floats, homography: npt.ArrayLike) -> Floats:
    matrix = np.asarray(homography, dtype=np.float64)
    return np.asarray(cv2.perspectiveTransform(points[:, None], matrix)[:, 0], dtype=np.float64)


def _inside(points: Floats, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    inside = (points >= 0.0) & (points <= (shape[1] - 1, shape[0] - 1))
    return np.asarray(inside.all(axis=1), dtype=np.bool_)
