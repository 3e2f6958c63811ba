"""Looks of a tab: colors, slice, surfaces, camera, and the plots beside the scene."""

from __future__ import annotations

from typing import Any

from softreach.studio.fields import Attribute, Fields, attribute
from softreach.studio.found import Found
from softreach.studio.plots.chart import Chart, Curve
from softreach.studio.plots.sweep import Sweep, swept_parameter
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.clouds import color_names
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import StudioState
from softreach.studio.widgets import PictureFrame
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
        size = lambda state, _: (state.design.length_unit, state.design.length)  # noqa: E731
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
_VOLUME = Curve("V", "#2f6db5", points=True)


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
        folders = {name: _figure(panel, name) for name in _PLOTS}
    frame, chart = PictureFrame(panel.gui, folders["section"]), Chart(panel.gui, folders["sweep"])

    def draw(_: StudioState, found: Found) -> None:
        if found.section is not None:
            frame.show(found.section.image)
        if found.sweep is not None and len(found.sweep.value) > 1:
            _draw_sweep(chart, found.sweep)

    panel.follow("found.section", "found.sweep", show=draw)


def _figure(panel: Fields, name: str) -> Any:
    """A folder with a line on what is seen in it."""

    def text(state: StudioState, found: Found) -> tuple[str, ...]:
        known: Any = getattr(found, name)
        if known is None:
            return (_COMPUTING,)
        about = _sweep_text(known) if isinstance(known, Sweep) else known.text
        old = known.arm != state.design
        return (about, " · of the design before, computing ..." if old else "")

    shown = lambda state, _: name in state.appearance.plots.shown  # noqa: E731
    with panel.folder(_PLOTS[name][0], shown) as folder:
        panel.text("design", f"found.{name}", content=text)
    return folder


def _draw_sweep(chart: Chart, known: Sweep) -> None:
    unit, parameter = known.arm.length_unit, known.parameter
    volumes = unit.of(known.volume, 3)
    here, y = parameter.shown, unit.label("V", 3)
    chart.show(parameter.label, known.value, (_VOLUME,), (volumes,), here, y=y)


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
    return state.showing(plots=state.appearance.plots.showing("sweep").sweeping(name))


def _sweep_text(known: Sweep) -> str:
    unit, parameter = known.arm.length_unit, known.parameter
    volumes = known.volume[known.value == parameter.shown]
    parts = [f"here V = {unit.rounded(v, 3)} at {parameter.shown:g}" for v in volumes]
    if known.refused:
        parts.append(f"{len(known.refused)} values make no design or take too long")
    return " · ".join([*parts, *([] if known.complete else [_COMPUTING])])
