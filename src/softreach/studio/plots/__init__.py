"""Plots beside the scene, one a file."""

from __future__ import annotations

from softreach.studio.plots.along_arm import AlongArmPlot
from softreach.studio.plots.histogram import HistogramPlot
from softreach.studio.plots.plot import Plot
from softreach.studio.plots.section import SectionPlot
from softreach.studio.plots.sweep import SweepPlot
from softreach.studio.plots.volumes import VolumeCurvePlot

PLOTS: tuple[type[Plot], ...] = (
    AlongArmPlot,
    SectionPlot,
    HistogramPlot,
    VolumeCurvePlot,
    SweepPlot,
)
"""In the order of the tab."""
