"""Your robot, your cameras, your detector: look only along the path that the hand is going to take.

Two fixed cameras look at a table; the hand is planned to move from the right to a blue disc. The detector is
OpenCV's circle finder, wrapped in a class with one method.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

import motorprime as mp


class CircleDetector:
    """Three lines make a detector of your own: crop what is attended, detect, shift back."""

    def detect(self, image: NDArray[np.uint8], where: mp.Mask) -> mp.Detections:
        """Circles in the attended part of an image (H, W, 3)."""
        rows, columns = np.flatnonzero(where.mask.any(1)), np.flatnonzero(where.mask.any(0))
        top, left = rows[0], columns[0]
        crop = cv2.cvtColor(image[top : rows[-1] + 1, left : columns[-1] + 1], cv2.COLOR_RGB2GRAY)
        circles = cv2.HoughCircles(crop, cv2.HOUGH_GRADIENT, 1.0, 40, param1=120, param2=18, maxRadius=40)
        if circles is None:
            return mp.Detections(attended=crop.size)
        u, v, r = np.add(circles[0, :1], (left, top, 0)).T
        # Boxes are half-open: the last column that a disc covers is u + r.
        boxes = np.column_stack([u - r, v - r, u + r + 1, v + r + 1]).astype(np.float32)
        return mp.Detections(boxes, np.ones(len(boxes), np.float32), ("disc",) * len(boxes), crop.size)


def rig() -> dict[str, NDArray[np.float64]]:
    """3 x 4 projection matrices of two cameras 12 cm apart, 60 cm above the table, looking down."""
    intrinsics = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
    down = np.diag([1.0, -1.0, -1.0])  # x stays, the camera's z is the world's -z
    return {
        name: intrinsics @ np.column_stack([down, -down @ [x, 0.0, 0.6]])
        for name, x in {"left": -0.06, "right": 0.06}.items()
    }


def picture(matrix: NDArray[np.float64], disc: NDArray[np.float64]) -> NDArray[np.uint8]:
    """A grey table with a blue disc of 3 cm radius, and a cup that does not matter."""
    image = np.full((480, 640, 3), 170, np.uint8)
    for place, radius, colour in (
        (disc, 30, (40, 70, 200)),
        (np.array([0.1, 0.15, 0.0]), 28, (200, 120, 40)),
    ):
        u, v, w = matrix @ np.append(place, 1.0)
        cv2.circle(image, (round(u / w), round(v / w)), radius, colour, -1, cv2.LINE_AA)
    return image


def main() -> None:
    """Plan, look, find, triangulate."""
    disc = np.array([-0.05, -0.03, 0.0])
    matrices = rig()
    images = {name: picture(matrix, disc) for name, matrix in matrices.items()}
    path = np.linspace([0.15, -0.12, 0.1], disc, 60)

    cameras = mp.PinholeProjection(matrices, shape=(480, 640))
    attention = mp.Attention(cameras)
    detector = CircleDetector()
    centres = {}
    for name, look in attention.motor_plan(path).items():
        found = detector.detect(images[name], look.mask(fraction=0.12))
        centres[name] = (found.boxes[:, :2] + found.boxes[:, 2:] - 1) / 2
        print(
            f"{name}: {len(found)} disc, looked at {found.attended / look.landscape.size:.0%} of the pixels"
        )
    place = cameras.triangulate(centres)[0]
    print(f"the disc is at {np.round(place, 3)} m, truly at {disc} m")


if __name__ == "__main__":
    main()
