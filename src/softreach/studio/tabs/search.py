"""Needs of the design, what it misses of them, and a search for designs that meet them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.optimization import OBJECTIVES, Candidate
from softreach.optimization.objectives import Goal
from softreach.requirements import Check, Finding, Requirements
from softreach.studio import markup
from softreach.studio.fields import attempt, bind_button
from softreach.studio.jobs.search import CheckNeeds, DrawSearch, SearchDesigns, SearchRun
from softreach.studio.markup import Part, Swatch, Term
from softreach.studio.needs import (
    LARGEST,
    needs_of_text,
    needs_parts,
    reach_text,
    requirements_of,
    with_box,
    with_payload,
    with_place,
    with_shortening,
)
from softreach.studio.scene.needs import MISSED, REACHED
from softreach.studio.search_ranges import ranges_of, slider_range
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.widgets import Line, PictureFrame, number_of, show_where
from softreach.support.errors import InvalidInput
from softreach.support.quantity import quantity
from softreach.support.units import LengthUnit, readable_unit

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
_NOTHING = "nothing more"
_ALL = "everything"
_ADD = "choose a number"
_MOST_DESIGNS = 5000
_ABOUT = {
    "add": "A place for the tip, a box for the arm at these places, or a limit",
    "field": "Numbers with commas between them",
    "remove": "One of the needs, or all of them",
    "load": "Requirements as softreach check and softreach search read them",
    "save": "The needs as a file for softreach check and softreach search",
    "free": "Numbers that the search may change, with ranges in the units of their sliders, such "
    "as taper = 0:3; without a range that of the slider; a = -b ties two",
    "number": "A number of this design that the search may change too",
    "first": "What is best among the designs that meet the needs",
    "second": "With two objectives there is a front: no design of it is better in both",
    "designs": "Designs that are looked at; polishes of the best may take more",
    "search": "Looks for designs in the background; Cancel above the tabs ends it",
    "at": "Designs of the front, from the first objective to the second",
    "take": "Makes it the design; can be undone. So does a click on a point of the picture in the "
    "scene",
    "clear": "Ends it, and takes its picture away; the design stays",
}


class SearchPanel:
    """Needs of a tab, and the search for a better design."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._design: Manipulator | None = None
        """The design whose numbers are offered."""
        self._said: tuple[Check | None, str, bool] | None = None
        self._shown: object = None
        with tab:
            with gui.add_folder("requirements"):
                Line(gui, _HINT)
                self._need_widgets(gui)
            with gui.add_folder("search for a design"):
                self._search_widgets(gui)
        self._listen()

    def _need_widgets(self, gui: GuiApi) -> None:
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

    def _search_widgets(self, gui: GuiApi) -> None:
        self._free = gui.add_text("free", "", hint=_ABOUT["free"])
        self._number: Any = gui.add_dropdown("free also", (_ADD,), hint=_ABOUT["number"])
        options = [f"{way} {name}" for way in ("maximize", "minimize") for name in OBJECTIVES]
        self._first = gui.add_dropdown("objective", (*options, _NOTHING), hint=_ABOUT["first"])
        self._second = gui.add_dropdown("and", (_NOTHING, *options), hint=_ABOUT["second"])
        self._designs = gui.add_number(
            "designs", 60, min=1, max=_MOST_DESIGNS, step=1, hint=_ABOUT["designs"]
        )
        self._search = gui.add_button("Search", hint=_ABOUT["search"])
        self._summary = Line(gui)
        self._judged = gui.add_folder("designs that were judged", visible=False)
        self._picture = PictureFrame(gui, self._judged)
        self._at = gui.add_slider("on the front", 1, 2, 1, 1, hint=_ABOUT["at"], visible=False)
        self._values = Line(gui)
        self._take = gui.add_button("Load the best", hint=_ABOUT["take"], visible=False)
        self._clear = gui.add_button("Remove the search", hint=_ABOUT["clear"], visible=False)

    def _listen(self) -> None:
        session = self._session
        self._kind.on_update(lambda _: attempt(session, self._explain))
        bind_button(self._add, session, self._added)
        bind_button(self._remove, session, self._removed)
        self._load.on_upload(lambda _: attempt(session, lambda: self._read(self._load.value)))
        bind_button(self._save, session, self._saved)
        self._number.on_update(lambda _: attempt(session, self._freed))
        bind_button(self._search, session, self._ask)
        self._at.on_update(lambda _: attempt(session, self._show_values))
        bind_button(self._take, session, self._loaded)
        bind_button(self._clear, session, self._forget)

    def show(self, session: Session) -> None:
        """Show what is met and missed, and how far the search is."""
        state = session.state
        if state.design is not self._design:
            self._design = state.design
            names = [slider.name for slider in slider_parameters(state.design)]
            if tuple(self._number.options) != (_ADD, *names):
                self._number.options = _ADD, *names
            self._explain()
        self._offer_parts(requirements_of(state.needs))
        self._say_verdict(session)
        run = session.search
        key = run and (run, run.picture, run.result, len(run.candidates))
        if key != self._shown:
            self._shown = key
            self._show_run(run)

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Load the design under the cursor, or add a place to reach; return if there is one."""
        if self._session.state.appearance.mouse == "place":
            spot = self._session.picked_place(origin, direction)
            if spot is not None:
                attempt(self._session, lambda: self._keep_place(spot.tolist()))
                return True
        run, board = self._session.search, self._session.job(DrawSearch).board
        place = board.place_under(origin, direction)
        if run is None or run.picture is None or place is None:
            return False
        if (candidate := run.picture.candidate_at(*place)) is not None:
            attempt(self._session, lambda: self._replace(run, candidate))
        return True

    @property
    def _unit(self) -> LengthUnit:
        return self._session.state.design.length_unit

    def _explain(self) -> None:
        """Say what the field holds."""
        self._expected.say(_EMPTY[self._kind.value].format(unit=self._unit.name))

    def _offer_parts(self, needs: Requirements) -> None:
        parts = tuple(needs_parts(needs, self._unit))
        show_where(bool(parts), self._part, self._remove, self._save)
        if tuple(self._part.options) != (*parts, _ALL):
            self._part.options = (*parts, _ALL)
            self._part.value = (*parts, _ALL)[0]

    def _say_verdict(self, session: Session) -> None:
        check, refusal = session.check, session.check_refusal
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

    def _keep_place(self, place: list[float]) -> None:
        self._keep(with_place(requirements_of(self._session.state.needs), place))

    def _place(self, needs: Requirements, text: str) -> Requirements:
        session = self._session
        if text.strip():
            return with_place(needs, [self._unit.size * x for x in _numbers(text, 3)])
        if session.tip is None:
            raise InvalidInput("tip", "nowhere", "in equilibrium, or type a place")
        return with_place(needs, (session.tip * session.state.design.length).tolist())

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
        if len(file.content) > LARGEST:
            size, most = len(file.content) / 1e6, LARGEST / 1e6
            raise InvalidInput(file.name, f"{size:.3g} MB", f"at most {most:g} MB")
        try:
            text = file.content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise InvalidInput(file.name, str(error), "text in UTF-8") from None
        length = self._session.state.design.length
        self._keep(needs_of_text(text, length=length, source=file.name))

    def _saved(self) -> None:
        content = self._session.state.needs.encode()
        self._session.client.send_file_download("needs.toml", content, save_immediately=True)

    def _freed(self) -> None:
        name, self._number.value = self._number.value, _ADD
        known = [part.split("=")[0].strip() for part in self._free.value.split(",") if part.strip()]
        if name == _ADD or name in known:
            return
        before = [part.strip() for part in self._free.value.split(",") if part.strip()]
        more = f"{name} = {slider_range(self._session.state.design, name)}"
        self._free.value = ", ".join([*before, more])

    def _ask(self) -> None:
        job = self._session.job(SearchDesigns)
        chosen = [str(menu.value) for menu in (self._first, self._second)]
        chosen = [text for text in dict.fromkeys(chosen) if text != _NOTHING]
        ways = {"maximize": [], "minimize": []}
        for text in chosen:
            way, name = text.split(" ", 1)
            ways[way].append(name)
        free: Mapping[str, Any] = ranges_of(self._free.value, self._session.state.design)
        job.free, job.designs = free, int(self._designs.value)
        job.maximize, job.minimize = tuple(ways["maximize"]), tuple(ways["minimize"])
        job.ask()

    def _show_run(self, run: SearchRun | None) -> None:
        """Show the picture, and what can be loaded."""
        some = run is not None and bool(run.candidates)
        self._judged.visible = self._take.visible = self._clear.visible = some
        if run is None or not some:
            self._summary.say()
            self._values.say()
            self._at.visible = False
            return
        if run.picture is not None:
            self._picture.show(run.picture.image)
        self._summary.say(*_summary(run))
        count = len(run.front)
        self._at.visible = count > 1
        self._at.max = max(count, 2)
        if self._at.value > count:
            self._at.value = 1
        label = "Load this design" if count > 1 else "Load the best"
        if self._take.label != label:
            self._take.label = label
        self._show_values()

    def _chosen(self, run: SearchRun) -> Candidate:
        front = run.front
        return front[min(int(self._at.value), len(front)) - 1]

    def _show_values(self) -> None:
        """Say what the chosen design of the front is."""
        run = self._session.search
        if run is not None and run.candidates:
            self._values.show(_table(run, self._chosen(run), self._session.state.design))

    def _loaded(self) -> None:
        run = self._session.search
        if run is None or not run.candidates:
            raise InvalidInput("search", "none", "begun, before a design of it is loaded")
        self._replace(run, self._chosen(run))

    def _forget(self) -> None:
        self._session.search = None
        self._session.follow(SearchDesigns, DrawSearch)  # which drops what it is doing
        self._session.show()

    def _replace(self, run: SearchRun, candidate: Candidate) -> None:
        arm = run.arm(candidate)
        self._session.end_step()
        self._session.update(lambda state: state.replace(design=arm))
        self._session.refresh(CheckNeeds)


def _numbers(text: str, count: int) -> list[float]:
    """Numbers that a text lists.

    Raises:
        InvalidInput: Others, or another number of them.
    """
    parts = text.replace(";", ",").replace(",", " ").split()
    numbers = [number for part in parts if (number := number_of(part)) is not None]
    if not len(parts) == len(numbers) == count:
        words = {1: "a number", 3: "three numbers, such as 0.2, 0, 0.7", 6: "six numbers"}
        raise InvalidInput("numbers", repr(text), words[count])
    return numbers


def _line(check: Check, finding: Finding) -> tuple[Part, ...]:
    """A finding in words: a place by its gap, all else by its own text."""
    color, sign = (REACHED, "\N{CHECK MARK}") if finding.met else (MISSED, "\N{MULTIPLICATION X}")
    text = finding.text
    if finding.kind == "reach":
        text = reach_text(check, finding)
    return Swatch(color), f" {sign} ", Term(finding.name, finding.text), f": {text}"


def _summary(run: SearchRun) -> tuple[Part, ...]:
    done = run.result is not None
    first = (
        f"{run.looked_at} designs looked at"
        if done
        else (f"{run.looked_at} of {run.designs} designs looked at")
    )
    met = sum(each.is_feasible for each in run.candidates)
    parts = [first, f"{met} of {len(run.candidates)} judged meet the needs"]
    if len(run.problem.goals) > 1 and met:
        parts.append(f"{len(run.front)} on the front")
    parts.append("computed to full accuracy" if done else "on coarse sets so far")
    return (" · ".join(parts),)


def _table(run: SearchRun, candidate: Candidate, arm: Manipulator) -> str:
    """Objectives and free numbers of a design, beside the same of the present one."""
    rows: list[list[tuple[str]]] = []
    if candidate.is_feasible:
        for goal, value in zip(run.problem.goals, candidate.objectives, strict=True):
            rows.append([(goal.name.replace("_", " "),), (_value_text(goal, value, arm),)])
    elif candidate.fault:
        rows.append([("no design",), (candidate.fault.splitlines()[0],)])
    for name, excess in candidate.missed.items():
        rows.append([(f"misses {name}",), (f"by {excess:.3g} (L, or share)",)])
    shown = {slider.name: slider for slider in slider_parameters(arm)}
    for parameter in run.problem.parameters.free:
        value, label, size = float(candidate.values[parameter.name]), parameter.name, 1.0
        if parameter.name in shown:
            label, size = shown[parameter.name].label, shown[parameter.name].scale
        rows.append([(label,), (f"{value / size:.5g}",)])
    return markup.table(("the design to load", ""), rows)


def _value_text(goal: Goal, value: Any, arm: Manipulator) -> str:
    unit, size = readable_unit(goal.objective.unit, abs(value.value), arm.length_unit)
    return quantity(value.value / size, unit, value.error / size)
