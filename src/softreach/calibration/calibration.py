"""Calibration: from measured poses to the arm on the bench, with honest errors."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.calibration.baselines import constant_curvature, quadratic
from softreach.calibration.errors import PlacementErrors, misses
from softreach.calibration.fit import Fit, exchanged_columns, fitted, started
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import Measurements, read_measurements
from softreach.calibration.model import MarkerModel
from softreach.calibration.result import Calibration, Rival
from softreach.calibration.uncertainty import uncertainty
from softreach.rod.summary import design_warnings
from softreach.support.arguments import as_flag, as_integer, as_number
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, NotPossible, Range, warn
from softreach.support.progress import Progress, as_progress

_LEAVES = 3.0  # factor by which a number has left its design
_POOR = 0.1  # error over the motion of the markers from which columns may be exchanged


def calibrate(
    arm: Manipulator,
    data: Any,
    *,
    free: Sequence[str],
    prior: Mapping[str, Any] | None = None,
    hold_out: float = 0.0,
    robust: bool = True,
    noise: float | None = None,
    rivals: bool = True,
    inputs: Mapping[str, str] | None = None,
    markers: Mapping[str, str] | None = None,
    run: str | None = None,
    order: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Calibration:
    """The arm whose markers come nearest to measured ones, and how sure that is.

    Least squares on exact derivatives, by SciPy's trust region within the ranges of the numbers.

    Args:
        arm: The design to start from.
        data: Measured poses: see `read_measurements`, which takes `inputs`, `markers`, `run` and
            `order` too; or its result.
        free: Numbers that may change: paths of parameters, with `*` for any text; several tied by
            "=" share one value; "pose" for the base (its start follows from the data).
        prior: What is known of a number beforehand, by its name: its width about the value of the
            design, or (mean, width).
        hold_out: Share of the samples, by chance, that the fit does not see.
        robust: Let samples far off count less than their squares.
        noise: Standard deviation of a measured coordinate [m], against which priors are weighed;
            by default that of the residuals.
        rivals: Fit constant curvature and a quadratic ridge as well.
        inputs: Column of each input.
        markers: Start of the columns of each marker.
        run: Column that says which samples belong together.
        order: Column that says in which order they were taken.
        seed: Of the samples held out.
        progress: Called with 1 for each step of the fit.

    Raises:
        InvalidInput: Data that cannot be read, or numbers that it cannot tell apart.
        NotPossible: Mirrored axes, exchanged columns, or no equilibrium at the start.
        InvalidDesign: No such arm can exist.

    Warns:
        SoftreachWarning: The fit did not converge, or numbers end at a bound.
    """
    begin = perf_counter()
    arm = a_manipulator("arm", arm)
    hold_out = as_number("hold_out", hold_out, Range(0.0, 0.9))
    robust, rivals = as_flag("robust", robust), as_flag("rivals", rivals)
    noise = None if noise is None else as_number("noise", noise, Range(0.0, 1.0, "m", True))
    table = read_measurements(arm, data, inputs=inputs, markers=markers, run=run, order=order)
    rows = np.concatenate([table.inputs, table.places.reshape(len(table), -1)], axis=1)
    if copies := len(rows) - len(np.unique(rows, axis=0, equal_nan=True)):
        warn(f"{copies} samples are copies of others to the last digit: errors come out too small")
    held = _held_out(len(table), hold_out, as_integer("seed", seed))
    train = table.of(~held)
    numbers = free_numbers(arm, free, prior)
    model = MarkerModel.of(numbers, train)
    progress = as_progress(progress)

    def fit_to(model: MarkerModel, places: Array) -> Fit:
        model = replace(model, free=started(model, places))
        return fitted(model, places, robust=robust, noise=noise, progress=progress)

    fit = fit_to(model, train.places)
    if not fit.converged:
        warn(f"the fit did not converge in {fit.evaluations} evaluations: look at its residuals")
    result = Calibration(
        arm=fit.free.made(fit.values),
        start=arm,
        data=table,
        held=held,
        fit=fit,
        uncertainty=uncertainty(fit, train, noise),
        rivals=(),
        exchange=None,
        seconds=perf_counter() - begin,
        date=dt.datetime.now(dt.UTC).date().isoformat(),
    )
    _warn_of_numbers(result)
    spread = misses(train.places - np.nanmean(train.places, axis=0)).rms
    if any(map(_left, result.ratios.values())) or result.train.rms > _POOR * spread:
        result = replace(result, exchange=exchanged_columns(fit, model, train.places, fit_to))
    return replace(result, rivals=_rivals(arm, table, held, progress)) if rivals else result


def _held_out(count: int, share: float, seed: int) -> Mask:
    held, out = np.zeros(count, bool), round(share * count)
    if out == count:
        raise InvalidInput("hold_out", share, f"a share that leaves some of {count} samples")
    held[np.random.default_rng(seed).permutation(count)[:out]] = True
    return held


def _rivals(
    arm: Manipulator, table: Measurements, held: Mask, progress: Progress
) -> tuple[Rival, ...]:
    train = table.of(~held)
    laws = {
        "constant curvature": constant_curvature(arm, train, table, progress),
        "quadratic ridge": quadratic(train, table),
    }
    left = {name: (places - table.places, count) for name, (places, count) in laws.items()}
    each = (Rival(k, n, misses(x[~held]), misses(x[held])) for k, (x, n) in left.items())
    return tuple(each)


def leave_one_run_out(
    arm: Manipulator, data: Any, *, free: Sequence[str], **options: Any
) -> dict[str, PlacementErrors]:
    """Errors of each run by a fit to all others: what to expect of a motion that is new.

    Args:
        arm: The design to start from.
        data: Measured poses with a column of runs, as for `calibrate`.
        free: Numbers, as for `calibrate`.
        **options: Others of `calibrate`.

    Raises:
        NotPossible: Fewer than two runs.
        InvalidInput: As `calibrate`.
    """
    names = ("inputs", "markers", "run", "order")
    columns = {name: options.pop(name) for name in names if name in options}
    table = read_measurements(arm, data, **columns)
    if len(table.run_names) < 2:
        raise NotPossible("leaving out a run needs two runs or more: name their column by `run`")
    errors = {}
    for number, name in enumerate(table.run_names):
        out = table.runs == number
        if out.any() and not out.all():
            others = calibrate(arm, table.of(~out), free=free, **{"rivals": False, **options})
            errors[name] = misses(others.residuals_on(table.of(out)))
    return errors


def _left(ratio: float) -> bool:
    return not 1.0 / _LEAVES < ratio < _LEAVES


def _warn_of_numbers(result: Calibration) -> None:
    if ends := [n for n, end in zip(result.names, result.fit.at_bound, strict=True) if end]:
        warn(f"numbers that end at a bound of their range: {', '.join(ends)}")
    own = [n.name for n in result.fit.free.numbers if n.prior is not None]
    for name, ratio in result.ratios.items():
        if _left(ratio) and name not in own:
            warn(
                f"{name} became {ratio:.3g} times what the design says: hold it, give it a prior, "
                "and look whether the inputs are in their order"
            )
    told = result.uncertainty.told | result.fit.at_bound
    if vague := [name for name, is_told in zip(result.names, told, strict=True) if not is_told]:
        warn(
            f"the data does not tell {', '.join(vague)}: its standard deviation is infinite; hold "
            "it, give it a prior, or measure more"
        )
    if after := design_warnings(result.arm):
        before = {re.sub(r"[\d.]+", "", text) for text in design_warnings(result.start)}
        for text in after:
            if re.sub(r"[\d.]+", "", text) not in before:
                warn(f"the calibrated arm: {text}")
