"""Looks of a tab: colors, slice, surfaces, camera, and the plots beside the scene."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter

from softreach.studio.fields import Attribute, Fields, attribute
from softreach.studio.figures import Picture, swept_parameter
from softreach.studio.found import Found
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.colors import color_names
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import StudioState
from softreach.support.units import LengthUnit

_ACROSS = {axis: axis for axis in ("none", "x", "y", "z")}
_TOGGLES = {
    "arm": ("arm", "The body and its bundles in the present activation"),
    "surface": ("exact surface", "Boundary of all that the tip reaches, from the map itself"),
    "cloud": ("cloud", "Tips of sampled activations"),
    "half": ("half of the cloud", "Cuts away the half in front of the arm, so that it is seen"),
    "dark": ("dark page", "Light on dark"),
}


def view(panel: Fields) -> None:
    """Fields of the appearance."""
    panel.dropdown(
        "color by",
        lambda state: color_names(state.design),
        Attribute(_color, lambda state, name: state.showing(color=name)),
        "What the color of a point says; the key is above the tabs",
    )
    with panel.folder("show"):
        for name, (label, hint) in _TOGGLES.items():
            panel.checkbox(label, attribute(f"appearance.{name}"), hint)
    looks = {name: lambda name=name: panel.session.look_from(name) for name in VIEWS}
    panel.choices("look from", looks, "Along an axis of the world, or between them")
    axis = attribute("appearance.slice.axis")
    panel.dropdown("slice across", _ACROSS, axis, "Hides all but a slab across this axis")
    with panel.folder("slab", lambda state, _: axis.read(state) != "none") as slab:
        size = lambda state, _: (state.design.length_unit, state.design.length)
        panel.anew(slab, "design", key=size, build=_center)


def _center(panel: Fields, size: tuple[LengthUnit, float]) -> None:
    """The middle of the slab, in the unit of the design."""
    (unit, length), center = size, attribute("appearance.slice.center")
    over = length / unit.size
    at = Attribute(
        lambda state: float(f"{over * center.read(state):.9g}"),
        lambda state, value: center.write(state, value / over),
    )
    ends = -1.5 * over, 1.5 * over
    panel.slider(unit.label("center"), ends, 0.01 * over, at, "Middle of the slab along the axis")


def _color(state: StudioState) -> str:
    """The color that is shown: a design may have none of the one that is asked for."""
    color = state.appearance.color
    return color if color in color_names(state.design) else "rgb"


# Plots beside the scene

_HINT = (
    "Plots stand in a window of their own beside the scene (on a phone in Figures, at the end of "
    "this sheet) and follow the arm, the design and the slice. What is not checked is not computed."
)
_PLOTS = {
    "section": (
        "section",
        "The reachable set in the plane of the slice (tab View; without a slice y = 0): its "
        "boundary, and how many activations reach each place",
    ),
    "sweep": (
        "V against parameter",
        "Volume of designs that differ from this one in one parameter, computed as you look",
    ),
}
_WIDTH = 380  # pixels
_COMPUTING = "computing ..."


def plots(panel: Fields) -> None:
    """Check boxes in the tab; a folder for each plot in the window."""
    panel.say(_HINT)
    for name, (label, hint) in _PLOTS.items():
        panel.checkbox(label, _switch(name), hint)
    about = "What changes in the plot of V against a parameter"
    panel.dropdown("parameter", _offered, Attribute(_swept, _sweeping), about)
    window = panel.gui.add_panel(visible=False)

    def place(state: StudioState, _: Found) -> None:
        shown = bool(state.appearance.plots.shown)
        if shown and not window.visible:
            window.visible = True
            window.dock_left()  # a page forgets where a hidden window was
            window.set_width(_WIDTH)
        window.visible = shown

    panel.follow("appearance.plots", show=place)
    with window.add_tab("Figures"):
        for name in _PLOTS:
            _figure(panel, name)


def _figure(panel: Fields, name: str) -> None:
    """A folder with a picture and a line on it."""
    known: Callable[[Found], Picture | None] = attrgetter(name)

    def text(state: StudioState, found: Found) -> tuple[str, ...]:
        picture = known(found)
        if picture is None:
            return (_COMPUTING,)
        old = picture.arm != state.design
        return (picture.text, " · of the design before, computing ..." if old else "")

    shown = lambda state, _: name in state.appearance.plots.shown
    with panel.folder(_PLOTS[name][0], shown) as folder:
        panel.text("design", f"found.{name}", content=text)
    panel.picture(folder, f"found.{name}", image=lambda _, f: (p := known(f)) and p.image)


def _switch(name: str) -> Attribute:
    return Attribute(
        lambda state: name in state.appearance.plots.shown,
        lambda state, on: state.showing(plots=state.appearance.plots.showing(name, on)),
    )


def _offered(state: StudioState) -> dict[str, str]:
    return {slider.name: slider.label for slider in slider_parameters(state.design)} or {"": ""}


def _swept(state: StudioState) -> str:
    parameter = swept_parameter(state)
    return "" if parameter is None else parameter.name


def _sweeping(state: StudioState, name: str) -> StudioState:
    return state.showing(plots=state.appearance.plots.showing("sweep", parameter=name))
