"""Status above all tabs, looks of a tab, and the plots beside its scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from softreach.studio import markup
from softreach.studio.captions import clearance_text, legend_text, loaded_share, reach_text
from softreach.studio.fields import Attribute, Fields, attribute
from softreach.studio.figures import Picture, swept_parameter
from softreach.studio.found import Found
from softreach.studio.markup import Part, Term
from softreach.studio.scene.camera import VIEWS
from softreach.studio.scene.colors import color_names, key_html, shown_color
from softreach.studio.session import Session
from softreach.studio.shown_parameters import slider_parameters, three_digits
from softreach.studio.state import AXES, StudioState
from softreach.studio.tabs.goals import verdict_text
from softreach.support.units import UNITS, LengthUnit

_HISTORY_HINT = (
    "Ctrl+Z, Ctrl+Shift+Z; Reset leads to what the studio was opened on. The view stays."
)
_NOTE_SECONDS = 12.0
_CANCEL, _GO_ON = "Cancel", "Compute what is missing"
_ABOUT_CANCEL = "Stops what is being computed; what is complete stays. Every change starts anew."
_WORK = "tab.busy", "tab.doing", "tab.compiling", "tab.canceled"
_TOGGLES = {
    "arm": ("arm", "The body and its bundles in the present activation"),
    "surface": ("exact surface", "Boundary of all that the tip reaches, without sampling"),
    "cloud": ("cloud", "Tips of sampled activations"),
    "free": ("free samples alone", "Of the cloud only what touches none of the surroundings"),
    "half": ("half of the cloud", "Cuts away the half in front of the arm"),
    "dark": ("dark page", "Light on dark"),
}
_ABOUT_SECTION = "What is reached in the plane of the slice, or y = 0, and by how many activations"
_ABOUT_SWEEP = "Volume of designs that differ from this one in this parameter alone"
_ABOUT_OLD = "The numbers of the present design are not known yet"
_WIDTH = 380  # pixels
_NOTHING = np.zeros((1, 1, 4), np.uint8)


def status(panel: Fields) -> None:
    """Numbers, key and notes above all tabs; keys of the page press undo and redo."""
    session, numbers = panel.session, list[Any]()
    known = "design", "found.reach", "found.free", "found.check", "found.key", "found.refusal"
    panel.follow(*known, show=lambda *now: numbers.__setitem__(slice(None), _numbers(*now)))
    panel.html(*known, "found.clearance", *_WORK, content=lambda *_: _status(session, *numbers))
    act = lambda: (session.cancel if session.busy else session.resume)()
    cancel = panel.button(_CANCEL, act, _ABOUT_CANCEL, visible=False)

    def offer(_: StudioState, found: Found) -> None:
        lacking = is_behind(session) and not found.refusal
        cancel.label = _GO_ON if lacking and not session.busy else _CANCEL
        cancel.visible = lacking or (session.busy and not found.is_dragged)

    follows = "design", "found.reach", "found.refusal", "found.is_dragged", "tab.busy"
    panel.follow(*follows, show=offer)
    toasts: list[Any] = []

    def note(*_: object) -> None:
        while toasts:
            toasts.pop().remove()
        if session.note:
            say = session.client.add_notification
            toasts.append(say("", session.note, auto_close_seconds=_NOTE_SECONDS))

    panel.follow("tab.note", show=note)
    undo, redo = partial(session.step, back=True), partial(session.step, back=False)
    actions = {"Undo": undo, "Redo": redo, "Reset": session.reset}
    panel.choices("history", actions, _HISTORY_HINT)


def _numbers(state: StudioState, found: Found) -> tuple[list[Part], list[str]]:
    """Numbers of the reach, and the lines below them as HTML."""
    check, reach = found.check, found.reach
    lines = [markup.paragraph(verdict_text(check))] if check is not None else []
    if reach is None:
        return [], [*lines, key_html(found.key)]
    refusal: list[Part] = [f"No exact volume: {reach.refusal}"] * bool(reach.refusal)
    words = "; ".join(reach.notes if reach.fine else ())
    notes: list[Part] = [f"{words[:1].upper()}{words[1:]}."] * bool(words)
    below = legend_text(reach, free=found.free is not None), refusal, notes
    before = [Term("of the design before: ", _ABOUT_OLD)] * (reach.arm != state.design)
    numbers = [*before, *reach_text(reach, loaded_share(found, state.design))]
    return numbers, [*lines, key_html(found.key), *(markup.paragraph(*parts) for parts in below)]


def _status(session: Session, numbers: list[Part], below: list[str]) -> str:
    work = _work(session)
    first = [*numbers, f" · {work}" * bool(work)] if numbers else [session.found.refusal or work]
    near = markup.paragraph(*clearance_text(session.state, session.found))
    return markup.status(markup.paragraph(*first), near, *below)


def is_behind(session: Session) -> bool:
    """True if results of the design in the fields are missing."""
    return session.found.complete_reach(session.state.design) is None


def _work(session: Session) -> str:
    if session.compiling or session.doing:
        return session.compiling or f"{session.doing} ..."
    idle = "canceled" if session.canceled else "not computed"
    missing = "computing ..." if session.busy else idle
    return missing if is_behind(session) else ""


def view(panel: Fields) -> None:
    """Fields of the appearance."""
    offered = lambda state: color_names(state.design)
    colored = lambda state, name: state.showing(color=name)
    color = Attribute(lambda state: shown_color(state.design, state.appearance.color), colored)
    about = "What the color of a point says; the key is above the tabs"
    panel.dropdown("color by", offered, color, about)
    named = lambda state, name: state.showing(unit=name)
    lengths = Attribute(lambda state: state.design.length_unit.name, named)
    about = "Unit of lengths, areas and volumes, here and in saved files"
    panel.dropdown("unit", {name: name for name in UNITS}, lengths, about)
    with panel.folder("show"):
        for name, (label, hint) in _TOGGLES.items():
            panel.checkbox(label, attribute(f"appearance.{name}"), hint)
    looks = {name: lambda name=name: panel.session.look_from(name) for name in VIEWS}
    panel.choices("look from", looks, "Along an axis of the world, or between them")
    axis = attribute("appearance.slice.axis")
    across = {axis: axis for axis in AXES}
    panel.dropdown("slice across", across, axis, "Hides all but a slab across this axis")
    size = lambda state, _: (state.design.length_unit, state.design.length)
    is_cut = lambda state, _: axis.read(state) != "none"
    panel.anew("slab", "design", key=size, build=_center, shown=is_cut)


def _center(panel: Fields, size: tuple[LengthUnit, float]) -> None:
    """The middle of the slab, in the unit of the design."""
    (unit, length), center = size, attribute("appearance.slice.center")
    over = length / unit.size
    read = lambda state: float(f"{over * center.read(state):.9g}")
    at = Attribute(read, lambda state, value: center.write(state, value / over))
    end = three_digits(1.5 * over)
    panel.slider(unit.label("center"), (-end, end), 0.01 * end, at, "Middle of the slab")


def plots(panel: Fields) -> None:
    """What is plotted; the plots stand in a window beside the scene."""
    panel.checkbox("section", attribute("appearance.section"), _ABOUT_SECTION)
    names = lambda state: {each.name: each.label for each in slider_parameters(state.design)}
    read = lambda state: one.name if (one := swept_parameter(state)) is not None else ""
    swept = Attribute(read, lambda state, name: state.showing(sweep=name))
    panel.dropdown("V against", lambda s: {"": "(no plot)"} | names(s), swept, _ABOUT_SWEEP)
    window = panel.gui.add_panel(visible=False)

    def place(state: StudioState, _: Found) -> None:
        shown = state.appearance.section or bool(state.appearance.sweep)
        if shown and not window.visible:
            window.visible = True
            window.dock_left()  # a page forgets where a hidden window was
            window.set_width(_WIDTH)
        window.visible = shown

    panel.follow("appearance", show=place)
    with window.add_tab("Figures"):
        _figure(panel, "section", "section")
        _figure(panel, "V against parameter", "sweep")


def _figure(panel: Fields, label: str, name: str) -> None:
    known: Callable[[Found], Picture | None] = attrgetter(name)

    def draw(_: StudioState, found: Found) -> None:
        if (picture := known(found)) is not None:
            image.image, image.visible = picture.image, True

    def text(state: StudioState, found: Found) -> tuple[str, ...]:
        if (picture := known(found)) is None:
            return ("computing ...",)
        before = " · of the design before, computing ..."
        return (picture.text, before * (picture.arm != state.design))

    with panel.folder(label, f"appearance.{name}"):
        image = panel.gui.add_image(_NOTHING, format="png", visible=False)
        panel.follow(f"found.{name}", show=draw)
        panel.text("design", f"found.{name}", content=text)
