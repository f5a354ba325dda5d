"""Where will the hand appear? Learned from a table of joint states and pixels, without any model.

Here a made-up arm before two fixed cameras writes the table; yours would come from its encoders and from
whatever finds a point of the hand in the images. docs/your-robot.md tells more.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import motorprime as mp
from motorprime.hand_map import learn_hand_map
from motorprime.recordings import read_table

SHAPE = (480, 640)
JOINTS = ("base", "shoulder", "elbow")


def true_pixels(joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """What nobody knows: u, v in the left and u, v in the right camera, (N, 4), of an arm of two links."""
    base, shoulder, elbow = joints.T
    reach = 0.3 * np.cos(shoulder) + 0.25 * np.cos(shoulder + elbow)
    height = 0.3 * np.sin(shoulder) + 0.25 * np.sin(shoulder + elbow)
    x, depth = reach * np.sin(base), 1.2 - reach * np.cos(base)
    v = 239.5 - 600.0 * (height - 0.1) / depth
    left, right = (319.5 + 600.0 * (x - eye) / depth for eye in (-0.05, 0.05))
    return np.column_stack([left, v, right, v])


def write_table(path: Path, rng: np.random.Generator) -> None:
    """Let the arm wander, and write down joints and pixels, half a pixel of noise in them."""
    joints = rng.uniform((-0.5, 0.1, -1.2), (0.5, 1.0, -0.3), (150, 3))
    pixels = true_pixels(joints) + rng.normal(0.0, 0.5, (150, 4))
    lines = [",".join((*JOINTS, "left_u", "left_v", "right_u", "right_v"))]
    for q, (lu, lv, ru, rv) in zip(joints, pixels, strict=True):
        right = f"{ru:.2f},{rv:.2f}" if rng.random() < 0.9 else ","  # now and then it is hidden
        lines.append(",".join(f"{angle:.5f}" for angle in q) + f",{lu:.2f},{lv:.2f},{right}")
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Learn, predict a motion that was never made, look along it."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        write_table(table, np.random.default_rng(1))
        samples = read_table(table)
    hand_map = learn_hand_map(samples, seed=0)

    path = np.linspace((-0.3, 0.3, -1.0), (0.4, 0.8, -0.5), 40)  # a planned motion of the joints
    pixels = hand_map.hand_pixels(path)
    looks = mp.attention_step(
        None, dict.fromkeys(pixels, SHAPE), pixels=pixels, fraction=0.1, width=60.0, seed=0
    )
    truth = true_pixels(path)
    for k, (camera, look) in enumerate(looks.items()):
        where = truth[:, 2 * k : 2 * k + 2]
        off = np.linalg.norm(pixels[camera] - where, axis=1)
        u, v = where.round().astype(int).T
        assert look.mask is not None
        print(
            f"{camera}: the planned motion is predicted to {np.median(off):.1f} px, and "
            f"{look.mask[v, u].mean():.0%} of it lies in the tenth of the image that is looked at"
        )
    print(f"known: {hand_map.inside(path).all()}; twice as far: {hand_map.inside(2 * path).all()}")


if __name__ == "__main__":
    main()
