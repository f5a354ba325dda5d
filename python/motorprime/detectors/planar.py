"""A flat textured object (a label, a book, a poster) found by its SURF keypoints, and its pose."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats, fixed, integer, positive
from ..camera import Camera
from ..errors import ArgumentError, ArgumentTypeError, StateError
from ..tiling import looked_at
from .base import Detections, Where, check_image
from .surf import Surf

CONFIDENCE, ITERATIONS = 0.999, 2000  # of RANSAC


@dataclass(frozen=True, eq=False)
class PlanarSighting:
    """A flat object that was found.

    Attributes:
        homography: (3, 3), pixels of the template to pixels of the image.
        corners: (4, 2) corners of the template in the image, from the upper left clockwise.
        template_points: (K, 2) pixels of the template that were seen.
        image_points: (K, 2) where they were seen, within the tolerance of the homography.
        score: the share of the matches that agree with the homography, 0 to 1.
    """

    homography: Floats
    corners: Floats
    template_points: Floats
    image_points: Floats
    score: float


@dataclass(eq=False)
class PlanarDetector:
    """Find a flat textured object by one picture of it.

    Keypoints of the image are matched with those of the template by the ratio test: a match counts when its
    descriptor is clearly nearer than the second nearest. RANSAC finds the homography that most matches agree
    with, and again among those that are left, for there may be copies. Lens distortion is left to RANSAC's
    tolerance. See :mod:`motorprime.detectors.surf` for patents.

    Args:
        template: (h, w, 3) uint8 RGB or (h, w) uint8, a picture that shows nothing but the object.
        label: name of what is found.
        surf: finds and describes the keypoints.
        ratio: a match's distance is below this times the second's, in (0, 1].
        tolerance: distance [px] up to which a match agrees with a homography.
        min_matches: with fewer that agree nothing was found, >= 4.

    Raises:
        ArgumentError: a template with fewer keypoints than ``min_matches``, or a number outside its domain.
        ArgumentTypeError: an argument of a wrong type.
    """

    template: NDArray[np.uint8]
    label: str = "target"
    surf: Surf = field(default_factory=Surf)
    ratio: float = 0.75
    tolerance: float = 3.0
    min_matches: int = 10
    _points: Floats = field(init=False, repr=False)
    _descriptors: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.surf, Surf):
            raise ArgumentTypeError(f"surf: a Surf expected, got {type(self.surf).__name__}")
        if not 0.0 < float(fixed("ratio", self.ratio, ())) <= 1.0:
            raise ArgumentError(f"ratio: a number in (0, 1] expected, got {self.ratio}")
        positive("tolerance", self.tolerance)
        integer("min_matches", self.min_matches, at_least=4)
        template = self.template
        if not isinstance(template, np.ndarray) or template.dtype != np.uint8:
            kind = getattr(template, "dtype", type(template).__name__)
            raise ArgumentTypeError(f"template: a uint8 array (h, w, 3) or (h, w) expected, got {kind}")
        if not (template.ndim == 2 or (template.ndim == 3 and template.shape[2] == 3)) or 0 in template.shape:
            raise ArgumentError(f"template: shape (h, w, 3) or (h, w) expected, got {template.shape}")
        keypoints, self._descriptors = self.surf.detect(template if template.ndim == 2 else _gray(template))
        self._points = _places(keypoints)
        if len(keypoints) < self.min_matches:
            raise ArgumentError(
                f"template: at least {self.min_matches} keypoints expected, found {len(keypoints)}; a larger "
                "picture with more texture or a lower hessian_threshold has more"
            )

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect the object, and copies of it, in ``image`` (H, W, 3) uint8 RGB: a box around each.

        Raises:
            ArgumentError, ArgumentTypeError: as for :meth:`find`.
        """
        mask = looked_at(where, check_image(image).shape[:2])
        attended = image.shape[0] * image.shape[1] if mask is None else int(np.count_nonzero(mask))
        found = self._find(image, mask)
        limits = (image.shape[1], image.shape[0])
        ends = [(seen.corners.min(axis=0), seen.corners.max(axis=0)) for seen in found]
        boxes = np.clip(np.array(ends, dtype=np.float32).reshape(-1, 2, 2), 0, limits).reshape(-1, 4)
        scores = np.array([seen.score for seen in found], dtype=np.float32)
        return Detections(boxes.astype(np.float32), scores, (self.label,) * len(found), attended)

    def find(self, image: NDArray[np.uint8], where: Where) -> PlanarSighting | None:
        """The object in ``image`` (H, W, 3) uint8 RGB with all that is known of it, or None.

        Of several copies it is the one that most matches agree with.

        Raises:
            ArgumentError, ArgumentTypeError: as for :meth:`find_all`.
        """
        return next(iter(self.find_all(image, where)), None)

    def find_all(self, image: NDArray[np.uint8], where: Where) -> list[PlanarSighting]:
        """The object and copies of it in ``image`` (H, W, 3) uint8 RGB, that with the most matches first.

        Windows and Tiles are looked at as the mask of their pixels.

        Raises:
            ArgumentError: the image or ``where`` has the wrong shape.
            ArgumentTypeError: the image is not uint8, or ``where`` is none of the four.
        """
        return self._find(image, looked_at(where, check_image(image).shape[:2]))

    def pose(self, sighting: PlanarSighting, size: npt.ArrayLike, camera: Camera) -> Floats:
        """Pose (4, 4) of the object in the camera frame.

        The object's frame has its origin in the middle of the template, x along its rows to the right, y
        down along its columns, and z behind it, as the camera's when it looks at it upright.

        Args:
            sighting: what :meth:`find` returned.
            size: (width, height) of the whole template [m].
            camera: intrinsics and lens distortion of the image.

        Raises:
            ArgumentError: a size that is not two positive numbers.
            StateError: no pose in front of the camera fits.
        """
        extent = fixed("size", size, (2,))
        if (extent <= 0.0).any():
            raise ArgumentError(f"size: (width, height) > 0 m expected, got {extent.tolist()}")
        height, width = self.template.shape[:2]
        plane = (
            (sighting.template_points - ((width - 1) / 2.0, (height - 1) / 2.0)) * extent / (width, height)
        )
        points = np.column_stack([plane, np.zeros(len(plane))])
        distortion = np.array(camera.distortion) if camera.distortion else None
        found, turn, shift = cv2.solvePnP(
            points, sighting.image_points, camera.matrix, distortion, flags=cv2.SOLVEPNP_IPPE
        )
        if not found or not np.isfinite(turn).all() or float(shift[2, 0]) <= 0.0:
            raise StateError("sighting: no pose in front of the camera fits")
        turn, shift = cv2.solvePnPRefineLM(
            points, sighting.image_points, camera.matrix, distortion, turn, shift
        )
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(turn)[0]
        pose[:3, 3] = shift[:, 0]
        return pose

    def _find(self, image: NDArray[np.uint8], mask: NDArray[np.bool_] | None) -> list[PlanarSighting]:
        keypoints, descriptors = self.surf.detect(_gray(image), mask)
        if len(keypoints) < self.min_matches:
            return []
        # From the image to the template, so that the keypoints of a second copy do not rival the first one's.
        pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(descriptors, self._descriptors, k=2)
        matches = [(a.trainIdx, a.queryIdx) for a, b in pairs if a.distance < self.ratio * b.distance]
        if not matches:
            return []
        ours, theirs = (np.array(side) for side in zip(*matches, strict=True))
        template_points, image_points = self._points[ours], _places(keypoints)[theirs]
        found = []
        while len(template_points) >= self.min_matches:
            homography, agree = cv2.findHomography(
                template_points,
                image_points,
                # As good as cv2.RANSAC here and dozens of times as fast, above all where there are no copies.
                cv2.USAC_MAGSAC,
                self.tolerance,
                maxIters=ITERATIONS,
                confidence=CONFIDENCE,
            )
            if homography is None or np.count_nonzero(agree) < self.min_matches:
                break
            inside = agree[:, 0] != 0
            corners = self._outline(homography)
            if _is_front(corners):
                score = float(np.count_nonzero(inside)) / len(matches)
                found.append(
                    PlanarSighting(homography, corners, template_points[inside], image_points[inside], score)
                )
            template_points, image_points = template_points[~inside], image_points[~inside]
        return found

    def _outline(self, homography: Floats) -> Floats:
        """Where the template's corners (4, 2) are in the image."""
        height, width = self.template.shape[:2]
        right, bottom = width - 0.5, height - 0.5
        corners = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
        return np.asarray(cv2.perspectiveTransform(corners[:, None], homography)[:, 0], dtype=np.float64)


def _gray(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _places(keypoints: NDArray[np.void]) -> Floats:
    return np.column_stack([keypoints["u"], keypoints["v"]]).astype(np.float64)


def _is_front(corners: Floats) -> bool:
    """Whether the corners go around a convex area clockwise, as those of the front of a flat object do."""
    if not np.isfinite(corners).all():
        return False
    sides = np.roll(corners, -1, axis=0) - corners
    following = np.roll(sides, -1, axis=0)
    return bool((sides[:, 0] * following[:, 1] - sides[:, 1] * following[:, 0] > 1.0).all())
