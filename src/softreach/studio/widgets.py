"""Widgets that viser lacks: lines of text, and fields for typed numbers, which are texts in forms.

viser's own number fields drop the sign of "-0.5" and the exponent of "1e-5" while one types, and
round to the step of a slider.
"""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.studio import markup
from softreach.support.quantity import five_digits, sizes_in

if TYPE_CHECKING:
    from viser import GuiApi

Ends = tuple[float, float]
_PRECISION = 12  # digits after the point that viser leaves of what a slider holds
_UNIT_IN = re.compile(r"\[([^\]]+)\]$| / (L)$")


class Line:
    """Line of text, shown as it is; without text it takes no room."""

    def __init__(self, gui: GuiApi, *parts: markup.Part) -> None:
        self._widget = gui.add_html(markup.paragraph(*parts), visible=bool(parts))

    def say(self, *parts: markup.Part) -> None:
        """Show text, some of it bold."""
        self.show(markup.paragraph(*parts))

    def warn(self, text: str) -> None:
        """Show in red what is wrong; "" for nothing."""
        self.show(markup.alert(text) if text else "")

    def show(self, content: str) -> None:
        """Show what `markup` made."""
        if (self._widget.content, self._widget.visible) != (content, bool(content)):
            self._widget.content, self._widget.visible = content, bool(content)

    def remove(self) -> None:
        """Take the line away."""
        self._widget.remove()


def number_of(text: str) -> float | None:
    """The finite number that a text is, with a minus of any kind; None if it is none."""
    try:
        value = float(text.strip().replace("\N{MINUS SIGN}", "-").replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def unit_in(label: str) -> str:
    """The unit that a label names, as in "taper φ [deg]" and "target / L"; "" for none."""
    match = _UNIT_IN.search(label)
    return "" if match is None else match[1] or match[2]


class TextKind(NamedTuple):
    """Kind of value that is typed."""

    demand: str  # on a text, as in "must be a number"
    value: Callable[[str], Any]  # from a text; None if it is no such value
    text: Callable[[Any], str]  # from a value, as a person would type it


def number_kind(unit: str, length: Callable[[], float]) -> TextKind:
    """Numbers in a unit, "" for plain ones; L [m] of the arm is a unit of lengths, too."""
    demand = "a number" + _with_units(unit, length())
    return TextKind(demand, lambda text: read_number(text, unit, length()), five_digits)


def vector_kind(unit: str, length: Callable[[], float]) -> TextKind:
    """Three of them, as `number_kind`."""
    demand = "three numbers, such as 0, 0, -9.81" + _with_units(unit, length())
    value = lambda text: numbers_in(text, 3, unit, length())
    return TextKind(demand, value, lambda vector: ", ".join(map(five_digits, vector)))


def numbers_in(text: str, count: int, unit: str, length: float) -> tuple[float, ...] | None:
    """So many numbers in a list, as `read_number`; None for anything else."""
    read = [read_number(part, unit, length) for part in _parts(text)]
    numbers = tuple(number for number in read if number is not None)
    return numbers if len(read) == len(numbers) == count else None


def _parts(text: str) -> list[str]:
    return text.split(next((mark for mark in ";," if mark in text), None))


def read_number(text: str, unit: str, length: float) -> float | None:
    """The number that a text is in a unit, "" for none, or with another behind it; else None."""
    text, units = text.strip(), _units(unit, length)
    name = next((name for name in sorted(units, key=len)[::-1] if text.endswith(name)), "")
    number = number_of(text.removesuffix(name))
    # 2 deg are 2.0 deg, whatever their sizes in rad
    return number if number is None or not name else float(f"{number * units[name]:.15g}")


def _units(unit: str, length: float) -> Mapping[str, float]:
    """Units that may be typed, with their sizes in that of a field."""
    sizes = sizes_in(unit) if unit else {}
    meter = 1 / length if unit == "L" else sizes.get("m")
    if meter is None:
        return sizes
    return {"L": length * meter} | {name: size * meter for name, size in sizes_in("m").items()}


def _with_units(unit: str, length: float) -> str:
    return f", without a unit or in {', '.join(_units(unit, length))}" if unit else ""


class TypedField:
    """Text field for a value, applied by Enter and by leaving it; below it a line for refusals."""

    def __init__(self, gui: GuiApi, label: str, value: Any, hint: str, kind: TextKind) -> None:
        self._kind, self._value = kind, value
        self._is_refused = False
        self._lock = threading.RLock()
        self._applied: Callable[[Any], object] = lambda _: None
        self._form = gui.add_form(None)
        with self._form:
            self._text = gui.add_text(label, kind.text(value), hint=hint)
        self._message = Line(gui)
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
        self._applied = callback

    def warn(self, text: str) -> None:
        """Say under the field why its value is refused; "" for nothing."""
        self._is_refused = bool(text)
        self._message.warn(text)

    def remove(self) -> None:
        """Take the field away."""
        self._text.remove()
        self._form.remove()
        self._message.remove()

    def _submitted(self, event: Any) -> None:
        text = self._text.value
        if (value := self._kind.value(text)) is None:
            self._message.warn(f"{text!r}: must be {self._kind.demand}")
            return
        with self._lock:
            self._value = self._kept(value)
            self.warn("")
        self._apply(event)
        has_units, plain = None in map(number_of, _parts(text)), self._kind.text(self._value)
        if has_units and not self._is_refused and text != plain:
            self._text.value = plain

    def _kept(self, value: Any) -> Any:
        """What was typed, but what the text shows rounded stays as it was held."""
        held, shown = self._value, self._kind.value(self._kind.text(self._value))
        if not isinstance(value, tuple) or shown is None:
            return held if value == shown else value
        known = zip(value, shown, held, strict=True)
        return tuple(old if new == seen else new for new, seen, old in known)

    def _apply(self, event: Any) -> None:
        self._follow()
        self._applied(event)

    def _follow(self) -> None:
        """Bring what else shows the value in line with it."""


class Slider(TypedField):
    """Number that is dragged, or typed: also beyond the ends of its slider."""

    def __init__(
        self,
        gui: GuiApi,
        label: str,
        ends: Ends,
        step: float,
        value: float,
        hint: str,
        kind: TextKind,
    ) -> None:
        self._ends = ends
        self._slider = gui.add_slider(label, *ends, step, self._within(value), hint=hint or None)
        self._slider.precision = _PRECISION
        self._thumb = self._slider.value
        super().__init__(gui, "", value, hint, kind)
        self._slider.on_update(self._dragged)

    @property
    def ends(self) -> Ends:
        """Ends of the slider; beyond them a value is typed."""
        return self._ends

    @ends.setter
    def ends(self, ends: Ends) -> None:
        with self._lock:
            self._ends = ends
            self._slider.min, self._slider.max = ends
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
            self._value = self._thumb = self._slider.value
            self._text.value = self._kind.text(self._value)
            self._message.warn("")
        self._apply(event)

    def _follow(self) -> None:
        thumb = self._within(self._value)
        if thumb != self._thumb:
            self._thumb = self._slider.value = thumb

    def _within(self, value: float) -> float:
        low, high = self._ends
        return min(max(value, low), high)
