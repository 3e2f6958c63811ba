"""The figures of softreach: they take data and draw it, and compute nothing.

What draws one panel takes `ax=None` and returns the axes; what draws several returns the figure.
"""

from __future__ import annotations

from softreach.plot.arm import plot_arm
from softreach.plot.atlas_axes import SheetAxis, box_over_length, sheet_axes
from softreach.plot.cloud import plot_cloud
from softreach.plot.compliance import plot_compliance
from softreach.plot.cross_section import plot_cross_section
from softreach.plot.curvature import plot_curvature
from softreach.plot.designs import DesignPanel, plot_designs
from softreach.plot.distance import plot_distance, plot_distance_histograms
from softreach.plot.equilibria import plot_equilibria
from softreach.plot.hull import plot_hull
from softreach.plot.metric_map import plot_metric_map
from softreach.plot.payload_curve import plot_payload_curve
from softreach.plot.redundancy import plot_redundancy
from softreach.plot.sheet import plot_cloud_sheet, plot_hull_sheet
from softreach.plot.sides import plot_opposite_sides
from softreach.plot.slab import plot_slab
from softreach.plot.slice import plot_slice, plot_slices
from softreach.plot.style import save_figure
from softreach.plot.views import plot_views
from softreach.plot.volume_curve import plot_volume_curve

__all__ = [
    "DesignPanel",
    "SheetAxis",
    "box_over_length",
    "plot_arm",
    "plot_cloud",
    "plot_cloud_sheet",
    "plot_compliance",
    "plot_cross_section",
    "plot_curvature",
    "plot_designs",
    "plot_distance",
    "plot_distance_histograms",
    "plot_equilibria",
    "plot_hull",
    "plot_hull_sheet",
    "plot_metric_map",
    "plot_opposite_sides",
    "plot_payload_curve",
    "plot_redundancy",
    "plot_slab",
    "plot_slice",
    "plot_slices",
    "plot_views",
    "plot_volume_curve",
    "save_figure",
    "sheet_axes",
]
