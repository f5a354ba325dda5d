"""Small recordings as yarpdatadumper writes them: a white thumb over a dark wall, encoders, known lag."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

SHAPE = (120, 160)
START = 1500.0
RADIUS = 6


def thumb_image(centre, shape=SHAPE, radius=RADIUS):
    """White, round thumb with its end's centre (u, v) there, pointing up and left, before a dark wall."""
    image = np.full((*shape, 3), 40, np.uint8)
    image[:, ::16] = 60
    fine = 16  # sub-pixel steps of the drawing
    at = [round(fine * float(x)) for x in centre]
    there = [round(fine * (float(x) + d)) for x, d in zip(centre, (12.0, 7.0), strict=True)]
    hand = [round(fine * (float(x) + d)) for x, d in zip(centre, (40.0, 24.0), strict=True)]
    cv2.line(image, there, hand, (90, 90, 90), 2 * radius, cv2.LINE_AA, 4)
    cv2.line(image, at, there, (250, 250, 240), 2 * radius, cv2.LINE_AA, 4)
    cv2.circle(image, at, round(fine * radius), (250, 250, 240), -1, cv2.LINE_AA, 4)
    return image


def write_log(folder: Path, lines: list[str]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.log").write_text("".join(f"{line}\n" for line in lines))
    (folder / "info.log").write_text("Type: Bottle;\n[1500.0] /robot [connected]\n")
    return folder


def write_encoders(folder: Path, postures, hold=0.5, step=0.02, start=START):
    """A line every ``step`` seconds, each posture [deg] held for ``hold`` seconds."""
    lines = []
    count = round(hold / step)
    for k, posture in enumerate(postures):
        for j in range(count):
            time = start + k * hold + j * step
            lines.append(f"-1 {time:.6f} " + " ".join(f"{value:.6f}" for value in posture))
    return write_log(folder, lines)


def write_images(folder: Path, pixels, hold=0.5, every=0.11, lag=0.03, shape=SHAPE, start=START):
    """Images every ``every`` seconds, each showing what was held ``lag`` seconds before it came."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    number = 0
    time = start + lag + 0.005
    while time - lag < start + hold * len(pixels):
        k = min(int((time - lag - start) / hold), len(pixels) - 1)
        name = f"{number:08d}.ppm"
        cv2.imwrite(str(folder / name), thumb_image(pixels[k], shape)[:, :, ::-1])
        lines.append(f"-1 {time:.6f} {name}")
        number, time = number + 1, time + every
    return write_log(folder, lines)
