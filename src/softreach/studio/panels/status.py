"""What is known of the design at this moment: volume, unreachability, and what colors mean."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softreach.plot.coloring import UNSTABLE
from softreach.rod.tip_map import TipStatus
from softreach.studio.markup import Part, Strong, Swatch, Term, fields_style
from softreach.studio.panels.binding import bind_button
from softreach.studio.panels.line import Line
from softreach.studio.scene.clouds import FAINT, key_html

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.reach import Reach, Size
    from softreach.studio.session import Session

__all__ = ["StatusPanel", "legend_text", "reach_text", "tip_text"]

_CANCEL, _GO_ON = "Cancel", "Compute what is missing"
_ABOUT_CANCEL = "Stops what is being computed; what is complete stays. Every change starts anew."
UNREACHABILITY = (
    "Unreachability UNR [%]: the share of the convex hull of all tips that no activation reaches, "
    "1 − V / V of the hull"
)
_SIZES = {
    "volume": "V [L³]: volume of all places that the tip reaches, its error beside it; L: length",
    "area": "Area [L²] of all places that the tip reaches, its error beside it; L: length",
    "length": "Length [L] of the curve that the tip reaches, its error beside it",
    "point": "All activations are held: the tip is at one place",
}
_GAP = "\N{EN SPACE} "
_POSTURES = {
    TipStatus.STABLE: "a stable equilibrium",
    TipStatus.UNSTABLE: "an unstable equilibrium: a real arm leaves it",
    TipStatus.NO_EQUILIBRIUM: "no equilibrium: the arm is not drawn",
}


class StatusPanel:
    """Text above all tabs."""

    def __init__(self, gui: GuiApi, session: Session) -> None:
        """Add the widgets."""
        Line(gui).show(fields_style())
        self._numbers = Line(gui, "computing ...")
        self._comparison = Line(gui)
        self._key = Line(gui)
        self._legend = Line(gui)
        self._refusal = Line(gui)
        self._coarser = Line(gui)
        self._note = Line(gui)
        self._cancel = gui.add_button(_CANCEL, disabled=True, hint=_ABOUT_CANCEL)
        bind_button(self._cancel, session, lambda: _stop_or_go_on(session))

    def show(self, session: Session) -> None:
        """Show what is known, and whether it is about to change."""
        self._numbers.say(*_numbers_text(session))
        self._comparison.say(*_comparison_text(session))
        self._key.show(key_html(session.key))
        self._explain_marks(session)
        self._note.say(*((session.note,) if session.note else ()))
        self._offer(session)

    def _offer(self, session: Session) -> None:
        """What the button does at this moment; it keeps its place, so that nothing jumps."""
        busy, lacking = session.busy, is_behind(session) and not session.refusal
        label, disabled = _CANCEL if busy or not lacking else _GO_ON, not (busy or lacking)
        if self._cancel.label != label:
            self._cancel.label = label
        if self._cancel.disabled != disabled:
            self._cancel.disabled = disabled

    def _explain_marks(self, session: Session) -> None:
        reach = session.reach
        free = session.state.appearance.free and session.free is not None
        self._legend.say(*(legend_text(reach, free=free) if reach is not None else ()))
        refusal = reach.refusal if reach is not None else ""
        self._refusal.say(*((f"No exact volume: {refusal}",) if refusal else ()))
        notes = reach.notes if reach is not None and reach.fine else ()
        self._coarser.say(*((f"{'; '.join(notes)}.",) if notes else ()))


def is_behind(session: Session) -> bool:
    """Whether what is shown is not yet, or not all, of the design in the fields."""
    reach = session.reach
    return reach is None or reach.arm != session.state.design or not reach.fine


def _numbers_text(session: Session) -> list[Part]:
    reach, work = session.reach, _work(session)
    if reach is None:
        return [session.refusal or work]
    hull = reach.alpha_volume if session.state.appearance.alpha_shape else None
    parts = [*reach_text(reach), *([f" · α-shape {hull:.4f} L³"] if hull is not None else [])]
    if reach.arm != session.state.design:
        parts = [Strong("of the design before: "), *parts]
    return [*parts, *([f" · {work}"] if work else [])]


def _work(session: Session) -> str:
    """What is being done; that nothing is, where something is missing."""
    if session.compiling:
        return "compiling, once on this machine ..."
    if session.doing:
        return f"{session.doing} ..."
    if not is_behind(session):
        return ""
    if session.busy:
        return "computing ..."
    return "canceled" if session.canceled else "not computed"


def _stop_or_go_on(session: Session) -> None:
    (session.cancel if session.busy else session.resume)()


def reach_text(reach: Reach) -> list[Part]:
    """The numbers of a reach in one line."""
    parts: list[Part] = []
    if reach.size is not None:
        name, value, error, unit = reach.size
        value_text = f"{name} {value:.4f} ± {error:.1g} {unit}"
        parts += [Term(value_text, _SIZES[name]), " · "]
    if not math.isnan(reach.unreachability):
        parts += [Term(f"UNR {100 * reach.unreachability:.2f} %", UNREACHABILITY), " · "]
    if reach.lost_share:
        parts.append(f"{_percent(reach.lost_share)} of the activations left out · ")
    parts.append(f"{reach.samples:,} samples")
    if reach.fine and reach.samples < reach.wanted:
        parts.append(f" of {reach.wanted:,}")
    return parts


def _comparison_text(session: Session) -> list[Part]:
    """How much of its reach the loads leave an arm; nothing for an arm without loads."""
    if session.state.design.loads is None:
        return []
    loaded, free = _present_size(session), session.free
    bare = free.size if free is not None else None
    if bare is None:
        return []
    free_text = f"free {bare.value:.4f} {bare.unit}"
    if loaded is None:
        return [free_text]
    share = f", {100 * loaded.value / bare.value:.0f} %" if bare.value > 0 else ""
    return [Strong(f"loaded {loaded.value:.4f} {loaded.unit}"), f" · {free_text}{share}"]


def _present_size(session: Session) -> Size | None:
    """The size of what the design itself can reach, not the one before it."""
    reach = session.reach
    return reach.size if reach is not None and reach.arm == session.state.design else None


def legend_text(reach: Reach, *, free: bool) -> list[Part]:
    """What marks stand for, how many samples they are, and what is left out.

    Args:
        reach: What is shown; of an arm without loads there is nothing to say.
        free: Whether the cloud without loads is shown too.
    """
    if reach.arm.loads is None:
        return []
    parts: list[Part] = []
    if unstable := reach.share(TipStatus.UNSTABLE):
        parts += [Swatch(UNSTABLE), f" unstable: {_percent(unstable)} of the samples {_GAP}"]
    if lost := reach.share(TipStatus.NO_EQUILIBRIUM):
        parts.append(f"no equilibrium, not shown: {_percent(lost)} {_GAP}")
    if not unstable and not lost:
        parts.append(f"every sample rests in a stable equilibrium {_GAP}")
    return [*parts, Swatch(FAINT), " without loads"] if free else parts


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def tip_text(session: Session) -> list[Part]:
    """Where the tip is, and whether a loaded arm rests there."""
    parts: list[Part] = []
    if session.tip is not None:
        x, y, z = session.tip
        parts.append(f"tip at ({x:.6f}, {y:.6f}, {z:.6f}) L")
    if session.posture is not None:
        parts.append(f"{' · ' if parts else ''}{_POSTURES[session.posture]}")
    return parts
