"""The figures of softreach: they take data and draw it.

What draws one panel takes `ax=None` and returns the axes; what draws several returns the figure.
"""

from __future__ import annotations

from softreach.plot.arm import (
    DesignPanel,
    plot_arm,
    plot_check,
    plot_compliance,
    plot_designs,
    plot_equilibria,
    plot_payload_curve,
)
from softreach.plot.atlas import atlas_figures, plot_cloud_sheet, plot_hull_sheet, plot_metric_map
from softreach.plot.clouds import plot_cloud, plot_opposite_sides, plot_slab, plot_views
from softreach.plot.cross_section import plot_cross_section
from softreach.plot.figure_3d import Figure3D, plot_3d
from softreach.plot.results import plot_calibration, plot_search
from softreach.plot.sets import plot_hull, plot_slice, plot_slices, plot_volume_curve
from softreach.plot.statistics import (
    plot_curvature,
    plot_distance,
    plot_distance_histograms,
    plot_redundancy,
)
from softreach.plot.style import save_figure

__all__ = [
    "DesignPanel",
    "Figure3D",
    "atlas_figures",
    "plot_3d",
    "plot_arm",
    "plot_calibration",
    "plot_check",
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
    "plot_search",
    "plot_slab",
    "plot_slice",
    "plot_slices",
    "plot_views",
    "plot_volume_curve",
    "save_figure",
]
