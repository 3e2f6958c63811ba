"""Plots beside the scene: which are shown, and the window with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.fields import Attribute, Fields
from softreach.studio.figures import swept_parameter
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import StudioState
from softreach.studio.widgets import Line, PictureFrame, show_where

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HINT = (
    "Plots stand in a window of their own beside the scene (on a phone in Figures, at the end of "
    "this sheet) and follow the arm, the design and the slice. What is not checked is not computed."
)
_LABELS = {"section": "section", "sweep": "V against parameter"}
_ABOUT = {
    "section": "The reachable set in the plane of the slice (tab View; without a slice y = 0): its "
    "boundary, and how many activations reach each place",
    "sweep": "Volume of designs that differ from this one in one parameter, computed as you look",
}
_WIDTH = 380  # pixels
_COMPUTING = "computing ..."


class PlotsPanel:
    """Check boxes in the tab; a folder for each plot in the window."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._fields = fields = Fields(session, dragged=False)
        with tab:
            Line(gui, _HINT)
            for name, label in _LABELS.items():
                fields.checkbox(label, _switch(name), _ABOUT[name])
            about = "What changes in the plot of V against a parameter"
            fields.dropdown("parameter", _offered, Attribute(_swept, _sweeping), about)
        self._window = gui.add_panel(visible=False)
        with self._window.add_tab("Figures"):
            self._folders = {name: gui.add_folder(text) for name, text in _LABELS.items()}
            self._texts = {name: self._text(gui, folder) for name, folder in self._folders.items()}
        self._frames = {name: PictureFrame(gui, place) for name, place in self._folders.items()}

    def _text(self, gui: GuiApi, folder: Any) -> Line:
        with folder:
            return Line(gui, _COMPUTING)

    def show(self, session: Session) -> None:
        """Show what is known of the plots that are wanted."""
        self._fields.show(session)
        found, shown = session.found, session.state.appearance.plots.shown
        if shown and not self._window.visible:
            self._window.visible = True
            self._window.dock_left()  # a page forgets where a hidden window was
            self._window.set_width(_WIDTH)
        self._window.visible = bool(shown)
        for name, folder in self._folders.items():
            show_where(name in shown, folder)
            picture = getattr(found, name)
            if name in shown and picture is not None:
                self._frames[name].show(picture.image)
                old = picture.arm != session.state.design
                more = " · of the design before, computing ..." if old else ""
                self._texts[name].say(picture.text, more)


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
