"""Fields of a tab: widgets bound both ways to values of the state."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.studio.state import StudioState
from softreach.studio.widgets import (
    Line,
    SliderField,
    TypedField,
    number_kind,
    unit_in,
    vector_kind,
)
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from softreach.studio.session import Session


class Attribute(NamedTuple):
    """A value of the state that a field shows and changes."""

    read: Callable[[StudioState], Any]
    write: Callable[[StudioState, Any], StudioState]


def attribute(path: str) -> Attribute:
    """The value at a path in the state, such as "appearance.slice.center"."""
    names = path.split(".")
    return Attribute(attrgetter(path), lambda state, value: _with(state, names, value))


def _with(owner: Any, names: list[str], value: Any) -> Any:
    first, *rest = names
    return replace(owner, **{first: _with(getattr(owner, first), rest, value) if rest else value})


class Fields:
    """Fields of a panel: they show values of the state, and write into it what a person changes.

    A refused value stays in its field, and the reason stands below it.
    """

    def __init__(
        self,
        session: Session,
        message: Line | None = None,
        *,
        words: Callable[[SoftreachError], str] = str,
        dragged: bool = True,
    ) -> None:
        """Begin without a field; fields are added where the panel is being built.

        Args:
            session: Whose state it is.
            message: Line for refusals of widgets that have none of their own; without one they are
                shown above all tabs.
            words: A refusal in words.
            dragged: Whether fields are dragged. None follows the state then while a person moves
                one of them, which would jump back to where it was a moment ago.
        """
        self._session, self._gui = session, session.client.gui
        self.message, self._words, self._dragged = message, words, dragged
        self._lock = threading.RLock()
        self._bound: list[_Binding] = []
        self._widgets: list[Any] = []
        self._refused: Any = None
        self._shown: tuple[int, object] = (session.revision, session.state.design)

    def checkbox(self, label: str, at: Attribute, hint: str) -> Any:
        """Add a check box."""
        return self.bind(self._gui.add_checkbox(label, self._read(at), hint=hint), at)

    def dropdown(
        self,
        label: str,
        options: Mapping[Any, str] | Callable[[StudioState], Mapping[Any, str]],
        at: Attribute,
        hint: str,
    ) -> Any:
        """Add a menu.

        Args:
            label: Before the menu.
            options: What each value is called; in each state, if that depends on the design.
            at: A value of the state that is among them.
            hint: What it means.
        """
        offered = options if callable(options) else lambda _: options
        names = offered(self._session.state)
        widget = self._gui.add_dropdown(
            label, tuple(names.values()), initial_value=names[self._read(at)], hint=hint
        )
        return self.bind(widget, at, offered)

    def slider(
        self, label: str, ends: tuple[float, float], step: float, at: Attribute, hint: str
    ) -> SliderField:
        """Add a slider beside a field for the same number."""
        kind = number_kind(unit_in(label), self._length)
        return self.bind(SliderField(self._gui, label, ends, step, self._read(at), hint, kind), at)

    def number(self, label: str, at: Attribute, hint: str) -> TypedField:
        """Add a field for a number."""
        kind = number_kind(unit_in(label), self._length)
        return self.bind(TypedField(self._gui, label, self._read(at), hint, kind), at)

    def vector(self, label: str, at: Attribute, hint: str) -> TypedField:
        """Add a field for three numbers."""
        kind = vector_kind(unit_in(label), self._length)
        return self.bind(TypedField(self._gui, label, self._read(at), hint, kind), at)

    def button(
        self, label: str, change: Callable[[StudioState], StudioState], hint: str, **looks: Any
    ) -> Any:
        """Add a button that changes the state."""
        button = self._gui.add_button(label, hint=hint, **looks)
        button.on_click(lambda _: self.apply(change))
        self._widgets.append(button)
        return button

    def bind(
        self,
        widget: Any,
        at: Attribute,
        options: Callable[[StudioState], Mapping[Any, str]] | None = None,
    ) -> Any:
        """Bind a widget, and return it.

        Events run at once and in any order: each reads what the widget holds by then, so that the
        last one has it right. Widgets that we set ourselves also send events, without a client.
        """
        binding = _Binding(widget, at, options)

        def moved(event: Any) -> None:
            if event.client_id is not None:
                self.apply(binding.write, widget)

        widget.on_update(moved)
        self._bound.append(binding)
        self._widgets.append(widget)
        return widget

    def apply(self, change: Callable[[StudioState], StudioState], widget: Any = None) -> None:
        """Change the state, or say below the widget why that cannot be."""
        place = widget if isinstance(widget, TypedField) else self.message
        try:
            self._update(change, by_widget=self._dragged and widget is not None)
            refusal = ""
        except SoftreachError as error:
            refusal = self._words(error)
            if place is None:
                self._session.fail(error)
        except Exception as error:  # whoever presses a button sees no log
            self._session.fail(error)
            return
        with self._lock:
            for line in {self._refused, place} - {None}:
                line.warn(refusal if line is place else "")
            self._refused = place
            if widget is None and not refusal:  # refused values of other fields are given up
                for binding in self._bound:
                    binding.follow(self._session.state, values=True)

    def _update(self, change: Callable[[StudioState], StudioState], *, by_widget: bool) -> None:
        """Change the state, if that changes anything: a page reports what was only drawn anew."""

        def changed(state: StudioState) -> StudioState:
            new = change(state)
            if new == state:
                raise _Unchanged
            return new

        with suppress(_Unchanged):
            self._session.update(changed, by_widget=by_widget)

    def show(self, session: Session) -> bool:
        """Bring the fields in line with the state; return whether there was anything to do."""
        with self._lock:
            revision, design = self._shown
            state = session.state
            if session.revision == revision and state.design is design:
                return False
            self._shown = session.revision, state.design
            for binding in self._bound:
                binding.follow(state, values=session.revision != revision or not self._dragged)
            return True

    def remove(self) -> None:
        """Take all fields away."""
        for widget in self._widgets:
            widget.remove()
        self._bound, self._widgets, self._refused = [], [], None

    def _length(self) -> float:
        """L [m], which may be typed as a unit."""
        return self._session.state.design.length

    def _read(self, at: Attribute) -> Any:
        return at.read(self._session.state)


class _Unchanged(Exception):
    """A change that leaves the state as it is."""


class _Binding(NamedTuple):
    widget: Any
    at: Attribute
    options: Callable[[StudioState], Mapping[Any, str]] | None

    def write(self, state: StudioState) -> StudioState:
        value = self.widget.value
        if self.options is not None:
            values = {name: value for value, name in self.options(state).items()}
            if value not in values:  # of a design before
                return state
            value = values[value]
        return self.at.write(state, value)

    def follow(self, state: StudioState, *, values: bool) -> None:
        value = self.at.read(state)
        if self.options is not None:
            names = self.options(state)
            if tuple(self.widget.options) != tuple(names.values()):
                self.widget.options, values = tuple(names.values()), True
            value = names[value]
        if values and self.widget.value != value:
            self.widget.value = value


def bind_button(button: Any, session: Session, action: Callable[[], object]) -> None:
    """Act whenever a person presses the button."""
    button.on_click(lambda _: attempt(session, action))


def attempt(session: Session, action: Callable[[], object]) -> None:
    """Act, and show the reader what is wrong if that fails."""
    try:
        action()
    except Exception as error:  # whoever presses a button sees no log
        session.fail(error)
