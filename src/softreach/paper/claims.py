"""Statements of the paper (`claims.toml`), the check of each, and verdicts."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from importlib.resources import files
from typing import Any, NamedTuple

Numbers = Mapping[str, Any]
"""Numbers that a section of the report computed, by name."""


class Verdict(StrEnum):
    """Verdict on a statement."""

    AGREES = "agrees"
    NEARLY = "nearly"
    DIFFERS = "differs"
    MISPRINT = "misprint"
    OPEN = "open"
    UNTESTED = "not tested"


class Finding(NamedTuple):
    """Result of a check."""

    text: str
    verdict: Verdict


def judged(text: str, agrees: bool, nearly: bool = False) -> Finding:
    """A finding whose verdict follows from whether it agrees, or nearly does."""
    verdict = Verdict.AGREES if agrees else Verdict.NEARLY if nearly else Verdict.DIFFERS
    return Finding(text, verdict)


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and its check."""

    section: str
    """Its section of the paper."""
    says: str
    """The statement, in the paper's words or nearly so."""
    how: str
    """How it is checked."""
    part: str
    """The part of the report that computes the numbers."""
    check: Callable[[Numbers], Finding]
    full: bool = False
    """True if only the full sizes test it."""


def _claims() -> Iterator[Claim]:
    text = files("softreach.paper").joinpath("claims.toml").read_text(encoding="utf-8")
    for name, row in tomllib.loads(text).items():
        part, function = name.split(".")
        check = getattr(import_module(f"softreach.paper.sections.{part}"), function)
        yield Claim(**row, part=part, check=check)


CLAIMS = tuple(_claims())
"""Every statement that is checked, in the paper's order."""
