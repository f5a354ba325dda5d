"""Detectors that look only where they are told."""

from .base import Detections, Detector, Everywhere, Mask, Tiles, Where, Windows
from .histogram import HistogramDetector, Silhouette
from .planar import PlanarDetector, PlanarSighting
from .surf import Surf

__all__ = [
    "Detections",
    "Detector",
    "Everywhere",
    "HistogramDetector",
    "Mask",
    "PlanarDetector",
    "PlanarSighting",
    "Silhouette",
    "Surf",
    "Tiles",
    "Where",
    "Windows",
]
