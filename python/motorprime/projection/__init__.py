"""Projections: from points in the robot's root frame to pixels in each of its cameras, and back."""

from .base import PosedProjection, Projection
from .kinematic import KinematicProjection
from .pinhole import PinholeProjection

__all__ = ["KinematicProjection", "PinholeProjection", "PosedProjection", "Projection"]
