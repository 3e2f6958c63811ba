"""The gallery shows every named design as it is."""

from __future__ import annotations

import re

import pytest
from tools.gallery import PAGE, PICTURES, measured, page, rows_of

from softreach.arm import designs

TEXT = PAGE.read_text(encoding="utf-8")
ROWS = rows_of(TEXT)
QUICK = [name for name in designs.__all__ if getattr(designs, name)().bundles == 3]


def test_the_page_is_written_by_the_tool_from_all_named_designs():
    assert list(ROWS) == designs.__all__
    assert page(ROWS) == TEXT


def parsed(text: str) -> tuple[float, float, str]:
    """Value, error and unit of a number as people write it."""
    found = re.fullmatch(r"\(?([\d.]+) ± ([\d.]+)\)?(e-\d+)? (.+)", text)
    assert found
    power = found[3] or ""
    return float(found[1] + power), float(found[2] + power), found[4]


@pytest.mark.parametrize("name", QUICK)
def test_the_numbers_on_the_page_are_those_of_the_exact_set(name):
    for text, again in zip(ROWS[name], measured(name), strict=True):
        value, error, unit = parsed(text)
        assert error < 0.01 * value
        assert parsed(again)[0] == pytest.approx(value, abs=error, rel=1e-6)
        assert parsed(again)[2] == unit


def test_every_design_has_a_small_picture():
    sizes = {path.stem: path.stat().st_size for path in PICTURES.glob("*.png")}
    assert sorted(sizes) == sorted(designs.__all__)
    assert max(sizes.values()) < 150_000
