"""Status of the design above all tabs: its numbers, the key to colors, and undo, redo, reset."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from softreach.studio import markup
from softreach.studio.captions import legend_text, loaded_share, reach_text
from softreach.studio.fields import attempt, bind_button
from softreach.studio.markup import Part, Strong
from softreach.studio.needs import verdict_text
from softreach.studio.scene.colors import key_html
from softreach.studio.widgets import Line, show_where

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

_HISTORY_HINT = (
    "Undo and redo changes of design, activation and target (Ctrl+Z, Ctrl+Shift+Z; Cmd on a Mac); "
    "reset to what the studio was opened on. The view stays."
)
_NOTE_SECONDS = 12.0
_CANCEL, _GO_ON = "Cancel", "Compute what is missing"
_ABOUT_CANCEL = "Stops what is being computed; what is complete stays. Every change starts anew."


class StatusPanel:
    """Numbers, key and notes above all tabs."""

    def __init__(self, gui: GuiApi, session: Session) -> None:
        self._known = Line(gui, "computing ...")
        self._note, self._toast = "", None
        self._cancel = gui.add_button(_CANCEL, visible=False, hint=_ABOUT_CANCEL)
        bind_button(
            self._cancel, session, lambda: (session.cancel if session.busy else session.resume)()
        )

    def show(self, session: Session) -> None:
        """Show what is known, and whether it is about to change."""
        check = session.found.check
        lines = [_numbers_text(session), [verdict_text(check)] if check is not None else []]
        marks = [markup.paragraph(*line) for line in _marks(session)]
        self._known.show(
            markup.status(
                *(markup.paragraph(*line) for line in lines),
                key_html(session.found.key),
                *marks,
            )
        )
        self._tell(session)
        self._offer(session)

    def _tell(self, session: Session) -> None:
        if session.note == self._note:
            return
        self._note = session.note
        if self._toast is not None:
            self._toast.remove()
        self._toast = (
            session.client.add_notification("", self._note, auto_close_seconds=_NOTE_SECONDS)
            if self._note
            else None
        )

    def _offer(self, session: Session) -> None:
        busy, lacking = session.busy, is_behind(session) and not session.found.refusal
        label = _GO_ON if lacking and not busy else _CANCEL
        if self._cancel.label != label:
            self._cancel.label = label
        show_where(busy or lacking, self._cancel)


def _marks(session: Session) -> list[list[Part]]:
    reach = session.found.reach
    if reach is None:
        return []
    free = session.found.free is not None
    lines = [legend_text(reach, free=free)]
    if reach.refusal:
        lines.append([f"No exact volume: {reach.refusal}"])
    if reach.fine and reach.notes:
        lines.append([f"{'; '.join(reach.notes)}."])
    return lines


def is_behind(session: Session) -> bool:
    """True if results of the design in the fields are missing."""
    reach = session.found.reach
    return reach is None or reach.arm != session.state.design or not reach.fine


def _numbers_text(session: Session) -> list[Part]:
    reach, work = session.found.reach, _work(session)
    if reach is None:
        return [session.found.refusal or work]
    parts = reach_text(reach, loaded_share(session.found, session.state.design))
    if reach.arm != session.state.design:
        parts = [Strong("of the design before: "), *parts]
    return [*parts, *([f" · {work}"] if work else [])]


def _work(session: Session) -> str:
    if session.compiling:
        done = f", {session.compiled} kernels so far" if session.compiled else ""
        return f"compiling, once on this machine{done} ..."
    if session.doing:
        return f"{session.doing} ..."
    if not is_behind(session):
        return ""
    if session.busy:
        return "computing ..."
    return "canceled" if session.canceled else "not computed"


def add_history(gui: GuiApi, session: Session) -> None:
    """Add undo, redo and reset; keys of the page press the first two."""
    actions: dict[str, Callable[[], None]] = {
        "Undo": lambda: session.step(back=True),
        "Redo": lambda: session.step(back=False),
        "Reset": session.reset,
    }
    row = gui.add_button_group("history", tuple(actions), hint=_HISTORY_HINT)
    row.on_click(lambda _: attempt(session, actions[row.value]))
