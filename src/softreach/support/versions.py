"""The versions of the package and of its datasets, which everything that is stored carries."""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import version

SCHEMA_VERSION = 3  # Of the names, dimensions and units of datasets


@cache  # looking the version up takes a millisecond
def versions() -> Mapping[str, object]:
    """Attributes that say what wrote a dataset."""
    return {"softreach_version": version("softreach"), "schema_version": SCHEMA_VERSION}
