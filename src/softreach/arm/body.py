"""The body of an arm: what bends, and what acts in it and on it, wherever it is clamped.

Its tables and tensions follow from it alone, and so do its mass and Λ.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.actuators.actuator import MOST_BUNDLES, MOST_TURN, Actuator, Outline, Resultants
from softreach.arm.loads import Loads
from softreach.arm.number import number
from softreach.arm.part import Part, Samples, faults_under, gathered, kind_faults, values_along
from softreach.arm.profile import Profile
from softreach.arm.section import Section, Stiffness, name_faults
from softreach.arm.stations import Located, RigidPiece, Stations, placed
from softreach.support.arrays import Array, as_stations, joined, read_only, rows
from softreach.support.errors import Fault, InvalidDesign
from softreach.support.lazy import lazy

VERIFIED_LOAD_NUMBER = 12.0  # Largest Λ for which loaded arms were verified over the box

# Exact for the square of a cubic, which is the mass of a piece of any profile.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, kw_only=True)
class RestShape(Part):
    """Curvature û of the arm before it is driven or loaded, in its directors.

    A cast arm keeps a bend, a wire its coil: each number is constant, or drawn through samples
    along the arm.

    Raises:
        InvalidDesign: A number is not finite.
    """

    curvature_x: float | Samples = number(
        "û1", "1/m", "curvature at rest about the first director", along=Samples, default=0.0
    )
    """û1, bending about d1 [1/m]: positive bends a straight arm toward -y."""
    curvature_y: float | Samples = number(
        "û2", "1/m", "curvature at rest about the second director", along=Samples, default=0.0
    )
    """û2, bending about d2 [1/m]: positive bends a straight arm toward +x."""
    twist: float | Samples = number("û3", "1/m", "twist at rest", along=Samples, default=0.0)
    """û3, twist about d3 [rad/m]."""

    @property
    def is_straight(self) -> bool:
        """True if nothing is bent or twisted."""
        return self == STRAIGHT

    def curvature(self, x: Array) -> Array:
        """û [1/m] at x = Z/L, shape (station, 3)."""
        each = (self.curvature_x, self.curvature_y, self.twist)
        return np.stack([values_along(value, x) for value in each], axis=1)


STRAIGHT = RestShape()  # A straight arm without twist


@dataclass(frozen=True, kw_only=True)
class UnseenActuator(Actuator):
    """Bundles of an inner arm that no design names and no picture shows."""

    bundles: int = number("n", "", "number of bundles", low=1, integer=True, default=1)

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        axis = np.zeros((len(z), self.bundles))
        places = dict.fromkeys(("center", "inner_ratio", "outer_ratio"), axis)
        shape, acts = ("line",) * self.bundles, self.acts(profile, z)
        return Outline(**places, extent=axis.max(axis=0, initial=0.0), shape=shape, acts=acts)


@dataclass(frozen=True, kw_only=True)
class RestStrains(UnseenActuator):
    """The rest shape as a bundle that is held at an activation of 1, for tables and kernels."""

    shape: RestShape

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        return Resultants(np.zeros((len(z), 1)), np.zeros((len(z), 3, 1)))

    @property
    def breaks(self) -> tuple[float, ...]:
        return self.shape.breaks


class Disks(NamedTuple):
    """Thin disks that hold tendons, (disk,) each."""

    station: Array  # Z [m]
    radius: Array  # [m]
    tendons: Array  # How far from the axis the tendons that they hold are [m]


@dataclass(frozen=True, kw_only=True, repr=False)
class Body:
    """A slender body with actuators in it."""

    profile: Profile
    """R2(Z), the outer radius along the arm, and its length."""
    section: Section
    """The core and the ring of actuators, in proportion to R2(Z)."""
    actuators: tuple[Actuator, ...]
    """In the order of the activations, bundle by bundle; empty for a passive rod."""
    rest: RestShape = STRAIGHT
    """Curvature and twist of the arm that nothing drives; straight."""
    stations: Mapping[str, float] = Stations()
    """Z [m] of stations by name, at which actuators, rigid pieces and markers may be."""
    rigid_pieces: tuple[RigidPiece, ...] = ()
    """Rigid pieces, which neither bend nor twist nor change their length."""
    loads: Loads | None = None
    """Loads beside the actuators; None for nothing, not even its weight."""

    def __post_init__(self) -> None:
        for judge in (self._faults, self._settle, self._fit_faults):  # each needs those before
            if faults := judge():
                raise InvalidDesign(faults)

    def _faults(self) -> list[Fault]:
        kinds = {
            "profile": (Profile, "a Profile, such as LinearTaper"),
            "section": (Section, "a Section"),
            "rest": (RestShape, "a RestShape, such as RestShape(curvature_x=2.0)"),
            "loads": (Loads | None, "Loads or None"),
            "rigid_pieces": ([RigidPiece], "RigidPieces"),
        }
        return kind_faults(self, kinds) + actuator_faults(self.actuators)

    def _settle(self) -> list[Fault]:
        """Give actuators names, and parts the places of the stations that they name."""
        if not isinstance(self.stations, Stations):
            with faults_under("stations"):
                object.__setattr__(self, "stations", Stations(self.stations))
        actuators = [(each.name, each) for each in named_actuators(self.actuators)]
        pieces = [(f"rigid_pieces[{k}]", piece) for k, piece in enumerate(self.rigid_pieces)]
        return self._place("actuators", actuators) + self._place("rigid_pieces", pieces)

    def _place(self, field: str, parts: Sequence[tuple[str, Located]]) -> list[Fault]:
        """Put parts where the stations that they name are; faults begin with their owners."""
        made, faults = list[Located](), list[Fault]()
        for owner, part in parts:
            with gathered(faults, owner):
                made.append(placed(part, self.stations))
        object.__setattr__(self, field, tuple(made))
        return faults

    def _fit_faults(self) -> list[Fault]:
        """Names given twice; if there are none, what keeps parts from acting together."""
        names = [actuator.name for actuator in self.actuators]
        if faults := [*name_faults(names, "actuators")]:
            return faults
        if twice := [name for name in self.bundle_names if self.bundle_names.count(name) > 1]:
            return [Fault("actuators", twice[0], "names two bundles: rename an actuator")]
        faults = [
            Fault(f"stations.{name}", z, f"must be on the arm, at most {self.length:g} m")
            for name, z in self.stations.items()
            if z > self.length
        ]
        for k, piece in enumerate(self.rigid_pieces):
            faults += behind(f"rigid_pieces[{k}]", piece.place_faults(self.length))
        rest = self.rest.curvature(np.linspace(0.0, 1.0, 65))
        turn = self.length * float(np.linalg.norm(rest, axis=1).mean())
        if turn > MOST_TURN:
            most = f"{MOST_TURN / math.tau:g} turns, {MOST_TURN / self.length:.4g} 1/m"
            allowed = f"must wind the arm by at most {most}"
            faults.append(Fault("rest", f"{turn / math.tau:.4g} turns", allowed))
        if self.loads is not None:
            faults += self.loads.section_faults(self.section, self.length)
        parts = self.profile, self.section
        for each in self.actuators:
            own = each.place_faults(self.length) or each.section_faults(*parts)
            faults += behind(each.name, [*own, *_far_faults(each, self.profile)])
        return faults

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new design."""
        return replace(self, **changes)

    @lazy
    def length(self) -> float:
        """L, from base to tip before activation [m]."""
        return self.profile.length

    @property
    def fibers(self) -> tuple[FiberArchitecture, ...]:
        """Those actuators that are fiber architectures."""
        return tuple(each for each in self.actuators if isinstance(each, FiberArchitecture))

    @lazy
    def bundles(self) -> int:
        """m, number of independent activations."""
        return sum(actuator.bundles for actuator in self.actuators)

    @lazy
    def bundle_names(self) -> tuple[str, ...]:
        """A readable name for each bundle."""
        return tuple(name for actuator in self.actuators for name in actuator.bundle_names)

    @lazy
    def bundle_actuators(self) -> tuple[Actuator, ...]:
        """The actuator of each bundle."""
        return tuple(actuator for actuator in self.actuators for _ in range(actuator.bundles))

    @lazy
    def bundle_units(self) -> tuple[str, ...]:
        """The unit of the activation of each bundle."""
        return tuple(actuator.unit for actuator in self.bundle_actuators)

    @lazy
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2), read-only."""
        bounds = (actuator.bounds for actuator in self.actuators)
        return read_only(np.concatenate([np.empty((0, 2)), *bounds]))

    @lazy
    def breakpoints(self) -> tuple[float, ...]:
        """Stations inside (0, L) where profile, section or actuators are not smooth [m]."""
        places = {0.0, self.length, *self.profile.breakpoints}
        places.update(self.length * x for x in self.section.breaks)
        places.update(z for actuator in self.actuators for z in actuator.breakpoints(self.profile))
        places.update(z for piece in self.rigid_pieces for z in piece.span(self.length))
        ascending = np.array(sorted(places))
        # Two that differ by rounding alone are one.
        apart = np.diff(ascending, prepend=-np.inf) > 1e-12 * self.length
        inside = ascending[apart & (ascending < (1 - 1e-12) * self.length)][1:]
        return tuple(inside.tolist())

    def stiffness_at(self, z: ArrayLike) -> Stiffness:
        """K0, K1 and K3 at stations Z [m]: those of its section, infinite in rigid pieces."""
        stiffness, stations = self.section.stiffness_at(self.profile, z), np.asarray(z, float)
        for piece in self.rigid_pieces:
            start, end = piece.span(self.length)
            rigid = (stations >= start) & ((stations < end) | (end >= self.length))
            stiffness = Stiffness(*(np.where(rigid, np.inf, value) for value in stiffness))
        return stiffness

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half axes of sections along the axes of K1 and K2 over R2 [-], as pictures show them.

        Those of an ellipse or a strip of these stiffnesses; what holds more than tendons is round.
        """
        aspect = math.sqrt(self.section.bending_ratio)
        is_plain = {*self.outline(0.0).shape} <= {"line"}
        return (min(1.0, aspect), min(1.0, 1.0 / aspect)) if is_plain else (1.0, 1.0)

    def outline(self, z: ArrayLike) -> Outline:
        """Places of all bundles in the sections at stations Z [m], shape (station,)."""
        stations = as_stations("z", z)
        each = [part.outline(self.profile, self.section, stations) for part in self.actuators]
        nothing = np.empty((len(stations), 0))
        return Outline(
            center=np.concatenate([nothing, *(part.center for part in each)], axis=1),
            extent=np.concatenate([np.empty(0), *(part.extent for part in each)]),
            inner_ratio=np.concatenate([nothing, *(part.inner_ratio for part in each)], axis=1),
            outer_ratio=np.concatenate([nothing, *(part.outer_ratio for part in each)], axis=1),
            shape=tuple(shape for part in each for shape in part.shape),
            acts=np.concatenate([nothing.astype(bool), *(part.acts for part in each)], axis=1),
            disk_ratio=np.concatenate([nothing, *(part.held_ratio for part in each)], axis=1),
        )

    def widest(self, z: Array) -> Array:
        """Radius of the widest of body, tendons, and disks that stand everywhere [m], (station,).

        Before activation, at ascending Z [m].
        """
        radius = self.profile.radius(z)
        if not self.bundles:
            return radius
        outline = self.outline(z)
        placed = np.array(
            [bool(part.disk_stations(self.profile)) for part in self.bundle_actuators]
        )
        ratio = np.where(placed, outline.outer_ratio, outline.held_ratio)
        held = np.pad(outline.acts, ((1, 1), (0, 0)))  # and one station beyond where it ends
        held = held[2:] | held[1:-1] | held[:-2]
        return radius * np.where(held, ratio, 0.0).max(axis=1).clip(1.0)

    @lazy
    def disks(self) -> Disks:
        """Those that hold tendons, at ascending Z."""
        parts = [Disks(*np.empty((3, 0)))]
        for each in self.actuators:
            if not len(z := np.array(each.disk_stations(self.profile))):
                continue
            outline, radius = each.outline(self.profile, self.section, z), self.profile.radius(z)
            ratios = outline.held_ratio, outline.outer_ratio
            parts.append(Disks(z, *(radius * ratio.max(axis=1) for ratio in ratios)))
        every = joined(parts)
        return rows(every, np.argsort(every.station, kind="stable"))


def behind(owner: str, faults: Iterable[Fault]) -> list[Fault]:
    """Faults of a part under its name; those of the section have theirs."""
    return [
        fault
        if fault.path.startswith(("rings", "core"))
        else fault._replace(path=f"{owner}.{fault.path}")
        for fault in faults
    ]


def _far_faults(actuator: Actuator, profile: Profile) -> Iterator[Fault]:
    """Distances and radii beyond the length of the arm: millimeters taken for meters."""
    radius = float(np.max(profile.radius(np.linspace(0.0, profile.length, 65))))
    allowed = f"must be at most the length of the arm, {profile.length:g} m"
    for name in ("distance", "distance_ratio", "radius", "radius_ratio", "disk_radius"):
        value: Any = getattr(actuator, name, None)
        values: Any = getattr(value, "values", value)
        scale = radius if name.endswith("ratio") else 1.0
        if value is not None and scale * np.max(values) > profile.length:
            yield Fault(name, values, allowed)


def actuator_faults(actuators: Any) -> list[Fault]:
    """Faults of what is no sequence of actuators, or holds too many bundles."""
    if not isinstance(actuators, Sequence) or isinstance(actuators, str):
        return [Fault("actuators", actuators, "must be a sequence of actuators")]
    allowed = "must be an actuator, such as FiberArchitecture"
    wrong = [(k, part) for k, part in enumerate(actuators) if not isinstance(part, Actuator)]
    if wrong:
        return [Fault(f"actuators[{k}]", part, allowed) for k, part in wrong]
    seen = [part for part in actuators if not isinstance(part, UnseenActuator)]
    if (count := sum(part.bundles for part in seen)) > MOST_BUNDLES:
        return [Fault("actuators", f"{count} bundles", f"must be at most {MOST_BUNDLES} in all")]
    return []


def named_actuators(actuators: Sequence[Actuator]) -> Iterator[Actuator]:
    """The actuators, those without a name called "fiber 1", "fiber 2", ... by their places."""
    taken = {actuator.name for actuator in actuators}
    for place, actuator in enumerate(actuators, start=1):
        names = (f"{actuator.default_name} {number}" for number in itertools.count(place))
        name = actuator.name or next(name for name in names if name not in taken)
        taken.add(name)
        yield actuator if actuator.name else actuator.replace(name=name)


def mass(arm: Body) -> float:
    """Mass of the arm [kg]; raises InvalidDesign for a layer without a density."""
    inside = (arm.length * x for x in arm.section.breaks)
    ends = np.array(sorted({0.0, *arm.profile.breakpoints, *inside, arm.length}))
    half = 0.5 * np.diff(ends)[:, None]
    z = ends[:-1, None] + half * (1.0 + _NODES)
    per_length = arm.section.mass_per_length_at(arm.profile, z)
    return float(np.sum(half * _WEIGHTS * per_length))


def load_number(arm: Body) -> float:
    """Λ = (w + P/L) L³/(4 K1), with the lesser bending stiffness at the base [-], theory (79).

    Without loads, w is the weight per length at the base under g = 9.81 m/s², and P is 0: Λ is
    ρ g L³/(E R2²) for a solid arm of one material, and an upright cylinder buckles under its own
    weight at 1.96. With loads, w is the weight under their gravity and the force per length beside
    it, P the sum of all other forces, payload included, and of all moments over L. Sizes are added
    whatever their directions, so that Λ bounds what bends the arm.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    if faults := load_number_faults(arm):
        raise InvalidDesign(faults)
    per_length, force = (arm.loads or Loads()).sizes(arm.section, arm.profile)
    stiffness = arm.section.stiffness_at(arm.profile, 0.0).bending
    stiffness = min(1.0, arm.section.bending_ratio) * stiffness
    return float((per_length + force / arm.length) * arm.length**3 / (4.0 * stiffness))


def is_overloaded(arm: Body) -> bool:
    """The load number is above what was verified, by more than rounding; raises its errors."""
    return load_number(arm) > VERIFIED_LOAD_NUMBER * (1 + 1e-9)


def load_number_faults(arm: Body) -> list[Fault]:
    """Faults that keep the load number from being known."""
    faults = arm.section.modulus_faults("where weight counts")
    weighs = arm.loads is None or any(arm.loads.gravity)
    return faults + (arm.section.density_faults("where weight counts") if weighs else [])
