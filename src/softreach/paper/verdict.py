"""Verdicts on the statements of the paper."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NamedTuple

__all__ = ["Finding", "Numbers", "Verdict", "judged"]

Numbers = Mapping[str, Any]
"""What a part of the report computed, by name."""


class Verdict(StrEnum):
    """Whether a statement holds."""

    AGREES = "agrees"
    NEARLY = "nearly"
    DIFFERS = "differs"
    MISPRINT = "misprint"
    OPEN = "open"


class Finding(NamedTuple):
    """What was found."""

    text: str
    verdict: Verdict


def judged(text: str, agrees: bool, nearly: bool = False) -> Finding:
    """What was found, and whether that agrees, or nearly does."""
    verdict = Verdict.AGREES if agrees else Verdict.NEARLY if nearly else Verdict.DIFFERS
    return Finding(text, verdict)
