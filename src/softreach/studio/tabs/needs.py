"""Needs of the design, and what it misses of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.requirements import Check, Finding, Requirements
from softreach.studio import markup
from softreach.studio.fields import attempt, bind_button
from softreach.studio.files import LARGEST
from softreach.studio.markup import Part, Swatch, Term
from softreach.studio.needs import (
    needs_of_text,
    needs_parts,
    reach_text,
    requirements_of,
    with_box,
    with_payload,
    with_place,
    with_shortening,
)
from softreach.studio.scene.needs import COLORS
from softreach.studio.widgets import Line, number_of, show_where
from softreach.support.errors import InvalidInput
from softreach.support.files.text import text_of
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    from viser import GuiApi, UploadedFile

    from softreach.studio.session import Session

_HINT = "Say what the arm is for: what it misses is shown while you change it."
_PLACE, _TARGET, _STAY, _AVOID, _PAYLOAD, _SHORTENING = (
    "place to reach",
    "place at the target",
    "box to stay inside",
    "box to avoid",
    "payload",
    "most shortening",
)
_EMPTY = {
    _PLACE: "x, y, z in {unit}; empty: where the tip is",
    _TARGET: "nothing: the target of the tab Move",
    _STAY: "x, y, z, x, y, z of two corners in {unit}; empty: around what is drawn",
    _AVOID: "x, y, z, x, y, z of two corners in {unit}",
    _PAYLOAD: "mass at the tip in g",
    _SHORTENING: "of any bundle, in %",
}
"""Kind of need -> contents of its field, in words."""
_ALL = "everything"
_ABOUT = {
    "add": "A place for the tip, a box for the arm at these places, or a limit",
    "field": "Numbers with commas between them",
    "remove": "One of the needs, or all of them",
    "load": "Requirements as softreach check and softreach search read them",
    "save": "The needs as a file for softreach check and softreach search",
}


class NeedsPanel:
    """Needs of a tab, and what its design misses of them."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._design: Manipulator | None = None
        """The design in whose unit numbers are typed."""
        self._said: tuple[Check | None, str, bool] | None = None
        with tab, gui.add_folder("requirements"):
            Line(gui, _HINT)
            self._add_widgets(gui)
        self._kind.on_update(lambda _: attempt(session, self._explain))
        bind_button(self._add, session, self._added)
        bind_button(self._remove, session, self._removed)
        self._load.on_upload(lambda _: attempt(session, lambda: self._read(self._load.value)))
        bind_button(self._save, session, self._saved)

    def _add_widgets(self, gui: GuiApi) -> None:
        self._kind = gui.add_dropdown("add", tuple(_EMPTY), hint=_ABOUT["add"])
        self._field = gui.add_text("numbers", "", hint=_ABOUT["field"])
        self._expected = Line(gui)
        self._add = gui.add_button("Add to the needs", hint=_ABOUT["add"])
        self._verdict = Line(gui)
        self._refusal = Line(gui)
        self._part: Any = gui.add_dropdown("remove", (_ALL,), hint=_ABOUT["remove"], visible=False)
        self._remove = gui.add_button("Remove", hint=_ABOUT["remove"], visible=False)
        self._load = gui.add_upload_button("Load needs (TOML)", hint=_ABOUT["load"], color="gray")
        self._save = gui.add_button(
            "Save needs (TOML)", hint=_ABOUT["save"], color="gray", visible=False
        )

    def show(self, session: Session) -> None:
        """Show what is met and missed."""
        state = session.state
        if state.design is not self._design:
            self._design = state.design
            self._explain()
        self._offer_parts(requirements_of(state.needs))
        self._say_verdict(session)

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Add the place under the cursor, if the mouse adds places; return if there is one."""
        if self._session.state.appearance.mouse != "place":
            return False
        spot = self._session.picked_place(origin, direction)
        if spot is not None:
            needs = requirements_of(self._session.state.needs)
            attempt(self._session, lambda: self._keep(with_place(needs, spot.tolist())))
        return spot is not None

    @property
    def _unit(self) -> LengthUnit:
        return self._session.state.design.length_unit

    def _explain(self) -> None:
        self._expected.say(_EMPTY[self._kind.value].format(unit=self._unit.name))

    def _offer_parts(self, needs: Requirements) -> None:
        parts = tuple(needs_parts(needs, self._unit))
        show_where(bool(parts), self._part, self._remove, self._save)
        if tuple(self._part.options) != (*parts, _ALL):
            self._part.options = (*parts, _ALL)
            self._part.value = (*parts, _ALL)[0]

    def _say_verdict(self, session: Session) -> None:
        check, refusal = session.found.check, session.found.check_refusal
        old = check is not None and check.arm != session.state.design
        if (check, refusal, old) != self._said:
            self._said = check, refusal, old
            lines = [] if check is None else [_line(check, finding) for finding in check.findings]
            if lines and old:
                lines.append(("of the design before, computing ...",))
            self._verdict.show("".join(markup.paragraph(*parts) for parts in lines))
            self._refusal.warn(refusal)

    def _added(self) -> None:
        add = {
            _PLACE: self._place,
            _TARGET: self._place_at_target,
            _STAY: self._box,
            _AVOID: self._box,
            _PAYLOAD: lambda needs, text: with_payload(needs, _numbers(text, 1)[0] / 1e3),
            _SHORTENING: lambda needs, text: with_shortening(needs, _numbers(text, 1)[0] / 100.0),
        }[self._kind.value]
        self._keep(add(requirements_of(self._session.state.needs), str(self._field.value)))
        self._field.value = ""

    def _place(self, needs: Requirements, text: str) -> Requirements:
        session = self._session
        if text.strip():
            return with_place(needs, [self._unit.size * x for x in _numbers(text, 3)])
        if session.found.tip is None:
            raise InvalidInput("tip", "nowhere", "in equilibrium, or type a place")
        return with_place(needs, (session.found.tip * session.state.design.length).tolist())

    def _place_at_target(self, needs: Requirements, text: str) -> Requirements:
        del text
        target = self._session.state.target
        if target is None:
            raise InvalidInput("target", "none", "set in the tab Move")
        return with_place(needs, target)

    def _box(self, needs: Requirements, text: str) -> Requirements:
        inside = self._kind.value == _STAY
        if inside and not text.strip():
            around = np.array(self._session.scene.axes.corners)
            low, high = around * self._session.state.design.length
        else:
            corners = self._unit.size * np.array(_numbers(text, 6)).reshape(2, 3)
            low, high = corners.min(axis=0), corners.max(axis=0)
        return with_box(needs, low.tolist(), high.tolist(), inside=inside)

    def _keep(self, needs: Requirements) -> None:
        """Make them the needs of the state; none are an empty text."""
        text = needs.to_toml()
        text = "" if text == Requirements().to_toml() else text
        self._session.update(lambda state: state.replace(needs=text))

    def _removed(self) -> None:
        needs, part = requirements_of(self._session.state.needs), self._part.value
        parts = needs_parts(needs, self._unit)
        self._keep(parts[part](needs) if part in parts else Requirements())

    def _read(self, file: UploadedFile) -> None:
        text = text_of("file", file.name, file.content, LARGEST)
        length = self._session.state.design.length
        self._keep(needs_of_text(text, length=length, source=file.name))

    def _saved(self) -> None:
        content = self._session.state.needs.encode()
        self._session.client.send_file_download("needs.toml", content, save_immediately=True)


def _numbers(text: str, count: int) -> list[float]:
    """So many numbers that a text lists; anything else is refused."""
    parts = text.replace(";", ",").replace(",", " ").split()
    numbers = [number for part in parts if (number := number_of(part)) is not None]
    if not len(parts) == len(numbers) == count:
        words = {1: "a number", 3: "three numbers, such as 0.2, 0, 0.7", 6: "six numbers"}
        raise InvalidInput("numbers", repr(text), words[count])
    return numbers


_SIGNS = {"met": "\N{CHECK MARK}", "missed": "\N{MULTIPLICATION X}", "undecided": "?"}


def _line(check: Check, finding: Finding) -> tuple[Part, ...]:
    mark, sign = Swatch(COLORS[finding.verdict]), _SIGNS[finding.verdict]
    text = reach_text(check, finding) if finding.kind == "reach" else finding.text
    return mark, f" {sign} ", Term(finding.name, finding.text), f": {text}"
