"""Arms of every kind that a design file can describe, drawn by hypothesis."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import assume
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    AlongArm,
    Chamber,
    FiberArchitecture,
    LinearTaper,
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
)
from tests.cable import Cable

numbers = st.floats(-1e3, 1e3)
turns = st.floats(-628, 628)
sizes = st.floats(0.02, 1.0)
angles = st.floats(-1.57, 1.57)
names = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters=".[]"), max_size=8)
"""Any text that a file can hold: control characters, quotes and signs of other scripts too."""


def pairs(ends: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[float, float]]:
    return st.tuples(ends, ends).map(sorted).map(tuple)


@st.composite
def stations(draw: st.DrawFn) -> tuple[float, ...]:
    inside = draw(st.lists(st.floats(1e-6, 1 - 1e-6), unique=True, max_size=3))
    return (0.0, *sorted(inside), 1.0)


@st.composite
def samples(draw: st.DrawFn, values: st.SearchStrategy[float]) -> Samples:
    places = draw(stations())
    return Samples(
        stations_over_length=places,
        values=tuple(draw(values) for _ in places),
        interpolation=draw(st.sampled_from(["cubic", "linear"])),
    )


@st.composite
def pieces(draw: st.DrawFn, values: st.SearchStrategy[float]) -> Pieces:
    places = draw(stations())
    return Pieces(stations_over_length=places, values=tuple(draw(values) for _ in places[1:]))


def along(values: st.SearchStrategy[float]) -> st.SearchStrategy[AlongArm]:
    return samples(values) | pieces(values)


@st.composite
def common(draw: st.DrawFn, ends: st.SearchStrategy[float]) -> dict[str, Any]:
    """The fields that all kinds share."""
    bundles = draw(st.integers(1, 3))
    start, end = draw(st.just((0.0, 1.0)) | pairs(st.floats(0, 1)))
    assume(end - start >= 1e-9)
    return {
        "name": draw(names),
        "bundles": bundles,
        "activation_bounds": draw(pairs(ends) | st.tuples(*[pairs(ends)] * bundles)),
        "start_over_length": start,
        "end_over_length": end,
    }


def _sector(draw: st.DrawFn) -> dict[str, Any]:
    extent = draw(st.floats(1e-6, 2 * math.pi))
    return {**draw(common(numbers)), "offset": draw(numbers), "extent": extent}


@st.composite
def fibers(draw: st.DrawFn) -> FiberArchitecture:
    winding = draw(
        st.fixed_dictionaries({"revolution": turns})
        | st.fixed_dictionaries({"helical_angle": angles | along(angles)})
    )
    return FiberArchitecture(**_sector(draw), **winding)


@st.composite
def muscles(draw: st.DrawFn) -> ObliqueMuscle | RadialMuscle:
    sector = _sector(draw)
    if draw(st.booleans()):
        return RadialMuscle(**sector)
    return ObliqueMuscle(**sector, helical_angle=draw(angles))


@st.composite
def tendons(draw: st.DrawFn) -> Tendon:
    lengths = st.floats(0, 1e-3)
    place = draw(
        st.fixed_dictionaries({"distance": lengths | samples(lengths)})
        | st.fixed_dictionaries({"distance_ratio": st.floats(0, 900)})
    )
    turn = draw(
        st.fixed_dictionaries({"revolution": turns})
        | st.fixed_dictionaries({"routing": samples(numbers)})
    )
    return Tendon(**draw(common(st.floats(0, 1e9))), **place, **turn, offset=draw(numbers))


@st.composite
def chambers(draw: st.DrawFn) -> Chamber:
    place = draw(
        st.fixed_dictionaries({"distance": st.floats(0, 1e-3)})
        | st.fixed_dictionaries({"distance_ratio": st.floats(0, 900)})
    )
    size = draw(
        st.fixed_dictionaries({"radius": sizes})
        | st.fixed_dictionaries({"radius_ratio": st.floats(1e-6, 1)})
    )
    return Chamber(
        **draw(common(numbers)), **place, **size, area_factor=draw(sizes), offset=draw(numbers)
    )


cables = st.builds(
    Cable, name=names, place=st.tuples(numbers, numbers), activation_bounds=pairs(numbers)
)

actuators = fibers() | muscles() | tendons() | chambers() | cables


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    kind = draw(st.sampled_from([LinearTaper, PiecewiseTaper, SampledTaper]))
    length = draw(sizes)
    if kind is LinearTaper:
        return LinearTaper(length=length, outer_radius=draw(sizes), taper=-draw(st.floats(0, 1.5)))
    places = draw(stations())
    radii = tuple(draw(sizes) for _ in places)
    return kind(length=length, stations_over_length=places, radii=radii)


materials = st.builds(
    Material,
    young_modulus=sizes,
    poisson_ratio=st.floats(0, 0.5) | st.just(-0.0),
    density=st.none() | sizes,
    name=names,
)


@st.composite
def sections(draw: st.DrawFn) -> Section:
    """Rings that may overlap, of own materials or of one without Young's modulus."""
    ratios = st.floats(0, 1, exclude_max=True)
    one = st.just(Material(poisson_ratio=draw(st.floats(0, 0.5))))
    matter = draw(st.sampled_from([materials, one, st.sampled_from(draw(some_materials))]))
    inner = draw(st.lists(ratios, min_size=1, max_size=3))
    rings = [
        Ring(inner_ratio=ratio, material=draw(matter), name=f"{draw(names)}{k}")
        for k, ratio in enumerate(inner)
    ]
    return Section(
        rings=tuple(rings),
        core=draw(st.none() | matter),
        bore_ratio=draw(st.just(0.0) | st.floats(0, min(inner))),
    )


some_materials = st.lists(materials, min_size=1, max_size=2)


@st.composite
def any_arms(draw: st.DrawFn) -> sr.Manipulator:
    """Any arm."""
    kinds = draw(st.lists(actuators, min_size=1, max_size=3))
    try:
        return sr.Manipulator(
            profile=draw(profiles()), section=draw(sections()), actuators=tuple(kinds)
        )
    except sr.InvalidDesign as error:  # names alike, no modulus for a force, far off
        allowed = "name", "must be given in Pa", "must be at most the length of the arm"
        assume(not any(fault in str(error) for fault in allowed))
        raise
