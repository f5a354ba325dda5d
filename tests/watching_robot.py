"""The small robot with eyes that turn far enough to see its hand, both of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from motorprime import Robot
from small_robot import small_robot


def watching_robot(folder: Path) -> Robot:
    robot = small_robot(folder)
    return replace(robot, ranges={**robot.ranges, "version": (-3.0, 3.0), "neck": (-3.0, 3.0)})
