"""Which map of an atlas the board shows; a click on it loads the design under it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.studio.atlas_map import MapBoard, map_choices, metric_names, nearest_numbers
from softreach.studio.panels.binding import attempt, bind
from softreach.studio.panels.line import Line
from softreach.studio.panels.picture import PictureFrame
from softreach.studio.state import MapView, StudioState

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["AtlasPanel"]

_HINT = (
    "Click the map beside the arm to load a design; the ball is the present one. Parameters that "
    "the map does not show are held at the value nearest to the present design's."
)


class AtlasPanel:
    """Metric and parameters of the map."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session, board: MapBoard) -> None:
        """Add the widgets."""
        self._session, self._board, self._atlas = session, board, board.atlas
        self._revision = -1
        self._explained: tuple[Manipulator, str] | None = None
        names = tuple(str(dim) for dim in self._atlas["status"].dims)
        with tab:
            Line(gui, _HINT)
            self._metric = gui.add_dropdown(
                "metric", tuple(metric_names(self._atlas)), hint="What the map shows"
            )
            self._right = gui.add_dropdown(
                "to the right", names, hint="The parameter from left to right"
            )
            self._up = gui.add_dropdown("upward", names, hint="The parameter from bottom to top")
            self._visible = gui.add_checkbox("show the map", True, hint="Beside the arm")
            self._numbers = Line(gui)
            self._picture = PictureFrame(gui, gui.add_folder("the map"))
        bind(self._metric, session, lambda s, name: _viewed(s, metric=name))
        bind(self._right, session, lambda s, name: self._turned(s, "right", name))
        bind(self._up, session, lambda s, name: self._turned(s, "up", name))
        bind(self._visible, session, lambda s, on: _viewed(s, shown=on))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        if self._board.map is not None:
            self._picture.show(self._board.map.image)
        if session.revision != self._revision:
            self._revision = session.revision
            attempt(session, lambda: self._follow(session.state.appearance.map))
        self._explain(session.state)

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Load the design under the cursor; return whether the map is there."""
        at = self._board.parameters_under(origin, direction)
        if at:
            attempt(self._session, lambda: self._load(at))
        return at is not None

    def _follow(self, view: MapView) -> None:
        metric, right, up = map_choices(self._atlas, view)
        self._metric.value, self._right.value, self._up.value = metric, right, up
        self._visible.value = view.shown

    def _explain(self, state: StudioState) -> None:
        """Say what the atlas knows of the nearest design; once for each design and metric."""
        asked = state.design, state.appearance.map.metric
        if asked != self._explained:
            self._explained = asked
            metric, *_ = map_choices(self._atlas, state.appearance.map)
            self._numbers.say(nearest_numbers(self._atlas, metric, state.design))

    def _turned(self, state: StudioState, axis: str, name: str) -> StudioState:
        """A parameter on one axis; the other axis takes what this one had if it is the same."""
        _, right, up = map_choices(self._atlas, state.appearance.map)
        axes = {"right": right, "up": up}
        other = "up" if axis == "right" else "right"
        if axes[other] == name:
            axes[other] = axes[axis]
        axes[axis] = name
        self._right.value, self._up.value = axes["right"], axes["up"]
        return _viewed(state, **axes)

    def _load(self, at: dict[str, float]) -> None:
        from softreach.atlas import atlas_design

        design = atlas_design(self._atlas, **at)
        self._session.update(lambda state: state.replace(design=design))


def _viewed(state: StudioState, **changes: Any) -> StudioState:
    return state.showing(map=replace(state.appearance.map, **changes))
