"""The rules for public names, which every name that a user may type obeys, and for imports."""

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import grimp
import pytest

import softreach as sr
from softreach.support.lazy import lazy

NAMED = """
    arm arm.designs arm.parameters atlas calibration cloud cloud.cells cloud.curvature
    cloud.dexterity
    support.errors exchange.activefilaments export forces inverse inverse.path models
    workspace.payload plot optimization requirements cloud.redundancy rod rod.rest stiffness
    cloud.volume workspace
"""
MODULES = [importlib.import_module(f"softreach.{name}") for name in NAMED.split()]
PAGES = (Path(__file__).parent.parent / "docs" / "reference").glob("*.md")
SHOWN = re.findall(r"(?m)^::: softreach\.([\w.]+)", "".join(p.read_text("utf-8") for p in PAGES))
TOP = [name for name in dir(sr) if not isinstance(getattr(sr, name), ModuleType)]


def names_of(module: ModuleType) -> list[str]:
    """What a package offers, and what the reference shows of any other module."""
    if hasattr(module, "__all__"):
        return module.__all__
    if hasattr(module, "__path__"):
        return [name for name in vars(module) if not name.startswith("_")]
    own = module.__name__.removeprefix("softreach.")
    return [name.rpartition(".")[2] for name in SHOWN if name.rpartition(".")[0] == own]


def public_objects() -> Iterator[tuple[str, object]]:
    """Everything public but modules, by the shortest name that a user types."""
    for module in MODULES:
        for name in names_of(module):
            if not isinstance(thing := getattr(module, name), ModuleType):
                yield f"{module.__name__.removeprefix('softreach.')}.{name}", thing


def public_functions() -> dict[str, Callable]:
    """Functions, methods and constructors other than that of the class, by name."""
    found = {}
    for name, thing in public_objects():
        if inspect.isfunction(thing):
            found[name] = thing
        elif inspect.isclass(thing):
            for method, function in inspect.getmembers(thing, inspect.isroutine):
                ours = getattr(function, "__module__", None) or ""
                ours = ours if callable(function) else ""  # no property that is computed once
                if not method.startswith("_") and ours.startswith("softreach"):
                    found[f"{name}.{method}"] = function
    return found


FUNCTIONS = public_functions()


def argument_texts(function: Callable) -> dict[str, str]:
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


def test_the_top_level_holds_about_thirty_names_of_named_modules():
    assert 20 <= len(TOP) <= 40
    things = {id(thing) for _, thing in public_objects()}
    assert [name for name in TOP if id(getattr(sr, name)) not in things] == []


def named(function: Callable) -> set[str]:
    """Arguments by their names, without those of `**values`."""
    return {n for n, p in parameters(function).items() if p.kind is not p.VAR_KEYWORD}


def test_every_argument_is_documented():
    """Methods, and functions of one or two arguments, may do so in their first sentence."""
    bad = {}
    for name, function in FUNCTIONS.items():
        told = set(argument_texts(function))
        brief = "." in function.__qualname__ or len(named(function)) <= 2
        if not (brief and not told) and (missing := named(function) - told):
            bad[name] = missing
    assert bad == {}


def test_what_a_function_refuses_itself_is_documented():
    bad = [
        name
        for name, function in FUNCTIONS.items()
        if "Raises:" not in (inspect.getdoc(function) or "")
        for source in [textwrap.dedent(inspect.getsource(inspect.unwrap(function)))]
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
    ]
    assert bad == []


def texts_of_bases(name: str, function: Callable) -> str:
    """Docstrings of a function, and of those of the same name that it overrides."""
    owner = dict(public_objects()).get(name.rpartition(".")[0])
    bases = inspect.getmro(owner) if inspect.isclass(owner) else ()
    overridden = [vars(base).get(name.rpartition(".")[2]) for base in bases]
    return " ".join(inspect.getdoc(f) or "" for f in (function, *overridden) if f)


def test_what_returns_arrays_says_their_unit_or_shape():
    arrays = {
        name: texts_of_bases(name, function)
        for name, function in FUNCTIONS.items()
        if re.search(r"\b(NDA|A)rray\b", str(function.__annotations__.get("return")))
    }
    assert len(arrays) > 100
    said = re.compile(r"\[[^\]]+\]|[Ss]hape|\((n|number),")
    assert [name for name, text in arrays.items() if not said.search(text)] == []


def test_methods_that_override_nothing_have_a_docstring():
    modules = [
        importlib.import_module(module.name)
        for module in pkgutil.walk_packages(sr.__path__, "softreach.")
        if not module.name.endswith("__main__")
    ]
    bad = [
        f"{module.__name__}.{owner.__name__}.{name}"
        for module in modules
        for owner in vars(module).values()
        if inspect.isclass(owner) and owner.__module__ == module.__name__
        for name, method in vars(owner).items()
        if not (name.startswith("_") or owner.__name__.startswith("_"))
        if inspect.isroutine(method) or isinstance(method, (property, lazy))
        if getattr(method, "__name__", name) == name  # no function as the value of a field
        if not method.__doc__ and not any(hasattr(base, name) for base in owner.__bases__)
    ]
    assert bad == []


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


@pytest.mark.parametrize(
    ("argument", "meant", "least"),
    [("tol", r"Largest( tip)? error|As for", 6), ("progress", "Called with", 3)],
)
def test_tol_is_the_largest_tip_error_and_progress_is_called_with_what_was_done(
    argument, meant, least
):
    functions = (function for function in FUNCTIONS.values() if argument in parameters(function))
    texts = [told.get(argument, "") for told in map(argument_texts, functions) if told]
    assert len(texts) >= least
    assert [text for text in texts if not re.match(meant, text)] == []


def test_no_argument_bears_a_word_with_another_meaning_or_another_unit_than_radians_and_meters():
    words = "report|tip_tol|callback|plane|normal|n_samples|fibre|.*_(deg|mm|cm|degrees)"
    bad = {n: p for n, f in FUNCTIONS.items() for p in parameters(f) if re.fullmatch(words, p)}
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


def test_at_most_three_arguments_may_go_without_their_names():
    """The data asked and the question; options are given by keyword."""
    bad = {}
    for name, function in FUNCTIONS.items():
        kinds = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
        free = [p for p in parameters(function).values() if p.kind in kinds]
        required = [p for p in free if p.default is p.empty]
        if name.count(".") <= 2 and (len(required) > 3 or len(free) > 4):
            bad[name] = [p.name for p in free]
    assert bad == {}


def classes_in(hint: object) -> Iterator[type]:
    if inspect.isclass(hint) and hint.__module__.startswith("softreach"):
        yield hint
    for part in typing.get_args(hint):
        yield from classes_in(part)


def return_hint(function: Callable) -> object:
    """The hint of what a function returns, whatever its arguments are."""
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    hint = function.__annotations__["return"]
    seen = {"xr": xarray, "pd": pandas, "Axes": Axes, "Figure": Figure, "Self": object}
    known = {**seen, **inspect.unwrap(function).__globals__}
    return eval(hint, known) if isinstance(hint, str) else hint


def shown(name: str) -> object:
    """What the reference shows under a name."""
    module, _, thing = name.rpartition(".")
    return getattr(importlib.import_module(f"softreach.{module}"), thing)


def test_what_a_function_returns_is_public_by_name():
    public = {id(thing) for _, thing in public_objects()} | {id(shown(name)) for name in SHOWN}
    bad = {}
    for name, function in FUNCTIONS.items():
        if "return" in function.__annotations__:
            hidden = [c for c in classes_in(return_hint(function)) if id(c) not in public]
            bad |= {name: hidden} if hidden else {}
    assert bad == {}


def test_a_name_means_one_thing_everywhere():
    homes: dict[str, set[int]] = {}
    for name, thing in public_objects():
        homes.setdefault(name.rpartition(".")[2], set()).add(id(thing))
    assert {name for name, things in homes.items() if len(things) > 1} == set()


def test_every_public_name_is_in_the_reference():
    pages = (Path(__file__).parent.parent / "docs" / "reference").glob("*.md")
    text = "".join(page.read_text("utf-8") for page in pages)
    shown = set(re.findall(r"^::: softreach\.([\w.]+)", text, re.MULTILINE))
    names = {name.rpartition(".")[2] for name in shown}
    missing = [
        name
        for name, thing in public_objects()
        if name.rpartition(".")[2] not in names
        and name.rpartition(".")[0] not in shown
        and not isinstance(thing, ModuleType)
    ]
    assert missing == []


def test_the_package_says_that_it_is_typed():
    from importlib.resources import files

    assert files("softreach").joinpath("py.typed").is_file()


def test_a_public_name_that_is_misspelled_is_told():
    with pytest.raises(AttributeError, match=r'no attribute .reachable_sett.; did you mean "reach'):
        _ = sr.reachable_sett
    assert not hasattr(sr, "q")


def test_no_module_imports_itself_by_way_of_others_for_types_included():
    graph = grimp.build_graph("softreach", exclude_type_checking_imports=False)
    below = {module: graph.find_upstream_modules(module) for module in graph.modules}
    circles = {
        frozenset({module, *mutual})
        for module in below
        if (mutual := {other for other in below[module] if module in below[other]})
    }
    assert sorted(" ".join(sorted(circle)) for circle in circles) == []
