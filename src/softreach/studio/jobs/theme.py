"""Light or dark: the page around the scene, and what is behind it."""

from __future__ import annotations

from softreach.studio.jobs.job import Job
from softreach.studio.server import theme
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

__all__ = ["SetTheme"]


class SetTheme(Job):
    """Turns the light on or off."""

    _dark = False

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """Whether the page is dark."""
        return state.appearance.dark

    def run(self, check: StaleCheck) -> None:
        """Tell the page, if it does not look so already."""
        check()
        dark = self.session.state.appearance.dark
        if dark != self._dark:
            self._dark = dark
            theme(self.session.client.gui, dark=dark)
