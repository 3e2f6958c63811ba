"""Number of parameters that the data bear: ladders of fits, runs left out, profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.calibration.calibration import Calibration, calibrate
from softreach.calibration.errors import Misses, misses
from softreach.calibration.fit import fitted
from softreach.calibration.measurements import read_measurements
from softreach.calibration.model import MarkerModel
from softreach.support.arguments import as_given, as_instance, as_number, as_text
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput, Range
from softreach.support.progress import silent

__all__ = ["Ladder", "ladder", "leave_one_run_out", "profile"]

Array = NDArray[np.float64]

_HELD = 1e-3
"""Width within which a number of a profile is held, in its scale."""
_ENOUGH = 1.02
"""Held-out error over the least one, up to which fewer numbers are better."""


@dataclass(frozen=True, eq=False, repr=False)
class Ladder:
    """Fits of more and more numbers on the same samples, judged on the same others."""

    rungs: tuple[Calibration, ...]
    """In the order in which they were asked for."""

    @property
    def best(self) -> Calibration:
        """The fewest numbers whose held-out error is within 2 % of the least."""
        least = min(rung.held_out.rms for rung in self.rungs)
        enough = [rung for rung in self.rungs if rung.held_out.rms <= _ENOUGH * least]
        return min(enough, key=lambda rung: len(rung.names))

    def __repr__(self) -> str:
        lines = ["numbers  fitted  held out  (mm rms)"]
        for rung in self.rungs:
            mark = "  <- enough" if rung is self.best else ""
            train, held = 1e3 * rung.train.rms, 1e3 * rung.held_out.rms
            lines.append(f"{len(rung.names):7d}  {train:6.2f}  {held:8.2f}{mark}")
        return "\n".join(lines)


def ladder(
    arm: Manipulator,
    data: Any,
    free: Sequence[Sequence[str]],
    *,
    hold_out: float = 0.33,
    seed: int = 0,
    **options: Any,
) -> Ladder:
    """Fits of several sets of numbers, so that nobody reports 27 where 13 do.

    Args:
        arm: The design to start from.
        data: Measured poses, as for `calibrate`.
        free: Sets of numbers, each as for `calibrate`.
        hold_out: Share of the samples, by chance, on which all are judged.
        seed: Of these samples.
        **options: Others of `calibrate`.

    Raises:
        InvalidInput: No set, or no samples to judge by; else as `calibrate`.
    """
    sets = list(free) if isinstance(free, list | tuple) else []
    if not sets or not all(isinstance(each, list | tuple) for each in sets):
        raise InvalidInput(
            "free", as_given(free), 'sets of names, such as [["pose"], ["pose", "length"]]'
        )
    hold_out = as_number("hold_out", hold_out, Range(0.0, 0.9, open_low=True))
    options = {"rivals": False, **options, "hold_out": hold_out, "seed": seed}
    return Ladder(tuple(calibrate(arm, data, free=each, **options) for each in free))


def leave_one_run_out(
    arm: Manipulator, data: Any, *, free: Sequence[str], **options: Any
) -> dict[str, Misses]:
    """Errors of each run by a fit to all others: what to expect of a motion that is new.

    Args:
        arm: The design to start from.
        data: Measured poses with a column of runs, as for `calibrate`.
        free: Numbers, as for `calibrate`.
        **options: Others of `calibrate`.

    Raises:
        InvalidInput: Fewer than two runs; else as `calibrate`.
    """
    names = ("inputs", "markers", "run", "order")
    columns = {name: options.pop(name) for name in names if name in options}
    table = read_measurements(arm, data, **columns)
    if not table.has_runs:
        raise InvalidInput("runs", len(table.run_names), "2 or more: name their column by `run`")
    errors = {}
    for number, name in enumerate(table.run_names):
        out = table.runs == number
        if out.any() and not out.all():
            others = calibrate(arm, table.of(~out), free=free, **{"rivals": False, **options})
            errors[name] = misses(others.residuals_on(table.of(out)))
    return errors


def profile(result: Calibration, name: str, values: ArrayLike) -> Array:
    """Error of the fit with one number held at each of some values, all others fitted again.

    Where it hardly rises the data says little of the number, whatever its σ.

    Args:
        result: The calibration.
        name: One of its numbers.
        values: At which it is held [unit of the number], shape (n,).

    Returns:
        rms of the fitted samples [m], shape (n,).

    Raises:
        InvalidInput: No such number, or values outside its range.
    """
    as_instance("result", result, Calibration, "a Calibration")
    free = result.fit.free
    if as_text("name", name) not in free.names:
        raise InvalidInput("name", name, f"one of {', '.join(free.names)}")
    k = free.names.index(name)
    held = np.atleast_1d(as_floats("values", values))
    low, high = free.bounds
    if not ((held >= low[k]) & (held <= high[k])).all():
        raise InvalidInput("values", held, free.numbers[k].range.text)
    train = result.data.of(~result.held)
    start = dict(zip(free.names, result.fit.values.tolist(), strict=True))
    errors = []
    for value in held.tolist():
        numbers = list(free.started_at({**start, name: value}).numbers)
        numbers[k] = replace(numbers[k], prior=(value, _HELD * numbers[k].scale))
        model = MarkerModel.of(replace(free, numbers=tuple(numbers)), train)
        fit = fitted(model, train.places, robust=False, noise=None, progress=silent)
        errors.append(misses(fit.residuals).rms)
    return np.array(errors)
