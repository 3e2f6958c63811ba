"""The body of the design: sliders, numbers that have none, and named designs to start from."""

from __future__ import annotations

import threading
from functools import cache
from typing import TYPE_CHECKING, Any

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed, find_parameter
from softreach.studio.fields import Attribute, Fields
from softreach.studio.shown_parameters import (
    ShownParameter,
    body_numbers,
    refusal,
    slider_ends,
    slider_parameters,
)
from softreach.studio.slopes import NO_BAR, slope_bars
from softreach.studio.state import StudioState, rod_of
from softreach.studio.tabs.parts import typed_number
from softreach.studio.widgets import Line, SliderField
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_ABOUT_BARS = "Bars: change of V over 1 % of each slider's range."
_OWN = "this design"
_ABOUT_START = "Replaces the whole design by an arm of the literature or an example; can be undone"


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
        self._typed: list[str] = []
        """Names of the numbers of the body that have fields."""
        self._revision, self._refused = -1, False
        self._sliders, self._numbers = Fields(session), Fields(session)
        self._others = Fields(session, dragged=False)
        with tab:
            self._folder = gui.add_folder("design")
            with self._folder:
                self._about_bars = Line(gui)
            self._body = gui.add_folder("body")
            names = {"": _OWN} | {name: name for name in designs.__all__}
            self._others.dropdown("start from", names, Attribute(_name, _named), _ABOUT_START)

    def show(self, session: Session) -> None:
        """Make the sliders anew for a design that they did not make."""
        self._others.show(session)
        with self._lock:
            self._follow_body(session.state.design)
            if session.revision != self._revision:
                self._revision = session.revision
                if session.state.design != self._made or self._refused:
                    self._build(session.state.design)
            if not session.busy and session.state.design != self._ended:
                self._end(session.state.design)
            self._show_slopes(session)

    def _show_slopes(self, session: Session) -> None:
        slopes, design = session.found.slopes, session.state.design
        if slopes is None:
            bars = dict.fromkeys(self._bars, NO_BAR) if rod_of(design).box.dimension > 2 else {}
        else:
            sliders = {row.name: (row, field.ends[1] - field.ends[0]) for row, field in self._rows}
            bars = slope_bars(slopes, sliders, old=slopes.arm != design)
        self._about_bars.say(*([_ABOUT_BARS] if bars else []))
        for name, line in self._bars.items():
            line.show(bars.get(name, ""))

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

    def _follow_body(self, arm: Manipulator) -> None:
        numbers = body_numbers(arm)
        if [number.name for number in numbers] == self._typed:
            self._numbers.show(self._session)
            return
        self._typed = [number.name for number in numbers]
        self._numbers.remove()
        self._numbers = Fields(self._session, words=self._words, dragged=False)
        with self._body:
            for number in numbers:
                self._numbers.number(number.label, typed_number(number), number.hint)

    def _slider(self, parameter: ShownParameter) -> SliderField:
        at = Attribute(lambda _: parameter.shown, lambda state, _: self._changed(state))
        field = self._sliders.slider(
            parameter.label, parameter.limits, parameter.step, at, parameter.hint
        )
        assert self._base is not None
        if not find_parameter(self._base, parameter.name).whole:  # what jumps has no slope
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
        rows = [parameter for parameter, _ in self._rows]
        return refusal(error, rows, self._session.state.design)


@cache
def _designs() -> dict[str, Manipulator]:
    return {name: getattr(designs, name)() for name in designs.__all__}


def _name(state: StudioState) -> str:
    return next((name for name, arm in _designs().items() if arm == state.design), "")


def _named(state: StudioState, name: str) -> StudioState:
    return state.replace(design=_designs()[name]) if name else state
