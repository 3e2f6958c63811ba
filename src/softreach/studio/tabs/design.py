"""Sliders of the design, and a reference to compare it with."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed
from softreach.studio.captions import reach_text
from softreach.studio.fields import Attribute, Fields, attribute, bind_button
from softreach.studio.markup import Part
from softreach.studio.reach import beside
from softreach.studio.shown_parameters import (
    ShownParameter,
    refusal,
    slider_ends,
    slider_parameters,
)
from softreach.studio.slopes import NO_BAR, slope_bars
from softreach.studio.state import StudioState, rod_of
from softreach.studio.widgets import Line, SliderField
from softreach.support.errors import InvalidDesign, SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_ABOUT_BARS = "Bars: change of V over 1 % of each slider's range."
_ABOUT_KEEP = "Keeps what the design reaches now, in gray, to compare others with"
_ABOUT_BESIDE = "Stands the reference beside the design, pulled as the design is"


class DesignPanel:
    """All sliders of a design together; a change may be valid only together with others."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._gui, self._session, self._lock = gui, session, threading.RLock()
        self._rows: list[tuple[ShownParameter, SliderField]] = []
        self._bars: dict[str, Line] = {}
        """Under each slider, by the name of its parameter."""
        self._base: Manipulator | None = None
        """The design that the sliders were made for."""
        self._made: Manipulator | None = None
        """The design that they made of it last."""
        self._ended: Manipulator | None = None
        """The design at whose limits they end."""
        self._revision, self._refused = -1, False
        self._sliders, self._others = Fields(session), Fields(session)
        with tab:
            self._folder = gui.add_folder("design")
            with self._folder:
                self._about_bars = Line(gui)
            with gui.add_folder("compare"):
                self._reference = Line(gui)
                self._others.button(
                    "Keep this design as reference",
                    lambda state: state.replace(reference=state.design),
                    _ABOUT_KEEP,
                )
                beside_box = self._others.checkbox(
                    "side by side", attribute("side_by_side"), _ABOUT_BESIDE
                )
                clear = gui.add_button("Forget the reference", hint="Takes the reference away")
        bind_button(clear, session, self._forget)

        def stepped(event: Any) -> None:
            if event.client_id is not None and session.state.reference is not None:
                self._step(beside_box.value)

        beside_box.on_update(stepped)

    def show(self, session: Session) -> None:
        """Show the reference; make the sliders anew for a design that they did not make."""
        self._reference.say(*_reference_text(session))
        self._others.show(session)
        with self._lock:
            if session.revision != self._revision:
                self._revision = session.revision
                if session.state.design != self._made or self._refused:
                    self._build(session.state.design)
            if not session.busy and session.state.design != self._ended:
                self._end(session.state.design)
            self._show_slopes(session)

    def _show_slopes(self, session: Session) -> None:
        """Bars of the same scale under the sliders; until they are known, room for them."""
        slopes, design = session.slopes, session.state.design
        if slopes is None:
            bars = dict.fromkeys(self._bars, NO_BAR) if rod_of(design).box.dimension > 2 else {}
        else:
            sliders = {row.name: (row, field.ends[1] - field.ends[0]) for row, field in self._rows}
            bars = slope_bars(slopes, sliders, old=slopes.arm != design)
        self._about_bars.say(*([_ABOUT_BARS] if bars else []))
        for name, line in self._bars.items():
            line.show(bars.get(name, ""))

    def _forget(self) -> None:
        if self._session.state.side_by_side and self._session.state.reference is not None:
            self._step(False)
        self._session.update(lambda s: s.replace(reference=None, side_by_side=False))

    def _step(self, back: bool) -> None:
        """Move the camera so that two clouds side by side fit; or to where it was."""
        session = self._session
        if session.reach is not None:
            shift = beside(session.reach)
            (session.camera.step_back if back else session.camera.step_forth)(shift)

    def _end(self, arm: Manipulator) -> None:
        """End the sliders where the design does, once nobody drags."""
        self._ended, ends = arm, slider_ends(arm)
        for parameter, field in self._rows:
            low, high = ends.get(parameter.name, field.ends)
            if (low, high) != field.ends and low < high:
                field.ends = low, high

    def _build(self, arm: Manipulator) -> None:
        self._sliders.remove()
        for line in self._bars.values():
            line.remove()
        self._bars = {}
        self._base = self._made = arm
        self._ended, self._refused = None, False
        self._sliders = Fields(self._session, words=self._words)
        with self._folder:
            self._rows = [
                (parameter, self._slider(parameter)) for parameter in slider_parameters(arm)
            ]

    def _slider(self, parameter: ShownParameter) -> SliderField:
        at = Attribute(lambda _: parameter.shown, lambda state, _: self._changed(state))
        field = self._sliders.slider(
            parameter.label, parameter.limits, parameter.step, at, parameter.hint
        )
        self._bars[parameter.name] = Line(self._gui)
        return field

    def _changed(self, state: StudioState) -> StudioState:
        """The design of all sliders; a slider may show rounded what stays as it is."""
        with self._lock:
            assert self._base is not None
            values = {
                parameter.name: field.value * parameter.scale
                for parameter, field in self._rows
                if field.value != parameter.shown
            }
            self._refused = True
            new = state.replace(design=changed(self._base, values))
            self._refused, self._made = False, new.design
        return new

    def _words(self, error: SoftreachError) -> str:
        if not isinstance(error, InvalidDesign):
            return str(error)
        rows = [parameter for parameter, _ in self._rows]
        return refusal(error, rows, self._session.state.design)


def _reference_text(session: Session) -> tuple[Part, ...]:
    if session.reference is None:
        return ("No reference is kept.",)
    where = "reference" if session.state.side_by_side else "reference (gray)"
    return (f"{where}: ", *reach_text(session.reference))
