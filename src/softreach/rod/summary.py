"""Summary of a design before any sample is drawn: angles, mass, load number, and warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, groupby
from operator import itemgetter
from typing import Any

import numpy as np

from softreach.arm.actuators import FiberArchitecture, Outline, SectorActuator
from softreach.arm.base import Base
from softreach.arm.body import (
    VERIFIED_LOAD_NUMBER,
    is_overloaded,
    load_number,
    load_number_faults,
    mass,
)
from softreach.arm.driving import extension_range
from softreach.arm.lines import law_warning, line_strains
from softreach.arm.loads import GRAVITIES, Loads
from softreach.arm.manipulator import Manipulator, a_manipulator, scale_warnings
from softreach.arm.number import default_of, fields_of
from softreach.arm.part import AlongArm
from softreach.arm.section import Measured, Stiffness
from softreach.arm.tables import both_sides, check_extension
from softreach.rod.bending import BendingRange, Extreme, bending_over_bounds
from softreach.rod.rest import Rest, rest
from softreach.rod.tip_map import InvalidLoads
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidInput
from softreach.support.units import Rows, lines_of, to_degrees


@dataclass(frozen=True, repr=False)
class DesignSummary:
    """The numbers that a design implies; as text they are what `softreach design` prints."""

    arm: Manipulator
    """The design."""
    helical_angles: Array
    """α of each architecture where it begins [rad]."""
    revolutions: Array
    """Ω of each architecture [rad]."""
    taper_ratio: float
    """R2(0)/R2(L) [-]."""
    extension: tuple[float, float]
    """Smallest and largest ζ in the activation box [-]."""
    curvature: tuple[float, float]
    """Smallest and largest bending κ times L, in the box and along the arm, loads included [-]."""
    bundle_extension: Array
    """Smallest and largest ζ that each activation reaches alone [-], shape (bundle, 2)."""
    bundle_bending: Array
    """Smallest and largest |κ| R2 that each activation reaches alone, without loads [-], shape
    (bundle, 2)."""
    bundle_strain: Array
    """Smallest and largest change of length of each bundle by its own activation alone [-], along
    its middle line, shape (bundle, 2): negative where it shortens."""
    stiffness: Stiffness | None
    """K0 [N], K1 and K3 [N m²] at base and tip; None without Young's modulus."""
    mass: float | None
    """Mass of the arm [kg]; None without density."""
    load_number: float | None
    """Λ = ρ g L³/(E R2²), or (w + P/L) L³/(4 K1) at the base for loads P beside weight [-]; None
    without E or ρ."""
    lacking: tuple[str, ...]
    """Properties to give so that the numbers above are known."""
    validity: tuple[str, ...]
    """Limit of the linear law of each kind of actuator."""
    warnings: tuple[str, ...]
    """Limits that the design touches, each with its number."""

    def __str__(self) -> str:
        return "\n".join([self.table, *(f"warning: {each}" for each in self.warnings)])

    __repr__ = __str__

    @property
    def table(self) -> str:
        """The summary, a line each, without warnings and limits of the linear laws."""
        lines = lines_of(self.rows | self._bundle_rows(), self.arm.length_unit)
        return "\n".join([*lines, *self.lacking])

    @property
    def rows(self) -> Rows:
        """Values and SI units by name, angles in degrees; the arm at rest is computed for them."""
        arm, measured = self.arm, self.arm.section.measured
        given = () if measured is None else fields_of(Measured).items()
        found = [x.meaning for k, x in given if getattr(measured, k) != default_of(Measured, k)]
        pieces, (base, tip) = enumerate(arm.rigid_pieces), arm.profile.radius([0.0, arm.length])
        rows: Rows = {
            "bundles": (arm.bundles, ""),
            "bundle names": (list(arm.bundle_names), ""),
            "helical angle": (to_degrees(self.helical_angles), "deg"),
            "revolution": (to_degrees(self.revolutions), "deg"),
            "length": (arm.length, "m"),
            "outer radius at base": (float(base), "m"),
            "outer radius at tip": (float(tip), "m"),
            "base to tip ratio": (self.taper_ratio, ""),
            "inner to outer radius": (arm.section.inner_ratio, ""),
            "breakpoints": (list(arm.breakpoints), "m"),
            **{f"station {name}": (z, "m") for name, z in arm.stations.items()},
            **{f"rigid piece {k}": (list(each.span(arm.length)), "m") for k, each in pieces},
            "markers": ([marker.name for marker in arm.markers], ""),
            "extension": (list(self.extension), ""),
            "curvature times L": (list(self.curvature), ""),
            "measured": (found, ""),
            **self._stiffness_rows(),
            "mass": (self.mass, "kg"),
            "load number": (self.load_number, ""),
        }
        known = {name: row for name, row in rows.items() if row[0] not in (None, [])}
        return known | load_rows(arm) | _rest_rows(arm)

    def _stiffness_rows(self) -> Rows:
        """K2 and the axis of K1 only where the section is not round."""
        if self.stiffness is None:
            return {}
        section, (axial, bending, torsion) = self.arm.section, self.stiffness
        ratio = section.bending_ratio
        ends = {"K0": (axial, "N"), "K1": (bending, "N m²")}
        ends |= {} if ratio == 1.0 else {"K2": (ratio * bending, "N m²")}
        ends |= {"K3": (torsion, "N m²")}
        rows: Rows = {f"{k} at base and tip": (x.tolist(), unit) for k, (x, unit) in ends.items()}
        angle = to_degrees(section.bending_angle)
        return rows if ratio == 1.0 else rows | {"axis of K1 from x": (angle, "deg")}

    def _bundle_rows(self) -> Rows:
        """Bounds and effects of each activation; neighbors that are equal share a line."""
        arm = self.arm
        texts = [
            f"{_span(arm.bounds[k], unit)}: length {_span(100.0 * self.bundle_strain[k])} %, "
            f"ζ {_span(self.bundle_extension[k])}, |κ| R2 {_span(self.bundle_bending[k])}"
            for k, unit in enumerate(arm.bundle_units)
        ]
        rows: Rows = {}
        for text, group in groupby(zip(texts, arm.bundle_names, strict=True), itemgetter(0)):
            first, *others = [name for _, name in group]
            label = f"{first} to {others[-1]}" if len(others) > 1 else ", ".join([first, *others])
            rows[f"activation {label}"] = (text, "")
        for drive in arm.drives:
            gains = ", ".join(f"{gain:+g} {name}" for name, gain in drive.gains.items())
            rows[f"drive {drive.name}"] = (f"{_span(drive.bounds, drive.unit)}: {gains}", "")
        return rows


def _span(ends: Any, unit: str = "1") -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}{'' if unit == '1' else f' {unit}'}"


def describe(arm: Manipulator) -> DesignSummary:
    """All that a design implies, as `softreach design` prints it.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.

    Examples:
        >>> print(sr.describe(sr.designs.lce_arm()))  # doctest: +ELLIPSIS
        bundles                  ...
    """
    check_extension(a_manipulator("arm", arm))
    base, tip = arm.profile.radius([0.0, arm.length])
    body, bending, alone = (arm.profile, arm.section), _bending(arm), list(_alone(arm))
    bent = [(each.gentlest, each.sharpest.value) for each in map(bending_over_bounds, alone)]
    limits = (f"{part.default_name}: {part.validity}" for part in arm.actuators if part.validity)
    return DesignSummary(
        arm=arm,
        helical_angles=np.array([_angle_at_start(fiber, arm) for fiber in arm.fibers]),
        revolutions=np.array([fiber.revolution_on(*body) for fiber in arm.fibers]),
        taper_ratio=float(base / tip),
        extension=extension_range(arm),
        curvature=(bending.least * arm.length, bending.largest * arm.length),
        bundle_extension=np.array([extension_range(each) for each in alone]).reshape(-1, 2),
        bundle_bending=np.array(bent).reshape(-1, 2),
        bundle_strain=line_strains(arm),
        validity=tuple(dict.fromkeys(limits)),
        warnings=design_warnings(arm),
        **_of_matter(arm),
    )


def _of_matter(arm: Manipulator) -> dict[str, Any]:
    """Stiffness, mass and load number, where moduli and densities are known."""
    moduli, densities = arm.section.modulus_faults(""), arm.section.density_faults("")
    ends = np.array([0.0, arm.length])
    return {
        "stiffness": None if moduli else arm.section.stiffness_at(arm.profile, ends),
        "mass": None if densities else mass(arm),
        "load_number": None if load_number_faults(arm) else load_number(arm),
        "lacking": (
            *_lacking("Young's modulus [Pa]", moduli, "the stiffnesses and the load number"),
            *_lacking("the density [kg/m³]", densities, "the mass and the load number"),
        ),
    }


def _lacking(what: str, faults: list[Fault], known: str) -> Iterator[str]:
    if faults:
        owners = dict.fromkeys(fault.path.rpartition(".")[0] for fault in faults)
        yield f"give {what} of {', '.join(owners)} to know {known}"


def _alone(arm: Manipulator) -> Iterator[Manipulator]:
    """For each activation, the arm without loads whose other activations stay zero."""
    for actuator in arm.actuators:
        bare = arm.replace(actuators=(actuator,), drives=(), loads=None)
        for bundle in range(bare.bundles):
            bounds = np.zeros_like(bare.bounds)
            bounds[bundle] = bare.bounds[bundle]
            yield bare.with_bounds(bounds)


def _angle_at_start(fiber: FiberArchitecture, arm: Manipulator) -> float:
    angle = fiber.helical_angle_on(arm.profile, arm.section)
    start, _ = fiber.span_over_length(arm.length)
    return float(angle(start)) if isinstance(angle, AlongArm) else angle


def design_warnings(arm: Manipulator) -> tuple[str, ...]:
    """One line for each limit that the design touches: none of them makes a result impossible."""
    of_theory = (*_beyond_theory(arm), *filter(None, [law_warning(arm)]))
    of_section = (*_overlaps(arm), *_chambers_outside(arm), *_angle_of_a_round_section(arm))
    return (*scale_warnings(arm), *of_section, *of_theory)


def _bending(arm: Manipulator) -> BendingRange:
    """The range of bending; NaN under loads that no solver follows."""
    try:
        return bending_over_bounds(arm)
    except InvalidInput:
        return BendingRange(np.nan, np.nan, np.nan, Extreme(np.nan, 0.0), exact=False)


def _beyond_theory(arm: Manipulator) -> Iterator[str]:
    sharpest = _bending(arm).sharpest
    if sharpest.value >= 1:
        place = f"Z = {sharpest.station / arm.length:.2f} L"
        yield (
            f"bending reaches |κ| R2 = {sharpest.value:.2f} at {place}: the inner side would fold "
            "where it is 1 or more, and the theory ends there"
        )
    largest = max((float(np.abs(fiber.bounds).max()) for fiber in arm.fibers), default=0.0)
    if largest > 1:
        yield (
            f"activations reach |γ| = {largest:.3g}: above 1 a fiber would shorten by more than "
            "its length, so that γ is a load on the matrix there, not a strain of the fiber"
        )
    if not load_number_faults(arm) and is_overloaded(arm):
        yield (
            f"the load number is {load_number(arm):.3g}: shapes under loads were verified up to "
            f"{VERIFIED_LOAD_NUMBER:g}"
        )


def _overlaps(arm: Manipulator) -> Iterator[str]:
    """Pairs of bundles in one ring whose sectors meet between base and tip.

    Different rings may overlap on purpose, each with its own stiffness: they do not share matter.
    """
    z = both_sides(arm, arm.profile.station(np.linspace(0.0, arm.profile.slender_length, 201)))
    outline, ring_of = arm.outline(z), arm.section.ring_index
    rings = [
        ring_of(actuator.ring) if isinstance(actuator, SectorActuator) else None
        for actuator in arm.bundle_actuators
    ]
    for first, second in combinations(range(arm.bundles), 2):
        if rings[first] is None or rings[first] != rings[second]:
            continue
        depth, place = _overlap(outline, z, first, second)
        if depth > 1e-9:
            names = f"{arm.bundle_names[first]} and {arm.bundle_names[second]}"
            yield (
                f"sectors of {names} overlap by up to {np.degrees(depth):.3g}° "
                f"(from Z = {place / arm.length:.2f} L): both contract the same matter"
            )


def _chambers_outside(arm: Manipulator) -> Iterator[str]:
    z = both_sides(arm, np.linspace(0.0, arm.length, 201))
    outline = arm.outline(z)
    reached = np.where(outline.acts, outline.outer_ratio, 0.0)
    for bundle, name in enumerate(arm.bundle_names):
        outer, place = float(reached[:, bundle].max()), z[int(reached[:, bundle].argmax())]
        if outline.shape[bundle] == "lumen" and outer > 1 + 1e-9:
            yield (
                f"{name} reaches out to {outer:.3g} R2 at Z = {place / arm.length:.2f} L: "
                "the arm does not enclose its lumen there"
            )


def _angle_of_a_round_section(arm: Manipulator) -> Iterator[str]:
    section = arm.section
    if section.measured and section.measured.angle and section.bending_ratio == 1.0:
        yield "measured.angle turns nothing: give bending_stiffness two numbers, K1 and K2"


def _overlap(outline: Outline, z: Array, first: int, second: int) -> tuple[float, float]:
    """Largest overlap of two sectors [rad] and the first Z where they overlap [m]."""
    pair = [first, second]
    shares = outline.acts[:, first] & outline.acts[:, second]
    if not shares.any():
        return 0.0, 0.0
    extent = outline.extent[pair].mean()
    apart = outline.center[:, second] - outline.center[:, first]
    depth = extent - np.abs((apart + np.pi) % (2 * np.pi) - np.pi)
    # Where the distance passes a whole turn between two stations, the overlap there is complete.
    turns = np.round(apart / (2 * np.pi))
    passes = (np.diff(np.sign(apart - 2 * np.pi * turns)) != 0) & (np.diff(turns) == 0)
    deepest = np.where(np.append(passes, False), extent, depth)
    deepest[~shares] = -np.inf
    touching = shares & (depth > 0)
    first = int(np.argmax(touching if touching.any() else shares))
    begins = float(z[first])
    if touching[first] and first > 0 and shares[first - 1]:
        begins = float(np.interp(0.0, depth[first - 1 : first + 1], z[first - 1 : first + 1]))
    return float(deepest.max()), begins


def load_rows(arm: Manipulator) -> Rows:
    """Posture of the base, gravity, and all other loads that are not 0; all of it in the world."""
    loads, posed = arm.loads, not arm.base.is_identity
    rows: Rows = {"base": (str(arm.base), "")} if posed else {}
    if loads is None:
        return rows
    if any(loads.gravity):
        gravity = loads.seen_from(arm.base).gravity  # a straight arm points along +z there
        angle = to_degrees(math.acos(-gravity[2] / math.hypot(*gravity)))
        words = {0: "upright", 90: "sideways", 180: "hanging"}
        posture = words.get(round(angle, 6), f"tilted from upright by {angle:.4g}°")
        posture += f": {arm.base}" if posed else ""
        rows = {"gravity": (list(loads.gravity), "m/s²"), "base": (posture, "")}
    for field, number in fields_of(type(loads)).items():
        value = getattr(loads, field)
        if field != "gravity" and (any(value) if isinstance(value, tuple) else value):
            rows[field.replace("_", " ")] = (value, number.unit)
    return rows | ({"point loads": (len(loads.point_loads), "")} if loads.point_loads else {})


def _rest_rows(arm: Manipulator) -> Rows:
    """Sag and stability of the arm without activation.

    Without loads: the sag under its own weight of an arm held sideways, and whether it would stand
    upright; nothing where moduli or densities are not known, or loads can't act.
    """
    if load_number_faults(arm) or arm.section.load_faults():
        return {}
    sideways, upright = " sideways", " upright"
    if arm.loads is not None:
        held = stood = _rest(arm)
        sideways = upright = ""
    else:
        ways = (Loads(gravity=GRAVITIES[way]) for way in ("sideways", "down"))
        held, stood = (_rest(arm.replace(loads=loads, base=Base())) for loads in ways)
    status = stood.status.name.lower() if stood else "unknown: the loads are too large"
    return {
        f"sag at rest{sideways}": (held.sag if held else None, "m"),
        f"at rest{upright}": (status.replace("_", " "), ""),
    }


def _rest(arm: Manipulator) -> Rest | None:
    """The arm at rest; None under loads too large to compute it."""
    try:
        return rest(arm)
    except InvalidLoads:
        return None
