"""Numbers as they are printed: no digit that the error makes worthless."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.support.quantity import quantity, read_quantity, unit_names


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.691642, 2.3e-5, "0.69164 ± 0.00002 m³"),
        (31.158, 0.0123, "31.16 ± 0.01 m³"),
        (1234.5, 20.0, "1234 ± 20 m³"),
        (5.5332e-6, 1e-10, "(5.5332 ± 0.0001)e-6 m³"),
        (0.0, 2e-4, "(0 ± 2)e-4 m³"),
        (0.5, 0.0, "0.5 m³"),
        (0.5, math.nan, "0.5 m³"),
        (math.nan, 0.1, "nan m³"),
    ],
)
def test_a_value_ends_with_the_first_digit_of_its_error(value, error, text):
    assert quantity(value, "m³", error) == text


@given(value=st.floats(1e-12, 1e12), share=st.floats(1e-9, 1.0))
def test_what_is_printed_is_off_by_less_than_the_error(value, share):
    text = quantity(value, error=share * value)
    mantissa, error, power = re.fullmatch(r"\(?([\d.]+) ± ([\d.]+)(?:\)e(-\d+))?", text).groups()
    scale = 10.0 ** int(power or 0)
    assert abs(float(mantissa) * scale - value) <= 0.51 * share * value
    assert float(error) * scale == pytest.approx(share * value, rel=0.5)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("200g", "kg", 0.2),
        ("0.2 kg", "kg", 0.2),
        ("250mg", "kg", 250e-6),
        ("+2e-1kg", "kg", 0.2),
        ("-3 mN", "N", -0.003),
        ("5cm", "m", 0.05),
        (".5mm", "m", 0.0005),
        ("1.4 MPa", "Pa", 1.4e6),
        ("2bar", "Pa", 2e5),
        ("1.07g/cm3", "kg/m³", 1070.0),
        ("-9.81m/s²", "m/s²", -9.81),
        ("2 N m", "N m", 2.0),
        ("2Nmm", "N m", 0.002),
        ("90deg", "rad", math.pi / 2),
        ("90°", "rad", math.pi / 2),
        ("0.5rad", "rad", 0.5),
        ("0.5", "1", 0.5),
        ("3K", "K", 3.0),
    ],
)
def test_a_number_with_a_unit_is_read_to_the_last_bit(text, unit, value):
    assert read_quantity(text, unit) == value


@pytest.mark.parametrize("unit", ["kg", "m", "N", "N m", "N/m", "Pa", "kg/m³", "m/s²", "rad"])
@pytest.mark.parametrize(
    "text",
    ["", "g", "5", "5 stone", "nan{}", "inf{}", "1e999{}", "5{} {}", "1,5{}", "1_0{}", "0x1{}"],
)
def test_what_is_no_finite_number_with_a_unit_of_its_kind_is_refused(text, unit):
    with pytest.raises(ValueError, match=r"^"):
        read_quantity(text.format(*[unit_names(unit)[0]] * 2), unit)


@given(value=st.floats(-1e200, 1e200))
def test_a_number_in_its_si_unit_is_read_as_it_was_written(value):
    assert read_quantity(f"{value!r}kg", "kg") == value
