"""Detectors that look only where they are told."""

from .base import Detections, Detector, Everywhere, Mask, Tiles, Where, Windows
from .histogram import HistogramDetector, Silhouette

__all__ = [
    "Detections",
    "Detector",
    "Everywhere",
    "HistogramDetector",
    "Mask",
    "Silhouette",
    "Tiles",
    "Where",
    "Windows",
]
