"""SURF: keypoints and descriptors, computed only where a mask wants them (Bay et al. 2008).

Other libraries compute the whole image and drop what is outside of a mask. Here the mask decides what is
computed, and what is inside has the same bits as in a run over the whole image.

A note on patents, which is no legal advice: SURF was patented, in the United States as US 8,165,401 and in
Europe as EP 1,850,270, and builds of OpenCV leave it out unless they are told otherwise. Whether a patent is
still in force where you are is for you to find out before you sell a product that uses this module. SIFT's
patent, US 6,711,293, expired in March 2020; SIFT, AKAZE and ORB are free alternatives that OpenCV has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .keypoints import KEYPOINT

SURF_KEYPOINT = np.dtype([*KEYPOINT.descr, ("laplacian", np.int32)])
"""A keypoint whose ``size`` is the side of its filter; ``laplacian`` is the sign of the blob."""


@dataclass(frozen=True)
class Surf:
    """Speeded-up robust features with the conventions of OpenCV 3.

    Args:
        hessian_threshold: keypoints have a determinant of the Hessian above this, >= 0; grey levels squared.
        octaves: 1 to 16; each doubles the filters' sizes and the distance of the samples. Those that do not
            fit into the image find nothing.
        layers: 1 to 16, how many layers of an octave have keypoints; the sides of the filters of octave o
            are (9 + 6 l) 2^o px for l = 0 to layers + 1.
        upright: leave out the orientation; all angles are 3/2 pi then, as OpenCV has it.
        extended: descriptors of 128 numbers instead of 64.
        threads: most threads that work at once; None is as many as the machine has. The result does not
            depend on it.

    Raises:
        ArgumentError: a number outside its domain.
        ArgumentTypeError: an argument of a wrong type.
    """

    hessian_threshold: float = 300.0
    octaves: int = 4
    layers: int = 3
    upright: bool = False
    extended: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        self.detect(np.zeros((1, 1), dtype=np.uint8))  # the kernel checks every argument

    def detect(
        self, gray: NDArray[np.uint8], mask: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.void], NDArray[np.float32]]:
        """Find keypoints and describe them.

        Args:
            gray: (H, W) uint8.
            mask: (H, W) bool. A keypoint is inside when the mask is set at its rounded (u, v), np.rint; only
                what these keypoints need is computed. An empty mask has no keypoints, nor has an image that
                is smaller than a filter.

        Returns:
            Keypoints (N,) of dtype :data:`SURF_KEYPOINT`, the strongest first, and descriptors of length 1,
            (N, 64) or (N, 128) float32. ``angle`` is that of the gradient, from the u axis towards the v
            axis, in [0, 2 pi); a Gaussian as wide as the filter has a standard deviation of 1.2 / 9 of
            ``size``; ``laplacian`` is 1 for dark blobs on bright ground and -1 for bright ones.

        Raises:
            ArgumentError: an image that is not (H, W), or a mask of another shape.
            ArgumentTypeError: an image that is not uint8, or a mask that is not bool.
        """
        numbers, signs, descriptors = _core.surf(
            gray,
            mask,
            self.hessian_threshold,
            self.octaves,
            self.layers,
            self.upright,
            self.extended,
            self.threads,
        )
        keypoints = np.empty(len(numbers), dtype=SURF_KEYPOINT)
        for at, name in enumerate(("u", "v", "size", "angle", "response")):
            keypoints[name] = numbers[:, at]
        keypoints["octave"], keypoints["laplacian"] = signs[:, 0], signs[:, 1]
        return keypoints, descriptors
