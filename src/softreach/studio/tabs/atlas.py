"""Map of an atlas: its metric and parameters; a click on it loads the design under it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from softreach.arm.manipulator import Manipulator
from softreach.studio.atlas_map import map_choices, metric_names, nearest_numbers
from softreach.studio.fields import Attribute, Fields, attempt, attribute
from softreach.studio.state import MapView, StudioState
from softreach.studio.widgets import Line, PictureFrame
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HINT = (
    "Click the map beside the arm to load a design; the ball is the present one. Parameters that "
    "the map does not show are held at the value nearest to the present design's."
)


class AtlasPanel:
    """Metric and parameters of the map."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        board = session.board
        assert board is not None
        self._session, self._board, self._atlas = session, board, board.atlas
        self._explained: tuple[Manipulator, str] | None = None
        self._fields = fields = Fields(session, dragged=False)
        names = {name: name for name in map(str, self._atlas["status"].dims)}
        with tab, gui.add_folder("map of the atlas"):
            Line(gui, _HINT)
            fields.dropdown(
                "metric",
                {name: name for name in metric_names(self._atlas)},
                self._choice("metric"),
                "What the map shows",
            )
            fields.dropdown(
                "to the right", names, self._choice("right"), "The parameter from left to right"
            )
            fields.dropdown("upward", names, self._choice("up"), "The parameter from bottom to top")
            fields.checkbox("show the map", attribute("appearance.map.shown"), "Beside the arm")
            self._numbers = Line(gui)
            self._picture = PictureFrame(gui, gui.add_folder("the map", expand_by_default=False))

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the state."""
        if self._board.map is not None:
            self._picture.show(self._board.map.image)
        self._fields.show(session)
        self._explain(session.state)

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Load the design under the cursor; return whether the map is there."""
        at = self._board.parameters_under(origin, direction)
        if at:
            attempt(self._session, lambda: self._load(at))
        return at is not None

    def _choice(self, name: str) -> Attribute:
        """Metric or parameter of the map; an axis takes what the other had if it is the same."""

        def write(state: StudioState, value: str) -> StudioState:
            choices = self._choices(state)
            other = {"right": "up", "up": "right"}.get(name)
            if other and choices[other] == value:
                choices[other] = choices[name]
            return state.showing(map=replace(state.appearance.map, **(choices | {name: value})))

        return Attribute(lambda state: self._choices(state)[name], write)

    def _choices(self, state: StudioState) -> dict[str, str]:
        """Metric and axes of the map; the first there are, if the state is of another atlas."""
        try:
            choices = map_choices(self._atlas, state.appearance.map)
        except InvalidInput:  # which the map says
            choices = map_choices(self._atlas, MapView())
        return dict(zip(("metric", "right", "up"), choices, strict=True))

    def _explain(self, state: StudioState) -> None:
        """Say what the atlas knows of the nearest design; once for each design and metric."""
        key = state.design, state.appearance.map.metric
        if key != self._explained:
            self._explained = key
            metric = self._choices(state)["metric"]
            self._numbers.say(nearest_numbers(self._atlas, metric, state.design))

    def _load(self, at: dict[str, float]) -> None:
        from softreach.atlas import atlas_design

        design = atlas_design(self._atlas, **at)
        self._session.update(lambda state: state.replace(design=design))
