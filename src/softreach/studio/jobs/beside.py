"""Jobs of other designs in the scene: the arm without its loads, and the one that is kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from softreach.arm.manipulator import Manipulator
from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.jobs.reach import draw_axes
from softreach.studio.reach import Reach, stages
from softreach.studio.state import StudioState

_LEVEL = 16


def _compute_free(state: StudioState, found: Found, tools: Tools) -> Results:
    free = None if state.design.loads is None else state.unloaded
    small = replace(tools.quality, fine_level=tools.quality.coarse_level)
    for reach in _reaches(free, found.free, found.reach, small, tools):
        yield Learned({"free": reach})


def _draw_free(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    page.scene.draw_beside("/free", found.free, state.appearance.slice)
    draw_axes(page, state, found)
    return {}


DRAW_FREE = Job(
    "free",
    ("unloaded", "appearance.slice"),
    _compute_free,
    _draw_free,
    wanted=lambda state: state.design.loads is not None,
    makes=("free",),
    draws=("/free",),
)
"""The reach of a loaded arm without its loads, faint behind the loaded one."""


def _compute_reference(state: StudioState, found: Found, tools: Tools) -> Results:
    for reach in _reaches(state.reference, found.reference, found.reach, tools.quality, tools):
        yield Learned({"reference": reach})


def _draw_reference(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    page.scene.draw_beside("/reference", found.reference, state.appearance.slice)
    return {}


DRAW_REFERENCE = Job(
    "reference",
    ("reference", "appearance.slice"),
    _compute_reference,
    _draw_reference,
    wanted=lambda state: state.reference is not None,
    makes=("reference",),
    draws=("/reference",),
)
"""The boundary of the design that is kept."""


def _reaches(
    design: Manipulator | None, known: Reach | None, now: Reach | None, quality: Any, tools: Tools
) -> Iterator[Reach | None]:
    """The reach of another design, unless it is known; that of the present one, if they agree."""
    if design is None:
        yield None
    elif known is not None and known.fine and known.arm == design:
        return
    elif now is not None and now.fine and now.arm == design:
        yield now
    else:
        yield from stages(design, min(_LEVEL, quality.coarse_level), quality, tools.check)
