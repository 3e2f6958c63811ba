"""View of the scene: colors, number of points, slice, surfaces, camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.fields import Attribute, Fields, attribute, bind_button
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.clouds import color_names
from softreach.studio.state import CUTS, LEVELS, StudioState

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_COUNTS = {level: f"{1 << level:,}" for level in LEVELS}
_ACROSS = {axis: axis for axis in ("none", "x", "y", "z")}
_TOGGLES = {
    "cloud": ("cloud", "Tips of sampled activations"),
    "arm": ("arm", "The body and its bundles in the present activation"),
    "surface": ("exact surface", "Boundary of all that the tip reaches, from the map itself"),
    "alpha_shape": (
        "α-shape (0.05 L)",
        "The surface of a cloud by balls of radius α = 0.05 L, to compare with",
    ),
    "axes": ("axes", "x, y and z in the world [L]"),
    "lit": ("lit points", "Points are shaded as spheres in a light"),
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
            fields.dropdown(
                "points",
                _COUNTS,
                attribute("appearance.level"),
                "Samples that are shown, at most as many as time and memory allow",
            )
            fields.slider(
                "point size / L",
                (5e-4, 0.02),
                5e-4,
                attribute("appearance.point_size"),
                "Edge of a point [L]",
            )
            fields.dropdown(
                "cut away",
                CUTS,
                attribute("appearance.cut"),
                "What of the cloud is taken away, so that arm and target are seen",
            )
            with gui.add_folder("show"):
                for name, (label, hint) in _TOGGLES.items():
                    fields.checkbox(label, attribute(f"appearance.{name}"), hint)
            with gui.add_folder("camera"):
                views = gui.add_button_group(
                    "look from", tuple(VIEWS), hint="Along an axis of the world, or between them"
                )
                fields.checkbox(
                    "orthographic",
                    attribute("appearance.orthographic"),
                    "Without perspective: what is parallel stays parallel",
                )
                reset = gui.add_button("Reset the view", hint="The view of the first picture")
            with gui.add_folder("slice"):
                fields.dropdown(
                    "across",
                    _ACROSS,
                    attribute("appearance.slice.axis"),
                    "Hides all but a slab across this axis",
                )
                fields.slider(
                    "center / L",
                    (-1.5, 1.5),
                    0.01,
                    attribute("appearance.slice.center"),
                    "Middle of the slab along the axis [L]",
                )
                fields.slider(
                    "thickness / L",
                    (0.01, 1.0),
                    0.01,
                    attribute("appearance.slice.thickness"),
                    "Of the slab [L]",
                )
        bind_button(views, session, lambda: session.look_from(views.value))
        bind_button(reset, session, lambda: _reset(session))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        self._fields.show(session)


def _color(state: StudioState) -> str:
    """The color that is shown: a design may have none of the one that is asked for."""
    color = state.appearance.color
    return color if color in color_names(state.design) else "rgb"


def _reset(session: Session) -> None:
    session.update(lambda s: s.showing(orthographic=False))
    session.camera.project(orthographic=False)
    session.look_from("oblique")
