"""What is said of a name that no parameter has."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping

from softreach.arm.parameters.parameter import Parameter
from softreach.support.errors import InvalidInput

__all__ = ["unknown_parameter"]

_ELEMENT = re.compile(r"(.*)\[(\d+)\]$")
_FEW = 12


def unknown_parameter(name: str, known: Mapping[str, Parameter]) -> InvalidInput:
    """What to raise for a name that no parameter has, in one line.

    It lists the parameters of the part that the name begins with, or those of the whole arm, and
    suggests the closest one.

    Args:
        name: The name.
        known: All parameters by what they are called where the name was given.
    """
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    hint = f'did you mean "{close[0]}"?' if close else ""
    if name.startswith("loads.") and not any(key.startswith("loads.") for key in known):
        hint = "the arm has no loads: give it some first"
    owners = list(dict.fromkeys(one.owner for one in known.values() if one.owner))
    meant = max((own for own in owners if name.startswith(f"{own}.")), key=len, default="")
    own = [key for key, one in known.items() if one.owner == meant]
    allowed = f"one of {', '.join(_shortened(own))}"
    if owners and not meant:
        parts = ", ".join(owners[:_FEW]) + (", ..." if len(owners) > _FEW else "")
        example = next(key for key, one in known.items() if one.owner)
        allowed += f", or of one part ({parts}), such as {example}"
    return InvalidInput("parameter", name, allowed, hint)


def _shortened(names: Iterable[str]) -> list[str]:
    """The names, of a series its first and its last number."""
    found: dict[str, list[str]] = {}
    for name in names:
        element = _ELEMENT.match(name)
        found.setdefault(element[1] if element else name, []).append(element[2] if element else "")
    return [
        text
        for base, places in found.items()
        for text in ([base] if "" in places else [])
        + _span(base, [place for place in places if place])
    ]


def _span(base: str, places: list[str]) -> list[str]:
    if len(places) < 2:
        return [f"{base}[{place}]" for place in places]
    return [f"{base}[{places[0]}] to [{places[-1]}]"]
