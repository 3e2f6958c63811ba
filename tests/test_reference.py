"""The reference: what each field of a class means, in which unit, and examples that run."""

import doctest
import io
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import softreach as sr

griffe = pytest.importorskip("griffe")

from tools.reference import rows_of  # noqa: E402

PAGES = sorted((Path(__file__).parent.parent / "docs" / "reference").glob("*.md"))
SHOWN = re.findall(r"(?m)^::: softreach\.([\w.]+)", "".join(p.read_text("utf-8") for p in PAGES))
QUANTITY = re.compile(r"\b(float|Array|ArrayLike|Triple|Samples|Estimate|Spread)\b")
UNIT = re.compile(r"\[[^\]]+\]")  # such as [m], [-] or [unit]


@cache
def package():
    return griffe.load("softreach", search_paths=["src"], docstring_parser="google")


def fields():
    """Public classes with each field, its type and its meaning."""
    for name in SHOWN:
        shown = package()[name]
        shown = shown.final_target if shown.is_alias else shown
        for row in rows_of(shown) if shown.is_class else ():
            text = str(row.description).partition("Default: `")[0].strip()
            yield f"{name}.{row.name}", str(row.annotation), text


def test_every_field_has_a_meaning_and_every_quantity_a_unit():
    known = list(fields())
    assert len(known) > 500
    assert [name for name, _, text in known if not text] == []
    quantities = [each for each in known if QUANTITY.search(each[1]) and "Call" not in each[1]]
    assert len(quantities) > 250
    assert [(name, text) for name, _, text in quantities if not UNIT.search(text)] == []


def test_nothing_is_on_two_pages():
    assert len(SHOWN) == len(set(SHOWN))


def examples():
    for name in SHOWN:
        shown = package()[name]
        shown = shown.final_target if shown.is_alias else shown
        if shown.docstring and ">>>" in shown.docstring.value:
            yield pytest.param(shown, id=name)


@pytest.mark.parametrize("shown", [*examples()])
def test_an_example_prints_what_it_says(shown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"sr": sr, "np": np}
    case = doctest.DocTestParser().get_doctest(shown.docstring.value, names, shown.path, None, 0)
    printed = io.StringIO()
    assert doctest.DocTestRunner().run(case, out=printed.write).failed == 0, printed.getvalue()
