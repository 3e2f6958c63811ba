"""Constructors of ActiveFilaments.jl: their arguments, and the kind of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from softreach.support.errors import InvalidInput

__all__ = ["CONSTRUCTORS", "Constructed", "Unreadable", "constructed", "is_of_kind"]

_NUMBER, _NUMBERS, _VECTOR, _ANY = "a number", "a vector of numbers", "a vector", ""

CONSTRUCTORS: Mapping[str, Mapping[str, str]] = {
    "MechanicalProperties": {"E": _NUMBER, "ν": _NUMBER},
    "Geometry": {"R1": _NUMBER, "R2": _NUMBER, "phi2": _NUMBER},
    "FiberArchitecture": {"α2": _ANY},
    "PiecewiseStructure": {"expressions": _NUMBERS, "piecewiseRanges": _VECTOR},
    "Ring": {
        "mechanics": "MechanicalProperties",
        "geometry": "Geometry",
        "architecture": "FiberArchitecture",
    },
    "InnerTube": {"mechanics": "MechanicalProperties", "geometry": "Geometry"},
    "AFilament": {
        "rings": _VECTOR,
        "L": _NUMBER,
        "phi2": _NUMBER,
        "ρvol": _NUMBER,
        "N": _ANY,
        "innerTube": "InnerTube",
    },
    "ActivationPiecewiseGamma": {"N": _NUMBER, "γ": _NUMBERS, "σ": _NUMBER, "θ0": _NUMBER},
}
"""The constructors that are read, and what each of their arguments must be."""

_DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    "Geometry": {"phi2": 0.0},
    "AFilament": {"L": 1.0, "phi2": 0.0, "ρvol": 1000.0, "N": 32.0, "innerTube": None},
}
"""Arguments that may be missing; these are passed by name."""


@dataclass(frozen=True)
class Unreadable:
    """Value of a name that was assigned something else than numbers and constructors."""

    error: InvalidInput
    names: frozenset[str]
    """Names that it was made from."""


class Constructed(SimpleNamespace):
    """Result of a constructor: its `name`, `where` it stands, and its arguments by their names."""

    def fault(self, value: object, allowed: str) -> InvalidInput:
        """The error that something in it is not as it must be."""
        return _fault(f"{self.where}, {self.name}", value, allowed)


def constructed(
    where: str, name: str, values: Sequence[Any], options: Sequence[tuple[str, Any]]
) -> Constructed:
    """Check the arguments of a constructor.

    Args:
        where: What errors call the place in the file.
        name: Which of `CONSTRUCTORS`.
        values: Positional arguments.
        options: Named arguments with their names.

    Raises:
        InvalidInput: Arguments that are missing, unknown, given twice or of another kind.
    """
    kinds, defaults, place = CONSTRUCTORS[name], _DEFAULTS.get(name, {}), f"{where}, {name}"
    order = [argument for argument in kinds if argument not in defaults]
    if len(values) > len(order):
        raise _fault(place, f"{len(values)} arguments", f"of {', '.join(order)}")
    pairs = [*zip(order, values, strict=False), *options]
    arguments = dict(pairs)
    if twice := [
        argument for argument, count in Counter(key for key, _ in pairs).items() if count > 1
    ]:
        raise _fault(place, f"{twice[0]} twice", "given each argument once")
    if unknown := sorted(set(arguments) - set(kinds)):
        raise _fault(place, unknown[0], f"one of {', '.join(kinds)}")
    if missing := [argument for argument in order if argument not in arguments]:
        raise _fault(place, "nothing", f"given for {missing[0]}")
    for argument, value in arguments.items():
        kind = kinds[argument]
        if not is_of_kind(value, kind):
            raise _fault(place, value, f"{kind} for {argument}")
    return Constructed(name=str(name), where=where, **{**defaults, **arguments})


def is_of_kind(value: object, kind: str) -> bool:
    """True if a value is a number, a vector, or what a constructor of that name makes."""
    if kind == _NUMBER:
        return isinstance(value, float)
    if kind == _NUMBERS:
        return isinstance(value, list | tuple) and all(isinstance(x, float) for x in value)
    if kind == _VECTOR:
        return isinstance(value, list) and bool(value)
    return kind == _ANY or (isinstance(value, Constructed) and value.name == kind)


def _fault(place: str, value: object, allowed: str) -> InvalidInput:
    shown = value.name if isinstance(value, Constructed) else value
    return InvalidInput(
        place, shown if isinstance(shown, int | float | str) else type(shown).__name__, allowed
    )
