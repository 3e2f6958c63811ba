"""Runs left out one by one, each predicted by all others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from softreach.arm.manipulator import Manipulator
from softreach.calibration.calibration import calibrate
from softreach.calibration.errors import Misses, misses
from softreach.calibration.measurements import read_measurements
from softreach.support.errors import InvalidInput

__all__ = ["leave_one_run_out"]


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
