"""Parts of an arm: rings and actuators are added, removed, renamed, their numbers typed."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from softreach.arm import edits
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import material_names
from softreach.arm.parameters import Parameter, changed, parameters
from softreach.studio.fields import Attribute, Fields
from softreach.studio.shown_parameters import Part, ShownParameter, part_parameters, parts, refusal
from softreach.studio.state import StudioState
from softreach.studio.widgets import Line, TextKind, TypedField
from softreach.support.errors import InvalidDesign, SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

Change = Callable[[Manipulator], Manipulator]

_AS_TYPED, _AS_INNERMOST = "(as typed)", "as the innermost ring"
_NEW_RING = "ring"
_ABOUT_MADE_OF = "Material of all rings, which an actuator that pulls with a force needs"
_OFFER = (
    "A {kind} needs Young's modulus E, which this arm leaves open: choose what it is made of, and "
    "press Add again."
)
_ABOUT_NAME = "What tables and files call it"
_NAME = TextKind("a name", lambda text: text.strip() or None, str)
_ABOUT_MATERIAL = "Sets modulus E, Poisson ratio ν and density ρ to those of a known material"


class PartsPanel:
    """A list of parts, and the fields of the one that is chosen."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._gui, self._session, self._lock = gui, session, threading.RLock()
        self._design: Manipulator | None = None
        self._made_for: object = None
        self._label = ""
        """Of the part that is chosen."""
        self._numbers: tuple[ShownParameter, ...] = ()
        self._widgets: list[Any] = []
        with tab:
            with gui.add_folder("add a part", expand_by_default=False):
                kinds = (*edits.ACTUATOR_KINDS, _NEW_RING)
                kind = gui.add_dropdown(
                    "kind", kinds, hint="An actuator, or a ring of the cross-section"
                )
                self._made_of = gui.add_dropdown(
                    "made of", tuple(material_names()), hint=_ABOUT_MADE_OF, visible=False
                )
                add = gui.add_button("Add", hint="Adds this part, with numbers to be changed below")
                self._offer = Line(gui)
            self._folder = gui.add_folder("part")
            self._message = Line(gui)
        self._fields = self._new_fields()
        add.on_click(lambda _: self._add(kind.value))

    def show(self, session: Session) -> None:
        """Show the parts of the design, and the numbers of the chosen one."""
        with self._lock:
            if session.state.design != self._design:
                self._build(session.state.design)

    def _new_fields(self) -> Fields:
        return Fields(self._session, self._message, words=self._words, dragged=False)

    def _build(self, arm: Manipulator) -> None:
        """Make the fields anew, unless they fit and only values changed."""
        known = {label: part for label, part in parts(arm).items() if label != "body"}
        if self._label not in known:
            self._label = next(iter(known))
        part = known[self._label]
        self._design, self._numbers = arm, part_parameters(arm, part)
        made_for = known, self._label, [parameter.name for parameter in self._numbers]
        if made_for == self._made_for:
            self._fields.show(self._session)
            return
        self._made_for = made_for
        self._fields.remove()
        for widget in self._widgets:
            widget.remove()
        self._fields = self._new_fields()
        with self._folder:
            self._widgets = [self._menu(tuple(known))]
            self._add_words(arm, part)
            for parameter in self._numbers:
                self._fields.number(parameter.label, typed_number(parameter), parameter.hint)
            if part.ring is not None or part.actuator:
                self._button(
                    "Remove", lambda: self._remove(part), "Takes the part out of the design"
                )

    def _menu(self, labels: tuple[str, ...]) -> Any:
        menu = self._gui.add_dropdown(
            "edit", labels, initial_value=self._label, hint="The part whose numbers are below"
        )

        def choose(event: Any) -> None:
            if event.client_id is not None:
                with self._lock:
                    self._label = menu.value
                    if self._design is not None:
                        self._build(self._design)

        menu.on_update(choose)
        return menu

    def _add_words(self, arm: Manipulator, part: Part) -> None:
        if part.ring is not None or part.actuator:
            at = Attribute(
                lambda _: part.name, lambda state, name: self._renamed(state, part, name)
            )
            name = TypedField(self._gui, "name", part.name, _ABOUT_NAME, _NAME)
            self._fields.bind(name, at)
        if part.ring is not None:
            ring = part.ring
            self._material(
                "material",
                _AS_TYPED,
                lambda arm: arm.section.rings[ring].material.name,
                lambda arm, name: edits.with_ring_material(arm, ring, name) if name else arm,
            )
        if part.ring == 0:
            self._material(
                "core",
                _AS_INNERMOST,
                lambda arm: arm.section.core.name if arm.section.core else "",
                edits.with_core,
            )
        if part.home is not None and len(arm.section.rings) > 1:
            rings = {k: edits.ring_label(arm, k) for k in range(len(arm.section.rings))}
            at = _of_design(
                lambda arm: _ring_of(arm, part.actuator),
                lambda arm, ring: edits.with_actuator_ring(arm, part.actuator, ring),
            )
            self._fields.dropdown("in ring", rings, at, "The ring that it lies in")

    def _material(
        self,
        label: str,
        none: str,
        read: Callable[[Manipulator], str],
        write: Callable[[Manipulator, str], Manipulator],
    ) -> None:
        names: Mapping[str, str] = {"": none} | {name: name for name in material_names()}
        at = _of_design(lambda arm: name if (name := read(arm)) in names else "", write)
        self._fields.dropdown(label, names, at, _ABOUT_MATERIAL)

    def _button(self, label: str, action: Callable[[], None], hint: str) -> None:
        button = self._gui.add_button(label, hint=hint, color="gray")
        button.on_click(lambda _: action())
        self._widgets.append(button)

    def _add(self, kind: str) -> None:
        if kind == _NEW_RING:
            self._edit(
                edits.with_ring, lambda arm: edits.ring_label(arm, len(arm.section.rings) - 1)
            )
        else:
            self._add_actuator(kind)

    def _add_actuator(self, kind: str) -> None:
        """Add it; where the arm lacks the modulus for it, offer a material first."""
        lacking, offered = self._lacks_material(kind), self._made_of.visible
        self._made_of.visible = lacking and not offered
        self._offer.warn(_OFFER.format(kind=kind) if self._made_of.visible else "")
        if self._made_of.visible:
            return

        def added(arm: Manipulator) -> Manipulator:
            stiff = edits.with_material(arm, self._made_of.value) if lacking else arm
            return edits.with_actuator(stiff, kind)

        self._edit(added, lambda arm: arm.actuators[-1].name)

    def _lacks_material(self, kind: str) -> bool:
        try:
            edits.with_actuator(self._session.state.design, kind)
        except InvalidDesign as error:
            return any(
                fault.value is None and fault.path.endswith("young_modulus")
                for fault in error.faults
            )
        return False

    def _remove(self, part: Part) -> None:
        ring = part.ring
        if ring is not None:
            self._edit(lambda arm: edits.without_ring(arm, ring))
        else:
            self._edit(lambda arm: edits.without_actuator(arm, part.actuator))

    def _renamed(self, state: StudioState, part: Part, name: str) -> StudioState:
        if name == part.name:
            return state
        ring = part.ring
        if ring is not None:
            arm = edits.with_ring_name(state.design, ring, name)
            label = edits.ring_label(arm, ring)
        else:
            arm = edits.with_actuator_name(state.design, part.actuator, name)
            label = name
        new = state.replace(design=arm)
        self._label = label
        return new

    def _edit(self, change: Change, chosen: Callable[[Manipulator], str] | None = None) -> None:
        def edited(state: StudioState) -> StudioState:
            new = state.replace(design=change(state.design))
            if chosen is not None:
                self._label = chosen(new.design)
            return new

        self._fields.apply(edited)

    def _words(self, error: SoftreachError) -> str:
        return refusal(error, self._numbers, self._session.state.design)


def _of_design(
    read: Callable[[Manipulator], Any], write: Callable[[Manipulator, Any], Manipulator]
) -> Attribute:
    return Attribute(
        lambda state: read(state.design),
        lambda state, value: state.replace(design=write(state.design, value)),
    )


def typed_number(parameter: ShownParameter) -> Attribute:
    """A number of the design that is typed; 0 where the design leaves it out."""

    def read(arm: Manipulator) -> float:
        value = _known(arm)[parameter.name].value(arm) / parameter.scale
        return 0.0 if math.isnan(value) else float(f"{value:.12g}")

    def write(arm: Manipulator, value: float) -> Manipulator:
        """A value that the field only shows rounded is left as it is."""
        return (
            arm if value == read(arm) else changed(arm, {parameter.name: value * parameter.scale})
        )

    return _of_design(read, write)


@lru_cache(maxsize=4)
def _known(arm: Manipulator) -> dict[str, Parameter]:
    return parameters(arm)


def _ring_of(arm: Manipulator, actuator: str) -> int:
    home = next(part.home for part in parts(arm).values() if part.actuator == actuator)
    return arm.section.rings.index(arm.section.ring(home or 0))
