"""Undo, redo and reset, above all tabs and on the keyboard."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from softreach.studio.panels.binding import attempt

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

__all__ = ["HistoryPanel"]

_HINT = (
    "Undo and redo changes of design, activation and target (Ctrl+Z, Ctrl+Shift+Z; Cmd on a Mac); "
    "reset to what the studio was opened on. The view stays."
)


class HistoryPanel:
    """A row of buttons, and the keys that do the same; text fields keep their own undo."""

    def __init__(self, gui: GuiApi, session: Session) -> None:
        """Add the widgets."""
        self._session = session
        actions: dict[str, Callable[[], None]] = {
            "Undo": lambda: session.step(back=True),
            "Redo": lambda: session.step(back=False),
            "Reset": session.reset,
        }
        row = gui.add_button_group("history", tuple(actions), hint=_HINT)
        row.on_click(lambda _: attempt(session, actions[row.value]))
        self._bind(gui.add_command("Undo", hotkey="Z", modifier="cmd/ctrl"), actions["Undo"])
        again: Any = "cmd/ctrl+shift"
        self._bind(gui.add_command("Redo", hotkey="Z", modifier=again), actions["Redo"])
        self._bind(gui.add_command("Reset the design"), actions["Reset"])

    def show(self, session: Session) -> None:
        """Nothing here depends on the state."""

    def _bind(self, command: Any, action: Callable[[], None]) -> None:
        command.on_trigger(lambda _: attempt(self._session, action))
