"""Expressions with units: what is typed means what it would mean on paper, or nothing."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.studio.expressions import number_kind, unit_in, vector_kind
from softreach.studio.shown_parameters import part_parameters, parts, slider_parameters
from softreach.support.quantity import read_quantity, sizes_in, unit_names

LENGTH = 0.5
FINITE = st.floats(-1e6, 1e6)


def number(text, unit=""):
    return number_kind(unit, lambda: LENGTH).value(text)


def vector(text, unit=""):
    return vector_kind(unit, lambda: LENGTH).value(text)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("1/3", "", 1 / 3), ("2*0.3", "", 0.6), ("-2**2", "", -4), ("2^-1", "", 0.5),
        ("2**3**2", "", 512), ("8/2/2", "", 2), ("7-2-1", "", 4), ("2+3*4", "", 14),
        ("(2+3)*4", "", 20), ("-(-2)", "", 2), ("\N{MINUS SIGN}0.5", "", -0.5), ("0,25", "", 0.25),
        ("40 %", "", 0.4), ("sqrt(2)/2", "", math.sqrt(0.5)), ("cos(60 deg)", "", 0.5),
        ("2 deg", "deg", 2), ("2", "deg", 2), ("pi/6 rad", "deg", 30), ("π/2 rad", "deg", 90),
        ("90°", "rad", math.pi / 2), ("1/2 deg", "deg", 0.5), ("2 rad", "rad", 2),
        ("5 cm", "L", 0.1), ("5 cm", "mm", 50), ("1e-3 m", "mm", 1), ("0.1L", "mm", 50),
        ("5 cm + 3 mm", "mm", 53), ("2*(5 cm)", "mm", 100), ("5 cm/2", "mm", 25),
        ("100 g", "g", 100), ("0.1 kg", "g", 100), ("1.5 MPa", "kPa", 1500),
        ("9.81 m/s2", "m/s²", 9.81), ("9.81*sin(30 deg)", "m/s²", 4.905), ("3", "1/m", 3),
    ],
)  # fmt: skip
def test_an_expression_means_what_it_would_on_paper(text, unit, value):
    assert number(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "why"),
    [
        ("", "", "nothing is typed"), ("2 3", "", "3 is not expected there"),
        ("1,000.5", "", ".5 is not expected"), ("1_000", "", "_ is not expected"),
        ("2pi", "", "pi is not expected"), ("2*", "", "missing at its end"),
        ("foo", "", "foo is not expected"), ("nan", "", "nan is not expected"),
        ("inf", "", "inf is not expected"), ("(1", "", ") is missing"),
        ("1)", "", ") is not expected"), ("sqrt 2", "", "( is missing behind sqrt"),
        ("sqrt(-1)", "", "no real number"), ("(-8)**(1/3)", "", "no real number"),
        ("1/0", "", "not finite"), ("9**999", "", "not finite"), ("1e999", "", "not finite"),
        ("2 cm", "deg", "cm is not expected"), ("5 cmm", "mm", "cmm is not expected"),
        ("5 cm + 3", "mm", "a unit on each"), ("2 cm * 3 cm", "mm", "second unit"),
        ("2 cm*(3 cm)", "mm", "not multiplied"),
        ("1/(2 cm)", "mm", "nor divided by"), ("(2 cm)**2", "mm", "powers are of plain"),
        ("(2 cm) mm", "mm", "mm is a second unit"), ("sqrt(4 cm)", "mm", "cm is not expected"),
        ("(" * 60 + ")" * 60, "", "at most 100 characters"), ("(" * 99, "", "missing at its end"),
        ("-" * 99, "", "missing at its end"), ("__import__('os')", "", "_ is not expected"),
        ("1 if 1 else 2", "", "if is not expected"), ("x" * 99, "", "is not expected"),
    ],
)  # fmt: skip
def test_anything_else_is_refused_in_words(text, unit, why):
    with pytest.raises(ValueError, match=r".") as caught:
        number(text, unit)
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)


@given(a=FINITE, b=FINITE, c=FINITE)
def test_sums_and_products_are_those_of_python(a, b, c):
    text = f"({a!r})*({b!r})-{c!r}+({a!r}+7)/7"
    assert number(text) == a * b - c + (a + 7) / 7


@given(value=FINITE, unit=st.sampled_from(["m", "rad", "Pa", "kg", "N", "m/s²", "kg/m³", "N m"]))
def test_a_unit_means_what_it_means_on_the_command_line(value, unit):
    for name in unit_names(unit):
        text = f"{value!r} {name}"
        assert number(text, unit) == pytest.approx(read_quantity(text, unit), rel=1e-13)
        assert number(text, name) == pytest.approx(value, rel=1e-13)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0, 0, -9.81", "m/s²", (0, 0, -9.81)), ("1 2 3", "L", (1, 2, 3)),
        ("1/2, 2*0.3, pi", "", (0.5, 0.6, math.pi)), ("1,5; 2; 1/4", "L", (1.5, 2, 0.25)),
        ("0, 0, 5 cm", "L", (0, 0, 0.1)), ("2 cm, 3 cm, 1 mm", "mm", (20, 30, 1)),
        ("(0.1, 0.2, 0.3) L", "mm", (50, 100, 150)), ("[1, 2, 3]", "mm", (1, 2, 3)),
        ("9.81*sin(30 deg), 0, -9.81*cos(30 deg)", "m/s²", (4.905, 0, -9.81 * math.sqrt(0.75))),
    ],
)  # fmt: skip
def test_components_of_a_vector_may_be_expressions(text, unit, value):
    assert vector(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("1, 2", "these are 2"), ("1, 2, 3, 4", "these are 4"), ("1, x, 2", "x is not expected"),
        ("1, 2, 5 cm", "a unit on each"), ("1, , 2", "nothing is typed"),
        ("1, 2, 1/0", "not finite"),
    ],
)  # fmt: skip
def test_what_is_no_vector_is_refused_in_words(text, why):
    with pytest.raises(ValueError, match=why):
        vector(text, "L")


def test_a_label_names_the_unit_of_its_field(trunk):
    assert unit_in("taper φ [deg]") == "deg"
    assert unit_in("target / L") == "L"
    assert unit_in("inner / outer radius") == unit_in("γ left") == ""
    for part in parts(trunk).values():
        for parameter in (*part_parameters(trunk, part), *slider_parameters(trunk)):
            if unit := unit_in(parameter.label):
                assert unit == "L" or sizes_in(unit)[unit] == 1.0
                assert number(f"2 {unit}", unit) == number("2", unit)
