"""Loads of the arm as they are typed: gravity, a payload, a force on the tip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.arm.base import POINTS
from softreach.arm.design_file import in_file_terms
from softreach.arm.loads import GRAVITIES, Loads
from softreach.arm.manipulator import Manipulator
from softreach.studio.captions import tip_text
from softreach.studio.fields import Attribute, Fields
from softreach.studio.shown_parameters import owner_label
from softreach.studio.state import StudioState, Vector, vector
from softreach.studio.widgets import Line, show_where
from softreach.support.errors import Fault, InvalidDesign, InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_WAYS: Mapping[str, str] = {name: name for name in POINTS} | {
    "up": "up (upright)",
    "down": "down (hanging)",
    "": "as the file says",
}

_NONE = Loads(gravity=GRAVITIES["none"])
_MOST = 1e6  # of any unit that is typed: far above what an arm bears, far below an overflow
_SYMBOLS = {"young_modulus": "Young's modulus E", "density": "the density ρ"}


class TypedLoads(NamedTuple):
    """Values of the fields."""

    gravity: Vector = GRAVITIES["none"]
    """[m/s²]."""
    payload: float = 0.0
    """[g]."""
    payload_arm: Vector = (0.0, 0.0, 0.0)
    """[mm]."""
    tip_force: Vector = (0.0, 0.0, 0.0)
    """[N]."""


class _Quantity(NamedTuple):
    name: str
    symbol: str
    unit: str
    scale: float
    """SI units per unit that is typed."""
    hint: str


_QUANTITIES = {
    "gravity": _Quantity(
        "gravity",
        "g",
        "m/s²",
        1.0,
        "g: acceleration of gravity as x, y, z in the world, whose z points up",
    ),
    "payload": _Quantity(
        "payload", "payload", "g", 1e-3, "m: mass at the tip; it weighs what gravity makes of it"
    ),
    "payload_arm": _Quantity(
        "lever arm",
        "lever arm",
        "mm",
        1e-3,
        "From the tip to the center of the payload's mass, as x, y, z in the tip's directors",
    ),
    "tip_force": _Quantity(
        "tip force", "tip force", "N", 1.0, "F: force on the tip as x, y, z in the world"
    ),
}


class LoadsPanel:
    """Fields of the loads; a refused value stays in its field beside the reason."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._design: Manipulator | None = None
        self._fields = fields = Fields(session, dragged=False)
        gravity = _typed("gravity")
        loaded = session.state.design.loads is not None
        with tab, gui.add_folder("base and loads", expand_by_default=loaded):
            fields.dropdown(
                "base",
                _WAYS,
                Attribute(lambda state: base_name(state.design), _based),
                "Which way the straight arm points from its base, in the world",
            )
            fields.vector(
                "base at [mm]",
                base_field("position"),
                "r(0): where the arm is clamped, as x, y, z in the world",
            )
            fields.number(
                "turn [deg]", base_field("turn"), "ψ: turn of the base about the way the arm points"
            )
            fields.dropdown(
                "gravity",
                {name: name for name in GRAVITIES} | {"": "as typed"},
                Attribute(
                    lambda state: gravity_name(gravity.read(state)),
                    lambda state, name: gravity.write(state, GRAVITIES[name]) if name else state,
                ),
                "Which way things fall in the world; the base says how the arm stands in it",
            )
            for name, kind in _QUANTITIES.items():
                add = fields.number if name == "payload" else fields.vector
                add(f"{kind.symbol} [{kind.unit}]", _typed(name), kind.hint)
            fields.message = Line(gui)
            self._off = fields.button(
                "Take all loads off",
                lambda state: state.replace(design=state.design.replace(loads=None)),
                "Gravity, payload and all forces",
                color="gray",
                visible=False,
            )
            self._posture, self._others = Line(gui), Line(gui)

    def show(self, session: Session) -> None:
        """Show the loads of the design, and whether the arm rests under them."""
        self._fields.show(session)
        design = session.state.design
        show_where(design.loads is not None, self._off)
        if design is not self._design:
            self._design = design
            others = ", ".join(other_loads(design))
            self._others.say(*([f"From the design file act too: {others}."] if others else []))
        self._posture.say(
            *(tip_text(session.found, session.state.design) if design.loads is not None else ())
        )


def _typed(name: str) -> Attribute:
    return Attribute(
        lambda state: getattr(typed_loads(state.design), name),
        lambda state, value: state.replace(
            design=with_loads(state.design, typed_loads(state.design)._replace(**{name: value}))
        ),
    )


def typed_loads(arm: Manipulator) -> TypedLoads:
    """Loads of a design that can be typed, in the units of the fields."""
    loads = arm.loads or _NONE
    return TypedLoads(
        *(_in_unit(getattr(loads, name), kind.scale) for name, kind in _QUANTITIES.items())
    )


def with_loads(arm: Manipulator, typed: TypedLoads) -> Manipulator:
    """The design under typed loads; other loads stay. Without any it is an arm without loads.

    Raises:
        InvalidInput: A number that no load can have.
        InvalidDesign: Matter that lacks what loads need, and where to give it.
    """
    known = typed_loads(arm)._asdict()  # what a field only shows rounded is left as it is
    changes = {
        name: _in_si(name, value) for name, value in typed._asdict().items() if value != known[name]
    }
    loads = (arm.loads or _NONE).replace(**changes)
    try:
        return arm.replace(loads=None if loads == _NONE else loads)
    except InvalidDesign as error:
        raise _in_words(error) from None


def gravity_name(gravity: Vector) -> str:
    """Name of a gravity in the list of directions; "" for any other."""
    return next((name for name, known in GRAVITIES.items() if known == gravity), "")


def base_name(arm: Manipulator) -> str:
    """Word for the way that an arm points; "" for a rotation."""
    return arm.base.points if isinstance(arm.base.points, str) else ""


def _based(state: StudioState, name: str) -> StudioState:
    if not name:
        return state
    design = state.design
    return state.replace(design=design.replace(base=design.base.replace(points=name)))


def base_field(name: str) -> Attribute:
    """Position in mm, or turn in degrees."""
    scale = math.radians(1.0) if name == "turn" else 1e-3

    def read(state: StudioState) -> Any:
        return _in_unit(getattr(state.design.base, name), scale)

    def write(state: StudioState, value: Any) -> StudioState:
        if value == read(state):  # what the field only shows rounded is left as it is
            return state
        there = vector(scale * v for v in value) if isinstance(value, tuple) else scale * value
        base = state.design.base.replace(**{name: there})
        return state.replace(design=state.design.replace(base=base))

    return Attribute(read, write)


def other_loads(arm: Manipulator) -> list[str]:
    """Loads of a design that have no field, in words."""
    loads = arm.loads or _NONE
    names = ("tip_moment", "follower_force", "follower_moment", "force_per_length")
    others = [name.replace("_", " ") for name in names if any(getattr(loads, name))]
    count = len(loads.point_loads)
    return others + ([f"point loads ({count})"] if count else [])


def _in_si(name: str, value: Any) -> Any:
    label, _, unit, scale, _ = _QUANTITIES[name]
    low = 0.0 if name == "payload" else -_MOST
    numbers = np.atleast_1d(np.asarray(value, float))
    good = (numbers >= low) & (numbers <= _MOST)
    if not good.all():
        wrong = f"{numbers[np.flatnonzero(~good)[0]]:g} {unit}"
        raise InvalidInput(label, wrong, f"{low:,.0f} to {_MOST:,.0f} {unit}")
    return vector(scale * v for v in value) if isinstance(value, tuple) else scale * value


def _in_unit(value: Any, scale: float) -> Any:
    if scale == 1.0:
        return value
    if isinstance(value, tuple):
        return vector(_in_unit(each, scale) for each in value)
    return float(f"{value / scale:.10g}")


def _in_words(error: InvalidDesign) -> InvalidDesign:
    """Moduli and densities that loads need and an arm lacks, in one line."""
    lacking: dict[str, list[str]] = {}
    for fault in error.faults:
        owner, _, field = fault.path.rpartition(".")
        if field not in _SYMBOLS:
            return in_file_terms(error, "")
        lacking.setdefault(owner_label(owner), []).append(_SYMBOLS[field])
    needed = "; ".join(f"{' and '.join(what)} of {owner}" for owner, what in lacking.items())
    line = f"need {needed}: choose a material or type the numbers on the tab Parts"
    return InvalidDesign([Fault("loads", None, line)])
