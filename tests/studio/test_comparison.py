"""Designs side by side, without a server."""

from __future__ import annotations

import re

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio.comparison import Candidate, compared, comparison_html
from softreach.studio.reach import Size
from softreach.studio.snapshots import Numbers

TRUNK = designs.minimal_trunk()


def numbers(volume, unr=0.3):
    return Numbers(Size("volume", volume, 1e-4, 3), unr)


def trio():
    flat = changed(TRUNK, {"taper": 0.0})
    turned = changed(TRUNK, {"revolution": 1.0})
    return compared(
        [
            Candidate("a", TRUNK, numbers(0.7)),
            Candidate("b", flat, numbers(0.5, 0.4)),
            Candidate("c", turned, None),
        ]
    )


def test_only_the_parameters_that_differ_have_columns():
    table = trio()
    assert table.titles == (
        "volume [m³]",
        "UNR [%]",
        "revolution Ω [deg]",
        "taper φ [deg]",
    )
    assert not table.differ_otherwise


def test_differences_are_from_the_first_design():
    table = trio()
    assert table.difference(1, 0) == pytest.approx(-0.2)
    assert table.difference(1, 1) == pytest.approx(10)
    assert table.difference(1, 3) == pytest.approx(-2)
    assert table.difference(2, 0) is None
    assert table.difference(2, 2) == pytest.approx(np.degrees(1.0) - 108)


def test_digits_of_volumes_and_of_their_differences_follow_the_errors():
    sizes = (0.691648, 2e-5), (0.6926257, 3e-4)
    rows = [Numbers(Size("volume", *size, 3), 0.311592 + k) for k, size in enumerate(sizes)]
    table = comparison_html(compared([Candidate(f"{k}", TRUNK, rows[k]) for k in (0, 1)]))
    texts = re.sub("<[^>]*>", " ", table).split()
    for text in ("0.69165", "0.6926", "+0.0010", "(+0.14", "31.16", "131.16", "+100.00"):
        assert text in texts


def test_designs_that_differ_in_more_than_sliders_say_so():
    other = designs.redundant_trunk()
    table = compared([Candidate("a", TRUNK, None), Candidate("b", other, None)])
    assert table.differ_otherwise
    assert "more than these numbers" in comparison_html(table)


def test_no_name_is_markup():
    table = compared([Candidate("a", TRUNK, None), Candidate("<b>x", TRUNK, None)])
    assert "<b>x" not in comparison_html(table)
