"""The reference: what each field of a class means, in which unit, and examples that run."""

import doctest
import importlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

import softreach as sr

PAGES = sorted((Path(__file__).parent.parent / "docs" / "reference").glob("*.md"))
SHOWN = re.findall(r"(?m)^::: softreach\.([\w.]+)", "".join(p.read_text("utf-8") for p in PAGES))
QUANTITY = re.compile(r"\b(float|Array|ArrayLike|Triple|Samples|Estimate|Spread)\b")
UNIT = re.compile(r"\[[^\]]+\]")  # such as [m], [-] or [unit]


def fields():
    """Fields and properties of the classes shown, with the type and the meaning of each."""
    griffe = pytest.importorskip("griffe")
    from tools.reference import rows_of

    package = griffe.load("softreach", search_paths=["src"], docstring_parser="google")
    for name in SHOWN:
        shown = package[name].final_target if package[name].is_alias else package[name]
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
        module, _, thing = name.rpartition(".")
        text = getattr(importlib.import_module(f"softreach.{module}"), thing).__doc__ or ""
        if ">>>" in text:
            yield pytest.param(text, id=name)


@pytest.mark.parametrize("text", [*examples()])
def test_an_example_prints_what_it_says(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = doctest.DocTestParser().get_doctest(text, {"sr": sr, "np": np}, "example", None, 0)
    printed = io.StringIO()
    assert doctest.DocTestRunner().run(case, out=printed.write).failed == 0, printed.getvalue()
