"""View of the scene: colors, slice, surfaces, camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.fields import Attribute, Fields, attribute, bind_button
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.colors import color_names
from softreach.studio.state import StudioState
from softreach.studio.widgets import show_where

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session
    from softreach.support.units import LengthUnit

_ACROSS = {axis: axis for axis in ("none", "x", "y", "z")}
_TOGGLES = {
    "arm": ("arm", "The body and its bundles in the present activation"),
    "surface": ("exact surface", "Boundary of all that the tip reaches, from the map itself"),
    "cloud": ("cloud", "Tips of sampled activations"),
    "half": ("half of the cloud", "Cuts away the half in front of the arm, so that it is seen"),
    "dark": ("dark page", "Light on dark"),
}


class ViewPanel:
    """Fields of the appearance."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._fields = fields = Fields(session)
        with tab:
            fields.dropdown(
                "color by",
                lambda state: color_names(state.design),
                Attribute(_color, lambda state, name: state.showing(color=name)),
                "What the color of a point says; the key is above the tabs",
            )
            with gui.add_folder("show"):
                for name, (label, hint) in _TOGGLES.items():
                    fields.checkbox(label, attribute(f"appearance.{name}"), hint)
            views = gui.add_button_group(
                "look from", tuple(VIEWS), hint="Along an axis of the world, or between them"
            )
            fields.dropdown(
                "slice across",
                _ACROSS,
                attribute("appearance.slice.axis"),
                "Hides all but a slab across this axis",
            )
            self._slab = gui.add_folder("slab", visible=False)
        self._session, self._centers = session, Fields(session)
        self._unit: LengthUnit | None = None
        bind_button(views, session, lambda: session.look_from(views.value))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        self._fields.show(session)
        if session.state.design.length_unit != self._unit:
            self._add_center(session.state)
        self._centers.show(session)
        show_where(session.state.appearance.slice.axis != "none", self._slab)

    def _add_center(self, state: StudioState) -> None:
        """The middle of the slab, in the unit of the design that there is now."""
        self._unit = state.design.length_unit
        size = state.design.length / self._unit.size
        self._centers.remove()
        self._centers = Fields(self._session)
        with self._slab:
            ends, hint = (-1.5 * size, 1.5 * size), "Middle of the slab along the axis"
            self._centers.slider(self._unit.label("center"), ends, 0.01 * size, _CENTER, hint)


def _centered(state: StudioState, value: float) -> StudioState:
    center = value * state.design.length_unit.size / state.design.length
    return attribute("appearance.slice.center").write(state, center)


_CENTER = Attribute(
    lambda state: float(
        f"{state.appearance.slice.center * state.design.length / state.design.length_unit.size:.9g}"
    ),
    _centered,
)


def _color(state: StudioState) -> str:
    """The color that is shown: a design may have none of the one that is asked for."""
    color = state.appearance.color
    return color if color in color_names(state.design) else "rgb"
