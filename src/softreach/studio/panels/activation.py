"""One slider per bundle moves the arm."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.schema import activation_symbols
from softreach.studio.panels.binding import bind, bind_button
from softreach.studio.panels.line import Line
from softreach.studio.panels.status import tip_text
from softreach.studio.panels.typed import SliderField
from softreach.studio.scene.scene import MOST_BUNDLES
from softreach.studio.state import StudioState, rod_of

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["ActivationPanel"]

_MOST = 40
"""Sliders: a page with hundreds takes minutes to build."""


class ActivationPanel:
    """Activations of the bundles within their bounds, and where the tip is."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._gui, self._session = gui, session
        self._lock = threading.RLock()
        self._sliders: list[Any] = []
        self._made_for: Any = None
        self._revision = -1
        with tab:
            self._tip = Line(gui)
            self._folder = gui.add_folder("activation")
            self._hidden = Line(gui)
            self._trail = gui.add_checkbox("show trail", False, hint="Draws where the tip has been")
            rest = gui.add_button("Rest", hint="Sets every activation to 0, or the nearest to it")
        bind(self._trail, session, lambda s, on: s.showing(trail=on))
        bind_button(rest, session, lambda: session.update(lambda s: s.replace(activation=())))

    def show(self, session: Session) -> None:
        """Move the sliders to the state, and show where the tip is."""
        with self._lock:
            if _slider_ends(session.state.design) != self._made_for:
                self._build(session)
            elif session.revision != self._revision:
                for slider, value in zip(self._sliders, session.state.activation, strict=False):
                    slider.value = value
                self._trail.value = session.state.appearance.trail
            self._revision = session.revision
        self._tip.say(*tip_text(session))

    def _build(self, session: Session) -> None:
        self._made_for = _slider_ends(session.state.design)
        for slider in self._sliders:
            slider.remove()
        with self._folder:
            self._sliders = [
                self._slider(name, low, high, value)
                for (name, low, high), value in zip(
                    self._made_for[:_MOST], session.state.activation, strict=False
                )
            ]
        hidden = len(self._made_for) - len(self._sliders)
        drawn = "" if len(self._made_for) <= MOST_BUNDLES else "; no bundle is drawn"
        text = f"{hidden} more bundles have no slider here{drawn}."
        self._hidden.say(*([text] if hidden else []))

    def _slider(self, name: str, low: float, high: float, value: float) -> Any:
        room = 1e-6 * max(1.0, abs(low))
        high = max(high, low + room)  # a slider needs room; the state keeps to the bounds
        about = f"{name}: activation of a bundle, from {low:g} to {high:g}; 0 is at rest"
        slider = SliderField(self._gui, name, (low, high), _step(high - low), value, about)
        bind(slider, self._session, self._wanted)
        return slider

    def _wanted(self, state: StudioState, moved: float) -> StudioState:
        """Read all sliders: the last of several events that run at once then has it right."""
        del moved
        shown = tuple(float(slider.value) for slider in self._sliders)
        return state.replace(activation=shown + state.activation[len(shown) :])


def _step(width: float) -> float:
    """A round step, a thousandth of the range or less."""
    return 10.0 ** (math.floor(math.log10(width)) - 3)


def _slider_ends(arm: Manipulator) -> list[tuple[str, float, float]]:
    """Label and bounds of every bundle."""
    symbols = activation_symbols(arm.bundle_units)
    units = (f" [{unit}]" if unit != "1" else "" for unit in arm.bundle_units)
    labels = zip(symbols, arm.bundle_names, units, strict=True)
    bounds = rod_of(arm).box.bounds
    return [("{} {}{}".format(*label), *ends) for label, ends in zip(labels, bounds, strict=True)]
