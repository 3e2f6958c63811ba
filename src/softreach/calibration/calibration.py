"""Calibration: from measured poses to the arm on the bench, with honest errors."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.calibration.baselines import constant_curvature, quadratic
from softreach.calibration.errors import (
    Misses,
    Repeatability,
    Verdict,
    judged,
    misses,
    repeatability,
)
from softreach.calibration.fit import Fit, exchanged_columns, fitted, robust_width, started
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import Measurements, read_measurements
from softreach.calibration.model import MarkerModel
from softreach.calibration.uncertainty import Uncertainty, uncertainty
from softreach.rod.summary import design_warnings
from softreach.support.arguments import as_flag, as_integer, as_number
from softreach.support.errors import InvalidInput, Range, warn
from softreach.support.files.text import write_text
from softreach.support.progress import Progress, as_progress
from softreach.support.report import Report
from softreach.support.units import as_unit
from softreach.support.versions import versions

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Calibration", "Rival", "calibrate", "leave_one_run_out"]

Array = NDArray[np.float64]

_OUTLIER = 5.0
"""Robust widths from which a sample is listed."""
_CORRELATED = 0.95
_LEAVES = 3.0
"""Factor by which a number has left its design."""
_POOR = 0.1
"""Error over the motion of the markers from which columns may be exchanged."""


class Rival(NamedTuple):
    """Another law, fitted to the same samples."""

    name: str
    numbers: int
    """Number of fitted parameters."""
    train: Misses
    held_out: Misses


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
        InvalidInput: Data that cannot be read, numbers that it cannot tell apart, or mirrored axes.
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


def _held_out(count: int, share: float, seed: int) -> NDArray[np.bool_]:
    held, out = np.zeros(count, bool), round(share * count)
    if out == count:
        raise InvalidInput("hold_out", share, f"such that some of {count} samples are left")
    held[np.random.default_rng(seed).permutation(count)[:out]] = True
    return held


def _rivals(
    arm: Manipulator, table: Measurements, held: NDArray[np.bool_], progress: Progress
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


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """A calibrated arm, the numbers that were fitted, and all that the data says of them."""

    arm: Manipulator
    """The calibrated arm."""
    start: Manipulator
    """The design before."""
    data: Measurements
    """All samples."""
    held: NDArray[np.bool_]
    """Samples that the fit did not see, shape (n,)."""
    fit: Fit
    uncertainty: Uncertainty
    rivals: tuple[Rival, ...]
    """Other laws on the same samples."""
    exchange: tuple[str, float] | None
    """Columns by whose exchange the same numbers would fit far better, and the error then [m]."""
    seconds: float
    date: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted numbers."""
        return self.fit.free.names

    @property
    def values(self) -> dict[str, float]:
        """Fitted numbers by name, in their units."""
        return dict(zip(self.names, self.fit.values.tolist(), strict=True))

    @property
    def sigma(self) -> dict[str, float]:
        """Their standard deviations."""
        return dict(zip(self.names, self.uncertainty.sigma.tolist(), strict=True))

    @cached_property
    def residuals(self) -> Array:
        """Predicted minus measured places of all samples [m], (n, marker, 3)."""
        return self._model(self.data).of_arm(self.arm).places - self.data.places

    @property
    def train(self) -> Misses:
        """Errors of the samples of the fit."""
        return misses(self.residuals[~self.held])

    @property
    def held_out(self) -> Misses:
        """Errors of the samples that it did not see."""
        return misses(self.residuals[self.held])

    @property
    def by_marker(self) -> dict[str, Misses]:
        """Errors of each marker: of held-out samples, or of all if none is held out."""
        rows = self.held if self.held.any() else ~self.held
        each = enumerate(self.data.marker_names)
        return {name: misses(self.residuals[rows, k]) for k, name in each}

    @cached_property
    def before(self) -> Misses:
        """Errors of the design before, moved onto the fitted samples as it is.

        Of samples held out, or of all if none is.
        """
        train = self.data.of(~self.held)
        free = started(MarkerModel.of(free_numbers(self.start, ["pose"]), train), train.places)
        judged = self.data.of(self.held) if self.held.any() else train
        model = MarkerModel.of(free, judged)
        return misses(model.of_arm(free.made(free.start)).places - judged.places)

    @cached_property
    def repeatability(self) -> Repeatability:
        """By how much the data repeats itself."""
        return repeatability(self.data, self.residuals)

    @cached_property
    def verdict(self) -> Verdict:
        """Limitation of the fit; samples far off are left out if they are few."""
        if self.exchange is not None:
            columns, less = self.exchange
            said = f"{columns}: the same numbers then fit to {1e3 * less:.3g} mm rms instead of "
            return Verdict("columns", f"{said}{1e3 * self.train.rms:.3g} mm")
        far = np.isin(self.data.rows, self.outliers)
        return judged(self.data, self.residuals, self.repeatability, self.held, far)

    @property
    def outliers(self) -> NDArray[np.intp]:
        """Rows of the data whose markers are more than five robust widths off."""
        distance = np.linalg.norm(self.residuals, axis=2)
        widths = [robust_width(self.residuals[:, k]) for k in range(self.data.markers)]
        far = np.nanmax(distance / widths, axis=1, initial=0.0) > _OUTLIER * 1.7
        return self.data.rows[far]

    @property
    def ratios(self) -> dict[str, float]:
        """Fitted numbers over those of the design, of all that cannot be below 0 and are not."""
        numbers = zip(self.fit.free.numbers, self.fit.values.tolist(), strict=True)
        return {n.name: v / n.start for n, v in numbers if n.range.low >= 0 and n.start > 0}

    @property
    def correlated(self) -> list[tuple[str, str, float]]:
        """Pairs of numbers that the data hardly tells apart, with their correlation."""
        matrix, names = self.uncertainty.correlation, self.names
        pairs = np.argwhere(np.triu(np.abs(matrix) > _CORRELATED, 1)).tolist()
        return [(names[a], names[b], float(matrix[a, b])) for a, b in pairs]

    def errors_on(self, data: Any, **columns: Any) -> Misses:
        """Errors of the calibrated arm on other measurements."""
        return misses(self.residuals_on(data, **columns))

    def residuals_on(self, data: Any, **columns: Any) -> Array:
        """Predicted minus measured places of other measurements [m], (n, marker, 3)."""
        table = read_measurements(self.start, data, **columns)
        return self._model(table).of_arm(self.arm).places - table.places

    def predict(self, inputs: ArrayLike) -> tuple[Array, Array]:
        """Places of the markers and the standard deviations that calibration leaves.

        Args:
            inputs: Of the arm, in their units, shape (n, input).

        Returns:
            Places in the world [m] and their standard deviations [m], (n, marker, 3) each.
        """
        from softreach.support.arrays import as_rows

        allowed = f"shape (n, {self.arm.inputs})"
        x = as_rows("inputs", inputs, self.arm.inputs, allowed)
        prediction = replace(self._model(self.data), inputs=x).predict(self.fit.values, slopes=True)
        assert prediction.slopes is not None
        covariance = self.uncertainty.covariance
        square = np.einsum("nmap,pq,nmaq->nma", prediction.slopes, covariance, prediction.slopes)
        return prediction.places, np.sqrt(np.maximum(square, 0.0))

    def draws(self, count: int = 32, seed: int = 0) -> list[Manipulator]:
        """Arms as likely as the data leaves them, for bands of whatever is computed from an arm.

        Numbers that the data does not tell stay as they are.
        """
        rng = np.random.default_rng(as_integer("seed", seed))
        root = np.linalg.svd(self.uncertainty.covariance, hermitian=True)
        factor = root[0] * np.sqrt(root[1])
        low, high = self.fit.free.bounds
        arms = []
        for _ in range(as_integer("count", count, 2, 10_000)):
            shift = factor @ rng.standard_normal(len(self.names))
            arms.append(self.fit.free.made(np.clip(self.fit.values + shift, low, high)))
        return arms

    def band(
        self, quantity: Callable[[Manipulator], ArrayLike], count: int = 32, seed: int = 0
    ) -> tuple[Array, Array]:
        """A quantity of the calibrated arm and the standard deviation that calibration leaves.

        Both have the shape and unit of the quantity.

        Args:
            quantity: Function of an arm, such as `lambda arm: sr.reachable_set(arm).volume`.
            count: Arms that it is computed of.
            seed: Of the draws.
        """
        best = np.asarray(quantity(self.arm), float)
        others = [np.asarray(quantity(arm), float) for arm in self.draws(count, seed)]
        return best, np.sqrt(np.mean([(other - best) ** 2 for other in others], axis=0))

    def _model(self, data: Measurements) -> MarkerModel:
        return MarkerModel.of(self.fit.free, data)

    def to_dataset(self) -> xr.Dataset:
        """Numbers with their errors over `number`, residuals over `sample`, `marker`, `axis`."""
        import xarray as xr

        free = self.fit.free
        place = ("sample", "marker", "axis")
        values = {
            "value": ("number", self.fit.values),
            "sigma": ("number", self.uncertainty.sigma),
            "start": ("number", np.array([number.start for number in free.numbers])),
            "at_bound": ("number", self.fit.at_bound),
            "correlation": (("number", "other"), self.uncertainty.correlation),
            "measured": (place, self.data.places, {"units": "m"}),
            "residual": (place, self.residuals, {"units": "m"}),
            "held_out": ("sample", self.held),
            "run": ("sample", self.data.runs),
            "rank": ("sample", np.argsort(self.data.order)),
            "input_value": (("sample", "input"), self.data.inputs),
        }
        names = {
            "number": list(self.names),
            "other": list(self.names),
            "unit": ("number", [number.unit for number in free.numbers]),
            "marker": list(self.data.marker_names),
            "axis": ["x", "y", "z"],
            "input": list(self.arm.input_names),
            "input_unit": ("input", list(self.arm.input_units)),
        }
        return xr.Dataset(values, names, {**self.provenance, "length": self.arm.length})

    @property
    def provenance(self) -> dict[str, str]:
        """Version, date and data behind the result."""
        return {
            "softreach_version": str(versions()["softreach_version"]),
            "date": self.date,
            "data": self.data.source,
            "data_sha256": self.data.digest,
            "samples": f"{len(self.data)}, of which {int(self.held.sum())} held out",
            "free": ", ".join(self.names),
            "error": (self.held_out if self.held.any() else self.train).text(self.arm.length),
            "verdict": self.verdict.sentence,
        }

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write the calibrated arm as a design file whose first lines say where it comes from.

        Raises:
            InvalidInput: Something is there, and `overwrite` is not given.
            NotWritten: It cannot be written.
        """
        free, sigma = self.fit.free.numbers, self.sigma
        pairs = zip(free, self.fit.values.tolist(), strict=True)
        lines = [
            "# Calibrated from measured poses.",
            *(f"# {key}: {value}" for key, value in self.provenance.items()),
            *(f"# {n.name} = {x:.6g} ± {sigma[n.name]:.2g} {n.unit}" for n, x in pairs),
        ]
        write_text(path, "\n".join(lines) + f"\n\n{self.arm.file_text}", overwrite=overwrite)

    def table(self, unit: str = "m") -> pd.DataFrame:
        """Inputs, measured and predicted places and their distances, a row for each sample.

        Args:
            unit: Of lengths: m, cm, mm or L.
        """
        from softreach.calibration.report import table_of

        return table_of(self, as_unit(unit, self.arm.length))

    def report(self, unit: str | None = None) -> Report:
        """Numbers, errors, verdict and pictures, to be printed, or saved as an .html file.

        Args:
            unit: Of lengths: m, cm, mm or L; None for that of the design, or one that is handy.
        """
        from softreach.calibration.report import report_of

        arm = self.arm
        return report_of(self, arm.length_unit if unit is None else as_unit(unit, arm.length))

    def __repr__(self) -> str:
        return str(self.report())
