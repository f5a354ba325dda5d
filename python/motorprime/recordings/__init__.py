"""Recordings of robots: postures and the pixels where a point of the hand appeared."""

from .icub import ICUB_RIGHT_ARM, Layout, RobotRecording, read_recording
from .synchronise import Holds, estimate_lag, find_holds
from .table import read_table
from .thumb import thumb_tips
from .yarp import Frames, Images, read_encoders, read_images

__all__ = [
    "ICUB_RIGHT_ARM",
    "Frames",
    "Holds",
    "Images",
    "Layout",
    "RobotRecording",
    "estimate_lag",
    "find_holds",
    "read_encoders",
    "read_images",
    "read_recording",
    "read_table",
    "thumb_tips",
]
