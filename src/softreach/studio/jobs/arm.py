"""Draws the arm, and the trail of its tip."""

from __future__ import annotations

import numpy as np

from softreach.rod.tip_map import TipStatus
from softreach.studio.jobs.job import Job
from softreach.studio.jobs.reference import draw_reference_arm
from softreach.studio.rod import solvable_rod
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck
from softreach.support.errors import InvalidInput

__all__ = ["DrawArm"]

_LONGEST_TRAIL = 2000


class DrawArm(Job):
    """The arm in its activation, where its tip has been, and the reference's arm beside it."""

    _trail_of: object = None
    """The design whose tip left the trail."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The design, its activation, and whether arm and trail are shown."""
        return state.design, state.activation, state.appearance.arm, state.appearance.trail

    def run(self, check: StaleCheck) -> None:
        """Draw them, and note where the tip is."""
        check()
        session, state = self.session, self.session.state
        if not state.appearance.arm:
            session.scene.remove("/arm")
        else:
            self._draw(state)
        self._draw_trail()
        draw_reference_arm(session)
        session.look_again()
        session.show()

    def _draw(self, state: StudioState) -> None:
        session = self.session
        session.posture = None
        try:
            rod = solvable_rod(state.design)
        except InvalidInput:  # `ComputeReach` says so
            session.tip, session.posture = None, TipStatus.NO_EQUILIBRIUM
            session.scene.remove("/arm")
            return
        with session.client.atomic():
            tip = session.scene.draw_arm(state.design, state.activation)
        session.tip = tip if np.isfinite(tip).all() else None
        if session.tip is not None:
            session.trail = [*session.trail[-_LONGEST_TRAIL:], session.tip]
        if rod.supports_unstable:
            lost = session.tip is None
            status = TipStatus.NO_EQUILIBRIUM if lost else rod.status([state.activation])[0]
            session.posture = TipStatus(status)

    def _draw_trail(self) -> None:
        session, state = self.session, self.session.state
        # Another arm's tip was never there.
        if self._trail_of != state.design or not state.appearance.trail:
            self._trail_of, session.trail = state.design, session.trail[-1:]
        session.scene.draw_trail(np.array(session.trail))
