"""Jobs of requirements: the design against its needs, live."""

from __future__ import annotations

import time

import numpy as np

from softreach.requirements import Check, check
from softreach.requirements.checks import quick_check
from softreach.studio.needs import requirements_of
from softreach.studio.scene.needs import draw_needs
from softreach.studio.session import Job, Session
from softreach.studio.work import StaleCheck
from softreach.support.errors import SoftreachError, no_warnings

_ACCURACY = 0.03  # of shares that are covered, and of distances between stations
_PAUSE = 0.4  # [s] without a change, before needs that are missed are looked at again
_LOOK = 0.05  # [s]
_POSES = ("reach", "cover", "stay_inside", "avoid")
"""Kinds of findings that other poses may change."""


class CheckNeeds(Job):
    """The design against its needs, by poses that are found in some milliseconds."""

    depends_on = "design", "needs"
    only_with = "needs"

    def run(self, check: StaleCheck) -> None:
        check()
        session, state = self.session, self.session.state
        made, refusal = None, ""
        if state.needs:
            try:
                with no_warnings():
                    made = quick_check(state.design, requirements_of(state.needs), _ACCURACY)
            except SoftreachError as error:
                refusal = str(error)
        check()
        session.check, session.check_refusal = made, refusal
        _draw(session)
        session.follow(ConfirmNeeds)


class ConfirmNeeds(Job):
    """Looks for every pose where quick ones miss something, once the design stays as it is."""

    def run(self, check: StaleCheck) -> None:
        session, quick = self.session, self.session.check
        if quick is None or all(f.met or f.kind not in _POSES for f in quick.findings):
            return
        begun = time.monotonic()
        while time.monotonic() - begun < _PAUSE:
            check()
            time.sleep(_LOOK)
        made = _checked(quick, check)
        check()
        if session.check is quick:  # else another design was judged meanwhile
            session.check = made
            _draw(session)


def _checked(quick: Check, wanted: StaleCheck) -> Check:
    with no_warnings():
        return check(quick.arm, quick.requirements, accuracy=_ACCURACY, progress=lambda _: wanted())


def _draw(session: Session) -> None:
    around = np.array(session.scene.axes.corners)
    with session.drawing, session.client.atomic():
        draw_needs(session.client.scene, session.check, around)
    session.show()
