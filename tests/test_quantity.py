"""Numbers as they are printed: no digit that the error makes worthless."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.quantity import quantity


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
