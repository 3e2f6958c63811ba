"""Jobs of the plots beside the scene; what is not shown is not computed."""

from __future__ import annotations

from softreach.studio.figures import section_picture, sweep_pictures, swept_parameter
from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Results, Tools
from softreach.studio.state import StudioState


def _cut(state: StudioState, found: Found, tools: Tools) -> Results:
    reach = found.complete_reach(state.design)
    if reach is not None:
        tools.report("cutting the reachable set")
        yield Learned({"section": section_picture(reach, state.appearance.slice)})


DRAW_SECTION = Job(
    "section",
    ("found.reach", "appearance.slice.axis", "appearance.slice.center"),
    _cut,
    wanted=lambda state: "section" in state.appearance.plots.shown,
    makes=("section",),
)
"""Picture of the section by the plane of the slice."""


def _sweep(state: StudioState, found: Found, tools: Tools) -> Results:
    parameter = swept_parameter(state)
    if parameter is not None:
        for picture in sweep_pictures(state.design, parameter, tools.quality):
            yield Learned({"sweep": picture})


SWEEP_VOLUME = Job(
    "sweep",
    ("design", "appearance.plots.parameter"),
    _sweep,
    wanted=lambda state: "sweep" in state.appearance.plots.shown,
    makes=("sweep",),
)
"""Volumes of designs that differ in one parameter."""
