"""Projections: from points in the robot's root frame to pixels in each of its cameras, and back."""

from .base import PosedProjection, Projection
from .calibration import Calibration
from .estimation import CalibrationResult, calibrate
from .hybrid import HybridProjection
from .kinematic import KinematicProjection
from .neural import LearnedCamera, NeuralProjection
from .parameters import Priors, parameter_names
from .pinhole import PinholeProjection

__all__ = [
    "Calibration",
    "CalibrationResult",
    "HybridProjection",
    "KinematicProjection",
    "LearnedCamera",
    "NeuralProjection",
    "PinholeProjection",
    "PosedProjection",
    "Priors",
    "Projection",
    "calibrate",
    "parameter_names",
]
