"""Jobs around the scene: the light of the page, the state that is kept."""

from __future__ import annotations

import time
from dataclasses import fields

from softreach.studio.serve.server import theme
from softreach.studio.session import Job, Session
from softreach.studio.state import StudioState
from softreach.studio.work import StaleCheck

_REST = 0.5  # [s] without changes


class KeepState(Job):
    """Writes the state, once it rests for a moment, to where the next tab or server finds it."""

    depends_on = tuple(field.name for field in fields(StudioState))

    @classmethod
    def has_use(cls, session: Session) -> bool:
        return session.work is not None

    def run(self, check: StaleCheck) -> None:
        if not self.session.is_touched:
            return
        for _ in range(10):
            check()
            time.sleep(_REST / 10)
        check()
        self.session.keep()


class SetTheme(Job):
    """Turns the light of the page on or off."""

    depends_on = ("appearance.dark",)
    _dark = False

    def run(self, check: StaleCheck) -> None:
        check()
        dark = self.session.state.appearance.dark
        if dark != self._dark:
            self._dark = dark
            theme(self.session.client.gui, dark=dark)
