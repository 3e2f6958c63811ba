"""Jobs of other designs in the scene: the arm without its loads, and the one that is kept."""

from __future__ import annotations

from dataclasses import replace

from softreach.arm.manipulator import Manipulator
from softreach.studio.jobs.reach import draw_axes
from softreach.studio.reach import Reach, stages
from softreach.studio.session import Job
from softreach.studio.work import StaleCheck

_LEVEL = 16


class DrawFree(Job):
    """The reach of a loaded arm without its loads, faint behind the loaded one."""

    depends_on = "unloaded", "appearance.slice"
    only_with = "design.loads"

    def run(self, check: StaleCheck) -> None:
        session, state = self.session, self.session.state
        free, known = state.unloaded, session.reach
        if state.design.loads is None:
            session.free = None
        elif session.free is None or session.free.arm != free or not session.free.fine:
            if known is not None and known.fine and known.arm == free:
                session.free = known  # the loads have just been put on
            else:
                quality = session.quality
                small = replace(quality, fine_level=quality.coarse_level)
                for reach in stages(free, min(_LEVEL, quality.coarse_level), small, check):
                    check()
                    session.free = reach
                    self._draw()
        self._draw()

    def _draw(self) -> None:
        session = self.session
        with session.drawing, session.client.atomic():
            session.scene.draw_free(session.free, session.state.appearance.slice)
            draw_axes(session)
        session.show()


class DrawReference(Job):
    """The boundary of the design that is kept."""

    depends_on = "reference", "appearance.slice"
    only_with = "reference"

    def run(self, check: StaleCheck) -> None:
        session, state = self.session, self.session.state
        reference = state.reference
        if reference is None:
            session.reference = None
            with session.drawing:
                session.scene.remove("/reference")
        elif session.reference is None or session.reference.arm != reference:
            session.reference = self._reach_of(reference, check)
        if session.reference is not None:
            with session.drawing, session.client.atomic():
                session.scene.draw_reference(session.reference, state.appearance.slice)
        session.show()

    def _reach_of(self, reference: Manipulator, check: StaleCheck) -> Reach:
        known = self.session.reach
        if known is not None and known.fine and known.arm == reference:
            return known
        *_, fine = stages(reference, _LEVEL, self.session.quality, check)
        return fine
