"""Columns that seem to be exchanged: two inputs, two axes, or two coordinates of markers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.errors import misses
from softreach.calibration.fit import Fit, fitted, moved_miss, started
from softreach.calibration.model import MarkerModel, exchanged_inputs
from softreach.support.errors import InvalidInput
from softreach.support.progress import Progress

__all__ = ["Exchange", "exchanged_columns"]

Array = NDArray[np.float64]

_SAMPLES = 100
"""Samples by which exchanges are compared."""
_PROMISING, _BETTER = 0.8, 0.5
"""Error over that of the columns as they are: before a fit, and after it."""
_ALIKE = 1.2
"""Factor between errors that nothing tells apart."""


class Exchange(NamedTuple):
    """Columns by whose exchange the same numbers fit far better."""

    columns: str
    fit: Fit
    """With them exchanged."""


def exchanged_columns(
    fit: Fit,
    model: MarkerModel,
    places: Array,
    *,
    robust: bool,
    noise: float | None,
    progress: Progress,
) -> Exchange | None:
    """The exchange of two columns that halves the error of a fit at least, if there is one.

    Args:
        fit: The fit with the columns as they are.
        model: Its model.
        places: Measured places [m], shape (n, marker, 3).
        robust: As in `fitted`.
        noise: As in `fitted`.
        progress: Called with 1 for each step.
    """
    some = slice(None, None, -(-len(places) // _SAMPLES))
    few, seen = replace(model, inputs=model.inputs[some]), places[some]
    least, best = _BETTER * misses(fit.residuals).rms, None
    tried: set[str] = set()
    for values in (model.free.start, fit.values):
        own = few.predict(values).places
        each = {text: (order, None) for text, order in exchanged_inputs(model.free.arm)}
        each |= {text: (None, order) for text, order in _coordinates(model.names)}
        found = {}
        for text, (inputs, columns) in each.items():
            other = few if inputs is None else replace(few, inputs=few.inputs[:, inputs])
            predicted = own if inputs is None else other.predict(values).places
            found[text] = moved_miss(model.free, predicted, _ordered(seen, columns))
        first = min(found, key=found.__getitem__, default="")
        promising = found and found[first] <= _PROMISING * moved_miss(model.free, own, seen)
        if not promising or first in tried:
            continue
        tried.add(first)
        alike = [text for text, miss in found.items() if miss <= _ALIKE * found[first]]
        inputs, columns = each[first]
        other = model if inputs is None else replace(model, inputs=model.inputs[:, inputs])
        moved = _ordered(places, columns)
        try:
            other = replace(other, free=started(other, moved))
            again = fitted(other, moved, robust=robust, noise=noise, progress=progress)
        except InvalidInput:
            continue
        if (error := misses(again.residuals).rms) < least:
            least, best = error, Exchange(" or ".join(alike[:4]), again)
    return best


def _coordinates(names: tuple[str, ...]) -> Iterator[tuple[str, list[int]]]:
    """Orders of the coordinates of all markers with two axes, or two columns, exchanged."""
    columns = [f"{name} {axis}" for name in names for axis in "xyz"]
    for a, b in combinations(range(3), 2):
        turned = {a: b, b: a}
        order = [k - k % 3 + turned.get(k % 3, k % 3) for k in range(len(columns))]
        yield f"the axes {'xyz'[a]} and {'xyz'[b]}", order
    for j, k in combinations(range(len(columns)) if len(names) > 1 else (), 2):
        order = list(range(len(columns)))
        order[j], order[k] = k, j
        yield f"the columns {columns[j]} and {columns[k]}", order


def _ordered(places: Array, order: list[int] | None) -> Array:
    rows = places.reshape(len(places), -1)
    return places if order is None else rows[:, order].reshape(places.shape)
