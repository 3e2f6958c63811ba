"""Job of requirements: the design against its needs, live."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from softreach.requirements import check
from softreach.requirements.checks import quick_check
from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.needs import requirements_of
from softreach.studio.scene.needs import draw_needs
from softreach.studio.state import StudioState
from softreach.support.errors import SoftreachError, no_warnings

_ACCURACY = 0.03  # of shares that are covered, and of distances between stations
_PAUSE = 0.4  # [s] without a change, before needs that are missed are looked at again
_LOOK = 0.05  # [s]
_POSES = ("reach", "cover", "stay_inside", "avoid")
"""Kinds of findings that other poses may change."""


def _check(state: StudioState, found: Found, tools: Tools) -> Results:
    """By poses that are found in some milliseconds; by every pose where these miss something."""
    del found
    if not state.needs:
        yield Learned({"check": None, "check_refusal": ""})
        return
    try:
        with no_warnings():
            quick = quick_check(state.design, requirements_of(state.needs), _ACCURACY)
    except SoftreachError as error:
        yield Learned({"check": None, "check_refusal": str(error)})
        return
    yield Learned({"check": quick, "check_refusal": ""})
    if all(finding.met or finding.kind not in _POSES for finding in quick.findings):
        return
    begun = time.monotonic()
    while time.monotonic() - begun < _PAUSE:
        tools.check()
        time.sleep(_LOOK)
    with no_warnings():
        made = check(
            quick.arm, quick.requirements, accuracy=_ACCURACY, progress=lambda _: tools.check()
        )
    yield Learned({"check": made})


def _draw(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    del state
    draw_needs(page.scene, found.check)
    return {}


CHECK_NEEDS = Job(
    "needs",
    ("design", "needs"),
    _check,
    _draw,
    wanted=lambda state: state.needs,
    makes=("check",),
    draws=("/needs",),
)
"""The design against its needs."""
