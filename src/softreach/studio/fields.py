"""Fields of a tab: widgets bound both ways to values of the state, lines of text, and pictures.

Numbers are typed into texts: viser's own number fields drop the sign of "-0.5" and the exponent of
"1e-5" while one types, and round to the step of a slider. Texts are sent as they are, and a form
tells when Enter is pressed.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.studio import markup
from softreach.studio.state import StudioState
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = [
    "Attribute",
    "Fields",
    "Line",
    "PictureFrame",
    "SliderField",
    "TypedField",
    "attempt",
    "attribute",
    "bind_button",
    "number_of",
    "vector_of",
]

_PRECISION = 12
"""Digits after the point that viser leaves of what a slider holds."""
_UNAPPLIED = "Enter applies it."


class Attribute(NamedTuple):
    """A value of the state that a field shows and changes."""

    read: Callable[[StudioState], Any]
    write: Callable[[StudioState, Any], StudioState]


def attribute(path: str) -> Attribute:
    """The value at a path in the state, such as "appearance.slice.center"."""
    names = path.split(".")
    return Attribute(attrgetter(path), lambda state, value: _with(state, names, value))


def _with(whole: Any, names: list[str], value: Any) -> Any:
    first, *rest = names
    return replace(whole, **{first: _with(getattr(whole, first), rest, value) if rest else value})


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
        return self.bind(SliderField(self._gui, label, ends, step, self._read(at), hint), at)

    def number(self, label: str, at: Attribute, hint: str) -> TypedField:
        """Add a field for a number."""
        return self.bind(TypedField(self._gui, label, self._read(at), hint), at)

    def vector(self, label: str, at: Attribute, hint: str) -> TypedField:
        """Add a field for three numbers."""
        return self.bind(TypedField(self._gui, label, self._read(at), hint, VECTOR), at)

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

    def _read(self, at: Attribute) -> Any:
        return at.read(self._session.state)


class _Unchanged(Exception):
    """A change that leaves the state as it is."""


class _Binding(NamedTuple):
    """A widget, and the value of the state that it stands for."""

    widget: Any
    at: Attribute
    options: Callable[[StudioState], Mapping[Any, str]] | None

    def write(self, state: StudioState) -> StudioState:
        """The state with what the widget holds."""
        held = self.widget.value
        if self.options is not None:
            values = {name: value for value, name in self.options(state).items()}
            if held not in values:  # of a design before
                return state
            held = values[held]
        return self.at.write(state, held)

    def follow(self, state: StudioState, *, values: bool) -> None:
        """Offer what the state offers, and show its value."""
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


class Line:
    """Line of text, shown as it is; without text it takes no room."""

    def __init__(self, gui: GuiApi, *parts: markup.Part) -> None:
        """Add the line where the panel is being built."""
        self._widget = gui.add_html(markup.paragraph(*parts), visible=bool(parts))

    def say(self, *parts: markup.Part) -> None:
        """Show text, some of it bold."""
        self.show(markup.paragraph(*parts))

    def warn(self, text: str) -> None:
        """Show in red what is wrong; "" for nothing."""
        self.show(markup.alert(text) if text else "")

    def show(self, content: str) -> None:
        """Show what `markup` made."""
        if self._widget.content != content:
            self._widget.content = content
        if self._widget.visible != bool(content):
            self._widget.visible = bool(content)

    def remove(self) -> None:
        """Take the line away."""
        self._widget.remove()


class PictureFrame:
    """Place for a picture that changes, empty until there is one."""

    def __init__(self, gui: GuiApi, container: Any) -> None:
        """Take the place in a folder or tab."""
        self._gui, self._container = gui, container
        self._widget: Any = None
        self._shown: NDArray[np.uint8] | None = None

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show a picture, RGB from 0 to 255, shape (rows, columns, 3)."""
        if image is self._shown:
            return
        self._shown = image
        if self._widget is None:
            with self._container:
                self._widget = self._gui.add_image(image, format="png")
        else:
            self._widget.image = image


def number_of(text: str) -> float | None:
    """The finite number that a text is, with a minus of any kind; None if it is none."""
    try:
        value = float(text.strip().replace("\N{MINUS SIGN}", "-").replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _number_text(value: float) -> str:
    return f"{value:.12g}"


def vector_of(text: str) -> tuple[float, ...] | None:
    """The three finite numbers that a text lists; None if it does not."""
    numbers = [number_of(part) for part in text.replace(";", ",").replace(",", " ").split()]
    finite = tuple(value for value in numbers if value is not None)
    return finite if len(numbers) == len(finite) == 3 else None


class TextKind(NamedTuple):
    """Kind of value that is typed."""

    demand: str
    """What a text has to be."""
    value: Callable[[str], Any]
    """From a text; None if it is no such value."""
    text: Callable[[Any], str]
    """From a value, as a person would type it."""


NUMBER = TextKind("a number", number_of, _number_text)
VECTOR = TextKind(
    "three numbers, such as 0, 0, -9.81",
    vector_of,
    lambda values: ", ".join(map(_number_text, values)),
)


class TypedField:
    """Text field for a value, applied by Enter and by leaving it; below it a line for refusals."""

    def __init__(
        self, gui: GuiApi, label: str, value: Any, hint: str, kind: TextKind = NUMBER
    ) -> None:
        """Add the widgets where the panel is being built."""
        self._kind, self._value = kind, value
        self._lock = threading.RLock()
        self._callbacks: list[Callable[[Any], object]] = []
        self._form = gui.add_form(None)
        with self._form:
            self._text = gui.add_text(label, kind.text(value), hint=hint)
        self._message = Line(gui)
        self._text.on_update(self._typed)
        self._form.on_submit(self._submitted)

    @property
    def value(self) -> Any:
        """The value that was applied last."""
        return self._value

    @value.setter
    def value(self, value: Any) -> None:
        with self._lock:
            same, text = value == self._value, self._kind.text(value)
            self._value = value
            if not same or self._text.value != text:
                self._text.value = text
                self._message.warn("")
        self._follow()

    def on_update(self, callback: Callable[[Any], object]) -> None:
        """Call back with the event when a person has applied a value."""
        self._callbacks.append(callback)

    def warn(self, text: str) -> None:
        """Say under the field why its value is refused; "" for nothing."""
        self._message.warn(text)

    def remove(self) -> None:
        """Take the field away."""
        self._text.remove()
        self._form.remove()
        self._message.remove()

    def _typed(self, event: Any) -> None:
        if event.client_id is not None:
            unapplied = self._text.value != self._kind.text(self._value)
            self._message.say(*((_UNAPPLIED,) if unapplied else ()))

    def _submitted(self, event: Any) -> None:
        value = self._kind.value(self._text.value)
        if value is None:
            self._message.warn(f"{self._text.value!r}: must be {self._kind.demand}")
            return
        with self._lock:
            self._value = value
            self._message.warn("")
        self._apply(event)

    def _apply(self, event: Any) -> None:
        self._follow()
        for callback in self._callbacks:
            callback(event)

    def _follow(self) -> None:
        """Bring what else shows the value in line with it."""


class SliderField(TypedField):
    """Number that is dragged, or typed: also beyond the ends of its slider."""

    def __init__(
        self,
        gui: GuiApi,
        label: str,
        ends: tuple[float, float],
        step: float,
        value: float,
        hint: str = "",
    ) -> None:
        """Add the widgets where the panel is being built."""
        self._ends = ends
        self._slider = gui.add_slider(label, *ends, step, self._within(value), hint=hint or None)
        self._slider.precision = _PRECISION
        self._thumb = self._slider.value
        super().__init__(gui, "", value, hint)
        self._slider.on_update(self._dragged)

    def remove(self) -> None:
        """Take the slider and its field away."""
        self._slider.remove()
        super().remove()

    def _dragged(self, event: Any) -> None:
        # A page also reports sliders that were only drawn anew.
        if event.client_id is None or self._slider.value == self._thumb:
            return
        with self._lock:
            self._value = self._thumb = self._slider.value
            self._text.value = self._kind.text(self._value)
            self._message.warn("")
        self._apply(event)

    def _follow(self) -> None:
        """Move the thumb to the value, or to the end that is nearest."""
        thumb = self._within(self._value)
        if thumb != self._thumb:
            self._thumb = self._slider.value = thumb

    def _within(self, value: float) -> float:
        low, high = self._ends
        return min(max(value, low), high)
