"""Jobs of the plots beside the scene; what is not shown is not computed."""

from __future__ import annotations

from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Results, Tools
from softreach.studio.plots.section import section_picture
from softreach.studio.plots.sweep import sweep, swept_parameter
from softreach.studio.state import StudioState


def _cut(state: StudioState, found: Found, tools: Tools) -> Results:
    reach, look = found.complete_reach(state.design), state.appearance
    if reach is not None:
        tools.report("cutting the reachable set")
        picture = section_picture(reach, look.slice, tools.check, dark=look.dark)
        yield Learned({"section": picture})


DRAW_SECTION = Job(
    "section",
    ("found.reach", "appearance.slice.axis", "appearance.slice.center", "appearance.dark"),
    _cut,
    wanted=lambda state: "section" in state.appearance.plots.shown,
    makes=("section",),
)
"""Picture of the section by the plane of the slice."""


def _sweep(state: StudioState, found: Found, tools: Tools) -> Results:
    latest, parameter = found.sweep, swept_parameter(state)
    if parameter is None:
        return
    subject = state.design, parameter
    if latest is None or not latest.complete or (latest.arm, latest.parameter) != subject:
        for known in sweep(state.design, parameter, tools.quality, tools.check, latest):
            yield Learned({"sweep": known})


SWEEP_VOLUME = Job(
    "sweep",
    ("design", "appearance.plots.parameter"),
    _sweep,
    wanted=lambda state: "sweep" in state.appearance.plots.shown,
    makes=("sweep",),
)
"""Volumes of designs that differ in one parameter."""
