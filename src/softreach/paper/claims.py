"""What the paper says, statement by statement: `claims.toml`, and the check of each."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.resources import files

from softreach.paper.verdict import Finding, Numbers

__all__ = ["CLAIMS", "Claim"]


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and its check."""

    section: str
    """Where it stands."""
    says: str
    """The statement, in the paper's words or nearly so."""
    how: str
    """How it is checked."""
    part: str
    """The part of the report that computes what it needs."""
    check: Callable[[Numbers], Finding]
    """From the part's numbers to a finding."""


def _claims() -> Iterator[Claim]:
    text = files("softreach.paper").joinpath("claims.toml").read_text(encoding="utf-8")
    for row in tomllib.loads(text)["claim"]:
        part, function = row.pop("check").split(".")
        check = getattr(import_module(f"softreach.paper.checks.{part}"), function)
        yield Claim(**row, part=part, check=check)


CLAIMS = tuple(_claims())
"""Every statement that is checked, in the paper's order."""
