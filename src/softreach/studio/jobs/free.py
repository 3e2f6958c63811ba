"""Computes and draws what the arm would reach without its loads."""

from __future__ import annotations

from dataclasses import replace

from softreach.arm.manipulator import Manipulator
from softreach.studio.jobs.job import Job
from softreach.studio.jobs.reach import draw_axes
from softreach.studio.reach import Reach
from softreach.studio.stages import stages
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

__all__ = ["DrawFree"]

_LEVEL = 16


class DrawFree(Job):
    """The reach of a loaded arm without its loads, faint behind the loaded one."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The design without loads if it has any, and how points look."""
        look, free = state.appearance, _free_arm(state)
        return None if free is None else (free, look.free, look.point_size, look.slice)

    def run(self, check: StaleCheck) -> None:
        """Compute what is not known of it, and draw it."""
        session, free = self.session, _free_arm(self.session.state)
        if free is None:
            session.free = None
        elif session.free is None or session.free.arm != free or not session.free.fine:
            known = session.reach
            if known is not None and known.fine and known.arm == free:
                session.free = known  # the loads have just been put on
            else:
                self._compute(free, check)
        self._draw()

    def _compute(self, free: Manipulator, check: StaleCheck) -> None:
        quality = self.session.quality
        small = replace(quality, fine_level=quality.coarse_level)
        for reach in stages(free, min(_LEVEL, quality.coarse_level), small, check):
            check()
            self.session.free = reach
            self._draw()

    def _draw(self) -> None:
        session = self.session
        known: Reach | None = session.free
        with session.drawing, session.client.atomic():
            session.scene.draw_free(known, session.state.appearance)
            draw_axes(session)
        session.show()


def _free_arm(state: StudioState) -> Manipulator | None:
    """The design without loads; None if it has none."""
    return None if state.design.loads is None else state.design.replace(loads=None)
