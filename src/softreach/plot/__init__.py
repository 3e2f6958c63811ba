"""Pictures of clouds, hulls and arms; they take data and return matplotlib axes."""

from __future__ import annotations

from softreach.plot.arm import plot_arm
from softreach.plot.cloud import plot_cloud
from softreach.plot.hull import plot_hull
from softreach.plot.style import save_figure
from softreach.plot.views import plot_views
from softreach.plot.workspace import plot_slice

__all__ = ["plot_arm", "plot_cloud", "plot_hull", "plot_slice", "plot_views", "save_figure"]
