"""View of the scene: colors, slice, surfaces, camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.fields import Attribute, Fields, attribute, bind_button
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.clouds import color_names
from softreach.studio.state import StudioState
from softreach.studio.widgets import show_where

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

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
            with self._slab:
                fields.slider(
                    "center / L",
                    (-1.5, 1.5),
                    0.01,
                    attribute("appearance.slice.center"),
                    "Middle of the slab along the axis [L]",
                )
        bind_button(views, session, lambda: session.look_from(views.value))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        self._fields.show(session)
        show_where(session.state.appearance.slice.axis != "none", self._slab)


def _color(state: StudioState) -> str:
    """The color that is shown: a design may have none of the one that is asked for."""
    color = state.appearance.color
    return color if color in color_names(state.design) else "rgb"
