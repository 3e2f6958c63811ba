"""Status of the design above all tabs: its numbers, the key to colors, and undo, redo, reset."""

from __future__ import annotations

from softreach.studio import markup
from softreach.studio.captions import legend_text, loaded_share, reach_text
from softreach.studio.fields import Fields
from softreach.studio.found import Found
from softreach.studio.markup import Part, Strong
from softreach.studio.scene.colors import key_html
from softreach.studio.session import Session
from softreach.studio.state import StudioState
from softreach.studio.tabs.goals import verdict_text

_HISTORY_HINT = (
    "Undo and redo changes of design, activation and target (Ctrl+Z, Ctrl+Shift+Z; Cmd on a Mac); "
    "reset to what the studio was opened on. The view stays."
)
_NOTE_SECONDS = 12.0
_CANCEL, _GO_ON = "Cancel", "Compute what is missing"
_ABOUT_CANCEL = "Stops what is being computed; what is complete stays. Every change starts anew."
_WORK = "tab.busy", "tab.doing", "tab.compiling", "tab.compiled", "tab.canceled"


def status(panel: Fields) -> None:
    """Numbers, key and notes above all tabs; keys of the page press undo and redo."""
    session = panel.session
    known = "found.reach", "found.free", "found.check", "found.key", "found.refusal"
    panel.html("design", *known, *_WORK, content=lambda _, found: _numbers(session, found))
    cancel = panel.button(
        _CANCEL,
        lambda: (session.cancel if session.busy else session.resume)(),
        _ABOUT_CANCEL,
        visible=False,
    )

    def offer(_: StudioState, found: Found) -> None:
        lacking = is_behind(session) and not found.refusal
        label = _GO_ON if lacking and not session.busy else _CANCEL
        if cancel.label != label:
            cancel.label = label
        if cancel.visible != (session.busy or lacking):
            cancel.visible = not cancel.visible

    panel.follow("design", "found.reach", "found.refusal", "tab.busy", show=offer)
    toast = None

    def note(_: StudioState, __: Found) -> None:
        nonlocal toast
        if toast is not None:
            toast.remove()
        toast = session.note and session.client.add_notification(
            "", session.note, auto_close_seconds=_NOTE_SECONDS
        )
        toast = toast or None

    panel.follow("tab.note", show=note)
    actions = {
        "Undo": lambda: session.step(back=True),
        "Redo": lambda: session.step(back=False),
        "Reset": session.reset,
    }
    panel.choices("history", actions, _HISTORY_HINT)


def _numbers(session: Session, found: Found) -> str:
    """What is known, and whether it is about to change."""
    check, reach = found.check, found.reach
    lines = [_reach_line(session), [verdict_text(check)] if check is not None else []]
    marks: list[list[Part]] = []
    if reach is not None:
        marks.append(legend_text(reach, free=found.free is not None))
        if reach.refusal:
            marks.append([f"No exact volume: {reach.refusal}"])
        if reach.fine and reach.notes:
            marks.append([f"{'; '.join(reach.notes)}."])
    above, below = ([markup.paragraph(*line) for line in each] for each in (lines, marks))
    return markup.status(*above, key_html(found.key), *below)


def is_behind(session: Session) -> bool:
    """True if results of the design in the fields are missing."""
    return session.found.complete_reach(session.state.design) is None


def _reach_line(session: Session) -> list[Part]:
    found, design, work = session.found, session.state.design, _work(session)
    if found.reach is None:
        return [found.refusal or work]
    parts = reach_text(found.reach, loaded_share(found, design))
    if found.reach.arm != design:
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
