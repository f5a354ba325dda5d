"""Another robot is another value: an arm beside a pan-tilt camera, described by a URDF and a few names.

Peripersonal attention needs the reachable space only: drawn once from random arm postures, then projected for
whatever posture the head takes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import motorprime as mp
from motorprime.robot import CameraMount, Palm


def joint(name: str, parent: str, child: str, xyz: str, rpy: str, axis: str, limit: float) -> str:
    """One revolute joint of a URDF."""
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
    )


LINKS = ("base", "neck", "camera", "shoulder", "upper", "hand")
URDF = (
    '<robot name="pantilt">'
    + "".join(f'<link name="{link}"/>' for link in LINKS)
    # Columns of the camera's axes in the neck: x right = -y, y down = -z, z forward = x.
    + joint("pan", "base", "neck", "0 0 0.5", "0 0 0", "0 0 1", 1.5)
    + joint("tilt", "neck", "camera", "0.03 0 0", "-1.5708 0 -1.5708", "1 0 0", 1.0)
    + joint("shoulder", "base", "shoulder", "0 -0.2 0.2", "0 0 0", "0 0 1", 1.2)
    + joint("lift", "shoulder", "upper", "0.05 0 0", "0 0 0", "0 1 0", 0.9)
    + joint("elbow", "upper", "hand", "0.25 0 0", "0 0 0", "0 0 1", 1.4)
    + "</robot>"
)


def main() -> None:
    """Turn the head and see the reachable space move through its image."""
    camera = mp.Camera.from_fov(640, 480, np.deg2rad(70.0))
    palm = np.eye(4)
    palm[0, 3] = 0.2
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "pantilt.urdf"
        urdf.write_text(URDF)
        robot = mp.Robot(
            name="pan-tilt",
            root="base",
            chest="base",
            gaze=("pan", "tilt"),
            torso=(),
            arm=("shoulder", "lift", "elbow"),
            cameras={"eye": CameraMount("camera", camera)},
            palm=Palm("hand", palm),
            urdf=urdf,
        )
        attention = mp.Attention(mp.KinematicProjection(robot), cloud=mp.ReachCloud(robot, seed=0))
        for pan, tilt in ((0.0, -0.6), (-0.4, -0.7), (1.4, 0.6)):
            try:
                look = attention.peripersonal([pan, tilt], mixing=0.2)["eye"]
            except mp.NotInViewError as error:
                print(f"pan {pan:+.1f} tilt {tilt:+.1f}: {error}")
                continue
            windows = look.windows(50, seed=1)
            middle = windows.centres.mean(axis=0).round()
            print(
                f"pan {pan:+.1f} tilt {tilt:+.1f}: {look.covered:.0%} of the image, windows around {middle}"
            )


if __name__ == "__main__":
    main()
