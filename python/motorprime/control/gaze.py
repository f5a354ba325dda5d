"""Turn neck and eyes so that a point comes to the middle of every image."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed
from ..errors import ArgumentError, UnreachableError
from ..kinematics import apply, invert
from ..robot import Robot
from .solver import solve_bounded

COMFORT = 0.04  # weight of a radian away from rest against a radian of gaze error


def fixate(
    robot: Robot,
    joints: npt.ArrayLike,
    point: npt.ArrayLike,
    *,
    move: tuple[str, ...] | None = None,
    tolerance: float = np.deg2rad(6.0),
) -> Floats:
    """Gaze posture (len(robot.gaze),) [rad] in which the cameras look at a point.

    This is the controller's own knowledge of its robot, by the URDF as it is; whatever projection attention
    uses, its errors do not come in here, and the URDF's errors do not go in there.

    Args:
        robot: with its URDF.
        joints: present gaze posture [rad]; variables that do not move keep their value.
        point: (3,) [m] in the root frame.
        move: variables that may move; default all of the gaze but the torso.
        tolerance: largest remaining angle [rad] between an optical axis and the point.

    Raises:
        ArgumentError: ``move`` is empty or names an unknown variable.
        UnreachableError: the joint limits do not let every camera look there.
    """
    posture: Floats = robot.gaze_posture(joints).copy()
    target = fixed("point", point, (3,))
    moving = tuple(name for name in robot.gaze if name not in robot.torso) if move is None else tuple(move)
    unknown = [name for name in moving if name not in robot.gaze]
    if unknown or not moving:
        raise ArgumentError(f"move: some of {robot.gaze} expected, got {moving}")
    columns = [robot.gaze.index(name) for name in moving]
    limits, rest = robot.limits(moving), robot.resting(moving)

    def offsets(values: Floats) -> Floats:
        posture[columns] = values
        rows = []
        for chain in robot.camera_chains.values():
            pose = chain.forward(robot.urdf_angles(chain.names, posture))
            x, y, z = apply(invert(pose), target)
            rows += [np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))]
        return np.array(rows)

    solution = solve_bounded(
        lambda values: np.concatenate([offsets(values), COMFORT * (values - rest)]), posture[columns], limits
    )
    remaining = float(np.abs(offsets(solution)).max())
    if remaining > tolerance:
        raise UnreachableError(
            f"gaze: the eyes cannot turn to {np.round(target, 3)} m; "
            f"{np.rad2deg(remaining):.0f} deg are missing"
        )
    posture[columns] = solution
    return posture
