"""Times SURF of an old OpenCV, one call for every line on stdin; run by the interpreter that has it.

NumPy and OpenCV are all that it may import: it runs under CPython 3.7.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import cv2
import numpy as np


def main() -> None:
    """Read "THRESHOLD PATH" lines, PATH being an image as .npy; answer processor time [ns] and keypoints."""
    cv2.setNumThreads(1)
    contributed: Any = cv2
    images = {}
    sys.stdout.write(cv2.__version__ + "\n")
    sys.stdout.flush()
    for line in sys.stdin:
        threshold, path = line.rstrip("\n").split(" ", 1)
        if path not in images:
            images[path] = np.load(path)
        surf = contributed.xfeatures2d.SURF_create(float(threshold), 4, 3)
        start = time.thread_time_ns()
        keypoints, _ = surf.detectAndCompute(images[path], None)
        taken = time.thread_time_ns() - start
        sys.stdout.write(f"{taken} {len(keypoints)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
