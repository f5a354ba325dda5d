"""Motor-primed visual attention: make any detector look only where the robot is going to move.

The library needs no simulator: a :class:`Projection` says where points of the workspace appear in the
cameras, :class:`Attention` turns a planned path or a posture into landscapes, and a landscape into windows
or a mask for a detector.
"""

from importlib.metadata import version as _version

from ._core import Mlp
from .attention import Attention, Look
from .camera import Camera, PosedCamera
from .detectors import Detections, Detector, Everywhere, HistogramDetector, Mask, Tiles, Windows
from .errors import (
    ArgumentError,
    ArgumentTypeError,
    Error,
    MissingExtraError,
    NotInViewError,
    StateError,
    UnreachableError,
)
from .landscape import (
    gaussian_landscape,
    gaussian_landscapes,
    gibbs_sample,
    kernel_landscape,
    kernel_landscapes,
    sample,
    threshold,
)
from .motorplan import motorplan_landscape
from .peripersonal import ReachCloud, fit_gaussian, fit_peripersonal
from .peripersonal_model import PeripersonalModel
from .projection import KinematicProjection, PinholeProjection, PosedProjection, Projection
from .robot import ICUB, Robot
from .step import Attended, attention_step

__version__ = _version("motorprime")

__all__ = [
    "ICUB",
    "ArgumentError",
    "ArgumentTypeError",
    "Attended",
    "Attention",
    "Camera",
    "Detections",
    "Detector",
    "Error",
    "Everywhere",
    "HistogramDetector",
    "KinematicProjection",
    "Look",
    "Mask",
    "MissingExtraError",
    "Mlp",
    "NotInViewError",
    "PeripersonalModel",
    "PinholeProjection",
    "PosedCamera",
    "PosedProjection",
    "Projection",
    "ReachCloud",
    "Robot",
    "StateError",
    "Tiles",
    "UnreachableError",
    "Windows",
    "__version__",
    "attention_step",
    "fit_gaussian",
    "fit_peripersonal",
    "gaussian_landscape",
    "gaussian_landscapes",
    "gibbs_sample",
    "kernel_landscape",
    "kernel_landscapes",
    "motorplan_landscape",
    "sample",
    "threshold",
]
