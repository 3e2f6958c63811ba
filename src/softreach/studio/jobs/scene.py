"""Jobs of what stands in the scene: the arm, other designs beside it, camera and light."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.tip_map import TipStatus
from softreach.studio.job import Given, Job, Learned, Results
from softreach.studio.jobs.reach import draw_axes
from softreach.studio.reach import Reach, stages
from softreach.studio.scene.camera import is_behind
from softreach.studio.serve import theme
from softreach.studio.state import solvable_rod
from softreach.support.errors import InvalidInput

_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_DRAGGED = 1 << 13  # points while the tip is dragged: the page draws all of them at each step
_LEVEL = 16


def _draw_arm(given: Given) -> Mapping[str, Any]:
    state, scene, held = given.state, given.scene, given.found.held
    if not state.appearance.arm:
        scene.remove("/arm")
        return {}
    try:
        rod = solvable_rod(state.design)
    except InvalidInput:  # the status says so
        scene.remove("/arm")
        return {"tip": None, "posture": TipStatus.NO_EQUILIBRIUM}
    if held is not None and held[0] == state.design and held[1].activation == state.activation:
        rod = held[1].tip_map  # in its posture
    tip = scene.draw_arm(state.design, state.activation, rod=rod)
    known = {"tip": tip if np.isfinite(tip).all() else None, "pointing": scene.pointing}
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


def _wait(given: Given) -> Results:
    time.sleep(_PAUSE)
    while given.camera.keep_width():
        given.check()
        time.sleep(_PAUSE)
    yield Learned()


def _look(given: Given) -> None:
    state, found, scene, look = given.state, given.found, given.scene, given.state.appearance
    camera = given.camera.actual()
    position = np.array(camera.position)
    ahead = (camera.look_at - position) * (1.0, 1.0, 0.0)
    base = np.array(state.design.base.position) / state.design.length
    scene.look(ahead if look.half else None, base, _DRAGGED if found.is_dragged else None)
    scene.axes.turn(position, given.camera.focal)
    tip = found.tip if look.handle and look.arm else None
    hides = tip is not None and is_behind(tip, position, *scene.spine)
    scene.see_through_arm(found.sample is not None or hides)


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

SET_THEME = Job(
    "theme",
    ("appearance.dark",),
    draw=lambda given: theme(given.client.gui, dark=given.state.appearance.dark),
)
"""Turns the light of the page on or off."""


def _compute_free(given: Given) -> Results:
    free = None if given.state.design.loads is None else given.state.unloaded
    small = replace(given.quality, fine_level=given.quality.coarse_level)
    for reach in _reaches(free, given.found.free, given._replace(quality=small)):
        yield Learned({"free": reach})


def _draw_free(given: Given) -> None:
    given.scene.draw_beside("/free", given.found.free, given.state.appearance.slice)
    draw_axes(given)


DRAW_FREE = Job(
    "free",
    ("unloaded", "appearance.slice"),
    _compute_free,
    _draw_free,
    wanted=lambda state, _: state.design.loads is not None,
    makes=("free",),
    draws=("/free",),
)
"""The reach of a loaded arm without its loads, faint behind the loaded one."""


def _compute_reference(given: Given) -> Results:
    for reach in _reaches(given.state.reference, given.found.reference, given):
        yield Learned({"reference": reach})


DRAW_REFERENCE = Job(
    "reference",
    ("reference", "appearance.slice"),
    _compute_reference,
    lambda g: g.scene.draw_beside("/reference", g.found.reference, g.state.appearance.slice),
    wanted=lambda state, _: state.reference is not None,
    makes=("reference",),
    draws=("/reference",),
)
"""The boundary of the design that is kept."""


def _reaches(
    design: Manipulator | None, known: Reach | None, given: Given
) -> Iterator[Reach | None]:
    """The reach of another design, unless it is known; that of the present one, if they agree."""
    if design is None:
        yield None
    elif known is not None and known.fine and known.arm == design:
        return
    elif (now := given.found.complete_reach(design)) is not None:
        yield now
    else:
        level = min(_LEVEL, given.quality.coarse_level)
        yield from stages(design, level, given.quality, given.check)
