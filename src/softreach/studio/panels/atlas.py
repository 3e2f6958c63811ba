"""The map of an atlas in the scene; a click loads the design under it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.studio.atlas_map import AtlasMap, atlas_map, metric_names
from softreach.studio.panels.binding import told
from softreach.studio.picking import plane_crossing

if TYPE_CHECKING:
    import xarray as xr
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["AtlasPanel"]

_CENTER = np.array([-1.7, 0.0, 0.5])
_SIZE = 1.6  # [L]
_UPRIGHT = (np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0)  # the picture's down goes to -z


class AtlasPanel:
    """Which metric the map shows."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session, atlas: xr.Dataset) -> None:
        """Add the widgets and the map."""
        self._session, self._atlas = session, atlas
        self._map: AtlasMap | None = None
        names = metric_names(atlas)
        with tab:
            gui.add_markdown("Click the map beside the arm to load a design.")
            self._metric = gui.add_dropdown("metric", tuple(names), initial_value=names[0])
            self._visible = gui.add_checkbox("show the map", True)
        self._metric.on_update(lambda _: told(session, self.draw))
        self._visible.on_update(lambda _: told(session, self.draw))
        told(session, self.draw)

    def show(self, session: Session) -> None:
        """The map does not depend on the tab's state."""

    def draw(self) -> None:
        """Put the map into the scene, or take it out."""
        self._session.scene.remove("/atlas")
        self._map = self._session.map_image = None
        if self._visible.value:
            self._map = atlas_map(self._atlas, self._metric.value)
            self._session.map_image = self._map.image
            self._session.scene.draw_picture(
                "/atlas/map", self._map.image, _SIZE, _CENTER, _UPRIGHT
            )

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Load the design under the cursor, and whether the map is there."""
        if self._map is None:
            return False
        hit = plane_crossing(origin, direction, _CENTER, (0.0, 1.0, 0.0))
        if hit is None:
            return False
        right, up = (hit - _CENTER)[[0, 2]] / _SIZE + 0.5
        if not (0 <= right <= 1 and 0 <= up <= 1):
            return False
        at = self._map.parameters_at(float(right), float(up))
        if at is not None:
            told(self._session, lambda: self._load(at))
        return True

    def place_of(self, **at: float) -> NDArray[np.float64]:
        """Where in the scene the map shows a design [L]."""
        assert self._map is not None
        right, up = self._map.place_of(**at)
        return _CENTER + _SIZE * np.array([right - 0.5, 0.0, up - 0.5])

    def _load(self, at: dict[str, float]) -> None:
        from softreach.atlas import atlas_design

        design = atlas_design(self._atlas, **at)
        self._session.scene.draw_mark("/atlas/here", self.place_of(**at))
        self._session.update(lambda state: state.replace(design=design))
