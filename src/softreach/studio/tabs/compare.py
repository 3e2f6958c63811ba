"""Comparison of snapshots of the work, their designs side by side in a table."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from softreach.studio.comparison import (
    Candidate,
    Comparison,
    compared,
    comparison_csv,
    comparison_html,
)
from softreach.studio.fields import bind_button
from softreach.studio.jobs.morph import WriteMorph
from softreach.studio.snapshots import Snapshot, numbers_of
from softreach.studio.widgets import Line
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HINT = "Keep designs as snapshots to see them side by side here."
_NONE = "none yet"
_NOW = "now"
"""Name of the row of the design in the fields."""
_ABOUT_GOAL = "The snapshot in which the movie ends, or the design in the fields"
_ABOUT_MOVIE = (
    "From the chosen snapshot, as seen from here: reach, arm and volume of each design on the way. "
    "Browsers that cannot record MP4 make WebM"
)


class ComparePanel:
    """Takes, restores and deletes snapshots; the table compares them with the first."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session, self._lock = session, threading.RLock()
        self._known: object = None
        self._comparison: Comparison | None = None
        with tab:
            self._table = Line(gui, _HINT)
            self._name = gui.add_text("name", "", hint="of the snapshot; empty for the next number")
            take = gui.add_button("Take snapshot", hint="keep design, activation and target")
            self._choice: Any = gui.add_dropdown(
                "snapshot", (_NONE,), hint="the one to restore or delete"
            )
            restore = gui.add_button("Restore", hint="go back to it; the view stays")
            delete = gui.add_button("Delete", color="gray", hint="forget it, for good")
            save = gui.add_button(
                "Save table (CSV)",
                color="gray",
                hint="with errors and differences, for a spreadsheet",
            )
            self._goal: Any = gui.add_dropdown("movie to", (_NOW,), hint=_ABOUT_GOAL)
            movie = gui.add_button_group("movie", ("GIF", "MP4"), hint=_ABOUT_MOVIE)
            self._frames = Line(gui)
        bind_button(movie, session, lambda: self._write_movie(movie.value))
        bind_button(take, session, self._take)
        bind_button(restore, session, self._restore)
        bind_button(delete, session, lambda: session.snapshots.remove(self._chosen().name))
        bind_button(save, session, self._save)

    def show(self, session: Session) -> None:
        """Bring menu and table in line with the snapshots and the design."""
        with self._lock:
            self._measure(session)
            snapshots, design = session.snapshots.all, session.state.design
            numbers = numbers_of(session.reach, session.state)
            if self._known == (snapshots, design, numbers):
                return
            self._known = (snapshots, design, numbers)
            self._follow_menu(tuple(each.name for each in snapshots))
            if not snapshots:
                self._comparison = None
                self._table.say(_HINT)
                return
            kept = [Candidate(each.name, each.state.design, each.numbers) for each in snapshots]
            self._comparison = compared([*kept, Candidate(_NOW, design, numbers)])
            self._table.show(comparison_html(self._comparison))

    def _measure(self, session: Session) -> None:
        """Note the numbers of snapshots whose design has only now been measured."""
        for each in session.snapshots.all:
            if each.numbers is None and (numbers := numbers_of(session.reach, each.state)):
                session.snapshots.measure(each.name, numbers)

    def _follow_menu(self, names: tuple[str, ...]) -> None:
        if tuple(self._choice.options) != (names or (_NONE,)):
            self._choice.options = names or (_NONE,)
            self._goal.options = (_NOW, *names)

    def _take(self) -> None:
        session = self._session
        state = session.state_now()
        name = self._name.value.strip() or session.snapshots.free_name()
        if name == _NOW:
            raise InvalidInput("snapshot name", name, "another, as the table calls this design so")
        numbers = numbers_of(session.reach, state)
        snapshot = Snapshot(name=name, state=state, taken=time.time(), numbers=numbers)
        session.snapshots.add(snapshot)
        self._name.value = ""
        session.show()
        self._choice.value = name

    def _restore(self) -> None:
        state = self._chosen().state
        self._session.update(
            lambda now: state.replace(appearance=now.appearance, camera=now.camera)
        )

    def _chosen(self) -> Snapshot:
        snapshot = self._session.snapshots.named(self._choice.value)
        if snapshot is None:
            raise InvalidInput("snapshot", "none", "chosen", "take one first")
        return snapshot

    def _write_movie(self, kind: str) -> None:
        session, goal = self._session, self._session.snapshots.named(self._goal.value)
        job = session.job(WriteMorph)
        job.between = self._chosen().state, session.state if goal is None else goal.state
        job.format, job.frames = kind, self._frames
        job.ask()

    def _save(self) -> None:
        if self._comparison is None:
            raise InvalidInput("table", "empty", "of one snapshot or more", "take one first")
        content = comparison_csv(self._comparison).encode("utf-8-sig")  # as spreadsheets expect
        self._session.client.send_file_download("designs.csv", content, save_immediately=True)
