"""Whatever a part of an arm is given, it is refused by name, or can be computed with."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import softreach as sr
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
    Resultants,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.tables import tables
from softreach.support.errors import InvalidDesign, InvalidInput

RUBBER = Material(young_modulus=1e6)
RING = Ring(inner_ratio=0.5, material=RUBBER)
STATIONS = {"stations_over_length": (0, 0.5, 1)}
ACTUATOR = {"name": "a", "bundles": 2, "start_over_length": 0.1, "end_over_length": 0.9}
SECTOR = ACTUATOR | {"extent": 0.5, "offset": 0.1, "ring": 0, "activation_bounds": (-0.1, 0)}

SOUND = {
    Material: {"young_modulus": 1e6, "poisson_ratio": 0.4, "density": 1e3, "name": "m"},
    Ring: {"inner_ratio": 0.5, "outer_ratio": 1.0, "material": RUBBER, "name": "r"},
    Section: {"rings": (RING,), "core": None, "bore_ratio": 0.1},
    LinearTaper: {"length": 1.0, "outer_radius": 0.05, "taper": 0.01},
    PiecewiseTaper: {"length": 1.0, "radii": (0.05, 0.04, 0.03), **STATIONS},
    SampledTaper: {"length": 1.0, "radii": (0.05, 0.04, 0.03), **STATIONS},
    Pieces: {"values": (0.1, 0.2), **STATIONS},
    Samples: {"values": (0.1, 0.2, 0.3), "interpolation": "cubic", **STATIONS},
    FiberArchitecture: {"helical_angle": 0.1, **SECTOR},
    ObliqueMuscle: {"helical_angle": 0.1, **SECTOR},
    RadialMuscle: SECTOR,
    Tendon: ACTUATOR
    | {
        "distance": 0.01,
        "offset": 0.1,
        "revolution": 0.3,
        "routing": None,
        "activation_bounds": (0, 5),
    },
    Chamber: ACTUATOR
    | {
        "distance": 0.02,
        "radius": 0.005,
        "area_factor": 1.0,
        "offset": 0.1,
        "activation_bounds": (0, 5e3),
    },
}

GIVEN = [
    *(None, True, False, math.nan, math.inf, -math.inf, "0.1", "x", -1, 0, -0.5, 1.5),
    *([], (), (1,), (0, 1), (1, 0), (0, 0.5, 0.5, 1), (0, math.nan, 1)),
    *(("a", "b"), {}, object(), 1j, np.array([1.0, 2.0]), np.array(0.3), np.float32(0.3)),
    *([[0, 1]], [[0, 1]] * 3, (None, 1), ((0, 1), (0,)), range(3), RUBBER, RING),
    Samples(stations_over_length=(0, 1), values=(0.1, 0.2)),
    Samples(stations_over_length=(0, 1), values=(-5, 9)),
    Pieces(stations_over_length=(0, 1), values=(0.1,)),
]


# Fields that may only be wrong together with others, which are named then.
JOINT = {
    "length": ("length", "taper"),
    "outer_radius": ("outer_radius", "taper"),
    "stations_over_length": ("stations_over_length", "values", "radii"),
}


def arm_with(part):
    """An arm in which a part is the only one of its kind, or one of two rings."""
    section = Section(**SOUND[Section])
    profile = LinearTaper(**SOUND[LinearTaper])
    actuator = FiberArchitecture(**SOUND[FiberArchitecture])
    if isinstance(part, Material):
        section = Section(rings=(Ring(inner_ratio=0.5, material=part),))
    elif isinstance(part, Ring):
        section = Section(rings=(part, RING.replace(name="other")))
    elif isinstance(part, Section):
        section = part
    elif isinstance(part, Profile):
        profile = part
    elif isinstance(part, Pieces | Samples):
        actuator = actuator.replace(helical_angle=part)
    else:
        assert isinstance(part, Actuator)
        actuator = part
    return Manipulator(profile=profile, section=section, actuators=(actuator,))


def made(kind, fields):
    """The part, or the faults that keep it from being made."""
    try:
        return kind(**fields), ()
    except InvalidDesign as error:
        return None, error.faults


def reached(part):
    """A tip of an arm with this part, or why there is none."""
    try:
        arm = arm_with(part)
        return sr.tip_positions(arm, [arm.bounds[:, 1]], tol=1e-3), ""
    except (InvalidDesign, InvalidInput) as error:
        return None, str(error)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # numbers beyond all sense
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("kind", SOUND, ids=lambda kind: kind.__name__)
def test_a_part_is_refused_by_the_name_of_its_field_or_can_be_computed_with(kind):
    for field, value in itertools.product(SOUND[kind], GIVEN):
        part, faults = made(kind, SOUND[kind] | {field: value})
        if part is None:
            said = "\n".join(map(str, faults))
            assert any(name in said for name in JOINT.get(field, (field,))), said
            assert len(said.splitlines()) == len(faults)
            continue
        assert part == part.replace()
        assert hash(part) == hash(part.replace())
        tips, complaint = reached(part)
        assert complaint or np.isfinite(tips).all()


def test_several_faults_are_named_at_once():
    with pytest.raises(InvalidDesign) as caught:
        Tendon(
            distance=-1,
            revolution=math.nan,
            bundles=0,
            name=3,
            activation_bounds=(1, 0),
            end_over_length=2,
        )
    assert {fault.path for fault in caught.value.faults} == {
        "distance",
        "revolution",
        "bundles",
        "name",
        "activation_bounds",
        "end_over_length",
    }


def test_faults_of_parts_that_do_not_fit_are_named_with_the_actuator():
    section = Section(rings=(Ring(inner_ratio=0.5),))
    with pytest.raises(InvalidDesign) as caught:
        Manipulator(
            profile=LinearTaper(length=1.0, outer_radius=0.05),
            section=section,
            actuators=(
                FiberArchitecture(name="f", helical_angle=0.0, extent=0.5, ring="skin"),
                Tendon(name="t", distance=0.01, activation_bounds=(0, 1)),
            ),
        )
    assert [fault.path for fault in caught.value.faults] == [
        "f.ring",
        "rings[0].material.young_modulus",
    ]


def test_bounds_that_shorten_an_arm_to_nothing_are_refused_for_forces_too():
    arm = arm_with(Tendon(**SOUND[Tendon]))
    with pytest.raises(InvalidDesign, match=r"reaches extension ζ = -.*must keep ζ > 0"):
        sr.tip_positions(arm.with_bounds((0, 5e4)), [[0, 0]])


def test_numbers_beyond_double_precision_are_refused_with_the_units_to_use():
    class Endless(Chamber):
        def resultants(self, *places):
            return Resultants(*(np.inf * load for load in super().resultants(*places)))

    arm = arm_with(Endless(**SOUND[Chamber]))
    with pytest.raises(
        InvalidDesign, match=r"design: overflows .*lengths in m, moduli and pressures"
    ):
        sr.tip_positions(arm, [[0, 0]])
    assert np.isfinite(tables(arm_with(RING), [0.0]).curvature).all()
