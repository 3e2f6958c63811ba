"""What acts on the arm: gravity, a payload, a force on the tip."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.studio.loading import (
    GRAVITIES,
    TypedLoads,
    gravity_name,
    other_loads,
    typed_loads,
    with_loads,
)
from softreach.studio.panels.binding import bind
from softreach.studio.panels.line import Line
from softreach.studio.panels.status import tip_text
from softreach.studio.panels.typed import NumberField, VectorField
from softreach.studio.state import rod_of, vector
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["LoadsPanel"]

_TYPED = "as typed"
_ZERO = (0.0, 0.0, 0.0)
_ABOUT = {
    "gravity": "g: acceleration of gravity as x, y, z in the frame of the base, whose tangent is z",
    "payload": "m: mass at the tip; it weighs what gravity makes of it",
    "arm": "From the tip to the center of the payload's mass, as x, y, z in the tip's directors",
    "force": "F: force on the tip as x, y, z in the frame of the base",
}


class LoadsPanel:
    """All fields together are the loads; a refused value stays in its field beside the reason."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._session, self._lock = session, threading.RLock()
        self._shown: Manipulator | None = None
        with tab:
            self._direction = gui.add_dropdown(
                "gravity", (*GRAVITIES, _TYPED), hint="Which way the base of the arm points"
            )
            self._gravity = VectorField(gui, "g [m/s²]", _ZERO, _ABOUT["gravity"])
            self._payload = NumberField(gui, "payload [g]", 0.0, _ABOUT["payload"])
            self._arm = VectorField(gui, "lever arm [mm]", _ZERO, _ABOUT["arm"])
            self._force = VectorField(gui, "tip force [N]", _ZERO, _ABOUT["force"])
            self._message = Line(gui)
            clear = gui.add_button("Take all loads off", hint="Gravity, payload and all forces")
            clear.on_click(lambda _: self._clear())
            self._free = gui.add_checkbox(
                "show the cloud without loads", True, hint="Faint, around that of the loaded arm"
            )
            self._posture, self._others = Line(gui), Line(gui)
        self._direction.on_update(
            lambda event: self._directed() if event.client_id is not None else None
        )
        for field in (self._gravity, self._payload, self._arm, self._force):
            field.on_update(lambda _, field=field: self._typed(field))
        bind(self._free, session, lambda s, on: s.showing(free=on))

    def show(self, session: Session) -> None:
        """Show the loads of the design, and whether the arm rests under them."""
        design = session.state.design
        with self._lock:
            if design != self._shown:
                self._shown = design
                self._fill(typed_loads(design))
                self._message.warn("")
                others = ", ".join(other_loads(design))
                self._others.say(*([f"From the design file act too: {others}."] if others else []))
        self._free.value = session.state.appearance.free
        self._posture.say(*(tip_text(session) if design.loads is not None else ()))

    def _fill(self, loads: TypedLoads) -> None:
        """Put values into the fields; those that are there already may be being typed."""
        self._direction.value = gravity_name(loads.gravity) or _TYPED
        if self._payload.value != loads.payload:
            self._payload.value = loads.payload
        vectors = (
            (self._gravity, loads.gravity),
            (self._arm, loads.payload_arm),
            (self._force, loads.tip_force),
        )
        for widget, value in vectors:
            if vector(widget.value) != value:
                widget.value = value

    def _directed(self) -> None:
        """A direction was chosen from the list."""
        if self._direction.value in GRAVITIES:
            self._gravity.value = GRAVITIES[self._direction.value]
            self._apply()

    def _typed(self, field: NumberField | VectorField) -> None:
        self._direction.value = gravity_name(vector(self._gravity.value)) or _TYPED
        self._apply(field)

    def _clear(self) -> None:
        self._fill(TypedLoads())
        self._change(lambda arm: arm.replace(loads=None))

    def _apply(self, field: NumberField | VectorField | None = None) -> None:
        typed = TypedLoads(
            vector(self._gravity.value),
            float(self._payload.value),
            vector(self._arm.value),
            vector(self._force.value),
        )
        self._change(lambda arm: with_loads(arm, typed), field)

    def _change(
        self,
        change: Callable[[Manipulator], Manipulator],
        field: NumberField | VectorField | None = None,
    ) -> None:
        """Change the design, or say below the field why that cannot be."""
        with self._lock:
            known = self._session.state.design
            try:
                made = rod_of(change(known)).arm
            except SoftreachError as error:
                (field or self._message).warn(str(error))
                return
            self._message.warn("")
            if made == known:
                return  # a page reports fields that were only drawn anew
        self._session.update(lambda state: state.replace(design=made))
