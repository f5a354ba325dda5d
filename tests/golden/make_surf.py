"""Keypoints and descriptors of OpenCV 3.4.2, stored as numbers; CONTRIBUTING.md says how to run this.

It runs where that old OpenCV does, under CPython 3.7, and so without motorprime.
"""

import importlib.util
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).resolve().parent
TEXTURES = HERE.parents[1] / "python" / "motorprime" / "evaluate" / "textures.py"
CASES = {
    # name: (seed, height, width, threshold, upright, extended)
    "plain": (1, 240, 320, 300.0, False, False),
    "large": (2, 360, 480, 2000.0, False, False),
    "extended": (3, 200, 260, 1000.0, False, True),
    "upright": (4, 200, 260, 1000.0, True, False),
}


def main():
    spec = importlib.util.spec_from_file_location("textures", str(TEXTURES))
    textures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(textures)
    for name, (seed, height, width, threshold, upright, extended) in CASES.items():
        image = textures.draw_texture(seed, height, width)
        surf = cv2.xfeatures2d.SURF_create(threshold, 4, 3, extended, upright)
        keypoints, descriptors = surf.detectAndCompute(image, None)
        rows = [(*k.pt, k.size, k.angle, k.response, k.octave, k.class_id) for k in keypoints]
        np.savez_compressed(
            str(HERE / f"surf-{name}.npz"),
            image=image,
            parameters=np.array([threshold, 4, 3, upright, extended], dtype=np.float64),
            keypoints=np.array(rows, dtype=np.float32),
            # Half precision is a thousand times finer than what the descriptors are compared by.
            descriptors=descriptors.astype(np.float16),
        )
        print(name, len(keypoints), "keypoints of OpenCV", cv2.__version__)


main()
