"""Arguments of the functions of an atlas, converted as `support.arguments` does."""

from __future__ import annotations

import math
import os
import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arguments import as_given, as_number, as_path, plain
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput
from softreach.support.quantity import numbers_in

__all__ = ["a_store", "an_atlas", "an_interval", "column", "constraint", "shard_of"]

_PLACE = "a path, a URL or a Zarr store"


def a_store(name: str, value: object) -> Any:
    """A place where an atlas may be.

    Raises:
        InvalidInput: Neither text nor a path nor a Zarr store.
    """
    if isinstance(value, str | os.PathLike):
        return as_path(name, value)
    for module, kind in (("zarr.abc.store", "Store"), ("zarr.storage", "StorePath")):
        # who has a store has imported it
        if module in sys.modules and isinstance(value, getattr(sys.modules[module], kind)):
            return value
    if isinstance(value, dict) and all(hasattr(content, "to_bytes") for content in value.values()):
        return value  # a store in memory
    raise InvalidInput(name, as_given(value), _PLACE)


def an_atlas(name: str, value: Any) -> Any:
    """A store, or a dataset from `open_atlas` or a part of one.

    Raises:
        InvalidInput: Anything else.
    """
    allowed = "a store, or a dataset from open_atlas"
    xarray = sys.modules.get("xarray")
    if xarray is not None and isinstance(value, xarray.Dataset):
        if "command" in value.attrs and "status" in value:
            return value
        raise InvalidInput(name, "another Dataset", allowed)
    try:
        return a_store(name, value)
    except InvalidInput:
        raise InvalidInput(name, as_given(value), allowed) from None


def column(name: str, values: ArrayLike) -> tuple[float, ...]:
    """Values of a parameter; whole numbers stay whole.

    Raises:
        InvalidInput: No numbers.
    """
    floats = as_floats(name, values, "one finite value or more")
    if floats.ndim > 1:
        raise InvalidInput(f"{name}.shape", floats.shape, "of one dimension")
    array = np.asarray(values)
    return tuple(np.atleast_1d(array if array.dtype.kind in "iu" else floats).tolist())


def shard_of(name: str, value: object) -> tuple[int, int]:
    """Part i of k.

    Raises:
        InvalidInput: Anything but two whole numbers, 0 <= i < k.
    """
    if isinstance(value, tuple | list) and len(value) == 2:
        first, count = map(plain, value)
        if {type(first), type(count)} == {int} and 0 <= first < count:
            return first, count
        raise InvalidInput(name, "/".join(map(str, (first, count))), "i/k with 0 <= i < k")
    raise InvalidInput(name, as_given(value), "(i, k) with 0 <= i < k")


def an_interval(name: str, value: object) -> tuple[float, float]:
    """The lowest and the highest number allowed; None leaves an end open.

    Raises:
        InvalidInput: Anything else.
    """
    if isinstance(value, tuple | list) and len(value) == 2:
        ends = [
            open_end if end is None or plain(end) == open_end else as_number(name, end)
            for end, open_end in zip(value, (-math.inf, math.inf), strict=True)
        ]
        return ends[0], ends[1]
    raise InvalidInput(name, as_given(value), "(lowest, highest), of which one may be None")


def constraint(text: str) -> tuple[str, tuple[float, float]]:
    """`taper_deg<=1` -> its name, and the numbers between which it is.

    Raises:
        InvalidInput: No name, <= or >=, and a number.
    """
    for sign in ("<=", ">=", "<", ">"):
        name, separator, number = text.partition(sign)
        if separator:
            break
    values = numbers_in(number, 1)
    if values is None:
        allowed = "a name, <= or >=, and a finite number"
        raise InvalidInput("where", text or "''", allowed)
    return name.strip(), (-math.inf, values[0]) if "<" in sign else (values[0], math.inf)
