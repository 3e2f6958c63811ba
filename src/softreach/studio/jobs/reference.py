"""Computes and draws the design that is kept for comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.studio.jobs.job import Job
from softreach.studio.reach import Reach, beside
from softreach.studio.stages import stages
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

if TYPE_CHECKING:
    from softreach.studio.session import Session

__all__ = ["DrawReference", "draw_reference_arm"]

_LEVEL = 16


class DrawReference(Job):
    """The reach of the reference, around this design's or beside it."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The reference, where it stands, and how points look."""
        look = state.appearance
        drawn = look.level, look.color, look.point_size, look.slice
        return state.reference, state.side_by_side, drawn

    def run(self, check: StaleCheck) -> None:
        """Compute what is not known of it, and draw it."""
        session, state = self.session, self.session.state
        reference = state.reference
        if reference is None:
            session.reference = None
            session.scene.remove("/reference")
        elif session.reference is None or session.reference.arm != reference:
            session.reference = self._reach_of(reference, check)
        if session.reference is not None:
            shift = beside(session.reference) if session.state.side_by_side else np.zeros(3)
            with session.drawing, session.client.atomic():
                session.scene.draw_reference(session.reference, state.appearance, shift)
            draw_reference_arm(session)
        session.show()

    def _reach_of(self, reference: Manipulator, check: StaleCheck) -> Reach:
        """What is known already, if it is fine."""
        known = self.session.reach
        if known is not None and known.fine and known.arm == reference:
            return known
        *_, fine = stages(reference, _LEVEL, self.session.quality, check)
        return fine


def draw_reference_arm(session: Session) -> None:
    """The arm beside this one pulls as this one does."""
    with session.drawing:
        state, reference = session.state, session.reference
        if reference is not None and state.side_by_side and state.appearance.arm:
            same = state.replace(design=reference.arm).activation
            session.scene.draw_reference_arm(reference.arm, same, beside(reference))
        else:
            session.scene.remove("/reference/arm")
