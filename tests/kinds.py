"""Arms of every kind: random sections of layers, profiles and actuators, driven within reason."""

import math

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from softreach.arm import (
    Actuator,
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    ObliqueMuscle,
    Pieces,
    PiecewiseTaper,
    Profile,
    RadialMuscle,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
    designs,
)
from softreach.arm.tables import tables
from tests.oracles.sections import Layer

Array = NDArray[np.float64]
number = st.floats

KINDS = (FiberArchitecture, ObliqueMuscle, RadialMuscle, Tendon, Chamber)


@st.composite
def materials(draw: st.DrawFn) -> Material:
    """From soft silicone to a thousand times that."""
    return Material(
        young_modulus=10 ** draw(number(4, 7)),
        poisson_ratio=draw(number(0, 0.5)),
        density=draw(number(500, 3000)),
    )


@st.composite
def sections(draw: st.DrawFn) -> Section:
    """A core, perhaps with a bore, and one to three rings that may overlap or leave gaps."""
    rings = []
    for k in range(draw(st.integers(1, 3))):
        outer = 1.0 if k == 0 else draw(number(0.3, 1.0))
        inner = outer * draw(number(0.0, 0.9))
        material = draw(materials())
        rings.append(Ring(inner_ratio=inner, outer_ratio=outer, material=material, name=f"r{k}"))
    bore = draw(number(0, 1)) * min(ring.inner_ratio for ring in rings)
    core = draw(st.none() | materials())
    return Section(rings=tuple(rings), core=core, bore_ratio=bore)


def layers_at(section: Section, radius: float) -> list[Layer]:
    """The layers where the outer radius is `radius` [m], as the quadrature wants them."""
    return [
        Layer(
            inner=layer.inner_ratio * radius,
            outer=layer.outer_ratio * radius,
            young_modulus=layer.material.young_modulus or 1.0,
            poisson_ratio=layer.material.poisson_ratio,
            density=layer.material.density or 0.0,
        )
        for layer in section.layers
    ]


@st.composite
def stations(draw: st.DrawFn) -> tuple[float, ...]:
    """Z/L from 0 to 1, with up to three breakpoints well apart between them."""
    gaps = np.array(draw(st.lists(number(0.2, 1.0), min_size=1, max_size=4)))
    return (0.0, *(np.cumsum(gaps)[:-1] / gaps.sum()).tolist(), 1.0)


def values_at(places: tuple[float, ...], low: float, high: float) -> st.SearchStrategy:
    return st.tuples(*[number(low, high, allow_subnormal=False) for _ in places])


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    """Cones, several cones, or a curve; slender, and never thinner than a fifth of the base."""
    length = draw(number(0.05, 5.0))
    base = length * draw(number(0.03, 0.1))
    kind = draw(st.sampled_from(["linear", "pieces", "samples"]))
    if kind == "linear":
        loss = draw(number(-0.5, 0.8))
        return LinearTaper(length=length, outer_radius=base, taper=math.atan(loss * base / length))
    places = draw(stations())
    radii = [base * share for share in draw(values_at(places, 0.2, 1.2))]
    make = PiecewiseTaper if kind == "pieces" else SampledTaper
    return make(length=length, stations_over_length=places, radii=tuple(radii))


@st.composite
def angles_along(draw: st.DrawFn) -> float | Pieces | Samples:
    """A helical angle: the same everywhere, in pieces, or through samples."""
    kind = draw(st.sampled_from(["constant", "pieces", "cubic", "linear"]))
    if kind == "constant":
        return draw(number(-0.5, 0.5))
    places = draw(stations())
    if kind == "pieces":
        return Pieces(stations_over_length=places, values=draw(values_at(places[1:], -0.5, 0.5)))
    values = draw(values_at(places, -0.5, 0.5))
    return Samples(stations_over_length=places, values=values, interpolation=kind)


@st.composite
def actuators(draw: st.DrawFn, section: Section, kind: type[Actuator] | None = None) -> Actuator:
    """Any actuator in the section, on the whole arm or on a stretch of it."""
    kind = kind or draw(st.sampled_from(KINDS))
    start = draw(st.just(0.0) | number(0.0, 0.6))
    end = draw(st.just(1.0) | number(start + 0.2, 1.0))
    common = {
        "bundles": draw(st.integers(1, 3)),
        "offset": draw(number(-7, 7)),
        "start_over_length": start,
        "end_over_length": end,
    }
    if kind is Tendon:
        return draw(_tendons(common))
    if kind is Chamber:
        distance = draw(number(0.2, 0.6))
        radius = draw(number(0.05, 1.0)) * min(distance, 1.0 - distance)
        return Chamber(
            distance_ratio=distance,
            radius_ratio=radius,
            area_factor=draw(number(0.5, 2.0)),
            activation_bounds=(0.0, 1.0),
            **common,
        )
    rings = [*(ring.name for ring in section.rings), *range(len(section.rings))]
    common |= {"extent": draw(number(0.05, 0.9)), "ring": draw(st.sampled_from(rings))}
    if kind is RadialMuscle:
        return RadialMuscle(**common)
    if kind is ObliqueMuscle:
        return ObliqueMuscle(helical_angle=draw(number(-1.0, 1.0)), **common)
    winding = draw(st.sampled_from(["helical_angle", "revolution"]))
    turn = draw(angles_along()) if winding == "helical_angle" else draw(number(-3, 3))
    return FiberArchitecture(**{winding: turn}, **common)


@st.composite
def _tendons(draw: st.DrawFn, common: dict) -> Tendon:
    turn = {"revolution": draw(number(-3, 3))}
    if draw(st.booleans()):
        places = draw(stations())
        values = draw(values_at(places, -2, 2))
        turn = {"routing": Samples(stations_over_length=places, values=values)}
    distance = draw(number(0.1, 1.0))
    return Tendon(distance_ratio=distance, activation_bounds=(0.0, 1.0), **turn, **common)


def fibers_and_a_tendon() -> Manipulator:
    """Two helical fibers, by whose length curvature counts, and a tendon that leaves it alone."""
    soft = Material(young_modulus=1e6, poisson_ratio=0.5, density=1000.0)
    trunk = designs.minimal_trunk(material=soft)
    tendon = Tendon(distance_ratio=0.8, revolution=1.0, offset=2.0, activation_bounds=(0, 60))
    return trunk.replace(actuators=(*trunk.actuators[:2], tendon))


def driven(arm: Manipulator, sharpness: float = 3.0) -> Manipulator:
    """The arm with bounds within which it bends by a few radians and changes length by a third."""
    table = tables(arm, np.linspace(0.0, arm.length, 51))
    stretch = np.abs(table.extension).max(axis=0) / 0.3
    bend = np.linalg.norm(table.curvature, axis=1).max(axis=0) * arm.length / sharpness
    largest = 1.0 / np.maximum(np.maximum(stretch, bend), 1e-29) / arm.bundles
    pulls = np.array([isinstance(one, Tendon) for one in arm.actuators for _ in range(one.bundles)])
    largest = np.minimum(largest, 1e15)
    return arm.with_bounds(np.stack([np.where(pulls, 0.0, -largest), largest], axis=1))


@st.composite
def any_arms(draw: st.DrawFn, kind: type[Actuator] | None = None) -> Manipulator:
    """Any arm with one or two actuators, at least one of them of a kind."""
    section = draw(sections())
    parts = [draw(actuators(section, kind))]
    if draw(st.booleans()):
        parts.append(draw(actuators(section)))
    return driven(Manipulator(profile=draw(profiles()), section=section, actuators=tuple(parts)))
