"""From a widget that a person moves to a change of the session's state."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from softreach.studio.state import StudioState

if TYPE_CHECKING:
    from softreach.studio.session import Session

__all__ = ["attempt", "bind", "bind_button"]


def bind(widget: Any, session: Session, change: Callable[[StudioState, Any], StudioState]) -> None:
    """Change the state by what the widget holds whenever a person moves it.

    Events run at once and in any order: each reads what the widget holds by then, so that the last
    one has it right. Widgets that we set ourselves also send events, without a client.
    """

    def moved(event: Any) -> None:
        if event.client_id is not None:
            attempt(
                session, lambda: session.update(lambda s: change(s, widget.value), by_widget=True)
            )

    widget.on_update(moved)


def bind_button(button: Any, session: Session, action: Callable[[], object]) -> None:
    """Act whenever a person presses the button."""
    button.on_click(lambda _: attempt(session, action))


def attempt(session: Session, action: Callable[[], object]) -> None:
    """Act, and show the reader what is wrong if that fails."""
    try:
        action()
    except Exception as error:  # whoever presses a button sees no log
        session.fail(error)
