"""The design: sliders of the body, numbers of its parts, base and loads; parts come and go."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

from softreach.arm import designs, edits
from softreach.arm.base import POINTS
from softreach.arm.design_file import in_file_terms
from softreach.arm.loads import GRAVITIES, Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.section import material_names
from softreach.arm.stations import Marker
from softreach.studio import shown_parameters
from softreach.studio.fields import GRAY, Attribute, Build, Fields, attribute, in_unit, of_design
from softreach.studio.figures import NO_BAR, SlopeBar, slope_bars
from softreach.studio.found import Found
from softreach.studio.shown_parameters import Part, ShownParameter, part_parameters, parts
from softreach.studio.state import StudioState, rod_of
from softreach.studio.tabs.solids import UNITS_OF_MESHES, solid, with_mesh
from softreach.studio.widgets import Line, Slider, TextKind, number_kind, vector_kind
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, SoftreachError
from softreach.support.units import LengthUnit

Numbers = Callable[[Manipulator], Sequence[ShownParameter]]

_ABOUT_BARS = "Bars: change of V over 1 % of each slider's range."
_ABOUT_START = "Replaces the whole design by an arm of the literature or an example; can be undone"
_AS_TYPED, _AS_INNERMOST = "(as typed)", "as the innermost ring"
_NEW_RING, _TOOL = "ring", "tool"
_ABOUT_UNIT = "Unit of the file of a mesh: a GLB is in m, few others say what they are in"
_ABOUT_MESH = "STL, OBJ, PLY, OFF or GLB, closed: the arm must not touch it"
_MESHES = ".stl,.obj,.ply,.off,.glb"
_NAME = TextKind("a name", lambda text: text.strip() or None, str)
_ABOUT_MATERIAL = "Sets modulus, Poisson's ratio and density to those of a known material"
_WAYS = {name: name for name in POINTS} | {"up": "up (upright)", "down": "down (hanging)"}
_WAYS[""] = "as the file says"
_NONE = Loads(gravity=GRAVITIES["none"])
_MOST = 1e6  # of any unit that is typed: far above what an arm bears, far below an overflow
_NEEDED = {"young_modulus": "the modulus", "density": "the density"}
_LEVER = "From the tip to the center of the payload's mass, as x, y, z in the tip's directors"
_LOADS = {
    "gravity": ("g", "m/s²", 1.0, "g: acceleration of gravity as x, y, z in the world, z up"),
    "payload": ("payload", "g", 1e-3, "m: mass at the tip; it weighs what gravity makes of it"),
    "payload_arm": ("lever arm", "", 0.0, _LEVER),
    "tip_force": ("tip force", "N", 1.0, "F: force on the tip as x, y, z in the world"),
}
"""Loads that are typed: field -> label, unit ("" for that of lengths), its size, and meaning."""


def design(panel: Fields) -> None:
    """Sliders of a design, each with the change of the volume by it."""
    _numbers(panel, "design", shown_parameters.slider_parameters, _sliders)
    _numbers(panel, "body", shown_parameters.body_numbers, _typed)
    names = {"": "this design"} | {name: name for name in designs.__all__}
    read = lambda state: next((name for name, arm in _designs().items() if arm == state.design), "")
    write = lambda state, name: state.replace(design=_designs()[name]) if name else state
    panel.dropdown("start from", names, Attribute(read, write, follows="design"), _ABOUT_START)


def _numbers(panel: Fields, label: str, shown: Numbers, build: Build) -> None:
    """Fields of parameters, made anew for a design that has others."""
    session = panel.session
    arm = lambda: session.state.design

    def words(error: SoftreachError) -> str:
        session.learn({"ends": {}})  # perhaps a slider does not end where it should
        session.follow("slopes")
        return shown_parameters.refusal(error, shown(arm()), arm())

    def remake(fields: Fields, _: object) -> None:
        fields.words = words
        build(fields, shown(arm()))

    key = lambda state, _: [each[:2] for each in shown(state.design)]
    panel.anew(label, "design", key=key, build=remake)


def _typed(panel: Fields, numbers: Sequence[ShownParameter]) -> None:
    for each in numbers:
        panel.typed(each.label, of_design(each.read, each.write), each.hint)


def _sliders(panel: Fields, shown: Sequence[ShownParameter]) -> None:
    about = lambda state, found: [_ABOUT_BARS] * _has_bars(state, found)
    panel.text("design", "found.slopes", content=about)
    rows, bars, told = dict[str, Slider](), dict[str, Line](), dict[str, SlopeBar]()
    before = panel.session.found.ends  # of a design with other sliders
    for each in shown:
        at = of_design(each.read, each.write)
        rows[each.name] = panel.slider(each.label, each.limits, each.step, at, each.hint)
        if not each.whole:  # what jumps has no slope
            bars[each.name] = panel.kept(Line(panel.gui))

    def end(_: StudioState, found: Found) -> None:
        for name, row in rows.items() if found.ends is not before else ():
            low, high = found.ends.get(name, row.ends)
            if (low, high) != row.ends and low < high:
                row.ends = low, high

    def tell(_: StudioState, found: Found) -> None:
        told.clear()
        if found.slopes is not None:
            ranges = {name: row.ends[1] - row.ends[0] for name, row in rows.items()}
            sliders = {each.name: (each, ranges[each.name]) for each in shown}
            told.update(slope_bars(found.slopes, sliders))

    def draw(state: StudioState, found: Found) -> None:
        old = found.slopes is not None and found.slopes.arm != state.design
        drawn = dict.fromkeys(bars, NO_BAR * _has_bars(state, found))
        drawn |= {name: each.html(old=old) for name, each in told.items()}
        for name, line in bars.items():
            line.show(drawn[name])

    panel.follow("found.ends", show=end)
    panel.follow("found.slopes", "found.ends", show=tell)
    panel.follow("design", "found.slopes", "found.ends", show=draw)


def _has_bars(state: StudioState, found: Found) -> bool:
    """True if there is a volume to change, as far as that is known."""
    slopes = found.slopes
    return rod_of(state.design).box.dimension > 2 if slopes is None else bool(slopes.slopes)


@cache
def _designs() -> dict[str, Manipulator]:
    return {name: getattr(designs, name)() for name in designs.__all__}


def arm_parts(panel: Fields) -> None:
    """A list of parts, the fields of the one that is chosen, and new parts."""
    session = panel.session
    with panel.folder("add a part", expanded=False):
        kinds = (*edits.ACTUATOR_KINDS, _NEW_RING, *edits.SOLID_KINDS)
        hint = "An actuator, a ring of the cross-section, or a solid that the arm must not touch"
        kind = panel.gui.add_dropdown("kind", kinds, hint=hint)
        add = lambda: grow(lambda arm: _with_part(arm, kind.value))
        panel.button("Add", add, "Adds this part, with numbers to be changed below")
        unit = panel.gui.add_dropdown("unit of mesh", UNITS_OF_MESHES, hint=_ABOUT_UNIT)
        read = lambda file: grow(lambda arm: with_mesh(arm, file.name, file.content, unit.value))
        panel.upload("Load a mesh as a solid", read, _ABOUT_MESH, mime_type=_MESHES, **GRAY)

    def grow(with_part: Callable[[Manipulator], Manipulator]) -> None:
        before = parts(session.state.design)
        panel.apply(lambda state: state.replace(design=with_part(state.design)))
        if new := [k for k, label in enumerate(parts(session.state.design)) if label not in before]:
            session.learn({"part": new[-1]})

    def build(fields: Fields, chosen: tuple[Mapping[str, Part], str, object]) -> None:
        fields.message, fields.words = message, words
        _part(fields, *chosen[:2])

    def words(error: SoftreachError) -> str:
        arm, (known, label, _) = session.state.design, _chosen(session.state, session.found)
        return shown_parameters.refusal(error, part_parameters(arm, known[label]), arm)

    panel.anew("part", "design", "found.part", key=_chosen, build=build)
    message = panel.kept(Line(panel.gui))
    panel.message, panel.words = message, words


def tool(panel: Fields) -> None:
    """The point that counts as the tip: the tip itself, a straight tool, or a marker."""
    unit = lambda state, _: shown_parameters.typed_unit(state.design)
    pointed = panel.session.state.design.point is not None
    panel.anew("tool", "design", key=unit, build=_tool, expanded=pointed)


def _tool(panel: Fields, unit: LengthUnit) -> None:
    def offered(state: StudioState) -> dict[str, str]:
        known = {marker.name: marker.name for marker in state.design.markers}
        return {"": "none", _TOOL: "a straight tool"} | known

    def choose(arm: Manipulator, name: str) -> Manipulator:
        if name and name not in {marker.name for marker in arm.markers}:
            new = Marker(name=name, offset=(0.0, 0.0, float(f"{0.1 * arm.length:.2g}")))
            return arm.replace(markers=(*arm.markers, new), point=name)
        return arm.replace(point=name or None)

    def place(arm: Manipulator, offset: Any) -> Manipulator:
        held = arm.pointed
        made = (m if m is not held else m.replace(offset=offset) for m in arm.markers)
        return arm.replace(markers=tuple(made))

    at = of_design(lambda arm: arm.point or "", choose)
    panel.dropdown("tool", offered, at, "The point that counts as the tip in all that is computed")
    offset = lambda arm: arm.pointed.offset if arm.pointed else (0.0, 0.0, 0.0)
    about = "Point of the tool, from the center of its section: across it x, y, and z along the arm"
    panel.typed(unit.label("tool point"), in_unit(offset, place, 0.0), about, vector_kind)


def _chosen(state: StudioState, found: Found) -> tuple[Mapping[str, Part], str, object]:
    """The parts by their labels, the label of the chosen one, and names of its numbers."""
    known = parts(state.design)
    label = [*known][min(found.part, len(known) - 1)]
    return known, label, [each.name for each in part_parameters(state.design, known[label])]


def _part(panel: Fields, known: Mapping[str, Part], label: str) -> None:
    session, part, labels = panel.session, known[label], tuple(known)
    read = lambda found: min(found.part, len(labels) - 1)
    chosen = attribute("part")._replace(read=read, of="found", follows="found.part")
    panel.dropdown("edit", dict(enumerate(labels)), chosen, "The part whose numbers are below")
    own = part.ring is not None or part.solid is not None or bool(part.actuator)
    if own:
        at = of_design(lambda _: part.name, lambda arm, name: part.changed(arm, name=name))
        panel.typed("name", at, "What tables and files call it", lambda *_: _NAME)
    _add_matter(panel, part)
    _typed(panel, part_parameters(session.state.design, part))
    if part.solid is not None:
        solid(panel, part)
    if own:
        remove = lambda state: state.replace(design=part.removed(state.design))
        panel.change("Remove", remove, "Takes the part out of the design", **GRAY)


def _with_part(arm: Manipulator, kind: str) -> Manipulator:
    if kind in edits.SOLID_KINDS:
        return edits.with_solid(arm, kind)
    return edits.with_ring(arm) if kind == _NEW_RING else edits.with_actuator(arm, kind)


def _add_matter(panel: Fields, part: Part) -> None:
    """What a ring is made of, and the ring that an actuator is in."""
    ring, arm = part.ring, panel.session.state.design
    if ring is not None:
        read = lambda arm: arm.section.rings[ring].material.name
        write = lambda arm, name: part.changed(arm, material=name) if name else arm
        _material(panel, "material", _AS_TYPED, of_design(read, write))
    if ring == 0:
        core = lambda arm: arm.section.core.name if arm.section.core else ""
        _material(panel, "core", _AS_INNERMOST, of_design(core, edits.with_core))
    if part.home is not None and len(arm.section.rings) > 1:
        rings = {k: edits.ring_label(arm, k) for k in range(len(arm.section.rings))}
        home = lambda arm: next(p.home for p in parts(arm).values() if p.actuator == part.actuator)
        read = lambda arm: arm.section.rings.index(arm.section.ring(home(arm) or 0))
        at = of_design(read, lambda arm, ring: part.changed(arm, ring=ring))
        panel.dropdown("in ring", rings, at, "The ring that it lies in")


def _material(panel: Fields, label: str, none: str, at: Attribute) -> None:
    names = {"": none} | {name: name for name in material_names()}
    known = at._replace(read=lambda state: name if (name := at.read(state)) in names else "")
    panel.dropdown(label, names, known, _ABOUT_MATERIAL)


def loads(panel: Fields) -> None:
    """Base, gravity, a payload and a force on the tip, as they are typed."""
    loaded = panel.session.state.design.loads is not None
    unit = lambda state, _: shown_parameters.typed_unit(state.design)
    panel.anew("base and loads", "design", key=unit, build=_base_and_loads, expanded=loaded)


def _base_and_loads(panel: Fields, unit: LengthUnit) -> None:
    read = lambda arm: arm.base.points if isinstance(arm.base.points, str) else ""
    write = lambda arm, way: arm.replace(base=arm.base.replace(points=way)) if way else arm
    way = "Which way the straight arm points from its base, in the world"
    panel.dropdown("base", _WAYS, of_design(read, write), way)
    where = "r(0): where the arm is clamped, as x, y, z in the world"
    panel.typed(unit.label("base at"), base_field("position"), where, vector_kind)
    turn = "ψ: turn of the base about the way the arm points"
    panel.typed("turn [deg]", base_field("turn"), turn)
    gravity, names = load_field("gravity"), {name: name for name in GRAVITIES} | {"": "as typed"}
    to = lambda state, name: gravity.write(state, GRAVITIES[name]) if name else state
    falls = "Direction of gravity in the world; the base says which way the arm points"
    panel.dropdown("gravity", names, Attribute(gravity_name, to), falls)
    for name, (label, symbol, _, hint) in _LOADS.items():
        kind = number_kind if name == "payload" else vector_kind
        panel.typed(f"{label} [{symbol or unit.name}]", load_field(name), hint, kind)
    panel.message = panel.kept(Line(panel.gui))
    off, about = lambda s: s.replace(design=s.free or s.design), "Gravity, payload and all forces"
    panel.change("Take all loads off", off, about, "design.loads", **GRAY)


def gravity_name(state: StudioState) -> str:
    """Name of the gravity in the list of directions; "" for any other."""
    gravity = (state.design.loads or _NONE).gravity
    return next((name for name, known in GRAVITIES.items() if known == gravity), "")


def base_field(name: str) -> Attribute:
    """Position in the unit of lengths that are typed, or turn in degrees."""
    moved = lambda arm, value: arm.replace(base=arm.base.replace(**{name: value}))
    size = math.radians(1.0) if name == "turn" else 0.0
    return in_unit(lambda arm: getattr(arm.base, name), moved, size)


def load_field(name: str) -> Attribute:
    """A load as it is typed; other loads stay, and without any the arm has no loads."""
    label, symbol, size, _ = _LOADS[name]
    low = 0.0 if name == "payload" else -_MOST

    def write(arm: Manipulator, value: Any) -> Manipulator:
        unit = symbol or shown_parameters.typed_unit(arm).name
        scale = size or shown_parameters.typed_unit(arm).size
        for number in value if isinstance(value, tuple) else (value,):
            if not low <= number / scale <= _MOST:
                allowed = f"{low:,.0f} to {_MOST:,.0f} {unit}"
                raise InvalidInput(label, f"{number / scale:g} {unit}", allowed)
        loads = (arm.loads or _NONE).replace(**{name: value})
        try:
            return arm.replace(loads=None if loads == _NONE else loads)
        except InvalidDesign as error:
            raise _in_words(error) from None

    return in_unit(lambda arm: getattr(arm.loads or _NONE, name), write, size)


def _in_words(error: InvalidDesign) -> InvalidDesign:
    """Moduli and densities that loads need and an arm lacks, in one line."""
    lacking: dict[str, list[str]] = {}
    for fault in error.faults:
        owner, _, field = fault.path.rpartition(".")
        if field not in _NEEDED:
            return in_file_terms(error, "")
        lacking.setdefault(shown_parameters.owner_label(owner), []).append(_NEEDED[field])
    needed = "; ".join(f"{' and '.join(what)} of {owner}" for owner, what in lacking.items())
    line = f"need {needed}: choose a material or type the numbers on the tab Parts"
    return InvalidDesign([Fault("loads", None, line)])
