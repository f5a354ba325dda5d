"""The report of a run: one HTML file that needs nothing else, and its plots."""

from .document import Shot
from .page import EMBED_LIMIT, page, write_report
from .plots import check_plots, plot_shots
from .way import movement_shots

__all__ = ["EMBED_LIMIT", "Shot", "check_plots", "movement_shots", "page", "plot_shots", "write_report"]
