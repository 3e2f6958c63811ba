"""Draws the map of the atlas that the studio was opened on."""

from __future__ import annotations

from softreach.studio.jobs.job import Job
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

__all__ = ["DrawMap"]


class DrawMap(Job):
    """A metric over two parameters, and where the design is on it."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """What the map shows, and the design."""
        return state.design, state.appearance.map

    def run(self, check: StaleCheck) -> None:
        """Draw it, if there is an atlas."""
        check()
        if self.session.board is not None:
            self.session.board.draw(self.session.state.appearance.map, self.session.state.design)
            self.session.show()
