"""Tabs of the page: each panel declares its fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from softreach.studio.fields import Fields, attempt
from softreach.studio.jobs import SCENE_JOBS
from softreach.studio.session import Session
from softreach.studio.tabs import compare, design, export, goals, move, view

TABS: dict[str, tuple[Callable[[Fields], None], ...]] = {
    "Design": (design.design,),
    "Parts": (design.loads, design.tool, design.arm_parts),
    "Move": (move.drag, move.activation, move.target, move.path),
    "View": (view.view, view.plots),
    "Compare": (compare.compare,),
    "Goals": (goals.needs, goals.measured),
    "Export": (export.export,),
}
JOBS = (*SCENE_JOBS, *move.JOBS, *goals.JOBS)  # every kind of work that a tab has done for it


def furnish(session: Session) -> None:
    """Add all panels to the page of a session."""
    panels = [Fields(session)]
    view.status(panels[0])
    tabs = session.client.gui.add_tab_group()
    for name, declared in TABS.items():
        with tabs.add_tab(name):
            for declare in declared:
                panels.append(Fields(session))
                declare(panels[-1])
    session.panels = [panel.show for panel in panels]

    @session.client.scene.on_click()
    def _(event: Any) -> None:
        attempt(session, lambda: click(session, event.ray_origin, event.ray_direction))


def click(session: Session, origin: Any, direction: Any) -> None:
    """Do what the mouse is for with the place under the cursor."""
    uses: dict[str, Callable[[Any], object]] = {
        "target": session.aim,
        "path": lambda place: move.extend_path(session, place),
        "place": lambda place: goals.add_place(session, place),
    }
    use = uses.get(session.state.appearance.mouse)
    if use is not None and (place := session.picked_place(origin, direction)) is not None:
        use(place)
