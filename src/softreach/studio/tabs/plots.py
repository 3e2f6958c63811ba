"""Choice of the plots that stand beside the scene, and the window with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.fields import Attribute, Fields
from softreach.studio.plots import PLOTS
from softreach.studio.plots.plot import Plot
from softreach.studio.widgets import Line

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HINT = (
    "Plots stand in a window of their own beside the scene (on a phone in Figures, at the end of "
    "this sheet) and follow the arm, the design and the slice. What is not checked is not computed."
)
_WIDTH = 380  # pixels
_COMPUTING = "computing ..."


class _Place:
    def __init__(self, gui: GuiApi, kind: type[Plot]) -> None:
        self.name = kind.name
        self._folder = gui.add_folder(kind.label, visible=False)
        with self._folder:
            self._text = Line(gui, _COMPUTING)
        self._plot = kind(gui, self._folder)
        self._drawn: Any = None
        self._caption = _COMPUTING

    def show(self, session: Session) -> None:
        self._folder.visible = self.name in session.state.appearance.plots.shown
        result = session.figures.plots.get(self.name)
        if not self._folder.visible or result is None:
            return
        if result is not self._drawn:
            self._drawn, self._caption = result, self._plot.show(result)
        old = result.arm != session.state.design
        self._text.say(self._caption, " · of the design before, computing ..." if old else "")


class PlotsPanel:
    """Check boxes in the tab; a folder for each plot in the window."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._fields = Fields(session, dragged=False)
        with tab:
            Line(gui, _HINT)
            for kind in PLOTS:
                self._fields.checkbox(kind.label, _switch(kind.name), kind.hint)
            for kind in PLOTS:
                kind.add_settings(self._fields)
        self._window = gui.add_panel(visible=False)
        with self._window.add_tab("Figures"):
            self._places = [_Place(gui, kind) for kind in PLOTS]

    def show(self, session: Session) -> None:
        """Show what is known of the plots that are wanted."""
        self._fields.show(session)
        shown = session.state.appearance.plots.shown
        if shown and not self._window.visible:
            self._window.visible = True
            self._window.dock_left()  # a page forgets where a hidden window was
            self._window.set_width(_WIDTH)
        self._window.visible = bool(shown)
        for place in self._places:
            place.show(session)


def _switch(name: str) -> Attribute:
    return Attribute(
        lambda state: name in state.appearance.plots.shown,
        lambda state, on: state.showing(plots=state.appearance.plots.showing(name, on)),
    )
