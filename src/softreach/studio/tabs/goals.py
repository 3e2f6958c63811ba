"""What the arm is for: live requirements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.requirements import Box, Check, Finding, Keep, Limits, Requirements, Target, check
from softreach.requirements.checks import checked
from softreach.requirements.parts import TOL
from softreach.studio import markup
from softreach.studio.fields import GRAY, Fields, file_text
from softreach.studio.found import Found
from softreach.studio.jobs import DESIGN, Given, Job, Learned, Results
from softreach.studio.markup import Part, Swatch, Term
from softreach.studio.scene.camera import add_label
from softreach.studio.scene.scene import Scene, pieces
from softreach.studio.session import Session
from softreach.studio.state import StudioState, needs_of_text, requirements_of
from softreach.studio.widgets import numbers_in
from softreach.studio.work import rest
from softreach.support.errors import InvalidInput, SoftreachError, no_warnings
from softreach.support.palette import MET, MISSED, eight_bit
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    pass

_EMPTY = {
    "place to reach": "x, y, z in {unit}; empty: where the tip is",
    "place at the target": "nothing: the target of the tab Move",
    "box to stay inside": "x, y, z, x, y, z of two corners in {unit}; empty: around what is drawn",
    "box to avoid": "x, y, z, x, y, z of two corners in {unit}",
    "payload": "mass at the tip in g",
    "most shortening": "of any bundle, in %",
}
"""Kind of need -> contents of its field, in words."""
_ALL = "everything"
_ACCURACY = 0.03  # of shares that are covered, and of distances between stations
_PAUSE = 0.4  # [s] without a change, before needs that are missed are looked at again
_POSES = ("reach", "cover", "stay_inside", "avoid")  # kinds of findings that other poses may change
VERDICTS = {"met": eight_bit(MET), "missed": eight_bit(MISSED), "undecided": (200, 130, 0)}
"""Colors of needs; a ball is reached and a cross missed, for who cannot tell them apart."""
_BALL, _CROSS, _FINE, _BROAD = 0.034, 0.022, 0.004, 0.008  # of needs [L]
_REGION = {"stay_inside": (70, 110, 170), "avoid": (135, 135, 140), "cover": (90, 150, 130)}
_MOST_LABELS = 20  # more would hide each other
_SIGNS = {"met": "\N{CHECK MARK}", "missed": "\N{MULTIPLICATION X}", "undecided": "?"}


def needs(panel: Fields) -> None:
    """Needs of the design, and what it misses of them."""
    session, gui = panel.session, panel.gui
    with panel.folder("requirements"):
        panel.say("Say what the arm is for: what it misses is shown while you change it.")
        about = "A place for the tip, a box for the arm at these places, or a limit"
        kind = gui.add_dropdown("add", tuple(_EMPTY), hint=about)
        field = gui.add_text("numbers", "", hint="Numbers with commas between them")
        unit = lambda: session.state.design.length_unit
        expected = lambda *_: [_EMPTY[kind.value].format(unit=unit().name)]
        line = panel.text("design", content=expected)
        kind.on_update(lambda _: line.say(*expected()))

        def add() -> None:
            add_need(session, kind.value, field.value)
            field.value = ""

        panel.button("Add to the needs", add, about)
        panel.html("design", "found.check", "found.check_refusal", content=verdict)
        one = "One of the needs, or all of them"
        part: Any = gui.add_dropdown("remove", (_ALL,), hint=one, visible=False)
        parts = lambda: needs_parts(requirements_of(session.state.needs), unit())

        def offer(*_: object) -> None:
            part.visible = bool(session.state.needs)
            if tuple(part.options) != (options := (*parts(), _ALL)):
                part.options, part.value = options, options[0]

        panel.follow("design", "needs", show=offer)
        remove = lambda: _keep(session, parts().get(part.value, Requirements()))
        panel.button("Remove", remove, one, "needs")
        read = lambda file: read_needs(session, file.name, file.content)
        about = "Requirements as softreach check and softreach search read them"
        panel.upload("Load needs (TOML)", read, about, **GRAY)
        save = lambda: session.send("needs.toml", session.state.needs.encode)
        about = "The needs as a file for softreach check and softreach search"
        panel.button("Save needs (TOML)", save, about, "needs", **GRAY)


def verdict(state: StudioState, found: Found) -> str:
    """What is met and what is missed, or why that is not known, as HTML."""
    if (check := found.check) is None:
        return markup.alert(found.check_refusal) if found.check_refusal else ""
    lines: list[tuple[Part, ...]] = []
    for finding in check.findings:
        sign, mark = _SIGNS[finding.verdict], Swatch(VERDICTS[finding.verdict])
        text = _reach_text(check, finding) if finding.kind == "reach" else finding.text
        lines.append((mark, f" {sign} ", Term(finding.name, finding.text), f": {text}"))
    if check.arm != state.design:
        lines.append(("of the design before, computing ...",))
    return "".join(markup.paragraph(*parts) for parts in lines)


def _reach_text(check: Check, finding: Finding) -> str:
    """A target in words: reached, or missed by its largest gap."""
    count, _, worst = finding.text.partition("; ")
    if finding.met:
        return "reached"
    gap = check.arm.length_unit.rounded(finding.excess * check.arm.length, digits=".3g")
    why = "not held: no stable equilibrium" if "not held" in worst else f"missed by {gap}"
    if "off the direction" in worst:
        why = worst.partition(" is ")[2].partition(";")[0]
    return why if count.startswith("0 of 1 ") else f"{count}, {why}"


def verdict_text(check: Check) -> str:
    """Number of needs that are met, and the worst that is not, in words."""
    missed = [finding for finding in check.findings if not finding.met]
    text = f"needs: {len(check.findings) - len(missed)} of {len(check.findings)} met"
    if not missed:
        return text
    worst = max(missed, key=lambda finding: finding.excess)
    more = f" {_reach_text(check, worst)}" if worst.kind == "reach" else ""
    return f"{text} · {worst.name}{more}{' undecided' * (worst.verdict == 'undecided')}"


def add_need(session: Session, kind: str, text: str) -> None:
    """Add one of the kinds of needs, as its field is filled; other numbers are refused."""
    state, needs = session.state, requirements_of(session.state.needs)
    (unit, size), length = state.design.length_unit, state.design.length
    is_empty = not text.strip()

    def numbers(count: int, unit: str) -> tuple[float, ...]:
        if (read := numbers_in(text, count, unit, length)) is None:
            words = {1: "a number", 3: "three numbers, such as 0.2, 0, 0.7", 6: "six numbers"}
            raise InvalidInput("numbers", repr(text), words[count])
        return read

    if kind == "place to reach" and is_empty:
        if (tip := session.found.tip) is None:
            raise InvalidInput("tip", "nowhere", "in equilibrium, or type a place")
        add_place(session, length * tip)
    elif kind == "place to reach":
        add_place(session, [size * x for x in numbers(3, unit)])
    elif kind == "place at the target":
        if state.target is None:
            raise InvalidInput("target", "none", "set in the tab Move")
        add_place(session, state.target)
    elif kind == "payload":
        payload = numbers(1, "g")[0] / 1e3
        _keep(session, needs.replace(payloads=(*needs.payloads, payload)))
    elif kind == "most shortening":
        _keep(session, _limited(needs, shortening=numbers(1, "%")[0] / 100.0))
    else:
        inside = kind == "box to stay inside"
        corners = np.array(session.scene.axes.corners) * length
        if not (inside and is_empty):
            corners = size * np.array(numbers(6, unit)).reshape(2, 3)
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        keep = Keep(Box(tuple(low), tuple(high)), inside, name=_unused("box", needs.keeps))
        _keep(session, needs.replace(keeps=(*needs.keeps, keep)))


def add_place(session: Session, place: Iterable[float]) -> None:
    """Add one more place to reach [m]."""
    needs = requirements_of(session.state.needs)
    target = Target(np.array([[*place]]), name=_unused("place", needs.targets))
    _keep(session, needs.replace(targets=(*needs.targets, target)))


def read_needs(session: Session, name: str, content: bytes) -> None:
    """Make the requirements in a file the needs."""
    length = session.state.design.length
    _keep(session, needs_of_text(file_text(name, content), length=length, source=name))


def _keep(session: Session, needs: Requirements) -> None:
    """Make them the needs of the state; none are an empty text."""
    text = needs.to_toml()
    text = "" if text == Requirements().to_toml() else text
    session.update(lambda state: state.replace(needs=text))


def needs_parts(needs: Requirements, unit: LengthUnit) -> dict[str, Requirements]:
    """Every part in words -> the requirements without it."""

    def without(field: str, out: object) -> Requirements:
        rest = tuple(each for each in getattr(needs, field) if each is not out)
        return needs.replace(**{field: rest})

    parts: dict[str, Requirements] = {}
    for target in needs.targets:
        where = f" {unit.place(target.points[0])}" if len(target.points) == 1 else ""
        parts[target.name + where] = without("targets", target)
    for keep in needs.keeps:
        parts[f"{keep.name}, to {keep.kind.replace('_', ' ')}"] = without("keeps", keep)
    for mass in needs.payloads:
        parts[f"payload {1e3 * mass:.6g} g"] = without("payloads", mass)
    for name in needs.limits.given:
        parts[f"limit of {name.replace('_', ' ')}"] = _limited(needs, **{name: None})
    for name in needs.measures:
        rest = {each: ends for each, ends in needs.measures.items() if each != name}
        parts[f"measure {name}"] = needs.replace(measures=rest)
    return parts


def _limited(needs: Requirements, **limits: Any) -> Requirements:
    return needs.replace(limits=Limits(**{**needs.limits.given, **limits}))


def _unused(kind: str, parts: Sequence[Target | Keep]) -> str:
    """The first of "place 1", "place 2" and so on that no part is called."""
    names = {part.name for part in parts}
    return next(name for k in range(1, len(names) + 2) if (name := f"{kind} {k}") not in names)


def _check(given: Given) -> Results:
    """By poses that are found in some milliseconds; by every pose where these miss something."""
    state = given.state
    if not state.needs:
        yield Learned({"check": None, "check_refusal": ""})
        return
    try:
        with no_warnings():
            quick = checked(state.design, requirements_of(state.needs), _ACCURACY, quick=True)
    except SoftreachError as error:
        yield Learned({"check": None, "check_refusal": str(error)})
        return
    yield Learned({"check": quick, "check_refusal": ""})
    if any(not finding.met and finding.kind in _POSES for finding in quick.findings):
        rest(given.check, _PAUSE)
        progress = lambda _: given.check()
        with no_warnings():
            made = check(quick.arm, quick.requirements, accuracy=_ACCURACY, progress=progress)
        yield Learned({"check": made})


def _draw_needs(given: Given) -> None:
    check, scene = given.found.check, given.scene
    scene.remove("/needs")
    if check is None:
        return
    if len(check.places):
        _draw_places(check, scene)
    length, needs = check.arm.length, check.requirements
    around = length * np.array(scene.axes.corners)
    verdicts = {(each.kind, each.name): each.verdict for each in check.findings}
    named = [(keep.kind, keep.name, keep.region) for keep in needs.keeps]
    named += [("cover", t.name, t.region) for t in needs.targets if t.region is not None]
    for k, (kind, name, region) in enumerate(named):
        lines = np.concatenate([pieces(line / length) for line in region.wireframe(around)])
        color, width = _REGION[kind], _FINE
        if (verdict := verdicts.get((kind, name), "met")) != "met":
            color, width = VERDICTS[verdict], _BROAD
        scene.lines(f"/needs/region {k}", lines, color, width)


def _draw_places(check: Check, scene: Scene) -> None:
    length, rows = check.arm.length, np.arange(len(check.places))
    places, met = check.places / length, check.reached.all(axis=0)
    turned = np.nan_to_num(check.direction_errors)
    worst = (check.gaps + length * turned).argmax(axis=0)  # of the payloads
    gaps, nearest = check.gaps[worst, rows], check.nearest[worst, rows] / length
    scene.dots("/needs/reached", places[met], VERDICTS["met"], _BALL)
    missed = np.flatnonzero(~met)
    arms = _CROSS * np.array([[1, 0, 1], [1, 0, -1], [0, 1, 0]]) / np.sqrt([[2], [2], [1]])
    cross = places[missed][:, None, None] + np.stack([-arms, arms], axis=1)
    scene.lines("/needs/missed", cross.reshape(-1, 2, 3), VERDICTS["missed"], _BROAD)
    ways = np.stack([places, nearest], axis=1)[missed]
    scene.lines("/needs/gaps", ways, VERDICTS["missed"], _FINE)
    for k in missed[:_MOST_LABELS]:
        text = check.arm.length_unit.rounded(float(gaps[k]), digits=".3g")
        if gaps[k] <= max(check.requirements.within[k], TOL * length):
            text = f"{np.degrees(turned[worst[k], k]):.3g}°"
        add_label(scene.api, f"/needs/label {k}", text, places[k] + [0.0, 0.0, 2.0 * _CROSS])


JOBS = (Job("needs", f"{DESIGN} needs", _check, _draw_needs, wanted="needs", makes="check"),)
