"""Definitions of filaments, as users of ActiveFilaments.jl write them, as designs.

The source is read, not run: see `expressions` for what it may hold. A statement of another kind is
passed over, unless the filament depends on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike, fspath
from typing import Any

from softreach.arm.manipulator import Manipulator
from softreach.exchange.activefilaments.constructors import filament_from
from softreach.exchange.activefilaments.expressions import Call, Unreadable, value_of
from softreach.exchange.activefilaments.filament import arm_of
from softreach.exchange.activefilaments.tokens import Token, refused, statements
from softreach.support.arguments import checked, path
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.files.text import read_text

__all__ = ["read_design"]

_LARGEST = 100_000  # bytes
_BLOCKS = {
    "for", "while", "if", "function", "macro", "let", "begin", "struct", "mutable", "try", "do",
    "quote", "module", "baremodule", "end", "else", "elseif", "catch", "finally", "return",
    "abstract", "primitive", "global", "local",
}  # fmt: skip
_PASSED_OVER = {"using", "import", "export", "@"}
_ASSIGNMENTS = {f"{dot}{sign}=" for dot in ("", ".") for sign in ("", *"+-*/^")}


@checked(path=path)
def read_design(path: str | PathLike[str]) -> Manipulator:
    """Read the definition of a filament from Julia source for ActiveFilaments.jl.

    The file must define one AFilament and its activation, one ActivationPiecewiseGamma a ring. The
    bounds of the activations are `γBounds` or `gammaBounds` if the file has them; else [-5/3, 0],
    widened to hold the activation.

    Args:
        path: The file. It is read and never run: numbers, simple arithmetic, elementary functions
            and the constructors of the package are understood.

    Raises:
        InvalidInput: A definition that is not such, with the number of its line, or that no arm can
            have.
    """
    source = fspath(path)
    known = _definitions(source, read_text("definition", path, _LARGEST))
    filament = filament_from(source, _the_filament(source, known), known)
    try:
        return arm_of(filament)
    except InvalidDesign as error:
        faults = "; ".join(str(fault) for fault in error.faults)
        raise InvalidInput(source, faults, "the filament of an arm that can exist") from None


def _definitions(source: str, text: str) -> dict[str, Any]:
    """What each name stands for at the end."""
    known: dict[str, Any] = {}
    for statement in statements(source, text):
        _follow(source, statement, known)
    return known


def _follow(source: str, statement: list[Token], known: dict[str, Any]) -> None:
    """Keep what a statement assigns, or that it assigns something unreadable."""
    if statement[0].text in _PASSED_OVER:
        return
    if statement[0].text == "const" and len(statement) > 1:
        statement = statement[1:]
    first = statement[0]
    if first.kind == "name" and first.text in _BLOCKS:
        hint = "keep only the definition of the filament in the file"
        raise refused(source, first, "a plain assignment", hint)
    signs = list(_assignments(statement))
    changes = any(token.kind == "name" and token.text.endswith("!") for token in statement)
    plain = signs == [1] and statement[1].text == "=" and first.kind == "name"
    if plain and not changes and statement[2:]:
        known[first.text] = _read(source, statement[2:], known)
    elif signs or changes:
        changed = statement if changes else statement[: signs[-1]]
        error = refused(source, first, "a plain assignment such as `R2 = 0.01`")
        names = frozenset(token.text for token in statement if token.kind == "name")
        known.update({t.text: Unreadable(error, names) for t in changed if t.kind == "name"})


def _assignments(statement: Sequence[Token]) -> Iterator[int]:
    """Where a statement has an `=`, `*=`, `.=`, ... that does not name an argument of a call."""
    of_calls: list[bool] = []
    for place, token in enumerate(statement):
        if token.kind != "sign":
            continue
        if token.text in "([{":
            named = token.touches and statement[place - 1].kind == "name"
            of_calls.append(named and token.text == "(")
        elif token.text in ")]}":
            of_calls.pop()
        elif token.text in _ASSIGNMENTS and not (of_calls and of_calls[-1]):
            yield place


def _read(source: str, tokens: Sequence[Token], known: dict[str, Any]) -> Any:
    try:
        return value_of(source, tokens, known)
    except InvalidInput as error:
        names = frozenset(token.text for token in tokens if token.kind == "name")
        return Unreadable(error, names)


def _the_filament(source: str, known: dict[str, Any]) -> Call:
    """The one filament that is defined, or why there is none."""
    found = [v for v in known.values() if isinstance(v, Call) and v.name == "AFilament"]
    if len(found) == 1:
        return found[0]
    if found:
        lines = " and ".join(str(call.line) for call in found)
        raise InvalidInput(source, f"filaments in lines {lines}", "the definition of one filament")
    for value in known.values():
        if isinstance(value, Unreadable) and "AFilament" in value.names:
            raise value.error
    raise InvalidInput(
        source, "no filament", "a definition with `filament = AFilament(rings; ...)`"
    )
