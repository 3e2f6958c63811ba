"""Activation of each bundle: a slider a bundle moves the arm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.schema import activation_symbols
from softreach.studio.captions import tip_text
from softreach.studio.fields import Attribute, Fields
from softreach.studio.scene.scene import MOST_BUNDLES
from softreach.studio.state import StudioState, rod_of
from softreach.studio.widgets import Line

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_KINDS = {"N": "tension", "Pa": "pressure"}
"""Kinds of inputs by their units."""
_MOST = 40
"""Sliders: a page with hundreds takes minutes to build."""


class ActivationPanel:
    """Activations of the bundles within their bounds, and the place of the tip."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._ends: list[_SliderEnds] = []
        self._design: Manipulator | None = None
        self._sliders, self._others = Fields(session), Fields(session)
        with tab:
            self._tip = Line(gui)
            self._folder = gui.add_folder("activation")
            self._hidden = Line(gui)
            self._others.button(
                "Rest",
                lambda state: state.replace(activation=()),
                "Sets every activation to 0, or the nearest to it",
                color="gray",
            )

    def show(self, session: Session) -> None:
        """Move the sliders to the state, and show where the tip is."""
        self._others.show(session)
        if session.state.design is not self._design:
            self._design = session.state.design
            self._fit(session)
        self._sliders.show(session)
        self._tip.say(*tip_text(session.found, session.state.design))

    def _fit(self, session: Session) -> None:
        ends = _slider_ends(session.state.design)
        if ends == self._ends:
            return
        self._ends = ends
        self._sliders.remove()
        self._sliders = Fields(session)
        with self._folder:
            for bundle, (label, low, high) in enumerate(ends[:_MOST]):
                room = 1e-6 * max(1.0, abs(low))
                upper = max(high, low + room)  # a slider needs room; the state keeps to the bounds
                hint = f"{label}: activation of a bundle, from {low:g} to {upper:g}; 0 is at rest"
                step = 10.0 ** (math.floor(math.log10(upper - low)) - 3)  # round
                self._sliders.slider(label, (low, upper), step, _activation(bundle), hint)
        hidden = len(ends) - _MOST
        drawn = "" if len(ends) <= MOST_BUNDLES else "; no bundle is drawn"
        text = f"{hidden} more bundles have no slider here{drawn}."
        self._hidden.say(*([text] if hidden > 0 else []))


def _activation(bundle: int) -> Attribute:
    def write(state: StudioState, value: float) -> StudioState:
        before = state.activation
        return state.replace(activation=(*before[:bundle], value, *before[bundle + 1 :]))

    return Attribute(lambda state: state.activation[bundle], write)


_SliderEnds = tuple[str, float, float]
"""Label and bounds of a bundle."""


def _slider_ends(arm: Manipulator) -> list[_SliderEnds]:
    inputs = zip(activation_symbols(arm.input_units), arm.input_names, arm.input_units, strict=True)
    bounds = rod_of(arm).box.bounds
    return [(_label(*each), *ends) for each, ends in zip(inputs, bounds, strict=True)]


def _label(symbol: str, name: str, unit: str) -> str:
    kind = _KINDS.get(unit)
    words = f"{symbol} {name}" if kind is None else f"{kind} of {name}"
    return words if unit == "1" else f"{words} [{unit}]"
