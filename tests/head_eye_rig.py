"""The two-eyed robot with its reachable space, a ball of points, in front of its eyes."""

from __future__ import annotations

import numpy as np

from motorprime import ReachCloud
from small_robot import reference_pose

MIDDLE = {"neck": -0.05, "left_pan": 0.2, "right_pan": -0.2}


def ball_of_points(robot, *, size=300, distance=0.5, radius=0.07, seed=0):
    """Points in the chest's frame, half a metre in front of both eyes when these look straight on."""
    eyes = [reference_pose("chest", link, MIDDLE) for link in ("left_eye", "right_eye")]
    centre = np.mean([eye[:3, 3] + distance * eye[:3, 2] for eye in eyes], axis=0)
    points = np.random.default_rng(seed).normal(centre, (radius, 0.6 * radius, 0.8 * radius), (size, 3))
    return ReachCloud.from_points(robot, points)
