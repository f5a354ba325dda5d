"""Projections: from points in the robot's root frame to pixels in each of its cameras, and back."""

from motorprime.projection.base import PosedProjection, Projection
from motorprime.projection.kinematic import KinematicProjection
from motorprime.projection.pinhole import PinholeProjection

__all__ = ["KinematicProjection", "PinholeProjection", "PosedProjection", "Projection"]
