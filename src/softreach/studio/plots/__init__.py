"""Plots beside the scene, one a file."""

from __future__ import annotations

from softreach.studio.plots.plot import Plot
from softreach.studio.plots.section import SectionPlot
from softreach.studio.plots.sweep import SweepPlot

PLOTS: tuple[type[Plot], ...] = (SectionPlot, SweepPlot)
"""In the order of the tab."""
