"""The versions of the package and of its datasets, which everything that is stored carries."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

__all__ = ["SCHEMA_VERSION", "versions"]

SCHEMA_VERSION = 2
"""Of the names, dimensions and units of datasets."""


def versions() -> dict[str, object]:
    """Attributes that say what wrote a dataset."""
    return {"softreach_version": _of_package(), "schema_version": SCHEMA_VERSION}


@cache
def _of_package() -> str:
    """Looking it up takes a millisecond."""
    return version("softreach")
