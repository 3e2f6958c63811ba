"""What the arm is for and what was measured on it: live requirements, poses and a fit to them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.calibration import calibrate
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import read_measurements
from softreach.calibration.model import MarkerModel
from softreach.requirements import Box, Check, Finding, Keep, Limits, Requirements, Target, check
from softreach.requirements.checks import checked
from softreach.requirements.parts import TOL
from softreach.studio import markup
from softreach.studio.fields import GRAY, Attribute, Fields, file_text
from softreach.studio.found import Bench, Found, Sample
from softreach.studio.jobs import DESIGN, Given, Job, Learned, Results
from softreach.studio.markup import Part, Swatch, Term
from softreach.studio.scene.camera import add_label
from softreach.studio.scene.scene import DARK, MARK, MARKER, Scene, pieces
from softreach.studio.session import Session
from softreach.studio.state import StudioState, needs_of_text, requirements_of
from softreach.studio.widgets import numbers_in
from softreach.studio.work import rest
from softreach.support.errors import InvalidInput, SoftreachError, counted, no_warnings
from softreach.support.files.columns import read_table
from softreach.support.palette import MET, MISSED, eight_bit
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    from viser import UploadedFile

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
_MEASURED = 0.03  # edge of a dot [L]
_SIGNS = {"met": "\N{CHECK MARK}", "missed": "\N{MULTIPLICATION X}", "undecided": "?"}


def needs(panel: Fields) -> None:
    """Needs of the design, and what it misses of them."""
    session, gui = panel.session, panel.gui
    with panel.folder("requirements"):
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


# Measured poses

_ABOUT_LOAD = "Columns of inputs and of x, y, z of markers, with units: tension1_N, tip_x_mm"
_ABOUT_SAMPLE = "Moves the arm to its inputs: large dots were measured, small ones are predicted"
_ABOUT_FIT = "Finds the numbers with which predicted markers come nearest to measured ones"
_FREE = {
    "pose": "pose of the base",
    "taper": "taper φ",
    "revolution": "revolution Ω",
    "*.offset": "offsets of bundles",
    "*.young_modulus": "Young's moduli",
}
"""Numbers that a fit may change: name -> what the check box says."""


def measured(panel: Fields) -> None:
    """Measured poses: their markers over the arm, a fit to them, and the calibrated design."""
    session = panel.session
    with panel.folder("measured poses", expanded=False):
        read = lambda file: _read_poses(session, file)
        panel.upload("Load measured poses (CSV)", read, _ABOUT_LOAD)
        panel.text("found.bench", content=_bench_text)
        with panel.folder("samples", "found.bench"):
            places = lambda bench: (bench.number, len(bench.data) - 1) if bench else (0, 1)
            at = lambda _, found: places(found.bench)

            def move(number: int) -> None:
                if (bench := session.found.bench) is not None:
                    _pose(session, replace(bench, number=number))

            panel.steps("sample", "found.bench", at=at, move=move, hint=_ABOUT_SAMPLE)
            panel.text("design", "found.bench", "found.sample", content=_residuals_text)
            for name, label in _FREE.items():
                panel.checkbox(label, _is_free(name), "Lets the fit change this number")
            panel.button("Fit", lambda: session.follow("fit"), _ABOUT_FIT)
            panel.html("found.bench", content=_summary)
            about = "Makes the calibrated arm the design; can be undone"
            fitted = lambda state, found: found.bench and found.bench.fitted(state.design)
            apply = lambda state: state.replace(design=fitted(state, session.found) or state.design)
            panel.change("Apply", apply, about, fitted)


def _is_free(name: str) -> Attribute:
    """Whether a fit may change a number; that of the pose before there are data."""

    def write(found: Found, on: bool) -> Found:
        if found.bench is None:
            return found
        free = tuple(each for each in _FREE if (on if each == name else each in found.bench.free))
        return replace(found, bench=replace(found.bench, free=free))

    read = lambda found: name in (found.bench.free if found.bench else ("pose",))
    return Attribute(read, write, "found", "found.bench")


def _read_poses(session: Session, file: UploadedFile) -> None:
    arm, before = session.state.design, session.found.bench
    data = read_measurements(arm, read_table(file.content, file.name))
    free = ("pose",) if before is None else before.free
    _pose(session, Bench(data=replace(data, source=file.name), arm=arm, free=free))


def _pose(session: Session, bench: Bench) -> None:
    """Show a pose, and bring the arm to its inputs."""
    if not bench.fits(session.state.design):
        allowed = "one with the inputs and markers of the data"
        raise InvalidInput("design", "another one", allowed, "load the data again")
    session.update(bench.posed, goes_on=True)
    session.learn({"bench": bench})


def _bench_text(_: StudioState, found: Found) -> list[str]:
    if (bench := found.bench) is None:
        return []
    data = bench.data
    inputs = ", ".join(name or "none" for name in data.input_names)
    samples = f"{counted(len(data), 'sample')} of {', '.join(data.marker_names)}"
    return [f"{data.source}: {samples}; inputs {inputs}"]


def _residuals_text(state: StudioState, found: Found) -> list[str]:
    sample, bench = found.sample, found.bench
    if sample is None or bench is None:
        return ["The arm is not at a measured pose: move the slider."]
    known = zip(bench.data.marker_names, 1e3 * sample.distances, strict=True)
    each = [f"{name} {d:.3g} mm" if np.isfinite(d) else f"{name} unknown" for name, d in known]
    inputs, (low, high) = bench.data.inputs[bench.number], state.design.input_bounds.T
    beyond = bool(((inputs < low) | (inputs > high)).any())
    note = ". Its inputs are beyond the bounds, at which the arm is drawn" if beyond else ""
    return [f"predicted − measured: {', '.join(each)}{note}."]


def _summary(_: StudioState, found: Found) -> str:
    if found.bench is None or (result := found.bench.result) is None:
        return ""
    report = result.report()
    printed = [part for part in report.sections if part.rows and part.printed]
    tables = [markup.table(part.head, part.rows) for part in printed]
    lines = [*(line for part in report.sections for line in part.points), report.verdict]
    if not result.fit.converged:
        lines.append(f"The fit did not converge in {result.fit.evaluations} evaluations.")
    return "".join([*tables, *map(markup.paragraph, lines)])


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


def _predict(given: Given) -> Results:
    """Markers of the pose, while the arm has its inputs."""
    bench, design = given.found.bench, given.state.design
    here = bench is not None and bench.posed(given.state).activation == given.state.activation
    if bench is None or not (here and bench.fits(design)):
        yield Learned({"sample": None})
        return
    arm = bench.fitted(design) or design
    pose = bench.data.of(np.array([bench.number]))
    # The inputs of a pose may be beyond the bounds of the design.
    predicted = MarkerModel.of(free_numbers(arm, ["pose"]), pose).of_arm(arm).places[0]
    yield Learned({"sample": Sample(pose.places[0], predicted, arm)})


def _draw_sample(given: Given) -> None:
    """Measured and predicted markers, lines between them, and the arm that predicts."""
    sample, design, scene = given.found.sample, given.state.design, given.scene
    if sample is None:
        scene.remove("/sample")
        return
    measured, predicted = sample.measured / design.length, sample.predicted / design.length
    scene.dots("/sample/measured", measured, MARK, _MEASURED)
    scene.dots("/sample/predicted", predicted, DARK, MARKER)
    scene.lines("/sample/residuals", np.stack([measured, predicted], axis=1), MARK, 0.005)
    if sample.arm == design:
        scene.remove("/sample/arm")
    else:
        same = given.state.replace(design=sample.arm).activation
        scene.draw_arm(sample.arm, same, "/sample/arm")


def _fit(given: Given) -> Results:
    if (bench := given.found.bench) is None:
        return
    progress = lambda _: given.check()
    with no_warnings():
        result = calibrate(given.state.design, bench.data, free=bench.free, progress=progress)
    yield Learned({"bench": replace(bench, result=result)})


JOBS = (
    Job("needs", f"{DESIGN} needs", _check, _draw_needs, wanted="needs", makes="check"),
    Job("sample", "design activation found.bench", _predict, _draw_sample, wanted="found.bench"),
    Job("fit", "", _fit, doing="calibrating"),
)
