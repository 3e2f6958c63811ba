"""Formulas of kernels as statements of C: a kernel's part is run on names instead of numbers.

So each formula has one source. What is zero or one drops out, and what comes twice is named once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any

Number = Any  # A float, or an expression that stands for one


class _Expression:
    """The name of a number in C; `known` has the names of all numbers `a op b`, in their order."""

    def __init__(self, known: dict[tuple[str, str, str], str], name: str) -> None:
        self.known, self.name = known, name

    def _named(self, operator: str, a: Number, b: Number) -> _Expression:
        key = operator, _text(a), _text(b)
        return _Expression(self.known, self.known.setdefault(key, f"t{len(self.known)}"))

    def __add__(self, other: Number) -> Number:
        return self if other == 0.0 else self._named("+", self, other)

    def __sub__(self, other: Number) -> Number:
        return self if other == 0.0 else self._named("-", self, other)

    def __rsub__(self, other: Number) -> Number:
        return self._named("-", other, self)

    def __mul__(self, other: Number) -> Number:
        same = self if other == 1.0 else None
        return 0.0 if other == 0.0 else same or self._named("*", self, other)

    def __truediv__(self, other: Number) -> Number:
        return self._named("/", self, other)

    __radd__, __rmul__ = __add__, __mul__


def function_in_c(
    head: str, formula: Callable[..., Sequence[Number]], inputs: dict[str, int], out: str
) -> str:
    """A C function with this head, whose arrays `inputs` have so many numbers each.

    `formula` takes a tuple for each of them, and gives what goes to the array `out`, which may be
    one of the inputs.
    """
    known: dict[tuple[str, str, str], str] = {}
    arrays = [
        tuple(_Expression(known, f"{name}[{i}]") for i in range(size))
        for name, size in inputs.items()
    ]
    numbers = [_text(number) for number in plain(formula)(*arrays)]
    needed = {*numbers}
    lines = [f"{out}[{i}] = {number};" for i, number in enumerate(numbers)][::-1]
    for (operator, a, b), name in reversed(known.items()):
        if name in needed:
            needed |= {a, b}
            lines.append(f"const double {name} = {a} {operator} {b};")
    return "\n".join([head, "{", *(f"    {line}" for line in reversed(lines)), "}", ""])


@cache
def plain(function: Any) -> FunctionType:
    """A part of kernels, and all parts that it calls, as functions of Python for any numbers."""
    source = getattr(function, "py_func", function)
    scope = dict(source.__globals__)
    for name in source.__code__.co_names:
        value = scope.get(name)
        if hasattr(value, "py_func") or isinstance(value, FunctionType):
            scope[name] = plain(value)
    return FunctionType(source.__code__, scope, source.__name__)


def _text(number: Number) -> str:
    return number.name if isinstance(number, _Expression) else repr(float(number))
