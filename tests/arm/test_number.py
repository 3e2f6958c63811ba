"""A number of a design is declared once: checks, files and parameters follow from it."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from dataclasses import dataclass

import pytest

import softreach as sr
from softreach.arm import Actuator, AlongArm, Loads, Measured, Pieces, PointLoad, Samples
from softreach.arm.design_file.keys import keys_of
from softreach.arm.design_file.schema import json_schema
from softreach.arm.number import fields_of, number, own_fields
from softreach.arm.parameters import changed, find_parameter, parameters
from softreach.arm.parameters.draft import Path
from softreach.support.errors import InvalidDesign
from tests.arm.test_refusals import SOUND
from tests.cable import Cable

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


@pytest.mark.parametrize("kind", [kind for kind in PARTS if not issubclass(kind, AlongArm)])
def test_the_declared_unit_is_that_of_the_key_and_of_the_schema(kind):
    known = {
        key: one
        for table in json_schema()["$defs"].values()
        for key, one in table["properties"].items()
    }
    for name, key in keys_of(kind).items():
        if key.number is not None:
            assert name == key.number.key
            assert "description" in known[name]


def test_every_declared_number_of_an_arm_is_a_parameter_with_its_range(trunk):
    for one in parameters(trunk).values():
        assert one.symbol
        assert one.meaning
        assert one.range == one.number.allowed
    left = fields_of(sr.FiberArchitecture).values()
    assert {f"left.{one.field}" for one in left} <= parameters(trunk).keys()


def test_a_parameter_knows_its_place_without_its_name(trunk):
    assert find_parameter(trunk, "left.offset").path == Path(("actuators", "left"), "offset")
    modulus = find_parameter(trunk, "rings[0].material.young_modulus")
    assert modulus.path == Path(("rings", 0, "material"), "young_modulus")
    assert find_parameter(trunk, "left.upper").path == Path(
        ("actuators", "left"), "activation_bounds", (1,)
    )


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
        ({"gain": "1"}, "gain = '1': must be a finite number"),
        ({"gain": math.nan}, "gain = nan: must be a finite number"),
        ({"gain": None}, "gain: must be a finite number"),
        ({"turns": 1.5}, "turns = 1.5: must be a whole number"),
        ({"knots": (0.0, math.inf)}, r"knots\[1\] = inf: must be a finite number"),
        ({"knots": "01"}, "knots = '01': must be a sequence of numbers"),
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


def test_the_text_of_a_design_is_written_once(trunk):
    assert trunk.to_toml() is trunk.to_toml()
    assert trunk.replace().to_toml() == trunk.to_toml()


def test_the_arm_needs_no_library_of_checks():
    code = "import sys, softreach.arm.design_file.schema; assert 'pydantic' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
