"""Jobs of the arm in the scene: its shape, and what the camera should see of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from softreach.rod.tip_map import TipStatus
from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.scene.camera import is_behind
from softreach.studio.serve import theme
from softreach.studio.state import StudioState, solvable_rod
from softreach.support.errors import InvalidInput

_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_DRAGGED = 1 << 13  # points while the tip is dragged: the page draws all of them at each step


def _draw_arm(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    if not state.appearance.arm:
        page.scene.remove("/arm")
        return {}
    try:
        rod = solvable_rod(state.design)
    except InvalidInput:  # the status says so
        page.scene.remove("/arm")
        return {"tip": None, "posture": TipStatus.NO_EQUILIBRIUM}
    if found.held is not None:
        design, dragged = found.held
        if design == state.design and dragged.activation == state.activation:
            rod = dragged.rod  # in its posture
    tip = page.scene.draw_arm(state.design, state.activation, rod=rod)
    known = {"tip": tip if np.isfinite(tip).all() else None, "pointing": page.scene.pointing}
    if not rod.supports_unstable:
        return known | {"posture": None}
    status = TipStatus(rod.status([state.activation])[0])
    lost = known["tip"] is None and status <= TipStatus.UNSTABLE  # its shape was not found again
    return known | {"posture": TipStatus.UNDECIDED if lost else status}


DRAW_ARM = Job(
    "arm",
    ("design", "activation", "appearance.arm"),
    draw=_draw_arm,
    makes=("tip", "posture"),
    draws=("/arm",),
)
"""The arm in its activation."""


def _wait(state: StudioState, found: Found, tools: Tools) -> Results:
    del state, found
    time.sleep(_PAUSE)
    while tools.page.camera.keep_width():
        tools.check()
        time.sleep(_PAUSE)
    yield Learned()


def _look(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    camera, look = page.camera.actual(), state.appearance
    position = np.array(camera.position)
    ahead = (camera.look_at - position) * (1.0, 1.0, 0.0)
    base = np.array(state.design.base.position) / state.design.length
    most = _DRAGGED if found.is_dragged else None
    page.scene.look(ahead if look.half else None, base, most)
    page.scene.axes.turn(position, page.camera.focal)
    tip = found.tip if look.handle and look.arm else None
    hides = tip is not None and is_behind(tip, position, *page.scene.spine)
    page.scene.see_through_arm(found.sample is not None or hides)
    return {}


FOLLOW_CAMERA = Job(
    "camera",
    (
        "appearance.half", "appearance.arm", "appearance.handle",
        "found.tip", "found.sample", "found.is_dragged",
    ),
    _wait,
    _look,
)  # fmt: skip
"""Cuts away the half of a cloud that hides the arm, and turns the axes to the camera."""


def _set_theme(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    del found
    theme(page.client.gui, dark=state.appearance.dark)
    return {}


SET_THEME = Job("theme", ("appearance.dark",), draw=_set_theme)
"""Turns the light of the page on or off."""
