"""Motor-primed visual attention: make any detector look only where the robot is going to move.

The library needs no simulator: a :class:`Projection` says where points of the workspace appear in the
cameras, :class:`Attention` turns a planned path or a posture into landscapes, and a landscape into windows
or a mask for a detector.
"""

from importlib.metadata import version as _version

from ._core import Mlp
from .attention import Attention, Look
from .budget import Budgeted, Glance
from .camera import Camera, PosedCamera
from .costs import CostModel, calibrate_costs
from .detectors import (
    Detections,
    Detector,
    Everywhere,
    Guarded,
    HistogramDetector,
    Keypoints,
    Mask,
    OnTiles,
    PlanarDetector,
    Surf,
    Tiles,
    Windows,
)
from .errors import (
    ArgumentError,
    ArgumentTypeError,
    Error,
    MissingExtraError,
    NotInViewError,
    StateError,
    UnreachableError,
)
from .hand_map import HandMap, learn_hand_map
from .intersections import intersections
from .landscape import (
    gaussian_landscape,
    gaussian_landscapes,
    gibbs_sample,
    kernel_landscape,
    kernel_landscapes,
    regions,
    sample,
    threshold,
    tiles,
)
from .looking import Memory, choose_piece, choose_windows
from .motorplan import motorplan_landscape
from .peripersonal import ReachCloud, fit_gaussian, fit_peripersonal
from .peripersonal_model import PeripersonalModel
from .projection import (
    Calibration,
    HybridProjection,
    KinematicProjection,
    NeuralProjection,
    PinholeProjection,
    PosedProjection,
    Priors,
    Projection,
    calibrate,
)
from .recordings import read_recording, read_table
from .robot import ICUB, Robot
from .samples import Samples
from .step import Attended, attention_step

__version__ = _version("motorprime")

__all__ = [
    "ICUB",
    "ArgumentError",
    "ArgumentTypeError",
    "Attended",
    "Attention",
    "Budgeted",
    "Calibration",
    "Camera",
    "CostModel",
    "Detections",
    "Detector",
    "Error",
    "Everywhere",
    "Glance",
    "Guarded",
    "HandMap",
    "HistogramDetector",
    "HybridProjection",
    "Keypoints",
    "KinematicProjection",
    "Look",
    "Mask",
    "Memory",
    "MissingExtraError",
    "Mlp",
    "NeuralProjection",
    "NotInViewError",
    "OnTiles",
    "PeripersonalModel",
    "PinholeProjection",
    "PlanarDetector",
    "PosedCamera",
    "PosedProjection",
    "Priors",
    "Projection",
    "ReachCloud",
    "Robot",
    "Samples",
    "StateError",
    "Surf",
    "Tiles",
    "UnreachableError",
    "Windows",
    "__version__",
    "attention_step",
    "calibrate",
    "calibrate_costs",
    "choose_piece",
    "choose_windows",
    "fit_gaussian",
    "fit_peripersonal",
    "gaussian_landscape",
    "gaussian_landscapes",
    "gibbs_sample",
    "intersections",
    "kernel_landscape",
    "kernel_landscapes",
    "learn_hand_map",
    "motorplan_landscape",
    "read_recording",
    "read_table",
    "regions",
    "sample",
    "threshold",
    "tiles",
]
