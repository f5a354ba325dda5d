"""Detectors that look only where they are told."""

from .base import Detections, Detector, Everywhere, Mask, Tiles, Where, Windows
from .guard import Guarded
from .histogram import HistogramDetector, Silhouette
from .keypoints import KEYPOINT, Keypoints
from .on_tiles import OnTiles
from .planar import PlanarDetector, PlanarSighting
from .surf import Surf

__all__ = [
    "KEYPOINT",
    "Detections",
    "Detector",
    "Everywhere",
    "Guarded",
    "HistogramDetector",
    "Keypoints",
    "Mask",
    "OnTiles",
    "PlanarDetector",
    "PlanarSighting",
    "Silhouette",
    "Surf",
    "Tiles",
    "Where",
    "Windows",
]
