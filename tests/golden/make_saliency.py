"""Make saliency.npz: maps of opencv-contrib's saliency module, see CONTRIBUTING.md.

Run by an interpreter that has opencv-contrib-python-headless, which must not be the project's own.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from pictures import shapes

SEEDS = (0, 1, 2)


def main():
    maps = {}
    for seed in SEEDS:
        image = np.ascontiguousarray(shapes(seed)[..., ::-1])
        for name, algorithm in (
            ("spectral_residual", cv2.saliency.StaticSaliencySpectralResidual_create()),
            ("fine_grained", cv2.saliency.StaticSaliencyFineGrained_create()),
        ):
            values = np.squeeze(algorithm.computeSaliency(image)[1])
            maps[f"{name}_{seed}"] = np.rint(255.0 * values / values.max()).astype(np.uint8)
    np.savez_compressed(Path(__file__).parent / "saliency.npz", **maps)
    print(f"OpenCV {cv2.__version__}: {', '.join(maps)}")


if __name__ == "__main__":
    main()
