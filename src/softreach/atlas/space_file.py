"""Design spaces as people write them: TOML and flags, angles in degrees, units in the keys."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from softreach.arm.design_file import document_of
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import unknown_parameter
from softreach.arm.written import Written, from_written
from softreach.atlas.space import DesignSpace, column
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.quantity import read_number, read_whole_number

_KEYS = ("design", "layout", "designs", "seed", "parameters")
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
_MOST = 100_000  # values of one parameter
_SAMPLERS = ("sobol", "latin")
_LAYOUTS = ("grid", "list", *_SAMPLERS)


def parse_space(text: str, design_from: Callable[[str], Manipulator]) -> DesignSpace:
    """A design space from the text of a file.

    ```toml
    design = "minimal_trunk"     # or a design file
    layout = "grid"              # grid, list, sobol or latin
    [parameters]
    revolution_deg = "0:108:16"  # 16 values, ends included; or a list: [0, 54, 108]
    taper_deg = "0:3:16"         # for sobol and latin the two ends: [0, 3]
    left.offset_deg = [60, 70]   # of the fiber "left"
    "fiber 2".extent_deg = [48]  # other names are quoted
    "rings[0].material.young_modulus_pa" = [1e5, 1e6]
    ```

    With `sobol` and `latin` the keys `designs` (their number) and `seed` apply too.

    Args:
        text: TOML.
        design_from: Name or path of a design -> the design.

    Raises:
        InvalidInput: A key or value that is wrong, with what is allowed.
    """
    try:
        document = document_of(text, "space", float)
    except InvalidDesign as error:
        raise InvalidInput("space", error.faults[0].value, str(error.faults[0].allowed)) from None
    for key in document:
        if key not in _KEYS:
            raise InvalidInput("key", key, f"one of {', '.join(_KEYS)}")
    base = design_from(str(document.get("design", "minimal_trunk")))
    table, layout = document.get("parameters", {}), document.get("layout", "grid")
    if not isinstance(table, dict):
        raise InvalidInput("parameters", table, "a table of parameters and their values")
    if layout not in _LAYOUTS:
        raise InvalidInput("layout", layout, f"one of {', '.join(_LAYOUTS)}")
    values: dict[str, list[float]] = {}
    for key, value in flat_keys(table):
        name, numbers = parse_parameter(base, key, value)
        if name in values:
            raise InvalidInput(key, value, "given once")
        if layout in _SAMPLERS and len(numbers) != 2:
            raise InvalidInput(name, numbers, f"two ends, [lower, upper], for {layout}")
        values[name] = numbers
    if layout not in _SAMPLERS:
        return (DesignSpace.grid if layout == "grid" else DesignSpace.listed)(base, **values)
    ranges = {name: (low, high) for name, (low, high) in values.items()}
    count, seed = document.get("designs", 64), document.get("seed", 0)
    return DesignSpace.sampled(base, count, method=layout, seed=seed, **ranges)


def flat_keys(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Keys and values; TOML reads the dots of unquoted keys as tables within tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flat_keys(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def parse_parameter(base: Manipulator, key: str, value: Any) -> tuple[str, list[float]]:
    """Name and values [SI units] of a parameter as written.

    `taper_deg` with `0:3:16` or a list, or `taper` with `0deg:3deg:16` or a list of such texts.
    """
    names = Written.of(base)
    if key not in names.by_key:
        raise unknown_parameter(key, names.written)
    parameter = names.by_key[key]
    try:
        if key in names.written:
            numbers = _read(value, _number) if isinstance(value, str) else column(key, value)
            return parameter.name, [from_written(x, parameter.unit) for x in numbers]
        return parameter.name, _read(value, partial(names.number, key))
    except (InvalidInput, ValueError):
        kind = "numbers" if key in names.written else names.allowed(key)
        allowed = f"{kind}: a list, or start:stop:count with both ends and a count up to {_MOST}"
        raise InvalidInput(key, value, allowed) from None


def _read(value: Any, read: Callable[[Any], float]) -> list[float]:
    if isinstance(value, str) and ":" in value:
        start, stop, count = value.split(":")
        number = read_whole_number(count)
        if not 0 < number <= _MOST:
            raise ValueError(value)
        values = np.linspace(read(start), read(stop), number)
        return [float(f"{value:.15g}") for value in values]  # 1.8 and not 1.8000000000000003
    each = value.split(",") if isinstance(value, str) else value
    return [read(one) for one in (each if isinstance(each, list) else [each])]


def _number(text: str) -> float:
    number = read_number(text)
    return read_whole_number(text) if _INTEGER.fullmatch(text.strip()) else number
