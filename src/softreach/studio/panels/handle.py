"""A handle on the tip: drag it, and the arm follows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.studio.jobs.inverse import DragTip
from softreach.studio.panels.binding import bind
from softreach.studio.panels.line import Line
from softreach.studio.scene.drag import DragBall
from softreach.studio.state import rod_of

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["HandlePanel"]

_HINT = "Drag the ball on the tip: the arm follows on its branch of solutions."


class HandlePanel:
    """The ball, and whether it is shown."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._session, self._revision = session, -1
        self._grip = DragBall(session.client.scene, session.job(DragTip).order)
        with tab:
            self._text = Line(gui, _HINT)
            self._shown = gui.add_checkbox(
                "handle on the tip", session.state.appearance.handle, hint=_HINT
            )
        bind(self._shown, session, lambda s, on: s.showing(handle=on))

    def show(self, session: Session) -> None:
        """Keep the ball on the tip."""
        state, drag = session.state, session.drag
        if session.revision != self._revision:
            self._revision = session.revision
            self._shown.value = state.appearance.handle
        movable = rod_of(state.design).box.dimension > 0
        grasped = state.appearance.handle and state.appearance.arm and movable
        arm = state.design
        radius = float(arm.profile.radius(arm.length)) / arm.length
        self._grip.move(session.tip if grasped else None, radius, dark=state.appearance.dark)
        if drag is None:
            self._text.say(_HINT)
            self._grip.show_lag(None, None)
            return
        gap = drag.dragged.gap / arm.length
        self._text.say(f"This branch ends {gap:.3f} L short of the pointer." if gap else _HINT)
        self._grip.show_lag(drag.wanted, drag.dragged.tip / arm.length, gap)
