"""Pictures of designs, clouds, hulls and maps; they take data and return matplotlib axes."""

from __future__ import annotations

from softreach.plot.arm import plot_arm
from softreach.plot.cloud import plot_cloud
from softreach.plot.cross_section import plot_cross_section
from softreach.plot.designs import DesignPanel, plot_designs
from softreach.plot.hull import plot_hull
from softreach.plot.redundancy import (
    plot_distance,
    plot_distance_histograms,
    plot_redundancy,
    plot_slab,
)
from softreach.plot.style import save_figure
from softreach.plot.views import plot_views
from softreach.plot.volume_curve import plot_volume_curve
from softreach.plot.workspace import plot_slice

__all__ = [
    "DesignPanel",
    "plot_arm",
    "plot_cloud",
    "plot_cross_section",
    "plot_designs",
    "plot_distance",
    "plot_distance_histograms",
    "plot_hull",
    "plot_redundancy",
    "plot_slab",
    "plot_slice",
    "plot_views",
    "plot_volume_curve",
    "save_figure",
]
