"""Arguments of public functions, converted in their first lines and refused in one way."""

import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from typing import Any

from softreach.support.errors import InvalidInput, Range, did_you_mean

POSITIVE = Range(0.0, open_low=True)  # Finite numbers above zero


def as_number(name: str, value: object, allowed: Range = Range()) -> float:  # noqa: B008
    """A real number of Python or NumPy in a range, as a float; no truth value, no text."""
    number = plain(value)
    if isinstance(number, Real) and not isinstance(number, bool) and allowed.admits(number):
        return float(number)
    raise InvalidInput(name, as_given(value), allowed.text)


def as_integer(name: str, value: object, low: int = 0, high: float = math.inf) -> int:
    """A whole number from `low` to `high` as an int; 2.0 is none."""
    number = plain(value)
    if isinstance(number, Integral) and not isinstance(number, bool) and low <= int(number) <= high:
        return int(number)
    limits = f"{low:,} or more" if high == math.inf else f"from {low:,} to {high:,}"
    raise InvalidInput(name, as_given(value), f"a whole number, {limits}")


def as_flag(name: str, value: object) -> bool:
    """True or False, and nothing else that Python takes for true."""
    return as_instance(name, plain(value), bool, "True or False")


def as_text(name: str, value: object) -> str:
    """Text of any length."""
    return as_instance(name, value, str, "text")


def as_function(name: str, value: object) -> Callable[..., Any]:
    """A function, or anything else that can be called."""
    return as_instance(name, value, Callable, "a function")


def as_path(name: str, value: object) -> str:
    """A path as text, not empty."""
    path = os.fspath(value) if isinstance(value, os.PathLike) else value
    if isinstance(path, str) and path and "\0" not in path:
        return path
    raise InvalidInput(name, as_given(value), "a path: text that is not empty, or a pathlib.Path")


def as_one_of(name: str, value: object, words: Iterable[str]) -> str:
    """One of some words."""
    if isinstance(value, str) and value in words:
        return value
    hint = did_you_mean(value, words) if isinstance(value, str) else ""
    raise InvalidInput(name, as_given(value), f"one of {', '.join(words)}", hint)


def as_names(name: str, value: object) -> tuple[str, ...]:
    """One name or a sequence of names."""
    if isinstance(value, str):
        return (value,)
    if isinstance(value, list | tuple | Mapping) and all(isinstance(item, str) for item in value):
        return tuple(value)
    raise InvalidInput(name, as_given(value), "a name, or a list or tuple of names")


def as_mapping(name: str, value: object, each: Callable[[str, Any], Any]) -> dict[str, Any]:
    """A mapping from names as a dictionary of what another converter makes of each value."""
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: each(f"{name}[{key!r}]", item) for key, item in value.items()}
    raise InvalidInput(name, as_given(value), "a dictionary whose keys are names")


def as_instance(name: str, value: Any, kind: Any, what: str) -> Any:
    """An object of a class; `what` names it: "a Manipulator"."""
    if isinstance(value, kind):
        return value
    raise InvalidInput(name, as_given(value), what)


def as_dataset(name: str, value: Any, *needed: str, kind: str = "Dataset", what: str = "") -> Any:
    """An `xarray.Dataset` (or another `kind`), called `what`, that has some variables."""
    with_variables = f" with {', '.join(needed)}" if needed else ""
    allowed = f"{what or f'an xarray.{kind}'}{with_variables}"
    xarray = sys.modules.get("xarray")  # who has a dataset has imported it
    if xarray is None or not isinstance(value, getattr(xarray, kind)):
        raise InvalidInput(name, as_given(value), allowed)
    if missing := [variable for variable in needed if variable not in value]:
        raise InvalidInput(name, f"a {kind} without {', '.join(missing)}", allowed)
    return value


def plain(value: Any) -> Any:
    """A value of Python for a scalar of NumPy or an array of no dimensions; others as they are."""
    if getattr(value, "ndim", 1) == 0 and hasattr(value, "item"):
        return value if getattr(value, "mask", False) else value.item()
    return value


def as_given(value: object) -> object:
    """A value as errors show it: text in quotes, so that '1' does not look like 1."""
    if isinstance(value, str | bytes):
        return repr(value)
    return f"the class {value.__name__}" if isinstance(value, type) else value
