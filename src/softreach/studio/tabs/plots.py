"""Which plots stand beside the scene, and the window with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.studio.fields import Line, PictureFrame, bind
from softreach.studio.plots.plot import Chart, Curve
from softreach.studio.plots.sweep import Sweep, swept_control
from softreach.studio.plots.volumes import VolumeCurve
from softreach.studio.shown_parameters import controls
from softreach.studio.state import StudioState

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["PlotsPanel"]

_HINT = (
    "Plots stand in a window of their own beside the scene (on a phone in Figures, at the end of "
    "this sheet) and follow the arm, the design and the slice. What is not checked is not computed."
)
_WIDTH = 380  # pixels
_BLUE, _ORANGE, _GREEN, _GRAY = "#2f6db5", "#e8590c", "#2b8a3e", "#868e96"
_COMPUTING = "computing ..."
_PLOTS = {
    "along_arm": (
        "along the arm",
        "curvature κ and torsion u₃ (times L) and axial extension ζ at stations Z, in the "
        "present activation",
    ),
    "section": (
        "section",
        "the reachable set in the plane of the slice (tab View; without a slice y = 0): its "
        "boundary, and how many activations reach each place",
    ),
    "histogram": (
        "activations",
        "how often the samples that the slice leaves pull each bundle how much",
    ),
    "volume_curve": (
        "V against α",
        "V(α): volume of the α-shape of the cloud against the radius α, beside the exact volume",
    ),
    "sweep": (
        "V against parameter",
        "volume of designs that differ from this one in one parameter, computed while you look",
    ),
}


class PlotsPanel:
    """Check boxes in the tab; a folder for each plot in the window."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._revision = -1
        self._labels: dict[str, str] = {}
        with tab:
            Line(gui, _HINT)
            self._boxes = {
                name: gui.add_checkbox(label, False, hint=hint)
                for name, (label, hint) in _PLOTS.items()
            }
            self._parameter: Any = gui.add_dropdown(
                "parameter", ("",), hint="what changes in the plot of V against a parameter"
            )
        self._window = gui.add_panel(visible=False)
        with self._window.add_tab("Figures"):
            self._folders = {
                name: gui.add_folder(label, visible=False) for name, (label, _) in _PLOTS.items()
            }
        self._furnish(gui)
        for name, box in self._boxes.items():
            bind(box, session, lambda s, on, name=name: _wished(s, **{name: on}))
        bind(self._parameter, session, self._chosen)

    def _furnish(self, gui: GuiApi) -> None:
        folders = self._folders
        self._text: dict[str, Line] = {}
        for name, folder in folders.items():
            with folder:
                self._text[name] = Line(gui, _COMPUTING)
        place = "Z / L"
        self._curvature = Chart(gui, folders["along_arm"], place, "curvature × L")
        self._strain = Chart(gui, folders["along_arm"], place, "extension ζ")
        self._volumes = Chart(gui, folders["volume_curve"], "α / L", "V / L³", logarithmic=True)
        self._sweep: Chart | None = None
        self._gui = gui
        self._section = PictureFrame(gui, folders["section"])
        self._histogram = PictureFrame(gui, folders["histogram"])

    def show(self, session: Session) -> None:
        """Show what is known of the plots that are wanted."""
        wish, figures = session.state.appearance.plots, session.figures
        self._follow(session)
        shown: dict[str, Callable[[], None]] = {
            "along_arm": lambda: self._show_arm(session),
            "volume_curve": lambda: self._show_volumes(session, figures.volume_curve),
            "sweep": lambda: self._show_sweep(session, figures.sweep),
            "section": lambda: self._show_picture("section", session),
            "histogram": lambda: self._show_picture("histogram", session),
        }
        for name, draw in shown.items():
            if getattr(wish, name):
                draw()

    def _follow(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        wish = session.state.appearance.plots
        for name, folder in self._folders.items():
            _set_visible(folder, getattr(wish, name))
        if wish.any and not self._window.visible:
            self._window.visible = True
            self._window.dock_left()  # a page forgets where a hidden window was
            self._window.set_width(_WIDTH)
        _set_visible(self._window, wish.any)
        self._offer(session.state)
        if session.revision != self._revision:
            self._revision = session.revision
            for name, box in self._boxes.items():
                box.value = getattr(wish, name)

    def _offer(self, state: StudioState) -> None:
        """The parameters that the design has."""
        labels = {control.label: control.name for control in controls(state.design)}
        if labels != self._labels:
            self._labels = labels
            self._parameter.options = tuple(labels)
        control = swept_control(state.design, state.appearance.plots.parameter)
        if control is not None and self._parameter.value != control.label:
            self._parameter.value = control.label

    def _chosen(self, state: StudioState, label: str) -> StudioState:
        return _wished(state, parameter=self._labels.get(label, ""), sweep=True)

    def _show_arm(self, session: Session) -> None:
        found = session.figures.along_arm
        if found is None or not found.known:
            self._text["along_arm"].say("There is no equilibrium in this activation.")
            return
        z = found.station
        bending, torsion = Curve("bending κL", _BLUE), Curve("torsion u₃L", _ORANGE)
        self._text["along_arm"].say(
            f"largest κL {found.bending.max():.4g} · mean ζ {found.extension.mean():.4g}"
        )
        self._curvature.show(z, (bending, torsion), (found.bending, found.torsion))
        one = Curve("no strain", _GRAY, dashed=True)
        values = found.extension, np.ones_like(z)
        self._strain.show(z, (Curve("ζ", _GREEN), one), values)

    def _show_volumes(self, session: Session, found: VolumeCurve | None) -> None:
        if found is None:
            return
        exact = np.full_like(found.radius, found.exact)
        convex = np.full_like(found.radius, found.convex)
        curves = [Curve("V(α)", _BLUE)]
        values = [found.volume]
        if np.isfinite(found.exact) and np.isfinite(found.convex):
            curves += [Curve("exact", "#495057"), Curve("convex hull", _GRAY, dashed=True)]
            values += [exact, convex]
        self._volumes.show(found.radius, curves, values)
        at = float(np.interp(0.05, found.radius, found.volume))
        self._text["volume_curve"].say(
            f"V(0.05 L) = {at:.4f} L³ of {found.samples:,} samples", _age(found.arm, session)
        )

    def _show_sweep(self, session: Session, found: Sweep | None) -> None:
        if found is None:
            self._text["sweep"].say(_COMPUTING)
            return
        if self._sweep is None or self._label != found.control.label:
            if self._sweep is not None:
                self._sweep.remove()
            self._label = found.control.label
            self._sweep = Chart(self._gui, self._folders["sweep"], self._label, "V / L³")
        if len(found.value) > 1:
            self._sweep.show(found.value, (Curve("V", _BLUE, points=True),), (found.volume,))
        self._text["sweep"].say(*_sweep_text(found), _age(found.arm, session))

    def _show_picture(self, name: str, session: Session) -> None:
        found = getattr(session.figures, name)
        frame = self._section if name == "section" else self._histogram
        if found is not None:
            frame.show(found.image)
            self._text[name].say(found.text, _age(found.arm, session))


def _sweep_text(found: Sweep) -> list[str]:
    here = np.flatnonzero(found.value == found.control.shown)
    parts = []
    if len(here):
        parts.append(f"here V = {found.volume[here[0]]:.4f} L³ at {found.control.shown:g}")
    if found.refused:
        parts.append(f"{found.refused} values make no design or take too long")
    if not found.complete:
        parts.append(_COMPUTING)
    return [" · ".join(parts)]


def _age(arm: object, session: Session) -> str:
    """What is of the design before says so."""
    return "" if arm == session.state.design else " · of the design before, computing ..."


def _set_visible(widget: Any, visible: bool) -> None:
    if widget.visible != visible:
        widget.visible = visible


def _wished(state: StudioState, **changes: Any) -> StudioState:
    return state.showing(plots=replace(state.appearance.plots, **changes))
