"""The rules for public names: every name that a user may type obeys them."""

from __future__ import annotations

import importlib
import inspect
import re
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

import softreach as sr

MODULES = [
    importlib.import_module(f"softreach.{name}")
    for name in (
        "arm",
        "arm.designs",
        "arm.parameters",
        "atlas",
        "cloud",
        "cloud.curvature",
        "cloud.dexterity",
        "support.errors",
        "exchange.activefilaments",
        "export",
        "forces",
        "inverse",
        "inverse.path",
        "workspace.payload",
        "plot",
        "cloud.redundancy",
        "rest",
        "rod",
        "stiffness",
        "cloud.volume",
        "workspace",
    )
]
TOP = [name for name in dir(sr) if not isinstance(getattr(sr, name), ModuleType)]


def public_objects() -> Iterator[tuple[str, object]]:
    """Everything public, by the shortest name that a user types."""
    for module in MODULES:
        for name in module.__all__:
            yield f"{module.__name__.removeprefix('softreach.')}.{name}", getattr(module, name)


def public_functions() -> dict[str, Callable]:
    """Functions, methods and constructors other than that of the class, by name."""
    found = {}
    for name, thing in public_objects():
        if inspect.isfunction(thing):
            found[name] = thing
        elif inspect.isclass(thing):
            for method, function in inspect.getmembers(thing, inspect.isroutine):
                ours = getattr(function, "__module__", None) or ""
                if not method.startswith("_") and ours.startswith("softreach"):
                    found[f"{name}.{method}"] = function
    return found


FUNCTIONS = public_functions()


def argument_texts(function: Callable) -> dict[str, str]:
    """What the docstring says of each argument."""
    text = inspect.getdoc(function) or ""
    block = re.search(r"Args:\n(.*?)(?:\n\n|\n\S|\Z)", text, re.S)
    found: dict[str, str] = {}
    name = ""
    for line in block[1].splitlines() if block else ():
        if head := re.match(r"    (\w+): (.*)", line):
            name, found[head[1]] = head[1], head[2]
        elif name:
            found[name] += " " + line.strip()
    return found


def parameters(function: Callable) -> dict[str, inspect.Parameter]:
    chosen = inspect.signature(function).parameters
    return {name: p for name, p in chosen.items() if name not in ("self", "cls")}


def test_the_top_level_holds_about_twenty_names():
    assert 15 <= len(TOP) <= 30


def test_every_name_of_the_top_level_is_also_that_of_a_named_module():
    homes = dict(public_objects())
    things = {id(thing) for thing in homes.values()}
    strangers = [name for name in TOP if id(getattr(sr, name)) not in things]
    assert strangers == []


def named(function: Callable) -> set[str]:
    """Arguments by their names, without those of `**values`."""
    return {n for n, p in parameters(function).items() if p.kind is not p.VAR_KEYWORD}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_is_documented(name):
    """Methods, and functions of one or two arguments, may do so in their first sentence."""
    function = FUNCTIONS[name]
    told = argument_texts(function)
    brief = "." in function.__qualname__ or len(named(function)) <= 2
    assert (brief and not told) or named(function) <= set(told)


def test_the_arm_or_the_data_asked_come_first():
    asked = {"arm", "cloud", "clouds", "atlas", "points", "space", "statistics", "grid"}
    bad = {
        name: list(parameters(function))
        for name, function in FUNCTIONS.items()
        if "." not in function.__qualname__
        if set(parameters(function)) & asked
        if next(iter(parameters(function))) not in asked
    }
    assert bad == {}


TOLERANT = [n for n, f in FUNCTIONS.items() if "tol" in parameters(f) and argument_texts(f)]


@pytest.mark.parametrize("name", TOLERANT)
def test_tol_is_the_largest_tip_error_and_nothing_else(name):
    assert re.match(r"(Largest( tip)? error|As for)", argument_texts(FUNCTIONS[name])["tol"])


def test_no_argument_bears_a_word_with_another_meaning():
    forbidden = {"report", "tip_tol", "callback", "plane", "normal", "n_samples", "fibre"}
    bad = {n: both for n, f in FUNCTIONS.items() if (both := set(parameters(f)) & forbidden)}
    assert bad == {}


@pytest.mark.parametrize("name", [n for n, f in FUNCTIONS.items() if "progress" in parameters(f)])
def test_progress_is_called_with_what_was_done_since_its_last_call(name):
    assert re.match(r"Called with", argument_texts(FUNCTIONS[name])["progress"])


def test_python_takes_radians_and_meters_so_no_argument_names_another_unit():
    units = re.compile(r"_(deg|mm|cm|degrees)$")
    bad = {n: p for n, f in FUNCTIONS.items() for p in parameters(f) if units.search(p)}
    assert bad == {}


def test_what_is_relative_to_the_length_says_so_in_its_name():
    """Only `tol` counts in L without saying so."""
    bad = [
        (name, argument)
        for name, function in FUNCTIONS.items()
        for argument, text in argument_texts(function).items()
        if re.search(r"(\bin L\b|\[L\]|times L\b)", text)
        if argument != "tol" and not re.search(r"over_length|_ratio", argument)
    ]
    assert bad == []


@pytest.mark.parametrize("name", [n for n, _ in FUNCTIONS.items() if n.count(".") <= 2])
def test_at_most_three_arguments_may_go_without_their_names(name):
    """The data asked and the question; options are given by keyword."""
    free = [
        p
        for p in parameters(FUNCTIONS[name]).values()
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)
    ]
    required = [p for p in free if p.default is p.empty]
    assert len(required) <= 3
    assert len(free) <= 4


def classes_in(hint: object) -> Iterator[type]:
    """Classes of softreach in a type hint."""
    if inspect.isclass(hint) and hint.__module__.startswith("softreach"):
        yield hint
    for part in typing.get_args(hint):
        yield from classes_in(part)


def return_hint(function: Callable) -> object:
    """The hint of what a function returns, whatever its arguments are."""
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    hint = function.__annotations__["return"]
    seen = {"xr": xarray, "Axes": Axes, "Figure": Figure, "Self": object}
    known = {**seen, **inspect.unwrap(function).__globals__}
    return eval(hint, known) if isinstance(hint, str) else hint


@pytest.mark.parametrize("name", [n for n, f in FUNCTIONS.items() if "return" in f.__annotations__])
def test_what_a_function_returns_is_public_by_name(name):
    public = {id(thing) for _, thing in public_objects()}
    hidden = [c for c in classes_in(return_hint(FUNCTIONS[name])) if id(c) not in public]
    assert hidden == []


def test_a_name_means_one_thing_everywhere():
    homes: dict[str, set[int]] = {}
    for name, thing in public_objects():
        homes.setdefault(name.rpartition(".")[2], set()).add(id(thing))
    assert {name for name, things in homes.items() if len(things) > 1} == set()


def test_every_public_name_is_in_the_reference():
    page = Path(__file__).parent.parent / "docs" / "reference.md"
    shown = set(re.findall(r"^::: softreach\.([\w.]+)", page.read_text("utf-8"), re.MULTILINE))
    names = {name.rpartition(".")[2] for name in shown}
    missing = [
        name
        for name, thing in public_objects()
        if name.rpartition(".")[2] not in names
        and name.rpartition(".")[0] not in shown
        and not isinstance(thing, ModuleType)
    ]
    assert missing == []
