"""Needs of a tab: requirements as a text of its state, and parts that are added and removed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from softreach.requirements import Box, Check, Finding, Keep, Requirements, Target
from softreach.support.errors import Fault, InvalidDesign, InvalidInput
from softreach.support.files.toml import tables_of
from softreach.support.units import LengthUnit

__all__ = [
    "needs_of_text",
    "needs_parts",
    "reach_text",
    "requirements_of",
    "verdict_text",
    "with_box",
    "with_payload",
    "with_place",
    "with_shortening",
]

_MOST_PLACES = 300  # which are judged while a slider moves
_FILES = "file", "mesh"
"""Keys under which a table may name another file."""


@lru_cache(maxsize=32)
def requirements_of(text: str) -> Requirements:
    """The requirements in the state of a tab; none for an empty text.

    Raises:
        InvalidDesign: The text is none of requirements, or names other files.
        InvalidInput: It lists more places than can be shown.
    """
    return needs_of_text(text) if text else Requirements()


def needs_of_text(text: str, *, length: float | None = None, source: str = "") -> Requirements:
    """Requirements from the text of a file that comes from a page, as `Requirements.from_toml`.

    Raises:
        InvalidDesign: The text is none of requirements, or names other files: those that lie beside
            it are not sent with it, and files of this machine are not for whoever has the page.
        InvalidInput: It lists more places than can be shown.
    """
    if faults := [Fault(path, None, _allowed(path)) for path in _files_in(text)]:
        raise InvalidDesign(faults, source)
    needs = Requirements.from_toml(text, length=length, source=source)
    if (count := len(needs.places)) > _MOST_PLACES:
        allowed = f"at most {_MOST_PLACES} in the studio"
        raise InvalidInput("places", f"{count:,}", allowed, "use softreach check")
    return needs


def _allowed(path: str) -> str:
    instead = "places_m" if path.endswith("file") else "a table of vertices_m and faces"
    return f"names another file, which is not sent along: write {instead} instead"


def _files_in(text: str) -> list[str]:
    try:
        document = tables_of(text)
    except ValueError:
        return []  # which the reader refuses
    lists = {key: tables for key, tables in document.items() if isinstance(tables, list)}
    return [
        f"{key}[{k}].{name}"
        for key, tables in lists.items()
        for k, table in enumerate(tables)
        if isinstance(table, dict)
        for name in _FILES
        if isinstance(table.get(name), str)
    ]


def with_place(needs: Requirements, place: Sequence[float]) -> Requirements:
    """With one more place to reach [m]."""
    name = _unused("place", needs.targets)
    return needs.replace(targets=(*needs.targets, Target([place], name=name)))  # pyright: ignore[reportArgumentType]


def with_box(
    needs: Requirements, low: Sequence[float], high: Sequence[float], *, inside: bool
) -> Requirements:
    """With a box [m] that the arm must stay in, or avoid, at the places that it reaches."""
    box = Box(tuple(low), tuple(high))  # pyright: ignore[reportArgumentType]
    keep = Keep(box, inside, name=_unused("box", needs.keeps))
    return needs.replace(keeps=(*needs.keeps, keep))


def with_payload(needs: Requirements, payload: float) -> Requirements:
    """With one more mass at the tip [kg]."""
    return needs.replace(payloads=(*needs.payloads, payload))


def with_shortening(needs: Requirements, share: float) -> Requirements:
    """With a limit of the share by which bundles shorten."""
    return _limited(needs, shortening=share)


def _limited(needs: Requirements, **limits: Any) -> Requirements:
    from softreach.requirements import Limits

    return needs.replace(limits=Limits(**{**needs.limits.given, **limits}))


def _unused(kind: str, parts: Sequence[Target | Keep]) -> str:
    """The first of "place 1", "place 2" and so on that no part is called."""
    names = {part.name for part in parts}
    return next(name for k in range(1, len(names) + 2) if (name := f"{kind} {k}") not in names)


def needs_parts(
    needs: Requirements, unit: LengthUnit
) -> dict[str, Callable[[Requirements], Requirements]]:
    """Every part in words -> the requirements without it."""
    parts: dict[str, Callable[[Requirements], Requirements]] = {}
    for target in needs.targets:
        where = ""
        if target.places is not None and len(target.places) == 1:
            where = f" ({', '.join(f'{x / unit.size:.4g}' for x in target.places[0])}) {unit.name}"
        parts[target.name + where] = lambda now, out=target.name: now.replace(
            targets=tuple(each for each in now.targets if each.name != out)
        )
    for keep in needs.keeps:
        parts[f"{keep.name}, to {keep.kind.replace('_', ' ')}"] = lambda now, out=keep.name: (
            now.replace(keeps=tuple(each for each in now.keeps if each.name != out))
        )
    for mass in needs.payloads:
        parts[f"payload {1e3 * mass:.6g} g"] = lambda now, out=mass: now.replace(
            payloads=tuple(each for each in now.payloads if each != out)
        )
    for name in needs.limits.given:
        words = name.replace("_", " ")
        parts[f"limit of {words}"] = lambda now, out=name: _limited(now, **{out: None})
    for name in needs.measures:
        parts[f"measure {name}"] = lambda now, out=name: now.replace(
            measures={each: ends for each, ends in now.measures.items() if each != out}
        )
    return parts


def reach_text(check: Check, finding: Finding) -> str:
    """A target in words: reached, or missed by its largest gap."""
    needs = check.requirements
    index = next(k for k, target in enumerate(needs.targets) if target.name == finding.name)
    own = check.target_of == index
    gap, unit = float(check.gaps[:, own].max()) - needs.targets[index].within, check.arm.length_unit
    reached = int(check.reached[:, own].all(axis=0).sum())
    many = f"{reached} of {int(own.sum())} places, " if own.sum() > 1 else ""
    if finding.met:
        return f"{many}reached"
    if "not held" in finding.text:
        return f"{many}not held: no stable equilibrium"
    return f"{many}missed by {gap / unit.size:.3g} {unit.name}"


def verdict_text(check: Check) -> str:
    """Number of needs that are met, and the worst that is not, in words."""
    missed = [finding for finding in check.findings if not finding.met]
    text = f"needs: {len(check.findings) - len(missed)} of {len(check.findings)} met"
    if not missed:
        return text
    worst = max(missed, key=lambda finding: finding.excess)
    more = f" {reach_text(check, worst)}" if worst.kind == "reach" else ""
    more += " undecided" if worst.verdict == "undecided" else ""
    return f"{text} · {worst.name}{more}"
