"""Any arm, part by part: rings and actuators are added, removed, renamed, their numbers typed."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.arm.materials import material_names
from softreach.arm.parameters import changed
from softreach.studio import edits
from softreach.studio.controls import Shown, refusal
from softreach.studio.panels.line import Line
from softreach.studio.panels.typed import NumberField
from softreach.studio.parts import Number, Part, numbers, parts
from softreach.studio.state import rod_of
from softreach.support.errors import InvalidDesign, SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["PartsPanel"]

Change = Callable[[Manipulator], Manipulator]

_AS_TYPED = "(as typed)"
_NEW_RING = "ring"
_ABOUT_BUTTONS = {
    "Take this design": "Replaces the whole design by this one",
    "Add": "Adds this part, with numbers to be changed below",
    "Rename": "Gives the part this name",
    "Remove": "Takes the part out of the design",
}
_ABOUT_EDIT = "The part whose numbers are below"
_ABOUT_MATERIAL = "Sets modulus E, Poisson ratio ν and density ρ to those of a known material"


class PartsPanel:
    """A list of parts, and the fields of the one that is chosen."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._gui, self._session, self._lock = gui, session, threading.RLock()
        self._shown: Manipulator | None = None
        self._label = ""
        self._fields: list[Any] = []
        self._typed: dict[str, tuple[Number, Any]] = {}
        with tab:
            with gui.add_folder("start from"):
                self._named = gui.add_dropdown(
                    "named design",
                    tuple(designs.__all__),
                    hint="Arms of the literature and examples",
                )
                self._button("Take this design", self._take)
            with gui.add_folder("add"):
                kinds = (*edits.ACTUATOR_KINDS, _NEW_RING)
                self._kind = gui.add_dropdown(
                    "kind", kinds, hint="An actuator, or a ring of the cross-section"
                )
                self._button("Add", self._add)
            self._folder = gui.add_folder("part")
            self._message = Line(gui)

    def show(self, session: Session) -> None:
        """Show the parts of the design, and what the chosen one has."""
        with self._lock:
            if session.state.design != self._shown:
                self._build(session.state.design)

    def _build(self, arm: Manipulator) -> None:
        """Make the fields anew, unless they fit and only values changed."""
        known = {part.label: part for part in parts(arm)}
        chosen = self._label if self._label in known else next(iter(known))
        fits = self._shown is not None and self._fields_for(self._shown) == (known, chosen)
        self._shown, self._label = arm, chosen
        if fits and self._refreshed(numbers(arm, known[chosen])):
            return
        for widget in self._fields:
            widget.remove()
        with self._folder:
            self._fields = self._list(known, chosen) + self._widgets(arm, known[chosen])

    def _fields_for(self, arm: Manipulator) -> tuple[dict[str, Part], str]:
        return {part.label: part for part in parts(arm)}, self._label

    def _refreshed(self, found: list[Number]) -> bool:
        """Whether the fields that are there could take these values."""
        if [one.parameter for one in found] != list(self._typed):
            return False
        for one in found:
            _, widget = self._typed[one.parameter]
            self._typed[one.parameter] = (one, widget)
            if widget.value != _shown(one):  # else a person who types would be interrupted
                widget.value = _shown(one)
        return True

    def _known(self) -> dict[str, Shown]:
        """How the numbers of the chosen part are shown."""
        return {name: Shown(one.label, one.scale) for name, (one, _) in self._typed.items()}

    def _list(self, known: dict[str, Part], chosen: str) -> list[Any]:
        menu = self._gui.add_dropdown("edit", tuple(known), initial_value=chosen, hint=_ABOUT_EDIT)

        def choose(event: Any) -> None:
            if event.client_id is not None:
                with self._lock:
                    self._label, arm, self._shown = menu.value, self._shown, None
                    if arm is not None:
                        self._build(arm)

        menu.on_update(choose)
        return [menu]

    def _widgets(self, arm: Manipulator, part: Part) -> list[Any]:
        self._typed = {}
        made = self._words(arm, part)
        for one in numbers(arm, part):
            widget = self._number(one)
            self._typed[one.parameter] = (one, widget)
            made.append(widget)
        if part.ring is not None or part.actuator:
            made.append(self._button("Remove", lambda: self._remove(part)))
        return made

    def _words(self, arm: Manipulator, part: Part) -> list[Any]:
        """Its name, its material, or the ring that it is in."""
        made: list[Any] = []
        if part.ring is not None or part.actuator:
            name = self._gui.add_text("name", part.name, hint="What tables and files call it")
            made += [name, self._button("Rename", lambda: self._renamed(part, name.value))]
        if part.ring is not None:
            material = arm.section.rings[part.ring].material.name
            made.append(self._material("material", material, part.ring))
        if part.label == parts(arm)[0].label:
            core = arm.section.core
            made.append(self._material("core", core.name if core else "", None))
        if part.home is not None and len(arm.section.rings) > 1:
            made.append(self._home(arm, part))
        return made

    def _number(self, one: Number) -> Any:
        field = NumberField(self._gui, one.label, _shown(one), one.hint)
        field.on_update(lambda _: self._change(one.parameter, field))
        return field

    def _change(self, parameter: str, widget: NumberField) -> None:
        """One number typed; what a field only shows rounded is left as it is."""
        known, current = self._typed.get(parameter, (None, None))
        if known is None or current is not widget or widget.value == _shown(known):
            return  # of a field that is gone, or no change
        value = widget.value * known.scale
        self._apply(lambda arm: changed(arm, {parameter: value}), field=widget)

    def _material(self, label: str, name: str, ring: int | None) -> Any:
        none = _AS_TYPED if ring is not None else "as the innermost ring"
        options = (none, *material_names())
        shown = name if name in options else none
        menu = self._gui.add_dropdown(label, options, initial_value=shown, hint=_ABOUT_MATERIAL)

        def take() -> None:
            material = "" if menu.value == none else menu.value
            if ring is None:
                self._apply(lambda arm: edits.with_core(arm, material))
            elif material:
                index = ring
                self._apply(lambda arm: edits.with_ring_material(arm, index, material))

        return self._on(menu, take)

    def _home(self, arm: Manipulator, part: Part) -> Any:
        labels = [edits.ring_label(arm, k) for k in range(len(arm.section.rings))]
        here = arm.section.rings.index(arm.section.ring(part.home or 0))
        menu = self._gui.add_dropdown(
            "in ring", tuple(labels), initial_value=labels[here], hint="The ring that it lies in"
        )
        return self._on(
            menu, lambda: self._apply(lambda arm: _moved(arm, part, labels.index(menu.value)))
        )

    def _button(self, label: str, action: Callable[[], None]) -> Any:
        button = self._gui.add_button(label, hint=_ABOUT_BUTTONS[label])
        button.on_click(lambda _: action())
        return button

    def _on(self, widget: Any, action: Callable[[], None]) -> Any:
        """Act when a person, and not the program, changed a widget."""
        widget.on_update(lambda event: action() if event.client_id is not None else None)
        return widget

    def _take(self) -> None:
        made: Callable[[], Manipulator] = getattr(designs, self._named.value)
        self._apply(lambda _: made())

    def _add(self) -> None:
        kind = self._kind.value
        if kind == _NEW_RING:
            self._apply(
                edits.with_ring,
                last=lambda arm: edits.ring_label(arm, len(arm.section.rings) - 1),
            )
        else:
            self._apply(
                lambda arm: edits.with_actuator(arm, kind), last=lambda arm: arm.actuators[-1].name
            )

    def _remove(self, part: Part) -> None:
        if part.ring is not None:
            index = part.ring
            self._apply(lambda arm: edits.without_ring(arm, index))
        else:
            self._apply(lambda arm: edits.without_actuator(arm, part.actuator))

    def _renamed(self, part: Part, name: str) -> None:
        if not name.strip() or name == part.name:
            return
        if part.ring is not None:
            index = part.ring
            self._apply(
                lambda arm: edits.with_ring_name(arm, index, name),
                last=lambda arm: edits.ring_label(arm, index),
            )
        else:
            self._apply(
                lambda arm: edits.with_actuator_name(arm, part.actuator, name),
                last=lambda _: name,
            )

    def _apply(
        self,
        change: Change,
        last: Callable[[Manipulator], str] | None = None,
        field: NumberField | None = None,
    ) -> None:
        """Change the design, or say below the field why that cannot be."""
        message = field or self._message
        try:
            made = rod_of(change(self._session.state.design)).arm
        except InvalidDesign as error:
            message.warn(refusal(error, self._known()))
            return
        except SoftreachError as error:
            message.warn(str(error))
            return
        self._message.warn("")
        if last is not None:
            self._label = last(made)
        self._session.update(lambda state: state.replace(design=made))


def _shown(one: Number) -> float:
    """What the field of a number holds; 0 where the design leaves it out."""
    if math.isnan(one.value):
        return 0.0
    return int(one.value) if one.whole else one.value


def _moved(arm: Manipulator, part: Part, ring: int) -> Manipulator:
    """The arm with an actuator in another ring."""
    return arm.replace(
        actuators=tuple(
            one.replace(ring=ring) if one.name == part.actuator else one for one in arm.actuators
        )
    )
