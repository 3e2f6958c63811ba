"""Fields for numbers that are kept as they are typed; Enter applies them, and leaving the field.

viser's own number fields drop the sign of "-0.5" and the exponent of "1e-5" while one types, and
round to the step of a slider. Texts are sent as they are, and a form tells when Enter is pressed.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.studio import markup
from softreach.studio.state import StudioState

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session


# A line of text in a panel, which is shown as it is.


class Line:
    """Text that changes; without any the line takes no room."""

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


_PRECISION = 12
"""Digits after the point that viser leaves of what a slider holds."""
_UNAPPLIED = "Enter applies it."


def number_of(text: str) -> float | None:
    """The finite number that a text is, with a minus of any kind; None if it is none."""
    try:
        value = float(text.strip().replace("\N{MINUS SIGN}", "-").replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def number_text(value: float) -> str:
    """A number as a person would type it."""
    return f"{value:.12g}"


def _vector_of(text: str) -> tuple[float, ...] | None:
    found = [number_of(part) for part in text.replace(";", ",").replace(",", " ").split()]
    known = [value for value in found if value is not None]
    return tuple(known) if len(found) == len(known) == 3 else None


def _vector_text(values: tuple[float, ...]) -> str:
    return ", ".join(map(number_text, values))


class _TypedField:
    """A text field that stands for a value, and a line under it for what is wrong."""

    _wanted = ""
    """What a text has to be."""

    def __init__(self, gui: GuiApi, label: str, value: Any, hint: str) -> None:
        """Add the widgets where the panel is being built."""
        self._lock = threading.RLock()
        self._value = value
        self._callbacks: list[Callable[[Any], object]] = []
        self._form = gui.add_form(None)
        with self._form:
            self._text = gui.add_text(label, self._shown(value), hint=hint)
        self._message = Line(gui)
        self._text.on_update(self._typed)
        self._form.on_submit(self._submitted)

    @property
    def value(self) -> Any:
        """What was applied last."""
        return self._value

    @value.setter
    def value(self, value: Any) -> None:
        with self._lock:
            same = value == self._value
            self._value = value
            if not same or self._text.value != self._shown(value):
                self._text.value = self._shown(value)
                self._message.warn("")

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
            unapplied = self._text.value != self._shown(self._value)
            self._message.say(*((_UNAPPLIED,) if unapplied else ()))

    def _submitted(self, event: Any) -> None:
        value = self._read(self._text.value)
        if value is None:
            self._message.warn(f"{self._text.value!r}: must be {self._wanted}")
            return
        with self._lock:
            self._value = value
            self._message.warn("")
        self._apply(event)

    def _apply(self, event: Any) -> None:
        for callback in self._callbacks:
            callback(event)

    def _shown(self, value: Any) -> str:
        raise NotImplementedError

    def _read(self, text: str) -> Any:
        raise NotImplementedError


class NumberField(_TypedField):
    """A number."""

    _wanted = "a number"

    def _shown(self, value: float) -> str:
        return number_text(value)

    def _read(self, text: str) -> float | None:
        return number_of(text)


class VectorField(_TypedField):
    """Three numbers."""

    _wanted = "three numbers, such as 0, 0, -9.81"

    def _shown(self, value: tuple[float, ...]) -> str:
        return _vector_text(value)

    def _read(self, text: str) -> tuple[float, ...] | None:
        return _vector_of(text)


class SliderField(NumberField):
    """A number that is dragged, or typed: also beyond the ends of its slider."""

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

    @property
    def value(self) -> float:
        """What was applied last."""
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        _TypedField.value.__set__(self, value)
        self._follow()

    def remove(self) -> None:
        """Take the slider and its field away."""
        self._slider.remove()
        super().remove()

    def _dragged(self, event: Any) -> None:
        # A page also reports sliders that were only drawn anew.
        if event.client_id is None or self._slider.value == self._thumb:
            return
        with self._lock:
            self._thumb = self._slider.value
            self._value = self._thumb
            self._text.value = self._shown(self._value)
            self._message.warn("")
        self._apply(event)

    def _apply(self, event: Any) -> None:
        self._follow()
        super()._apply(event)

    def _follow(self) -> None:
        """Move the thumb to the value, or to the end that is nearest."""
        thumb = self._within(self._value)
        if thumb != self._thumb:
            self._thumb = thumb
            self._slider.value = thumb

    def _within(self, value: float) -> float:
        low, high = self._ends
        return min(max(value, low), high)


# From a widget that a person moves to a change of the session's state.


def bind(widget: Any, session: Session, change: Callable[[StudioState, Any], StudioState]) -> None:
    """Change the state by what the widget holds whenever a person moves it.

    Events run at once and in any order: each reads what the widget holds by then, so that the last
    one has it right. Widgets that we set ourselves also send events, without a client.
    """

    def moved(event: Any) -> None:
        if event.client_id is not None:
            attempt(
                session, lambda: session.update(lambda s: change(s, widget.value), by_widget=True)
            )

    widget.on_update(moved)


def bind_button(button: Any, session: Session, action: Callable[[], object]) -> None:
    """Act whenever a person presses the button."""
    button.on_click(lambda _: attempt(session, action))


def attempt(session: Session, action: Callable[[], object]) -> None:
    """Act, and show the reader what is wrong if that fails."""
    try:
        action()
    except Exception as error:  # whoever presses a button sees no log
        session.fail(error)


# A place in a panel for a picture that changes.


class PictureFrame:
    """Empty until there is a picture."""

    def __init__(self, gui: GuiApi, container: Any) -> None:
        """Take the place."""
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
