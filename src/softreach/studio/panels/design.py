"""Sliders for the design; what cannot exist is reported below the slider moved."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed
from softreach.studio.controls import Control, Shown, controls, refusal
from softreach.studio.markup import Part
from softreach.studio.panels.binding import bind, bind_button
from softreach.studio.panels.line import Line
from softreach.studio.panels.status import reach_text
from softreach.studio.panels.typed import SliderField
from softreach.studio.reach import beside
from softreach.studio.state import rod_of
from softreach.support.errors import InvalidDesign

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["DesignPanel"]

_ABOUT_KEEP = "Keeps what the design reaches now, in gray, to compare others with"
_ABOUT_BESIDE = "Stands the reference beside the design, pulled as the design is"


class _Row(NamedTuple):
    control: Control
    field: SliderField
    first: float
    """What the field showed before anyone changed it."""


class DesignPanel:
    """All sliders of a design together; a change may be valid only together with others."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._gui, self._tab, self._session = gui, tab, session
        self._lock = threading.RLock()
        self._rows: list[_Row] = []
        self._base: Manipulator | None = None
        self._made: Manipulator | None = None
        self._complaining, self._revision = False, -1
        with tab:
            self._folder = gui.add_folder("design")
            with gui.add_folder("compare"):
                self._reference = Line(gui)
                keep = gui.add_button("Keep this design as reference", hint=_ABOUT_KEEP)
                self._beside = gui.add_checkbox("side by side", False, hint=_ABOUT_BESIDE)
                clear = gui.add_button("Forget the reference", hint="Takes the reference away")
        bind_button(keep, session, lambda: session.update(lambda s: s.replace(reference=s.design)))
        bind_button(clear, session, self._forget)
        bind(self._beside, session, lambda s, on: s.replace(side_by_side=on))
        self._beside.on_update(self._stepped)

    def show(self, session: Session) -> None:
        """Show the reference; rebuild the sliders for a design that they did not make."""
        self._reference.say(*_reference_text(session))
        with self._lock:
            if session.revision == self._revision:
                return
            self._revision = session.revision
            if session.state.design != self._made or self._complaining:
                self._build(session.state.design)
        self._beside.value = session.state.side_by_side

    def _forget(self) -> None:
        if self._session.state.side_by_side and self._session.state.reference is not None:
            self._step(False)
        self._session.update(lambda s: s.replace(reference=None, side_by_side=False))

    def _stepped(self, event: Any) -> None:
        if event.client_id is not None and self._session.state.reference is not None:
            self._step(self._beside.value)

    def _step(self, back: bool) -> None:
        """Move the eye so that two clouds side by side fit; or to where it was."""
        session = self._session
        if session.reach is not None:
            shift = beside(session.reach)
            (session.camera.step_back if back else session.camera.step_forth)(shift)

    def _build(self, arm: Manipulator) -> None:
        for row in self._rows:
            row.field.remove()
        self._base = self._made = arm
        self._complaining = False
        with self._folder:
            self._rows = [self._row(control) for control in controls(arm)]

    def _row(self, control: Control) -> _Row:
        made = SliderField(
            self._gui, control.label, control.limits, control.step, control.shown, control.hint
        )
        made.on_update(lambda _: self._moved(control.name))
        return _Row(control, made, made.value)

    def _moved(self, name: str) -> None:
        """Read all fields, as older and newer events may come in any order."""
        with self._lock:
            assert self._base is not None
            try:
                made = rod_of(changed(self._base, self._values())).arm
            except InvalidDesign as error:
                self._complain(name, refusal(error, self._shown()))
                return
            known, self._made = self._made, made
            self._complain(name, "")
        if made == known:
            return  # a page reports sliders that were only drawn anew, perhaps late
        self._session.update(lambda s: s.replace(design=made), by_widget=True)

    def _values(self) -> dict[str, float]:
        """What differs from the base, which a field may show rounded."""
        moved = (row for row in self._rows if row.field.value != row.first)
        return {row.control.name: row.field.value * row.control.scale for row in moved}

    def _shown(self) -> dict[str, Shown]:
        controls = (row.control for row in self._rows)
        return {one.name: Shown(one.label, one.scale) for one in controls}

    def _complain(self, name: str, text: str) -> None:
        self._complaining = bool(text)
        for row in self._rows:
            row.field.warn(text if row.control.name == name else "")


def _reference_text(session: Session) -> tuple[Part, ...]:
    if session.reference is None:
        return ("No reference is kept.",)
    where = "reference" if session.state.side_by_side else "reference (gray)"
    return (f"{where}: ", *reach_text(session.reference))
