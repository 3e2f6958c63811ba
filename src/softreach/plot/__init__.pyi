# ruff: noqa: I001  (several names a line)
from .arm import DesignPanel as DesignPanel, plot_arm as plot_arm, plot_check as plot_check
from .arm import plot_designs as plot_designs
from .arm import plot_equilibria as plot_equilibria, plot_payload_curve as plot_payload_curve
from .atlas import atlas_figures as atlas_figures, plot_cloud_sheet as plot_cloud_sheet
from .atlas import plot_hull_sheet as plot_hull_sheet, plot_metric_map as plot_metric_map
from .cross_section import plot_cross_section as plot_cross_section
from .figure_3d import Figure3D as Figure3D, plot_3d as plot_3d
from .reach import plot_cloud as plot_cloud, plot_hull as plot_hull, plot_slab as plot_slab
from .reach import plot_opposite_sides as plot_opposite_sides, plot_slice as plot_slice
from .reach import plot_slices as plot_slices, plot_views as plot_views
from .results import plot_calibration as plot_calibration, plot_search as plot_search
from .statistics import plot_curvature as plot_curvature, plot_distance as plot_distance
from .statistics import plot_redundancy as plot_redundancy
from .style import save_figure as save_figure
