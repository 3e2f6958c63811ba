"""What acts on the arm: gravity, a payload, a force on the tip."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.arm.file import in_file_terms
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.manipulator import Manipulator
from softreach.arm.weight import GRAVITY
from softreach.studio.captions import tip_text
from softreach.studio.fields import Line, NumberField, VectorField, bind
from softreach.studio.rod import rod_of
from softreach.studio.state import Vector, vector
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session


# Gravity, payload and tip force of a design, in the units that a person types.


GRAVITIES: Mapping[str, Vector] = {
    "none": (0.0, 0.0, 0.0),
    "base upright": (0.0, 0.0, -GRAVITY),
    "hanging": (0.0, 0.0, GRAVITY),
    "sideways": (GRAVITY, 0.0, 0.0),
}
"""Gravity [m/s²] as the base sees it, whose tangent is +z."""

_GRAM, _MILLIMETER = 1e-3, 1e-3
_NONE = Loads(gravity=GRAVITIES["none"])
_MOST = 1e6  # of any unit that is typed: far above what an arm bears, far below an overflow
_SYMBOLS = {"young_modulus": "Young's modulus E", "density": "the density ρ"}


class TypedLoads(NamedTuple):
    """What the fields hold."""

    gravity: Vector = GRAVITIES["none"]
    """[m/s²]."""
    payload: float = 0.0
    """[g]."""
    payload_arm: Vector = (0.0, 0.0, 0.0)
    """[mm]."""
    tip_force: Vector = (0.0, 0.0, 0.0)
    """[N]."""


_FIELDS = {
    "gravity": ("gravity", "m/s²", 1.0),
    "payload": ("payload", "g", _GRAM),
    "payload_arm": ("lever arm", "mm", _MILLIMETER),
    "tip_force": ("tip force", "N", 1.0),
}


def typed_loads(arm: Manipulator) -> TypedLoads:
    """What a design has of the loads that can be typed."""
    loads = arm.loads or _NONE
    return TypedLoads(
        loads.gravity,
        _rounded(loads.payload / _GRAM),
        vector(_rounded(value / _MILLIMETER) for value in loads.payload_arm),
        loads.tip_force,
    )


def with_loads(arm: Manipulator, typed: TypedLoads) -> Manipulator:
    """The design under typed loads; other loads stay. Without any it is an arm without loads.

    Raises:
        InvalidInput: A number that no load can have.
        InvalidDesign: Matter that lacks what loads need, and where to give it.
    """
    _check(typed)
    known = typed_loads(arm)  # what a field only shows rounded is left as it is
    changes = {
        name: _in_si(name, getattr(typed, name))
        for name in TypedLoads._fields
        if getattr(typed, name) != getattr(known, name)
    }
    loads = (arm.loads or _NONE).replace(**changes)
    try:
        return arm.replace(loads=None if loads == _NONE else loads)
    except InvalidDesign as error:
        raise _in_words(error) from None


def gravity_name(gravity: Vector) -> str:
    """What the list of directions calls a gravity; "" for any other."""
    return next((name for name, one in GRAVITIES.items() if one == gravity), "")


def other_loads(arm: Manipulator) -> list[str]:
    """Loads of a design that have no field, in words."""
    loads = arm.loads or _NONE
    names = ("tip_moment", "follower_force", "follower_moment", "force_per_length")
    found = [name.replace("_", " ") for name in names if any(getattr(loads, name))]
    points: tuple[PointLoad, ...] = loads.point_loads
    return found + ([f"point loads ({len(points)})"] if points else [])


def _check(typed: TypedLoads) -> None:
    for name, value in typed._asdict().items():
        label, unit, _ = _FIELDS[name]
        low = 0.0 if name == "payload" else -_MOST
        numbers = np.atleast_1d(np.asarray(value, float))
        good = np.isfinite(numbers) & (numbers >= low) & (numbers <= _MOST)
        if not good.all():
            wrong = f"{numbers[np.flatnonzero(~good)[0]]:g} {unit}"
            raise InvalidInput(label, wrong, f"{low:,.0f} to {_MOST:,.0f} {unit}")


def _in_si(name: str, value: Vector | float) -> Vector | float:
    scale = _FIELDS[name][2]
    return value * scale if isinstance(value, float | int) else vector(scale * v for v in value)


def _rounded(value: float) -> float:
    return float(f"{value:.10g}")


def _in_words(error: InvalidDesign) -> InvalidDesign:
    """What an arm lacks that loads need, in one line."""
    lacking: dict[str, list[str]] = {}
    for fault in error.faults:
        owner, _, field = fault.path.rpartition(".")
        if field not in _SYMBOLS:
            return in_file_terms(error, "")
        lacking.setdefault(_owner(owner), []).append(_SYMBOLS[field])
    needed = "; ".join(f"{' and '.join(what)} of {owner}" for owner, what in lacking.items())
    line = f"need {needed}: choose a material or type the numbers on the tab Parts"
    return InvalidDesign([Fault("loads", None, line)])


def _owner(path: str) -> str:
    """A part by the name that the list of parts has for it."""
    return path.removesuffix(".material").replace("rings[", "ring ").replace("]", "")


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
