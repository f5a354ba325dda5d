"""Your slow detector, wrapped in three lines: how much faster it became, and that it found the same things.

The detector denoises before it looks for blue things, which takes far too long for a control loop. Around the
planned path of the hand it looks at a tenth of the image and at some pixels around that.
"""

from __future__ import annotations

import time

import cv2
import numpy as np
from numpy.typing import NDArray

import motorprime as mp


def slow(image: NDArray[np.uint8]) -> mp.Detections:
    """Blue things in an image (H, W, 3), however noisy: the detector that you have."""
    calm = cv2.fastNlMeansDenoisingColored(image, None, 12, 12, 5, 15)
    blue = cv2.inRange(cv2.cvtColor(calm, cv2.COLOR_RGB2HSV), (100, 110, 60), (130, 255, 255))
    _, _, stats, _ = cv2.connectedComponentsWithStats(blue)
    boxes = np.array([(u, v, u + w, v + h) for u, v, w, h, area in stats[1:] if area > 60], np.float32)
    return mp.Detections(boxes.reshape(-1, 4), np.ones(len(boxes), np.float32), ("blue",) * len(boxes))


def picture(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A grey table under a noisy camera: blue pegs along the way of the hand, and clutter elsewhere."""
    image = np.full((480, 640, 3), 150, np.uint8)
    for u, v in ((180, 300), (300, 250), (420, 200)):
        cv2.circle(image, (u, v), 12, (40, 70, 200), -1, cv2.LINE_AA)
    for u, v in rng.integers((20, 20), (620, 120), (12, 2)).tolist():
        cv2.rectangle(image, (u, v), (u + 9, v + 9), (40, 70, 200), -1)
    noisy = image + rng.normal(0.0, 18.0, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def main() -> None:
    """Detect everywhere and where the hand will be."""
    image = picture(np.random.default_rng(3))
    plan = np.linspace((120.0, 330.0), (480.0, 175.0), 60)  # projected points (u, v) of the planned path
    look = mp.Look(mp.kernel_landscape(plan, (480, 640), width=60.0))

    detector = mp.Guarded(mp.OnTiles(slow, halo=16))  # a frame in which it fails does not end the loop
    where = look.mask(fraction=0.1)
    found, times = {}, {}
    for name, place in (("everywhere", mp.Everywhere()), ("attended", where)):
        start = time.perf_counter()
        found[name] = detector.detect(image, place)
        times[name] = time.perf_counter() - start
        share = found[name].attended / image[..., 0].size
        print(
            f"{name}: {len(found[name])} found in {times[name] * 1e3:.0f} ms, {share:.0%} of the pixels read"
        )

    centres = ((found["everywhere"].boxes[:, :2] + found["everywhere"].boxes[:, 2:]) / 2).astype(int)
    there = found["everywhere"].boxes[where.mask[centres[:, 1], centres[:, 0]]]
    both = sum(bool((np.abs(found["attended"].boxes - box).max(axis=1) <= 2).any()) for box in there)
    print(
        f"{times['everywhere'] / times['attended']:.1f} times as fast; of the {len(there)} things that the "
        f"full run has on the path it found {both}"
    )


if __name__ == "__main__":
    main()
