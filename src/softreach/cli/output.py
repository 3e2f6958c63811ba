"""What commands print: a table for people, JSON for machines, both on standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

__all__ = ["print_rows"]


def print_rows(title: str, rows: Mapping[str, tuple[Any, str]], as_json: bool) -> None:
    """Print named values with their units.

    Args:
        title: Heading of the table.
        rows: name -> (value, unit); JSON keys are the names with unit suffixes.
        as_json: Whether to print JSON.
    """
    if as_json:
        json.dump({_key(name, unit): value for name, (value, unit) in rows.items()}, sys.stdout)
        sys.stdout.write("\n")
        return
    width = max(len(name) for name in rows)
    lines = (
        f"  {name:<{width}}  {_shown(value)} {'' if value is None else unit}".rstrip()
        for name, (value, unit) in rows.items()
    )
    sys.stdout.write("\n".join([title, *lines, ""]))


_SUFFIX = {
    "m": "_m",
    "m³": "_m3",
    "L³": "_L3",
    "L": "_L",
    "deg": "_deg",
    "%": "_percent",
    "Pa": "_pa",
    "N": "_n",
    "N m²": "_n_m2",
    "kg": "_kg",
    "kg/m³": "_kg_m3",
    "m/s²": "_m_s2",
    "N m": "_n_m",
    "N/m": "_n_per_m",
    "mm": "_mm",
}


def _key(name: str, unit: str) -> str:
    from softreach.arm.parameters.shown import with_suffix

    plain = name.replace(" ", "_").replace("/", "_per_").replace("(", "").replace(")", "")
    return with_suffix(plain, _SUFFIX.get(unit, ""))


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, list | tuple):
        return ", ".join(_shown(item) for item in value)
    return str(value)
