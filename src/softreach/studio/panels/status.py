"""What is known of the design at this moment: volume, unreachability, and what colors mean."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softreach.studio.colors import key_html

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.reach import Reach
    from softreach.studio.session import Session

__all__ = ["StatusPanel", "reach_text"]


class StatusPanel:
    """Text above all tabs."""

    def __init__(self, gui: GuiApi) -> None:
        """Add the widgets."""
        self._numbers = gui.add_markdown("computing ...")
        self._key = gui.add_html("")
        self._note = gui.add_markdown("", visible=False)

    def show(self, session: Session) -> None:
        """Show what is known, and whether it is about to change."""
        reach = session.reach
        self._numbers.content = "computing ..." if reach is None else _known_text(session, reach)
        self._key.content = key_html(session.key)
        self._note.content, self._note.visible = session.note, bool(session.note)


def _known_text(session: Session, reach: Reach) -> str:
    stale = reach.arm != session.state.design
    hull = reach.alpha_volume if session.state.appearance.alpha_shape else None
    hull_text = f" · α-shape {hull:.4f} L³" if hull is not None else ""
    return reach_text(reach) + hull_text + (" · computing ..." if stale or not reach.fine else "")


def reach_text(reach: Reach) -> str:
    """The numbers of a reach in one line."""
    name, value, error, unit = reach.size
    parts = [f"**{name} {value:.4f} ± {error:.1g} {unit}**"]
    if not math.isnan(reach.unreachability):
        parts.append(f"**UNR {100 * reach.unreachability:.2f} %**")
    return " · ".join([*parts, f"{reach.samples:,} samples"])
