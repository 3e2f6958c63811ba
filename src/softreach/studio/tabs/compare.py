"""Comparison of snapshots of the work: in a table, and drawn around or beside the design."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from softreach.studio.comparison import Candidate, compared, comparison_html
from softreach.studio.fields import attempt, bind_button
from softreach.studio.reach import beside
from softreach.studio.snapshots import REFERENCE, Snapshot, numbers_of
from softreach.studio.state import StudioState
from softreach.studio.widgets import Line
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HINT = "Keep designs as snapshots to see them side by side here."
_NONE = "none yet"
_NOW = "now"
"""Name of the row of the design in the fields."""
_UNDRAWN, _AROUND, _BESIDE = "not drawn", "in gray around this design", "beside this design"


class ComparePanel:
    """Takes, restores and deletes snapshots; the table compares them with the first."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session, self._lock = session, threading.RLock()
        self._known: object = None
        with tab:
            self._table = Line(gui, _HINT)
            take = gui.add_button("Take snapshot", hint="keep design, activation and target")
            self._of_chosen = gui.add_folder("snapshots", visible=False)
            with self._of_chosen:
                self._choice: Any = gui.add_dropdown(
                    "snapshot", (_NONE,), hint="the one to draw, restore or delete"
                )
                self._drawn: Any = gui.add_dropdown(
                    "draw",
                    (_UNDRAWN, _AROUND, _BESIDE),
                    hint="what it reaches, and beside this design its arm too, pulled as this is",
                )
                restore = gui.add_button("Restore", hint="go back to it; the view stays")
                delete = gui.add_button("Delete", color="gray", hint="forget it, for good")
        self._choice.on_update(lambda _: self._follow_drawn(session.state))
        self._drawn.on_update(self._draw)
        bind_button(take, session, self._take)
        bind_button(restore, session, self._restore)
        bind_button(delete, session, self._delete)

    def show(self, session: Session) -> None:
        """Bring menu and table in line with the snapshots and the design."""
        with self._lock:
            self._measure(session)
            self._follow_drawn(session.state)
            kept, design = self._kept(), session.state.design
            numbers = numbers_of(session.reach, session.state)
            if self._known == (kept, design, numbers):
                return
            self._known = (kept, design, numbers)
            names = tuple(each.name for each in kept) or (_NONE,)
            if tuple(self._choice.options) != names:
                self._choice.options = names
            self._of_chosen.visible = bool(kept)
            if not kept:
                self._table.say(_HINT)
                return
            rows = [Candidate(each.name, each.state.design, each.numbers) for each in kept]
            comparison = compared([*rows, Candidate(_NOW, design, numbers)])
            self._table.show(comparison_html(comparison))

    def _kept(self) -> tuple[Snapshot, ...]:
        """The snapshots, and what an older state draws without one."""
        session, kept = self._session, self._session.snapshots.all
        drawn = session.state.reference
        if drawn is None or session.snapshots.name_of(drawn) != REFERENCE:
            return kept
        state = session.state.replace(design=drawn, reference=None, side_by_side=False)
        numbers = numbers_of(session.reference, state)
        return *kept, Snapshot(name=REFERENCE, state=state, taken=0.0, numbers=numbers)

    def _measure(self, session: Session) -> None:
        for each in session.snapshots.all:
            if each.numbers is None and (numbers := numbers_of(session.reach, each.state)):
                session.snapshots.measure(each.name, numbers)

    def _follow_drawn(self, state: StudioState) -> None:
        chosen, drawn = self._named(), _UNDRAWN
        if chosen is not None and chosen.state.design == state.reference:
            drawn = _BESIDE if state.side_by_side else _AROUND
        if self._drawn.value != drawn:
            self._drawn.value = drawn

    def _draw(self, event: Any) -> None:
        if event.client_id is not None:
            attempt(self._session, lambda: self._become_drawn(self._drawn.value))

    def _become_drawn(self, how: str) -> None:
        design, beside_now = self._chosen().state.design, how == _BESIDE
        reference = None if how == _UNDRAWN else design
        if beside_now != self._session.state.side_by_side:
            self._step(beside_now)
        self._session.update(
            lambda state: state.replace(reference=reference, side_by_side=beside_now)
        )

    def _step(self, back: bool) -> None:
        session = self._session
        if session.reach is not None:
            shift = beside(session.reach)
            (session.camera.step_back if back else session.camera.step_forth)(shift)

    def _delete(self) -> None:
        snapshot = self._chosen()
        if snapshot.state.design == self._session.state.reference:
            self._become_drawn(_UNDRAWN)
        self._session.snapshots.remove(snapshot.name)

    def _take(self) -> None:
        session = self._session
        state = session.state_now()
        name = session.snapshots.free_name()
        numbers = numbers_of(session.reach, state)
        snapshot = Snapshot(name=name, state=state, taken=time.time(), numbers=numbers)
        session.snapshots.add(snapshot)
        session.show()
        self._choice.value = name

    def _restore(self) -> None:
        state = self._chosen().state
        self._session.update(
            lambda now: state.replace(
                appearance=now.appearance,
                camera=now.camera,
                reference=now.reference,
                side_by_side=now.side_by_side,
            )
        )

    def _chosen(self) -> Snapshot:
        snapshot = self._named()
        if snapshot is None:
            raise InvalidInput("snapshot", "none", "chosen", "take one first")
        return snapshot

    def _named(self) -> Snapshot | None:
        return next((each for each in self._kept() if each.name == self._choice.value), None)
