"""What is drawn and how: colors, number of points, slice, surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from softreach.studio.panels.binding import bind, bind_button
from softreach.studio.panels.typed import SliderField
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.clouds import color_names
from softreach.studio.state import CUTS, LEVELS, Appearance, StudioState

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["ViewPanel"]

_COUNTS = {f"{1 << level:,}": level for level in LEVELS}
_CUT_NAMES = {text: name for name, text in CUTS.items()}
_ACROSS: tuple[str, ...] = ("none", "x", "y", "z")
_TOGGLES = {
    "cloud": "cloud",
    "arm": "arm",
    "surface": "exact surface",
    "alpha_shape": "α-shape (0.05 L)",
    "axes": "axes",
    "lit": "lit points",
    "dark": "dark page",
}

_ABOUT = {
    "color": "What the color of a point says; the key is above the tabs",
    "points": "Samples that are shown, at most as many as time and memory allow",
    "size": "Edge of a point [L]",
    "cloud": "Tips of sampled activations",
    "arm": "The body and its bundles in the present activation",
    "surface": "Boundary of all that the tip reaches, from the map itself",
    "alpha_shape": "The surface of a cloud by balls of radius α = 0.05 L, to compare with",
    "axes": "x, y and z [L] from the base",
    "lit": "Points are shaded as spheres in a light",
    "dark": "Light on dark",
    "cut": "What of the cloud is taken away, so that arm and target are seen",
    "views": "Along an axis of the base, or between them",
    "orthographic": "Without perspective: what is parallel stays parallel",
    "reset": "The view of the first picture",
    "axis": "Hides all but a slab across this axis",
    "center": "Middle of the slab along the axis [L]",
    "thickness": "Of the slab [L]",
}


class ViewPanel:
    """Widgets of the appearance."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._revision = -1
        look, names = session.state.appearance, color_names(session.state.design)
        with tab:
            self._color = gui.add_dropdown("color by", tuple(names.values()), hint=_ABOUT["color"])
            self._count = gui.add_dropdown(
                "points", tuple(_COUNTS), initial_value=_count(look), hint=_ABOUT["points"]
            )
            self._size = SliderField(
                gui, "point size / L", (5e-4, 0.02), 5e-4, look.point_size, _ABOUT["size"]
            )
            self._cut = gui.add_dropdown(
                "cut away", tuple(CUTS.values()), initial_value=CUTS[look.cut], hint=_ABOUT["cut"]
            )
            with gui.add_folder("show"):
                self._toggles = {
                    field: gui.add_checkbox(label, getattr(look, field), hint=_ABOUT[field])
                    for field, label in _TOGGLES.items()
                }
            with gui.add_folder("camera"):
                views = gui.add_button_group("look from", tuple(VIEWS), hint=_ABOUT["views"])
                self._orthographic = gui.add_checkbox(
                    "orthographic", look.orthographic, hint=_ABOUT["orthographic"]
                )
                reset = gui.add_button("Reset the view", hint=_ABOUT["reset"])
            with gui.add_folder("slice"):
                self._slice = {
                    "axis": gui.add_dropdown(
                        "across", _ACROSS, initial_value=look.slice.axis, hint=_ABOUT["axis"]
                    ),
                    "center": SliderField(
                        gui, "center / L", (-1.5, 1.5), 0.01, look.slice.center, _ABOUT["center"]
                    ),
                    "thickness": SliderField(
                        gui,
                        "thickness / L",
                        (0.01, 1.0),
                        0.01,
                        look.slice.thickness,
                        _ABOUT["thickness"],
                    ),
                }
        self._listen(session)
        bind(self._orthographic, session, lambda s, on: s.showing(orthographic=on))
        bind_button(views, session, lambda: session.look_from(views.value))
        bind_button(reset, session, lambda: self._reset(session))

    def _listen(self, session: Session) -> None:
        bind(self._color, session, self._recolored)
        bind(self._count, session, lambda s, text: s.showing(level=_COUNTS[text]))
        bind(self._size, session, lambda s, size: s.showing(point_size=size))
        bind(self._cut, session, lambda s, text: s.showing(cut=_CUT_NAMES[text]))
        for field, box in self._toggles.items():
            bind(box, session, lambda s, on, field=field: s.showing(**{field: on}))
        for field, widget in self._slice.items():
            bind(widget, session, lambda s, value, field=field: _sliced(s, field, value))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        look, names = session.state.appearance, color_names(session.state.design)
        if self._color.options != tuple(names.values()):
            self._color.options = tuple(names.values())
        if session.revision == self._revision:
            return
        self._revision = session.revision
        self._color.value = names.get(look.color, names["rgb"])
        self._count.value, self._size.value = _count(look), look.point_size
        self._cut.value = CUTS[look.cut]
        self._orthographic.value = look.orthographic
        for field, box in self._toggles.items():
            box.value = getattr(look, field)
        for field, widget in self._slice.items():
            widget.value = getattr(look.slice, field)

    def _reset(self, session: Session) -> None:
        session.update(lambda s: s.showing(orthographic=False))
        session.camera.project(orthographic=False)
        session.look_from("oblique")

    def _recolored(self, state: StudioState, label: str) -> StudioState:
        names = color_names(state.design)
        return state.showing(color=next((n for n, text in names.items() if text == label), "rgb"))


def _sliced(state: StudioState, field: str, value: Any) -> StudioState:
    return state.showing(slice=replace(state.appearance.slice, **{field: value}))


def _count(look: Appearance) -> str:
    return f"{1 << look.level:,}"
