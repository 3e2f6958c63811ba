"""Whatever a part of an arm is given, it is refused by name, or can be computed with."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest

import softreach as sr
from softreach.arm import (
    Actuator,
    Chamber,
    Drive,
    FiberArchitecture,
    LinearTaper,
    Loads,
    Manipulator,
    Material,
    Measured,
    ObliqueMuscle,
    Pieces,
    PiecewiseTaper,
    PointLoad,
    Profile,
    RadialMuscle,
    Resultants,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.number import fields_of, number, own_fields
from softreach.arm.parameters import changed, parameters
from softreach.arm.tables import tables
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.cable import Cable

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

NO_NUMBERS = (True, False, math.nan, math.inf, -math.inf, "0.1", "x")
GIVEN = [
    *(None, *NO_NUMBERS, -1, 0, -0.5, 1.5),
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
        if field in fields_of(kind) and any(value is one for one in NO_NUMBERS):
            assert part is None
        if part is None:
            said = "\n".join(map(str, faults))
            assert any(name in said for name in JOINT.get(field, (field,))), said
            assert len(said.splitlines()) == len(faults)
            continue
        assert part == part.replace()
        assert hash(part) == hash(part.replace())
        tips, complaint = reached(part)
        assert complaint or np.isfinite(tips).all()


TWO = {"stations_over_length": (0, 1)}
BEYOND_SENSE = Samples(**TWO, values=(0, 2))
IMPOSSIBLE = [
    (Tendon, {"distance_ratio": 0.5}, r"\(0.01, 0.5\): give exactly one of distance and"),
    (Tendon, {"distance": (0.01, 0.02, 0.03)}, "must be .*, or two at its ends, or Samples"),
    (Tendon, {"routing": 0.3, "revolution": 0.0}, "routing = 0.3: must be Samples along the arm"),
    (Tendon, {"routing": BEYOND_SENSE}, "give exactly one of routing and revolution"),
    (Tendon, {"activation_bounds": (-1, 5)}, "must be at least 0 N: a tendon pulls and"),
    (Chamber, {"distance_ratio": 0.5}, "give exactly one of distance and distance_ratio"),
    (Chamber, {"radius_ratio": 0.2}, r"\(0.005, 0.2\): give exactly one of radius and"),
    (ObliqueMuscle, {"helical_angle": Pieces(**TWO, values=(0.1,))}, r"Pieces\(.*a finite number"),
    (FiberArchitecture, {"helical_angle": BEYOND_SENSE}, "helical_angle = 2: "),
    (FiberArchitecture, {"revolution": 0.2}, "give exactly one of helical_angle and revol"),
    (Pieces, TWO | {"values": (1, 2)}, "values = .*must be 1 finite"),
    (Samples, {"stations_over_length": (1, 0), "values": (1, 2)}, "rise from 0"),
    (Samples, {"interpolation": "spline"}, "must be one of cubic, l"),
    (Ring, {"outer_ratio": 0.5}, "must be below outer_ratio = 0.5"),
    (Ring, {"material": 0.5}, "material = 0.5: must be a Material"),
    (Section, {"rings": ()}, r"section.rings = \(\): must hold one Ring"),
    (Section, {"rings": RING}, r"section.rings = Ring\(.*must hold one Ring"),
    (Section, {"rings": (RING.replace(outer_ratio=0.9),)}, r"\[0\].outer_ratio = 0.9: must be 1"),
    (Section, {"measured": 3}, "section.measured = 3: must be Measured or None"),
]


@pytest.mark.parametrize(("kind", "fields", "message"), IMPOSSIBLE)
def test_an_impossible_part_is_refused_in_one_line(kind, fields, message):
    with pytest.raises(InvalidDesign, match=message) as caught:
        kind(**SOUND[kind] | fields)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("kind", "field"), [(Tendon, "distance"), (Chamber, "distance"), (Chamber, "radius")]
)
def test_one_of_two_ways_to_say_a_number_replaces_the_other_and_back(kind, field):
    given, body = kind(**SOUND[kind]), (LinearTaper(length=1.0, outer_radius=0.04), SOUND[Section])
    by_ratio = given.replace(**{f"{field}_ratio": 0.7})
    assert getattr(by_ratio, field) is None
    assert by_ratio.replace(**{field: getattr(given, field)}) == given
    assert by_ratio.value_on(field, *body) == pytest.approx(0.7 * 0.04)
    assert given.value_on(f"{field}_ratio", *body) == pytest.approx(getattr(given, field) / 0.04)


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


# A number of a design is declared once: checks, files and parameters follow from it


PARTS = {**SOUND, Loads: {}, PointLoad: {"station": 0.0}, Measured: {}}
NUMBERS = [(kind, field) for kind in PARTS for field in fields_of(kind)]
UNDECLARED = {"activation_bounds", "values"}
"""Their unit is that of the activation, or of the field that changes along the arm."""


def beyond(kind: type, field: str) -> list[float]:
    """Values just outside of what is allowed."""
    allowed = fields_of(kind)[field].allowed
    low = allowed.low if allowed.open_low else math.nextafter(allowed.low, -math.inf)
    high = allowed.high if allowed.open_high else math.nextafter(allowed.high, math.inf)
    return [end for end in (low, high) if math.isfinite(end)] or [math.nan]


@pytest.mark.parametrize("kind", PARTS, ids=lambda kind: kind.__name__)
def test_every_number_of_a_part_is_declared(kind):
    numeric = {
        field.name
        for field in dataclasses.fields(kind)
        if any(word in str(field.type) for word in ("float", "Triple", "Samples", "bundles"))
    }
    assert numeric - UNDECLARED <= fields_of(kind).keys()
    assert all(one.symbol and one.meaning for one in fields_of(kind).values())


@pytest.mark.parametrize(
    ("kind", "field"), [(k, f) for k, f in NUMBERS if fields_of(k)[f].shape == "single"]
)
def test_the_declared_range_is_that_of_the_part(kind, field):
    for value in beyond(kind, field):
        with pytest.raises(InvalidDesign) as caught:
            kind(**PARTS[kind] | {field: value})
        assert field in {fault.path for fault in caught.value.faults}


def test_every_declared_number_of_an_arm_is_a_parameter_with_its_range(trunk):
    for one in parameters(trunk).values():
        assert one.symbol
        assert one.meaning
        assert one.range == one.number.allowed
    left = fields_of(sr.FiberArchitecture).values()
    assert {f"left.{one.field}" for one in left} <= parameters(trunk).keys()


@pytest.mark.parametrize(
    "table",
    [
        "[base]\nposition_m = [true, 0.0, 0.3]",
        "[loads]\ntip_force_n = [0.0, 0.0, true]",
        "[rest]\ncurvature_x_per_m = { stations_over_length = [0.0, 1.0], values = [0.5, true] }",
    ],
)
def test_a_truth_value_is_no_number_in_a_list_either(trunk, table):
    key = table.split("\n")[1].split(" =")[0]
    with pytest.raises(InvalidDesign, match=key):
        sr.Manipulator.from_toml(f"{trunk.to_toml()}\n{table}\n")


@pytest.mark.parametrize("gains", [2, None, "left", ()])
def test_gains_that_are_no_mapping_are_refused_alone(gains):
    with pytest.raises(InvalidDesign) as caught:
        Drive(name="knob", bounds=(0.0, 1.0), gains=gains, offsets={"left": 0.1})
    assert [fault.path for fault in caught.value.faults] == ["gains"]


def test_a_gain_of_one_bundle_wins_over_the_size_of_all():
    gains = {"left": 1.0, "right": -1.0, "third": 1.0}
    knob = Drive(name="knob", bounds=(0.0, 1.0), gains=gains)
    for name in gains:
        made = knob.replace(**{f"gains[{name}]": 0.5, "gain": 2.0}).gains
        assert {each: abs(gain) for each, gain in made.items()} == dict.fromkeys(gains, 2.0) | {
            name: 0.5
        }


def test_another_number_of_bundles_has_the_bounds_of_the_first_by_its_parameter_alone(trunk):
    left = trunk.actuators[0].replace(bundles=2, activation_bounds=((-1.0, 0.0), (-0.5, 0.0)))
    arm = trunk.replace(actuators=(left,))
    made = changed(arm, {"left.bundles": 3, "left.upper[1]": 0.2}).actuators[0]
    np.testing.assert_array_equal(made.bounds, [(-1.0, 0.0), (-1.0, 0.2), (-1.0, 0.0)])
    with pytest.raises(InvalidDesign, match="one pair"):
        left.replace(bundles=3)


def test_a_field_that_a_kind_of_ones_own_gives_another_default_stays_a_number():
    @dataclass(frozen=True, kw_only=True)
    class Late(Cable):
        start_over_length: float = 0.5

    assert fields_of(Late)["start_over_length"] == fields_of(Actuator)["start_over_length"]
    with pytest.raises(InvalidDesign, match="start_over_length = 1"):
        Late(place=(0.0, 0.0), start_over_length=1.0)


def test_a_number_of_a_kind_of_ones_own_is_checked_and_comes_before_inherited_ones():
    @dataclass(frozen=True, kw_only=True)
    class Wide(Cable):
        width: float = number("w", "m", "width of the cable", low=0.0, default=0.01)

    assert next(iter(fields_of(Wide))) == "width"
    with pytest.raises(InvalidDesign, match="width = -1: must be a finite number >= 0 m"):
        Wide(place=(0.0, 0.0), width=-1)


@dataclass(frozen=True, kw_only=True)
class Plain(Cable):
    """Fields of every type that is a number, and of one that is none."""

    gain: float = 1.0
    turns: int = 2
    slack: float | None = None
    knots: tuple[float, ...] = (0.0, 1.0)
    mode: str = "fast"
    activation_bounds: tuple[float, float] = (0.0, 1e-4)


def test_plain_numbers_of_a_kind_of_ones_own_need_no_declaration(trunk):
    own = {"gain", "turns", "slack", "knots", "place"}
    assert own_fields(Plain) == own
    assert own_fields(sr.Tendon) == own_fields(sr.LinearTaper) == set()
    arm = trunk.replace(actuators=(*trunk.actuators, Plain(place=(0.0, 0.01), name="own")))
    names = {name.partition(".")[2] for name in parameters(arm) if name.startswith("own.")}
    mine = {"gain", "turns", "slack", "knots[0]", "knots[1]", "place[0]", "place[1]"}
    ends = {"start", "end", "start_over_length", "end_over_length"}
    assert names == mine | ends | {"bundles", "lower", "upper"}
    new = {"own.gain": 0.5, "own.turns": 3, "own.slack": 0.1, "own.knots[1]": 2.0}
    made = changed(arm, new).actuators[3]
    assert made == Plain(
        place=(0.0, 0.01), name="own", gain=0.5, turns=3, slack=0.1, knots=(0.0, 2.0)
    )


def test_fields_that_are_called_like_those_of_the_body_are_not_shared_with_it(trunk):
    @dataclass(frozen=True, kw_only=True)
    class Namesake(Cable):
        inner_ratio: float = 0.1
        poisson_ratio: float = 0.2
        revolution: float = 3.0

    arm = trunk.replace(actuators=(*trunk.actuators[:2], Namesake(place=(0.0, 0.01), name="own")))
    shared = {"radius_ratio": 0.7, "poisson_ratio": 0.4, "revolution": 1.0}
    assert changed(arm, shared).actuators[2] == arm.actuators[2]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"gain": math.nan}, "gain = nan: must be a finite number"),
        ({"turns": 1.5}, "turns = 1.5: must be a whole number"),
        ({"knots": (0.0, math.inf)}, r"knots\[1\] = inf: must be a finite number"),
        ({"knots": ((0.0, 1.0),)}, "knots = .*: must be a sequence of numbers"),
    ],
)
def test_plain_numbers_of_a_kind_of_ones_own_are_checked(values, said):
    with pytest.raises(InvalidDesign, match=said):
        Plain(place=(0.0, 0.0), **values)


def test_a_function_along_the_arm_is_allowed_where_it_is_declared():
    places = {"stations_over_length": (0, 1)}
    assert sr.Tendon(distance=Samples(values=(0.1, 0.2), **places), activation_bounds=(0, 1))
    with pytest.raises(InvalidDesign, match="or Samples along the arm"):
        sr.Tendon(distance=Pieces(values=(0.1,), **places), activation_bounds=(0, 1))
