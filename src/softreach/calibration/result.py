"""Result of a calibration: numbers with their errors, beside those of other laws."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.arm.number import unit_suffix
from softreach.calibration.errors import (
    PlacementErrors,
    Repeatability,
    Verdict,
    judged,
    misses,
    repeatability,
)
from softreach.calibration.fit import Fit, Uncertainty, robust_width, started
from softreach.calibration.free_numbers import POSE, SCALE, free_numbers
from softreach.calibration.measurements import Measurements, read_measurements
from softreach.calibration.model import MarkerModel
from softreach.support.arguments import as_flag, as_integer
from softreach.support.arrays import Array, Index, Mask, as_rows, over
from softreach.support.errors import counted
from softreach.support.files.text import write_text
from softreach.support.lazy import DataFrame, Dataset
from softreach.support.quantity import quantity
from softreach.support.report import Report, Reported, Section
from softreach.support.units import LengthUnit, as_unit, readable_unit
from softreach.support.versions import versions

_OUTLIER = 5.0  # robust widths from which a sample is listed
_CORRELATED = 0.95
_ROWS = 5  # samples for each number of a linear law of the inputs
_MATTERS = 0.1  # motion of a marker by an input over that by the strongest
_WIDTHS = 3.0  # standard errors by which an input is beyond doubt
_AGAINST, _HARDLY = -0.2, 0.3  # motion by an input over that of the model
_FAR_FROM_PRIOR = 2.0  # widths
_BETTER = 0.9  # error of a rival over that of the arm
_MOST_ROWS = 10
_ERRORS = ("rms", "median", "95 % below", "rms / L")
_PICTURE = "Measured places and the lines to the predicted ones; errors by marker, in the order in "
_PICTURE += "which samples were taken, and against each input."
_DISTANCES = "Distances between measured and predicted places of the markers. Samples that are "
_DISTANCES += "held out were not seen by any fit."
_WORDS = {"softreach_version": "softreach", "data_sha256": "SHA-256 of the data"}


class Rival(NamedTuple):
    """Another law, fitted to the same samples."""

    name: str
    """Name of the law."""
    numbers: int
    """Number of fitted parameters."""
    train: PlacementErrors
    """Errors at the samples that it was fitted to."""
    held_out: PlacementErrors
    """Errors at the samples that were held out."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Reported):
    """A calibrated arm, the numbers that were fitted, and all that the data says of them."""

    arm: Manipulator
    """The calibrated arm."""
    start: Manipulator
    """The design before."""
    data: Measurements
    """The measurements, those held out among them."""
    held: Mask
    """Samples that the fit did not see, shape (n,)."""
    fit: Fit
    """End of the fit: the fitted numbers and what is left of the residuals."""
    uncertainty: Uncertainty
    """Covariance of the fitted numbers."""
    date: str
    """Day of the fit, such as "2026-11-27"."""
    rivals: tuple[Rival, ...] = ()
    """Other laws on the same samples."""
    exchange: tuple[str, float] | None = None
    """Columns by whose exchange the same numbers would fit far better, and the error then [m]."""
    seconds: float = 0.0
    """Time that the fit took [s]."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted numbers."""
        return self.fit.free.names

    @property
    def values(self) -> dict[str, float]:
        """Fitted numbers by name [unit of each]."""
        return dict(zip(self.names, self.fit.values.tolist(), strict=True))

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the fitted numbers by name [unit of each]."""
        return dict(zip(self.names, self.uncertainty.sigma.tolist(), strict=True))

    @property
    def _judged(self) -> Mask:
        """Samples by which the fit is judged: those held out, or all if none is."""
        return self.held if self.held.any() else ~self.held

    @cached_property
    def residuals(self) -> Array:
        """Predicted minus measured places of all samples [m], (n, marker, 3)."""
        return self.residuals_on(self.data)

    @property
    def train(self) -> PlacementErrors:
        """Errors of the samples of the fit."""
        return misses(self.residuals[~self.held])

    @property
    def held_out(self) -> PlacementErrors:
        """Errors of the samples that it did not see."""
        return misses(self.residuals[self.held])

    @property
    def by_marker(self) -> dict[str, PlacementErrors]:
        """Errors of each marker: of held-out samples, or of all if none is held out."""
        each = enumerate(self.data.marker_names)
        return {name: misses(self.residuals[self._judged, k]) for k, name in each}

    @cached_property
    def before(self) -> PlacementErrors:
        """Errors of the design before, moved onto the fitted samples as it is.

        Of samples held out, or of all if none is.
        """
        train = self.data.of(~self.held)
        moved = free_numbers(self.start, ["pose", *({SCALE} & set(self.names))])
        free = started(MarkerModel.of(moved, train), train.places)
        data = self.data.of(self._judged)
        return misses(MarkerModel.of(free, data).predict(free.start).places - data.places)

    @cached_property
    def repeatability(self) -> Repeatability:
        """Scatter of the data where inputs are repeated."""
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

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the model or its numbers, in a sentence each, with what to try."""
        doubts, own = [*_doubtful_inputs(self)], self.held_out
        for number, value in zip(self.fit.free.numbers, self.fit.values.tolist(), strict=True):
            mean, width = number.prior or (value, 1.0)
            if (off := abs(value - mean) / width) > _FAR_FROM_PRIOR:
                more = "free another number that may explain the data, or widen the prior"
                doubts.append(f"{number.name} is {off:.1f} widths from its prior: {more}")
        known = [rival for rival in self.rivals if rival.held_out.number]
        best = min(known, key=lambda rival: rival.held_out.rms, default=None)
        if best is not None and best.held_out.rms < _BETTER * own.rms:
            errors = f"{1e3 * best.held_out.rms:.3g} mm, not {1e3 * own.rms:.3g}"
            more = "check order, sign and unit of inputs, or free more numbers"
            doubts.append(f"{best.name} predicts better than the arm ({errors}): {more}")
        return tuple(doubts)

    @property
    def held_runs(self) -> bool:
        """True if whole runs were held out."""
        runs = self.data.runs
        return bool(self.held.any()) and not set(runs[self.held]) & set(runs[~self.held])

    @property
    def outliers(self) -> Index:
        """Rows of the data whose markers are more than five robust widths off."""
        distance = np.linalg.norm(self.residuals, axis=2)
        widths = [robust_width(self.residuals[:, k]) for k in range(self.data.markers)]
        far = np.nanmax(distance / widths, axis=1, initial=0.0) > _OUTLIER * 1.7
        return self.data.rows[far]

    @property
    def ratios(self) -> dict[str, float]:
        """Fitted numbers over those of the design [-], of numbers that stay above 0."""
        numbers = zip(self.fit.free.numbers, self.fit.values.tolist(), strict=True)
        return {n.name: v / n.start for n, v in numbers if n.range.low >= 0 and n.start > 0}

    @property
    def correlated(self) -> list[tuple[str, str, float]]:
        """Pairs of numbers that the data hardly tells apart, with their correlation [-]."""
        matrix, names = self.uncertainty.correlation, self.names
        pairs = np.argwhere(np.triu(np.abs(matrix) > _CORRELATED, 1)).tolist()
        return [(names[a], names[b], float(matrix[a, b])) for a, b in pairs]

    def errors_on(self, data: Any, **columns: Any) -> PlacementErrors:
        """Errors of the calibrated arm on other measurements."""
        return misses(self.residuals_on(data, **columns))

    def residuals_on(self, data: Any, **columns: Any) -> Array:
        """Predicted minus measured places of other measurements [m], (n, marker, 3)."""
        table = read_measurements(self.start, data, **columns)
        scale = self.fit.free.scaled(self.fit.values)
        return MarkerModel.of(self.fit.free, table).of_arm(self.arm, scale).places - table.places

    def predict(self, inputs: ArrayLike, *, numbers_only: bool = False) -> tuple[Array, Array]:
        """Places of the markers and the standard deviations to expect of measured ones.

        They hold what calibration leaves open of the numbers, and the residuals: those held out if
        there are some, else those of the fit.

        Args:
            inputs: Of the arm, in their units, shape (n, input).
            numbers_only: Leave the residuals out: how sure the places of the model are, were it
                right.

        Returns:
            Places in the world [m] and their standard deviations [m], (n, marker, 3) each.

        Raises:
            InvalidInput: No finite inputs of that shape.
        """
        x = as_rows("inputs", inputs, self.arm.inputs, f"shape (n, {self.arm.inputs})")
        model = MarkerModel(self.fit.free, x, self.data.marker_names)
        places, slopes, _ = model.predict(self.fit.values, slopes=True)
        square = np.einsum("nmap,pq,nmaq->nma", slopes, self.uncertainty.covariance, slopes)
        square = np.maximum(square, 0.0)
        if not as_flag("numbers_only", numbers_only):
            square = square + self.spread**2
        return places, np.sqrt(square)

    @cached_property
    def spread(self) -> Array:
        """Standard deviations of the residuals by marker and axis of the world [m], (marker, 3)."""
        left = self.residuals[self._judged]
        seen = np.isfinite(left).sum()
        freedom = 1.0 if self.held.any() else seen / max(seen - len(self.names), 1)
        return np.sqrt(freedom * np.nanmean(left**2, axis=0))

    def draws(self, count: int = 32, seed: int = 0) -> list[Manipulator]:
        """Arms as likely as the data leaves them, for bands of any quantity of an arm.

        Numbers that the data does not determine stay as they are.
        """
        rng = np.random.default_rng(as_integer("seed", seed))
        root = np.linalg.svd(self.uncertainty.covariance, hermitian=True)
        factor = root[0] * np.sqrt(root[1])
        shifts = rng.standard_normal((as_integer("count", count, 2, 10_000), len(self.names)))
        values = (self.fit.values + factor @ shift for shift in shifts)
        return [self.fit.free.made(np.clip(each, *self.fit.free.bounds)) for each in values]

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

    @property
    def _held_text(self) -> str:
        return f"{int(self.held.sum())} {'in held-out runs' if self.held_runs else 'held out'}"

    def to_dataset(self) -> Dataset:
        """Numbers with their errors over `number`, residuals over `sample`, `marker`, `axis`."""
        import xarray as xr

        free, data, place = self.fit.free, self.data, ("sample", "marker", "axis")
        sigma = self.uncertainty.sigma
        values = over("number", value=self.fit.values, sigma=sigma, start=free.start)
        values |= over("number", at_bound=self.fit.at_bound)
        values |= over(("number", "other"), correlation=self.uncertainty.correlation)
        values |= over(place, "m", measured=data.places, residual=self.residuals)
        values |= over("sample", held_out=self.held, run=data.runs, rank=np.argsort(data.order))
        values |= over(("sample", "input"), input_value=data.inputs)
        names = {
            "number": list(self.names),
            "other": list(self.names),
            "axis": ["x", "y", "z"],
            "marker": list(data.marker_names),
            "input": list(self.arm.input_names),
        }
        names |= over("input", input_unit=list(self.arm.input_units))
        names |= over("number", unit=[number.unit for number in free.numbers])
        return xr.Dataset(values, names, {**self.provenance, "length": self.arm.length})

    @property
    def provenance(self) -> dict[str, str]:
        """Version, date and data behind the result."""
        about = {
            "softreach_version": str(versions()["softreach_version"]),
            "date": self.date,
            "data": self.data.source,
            "data_sha256": self.data.digest,
            "samples": f"{len(self.data)}, of which {self._held_text}",
        }
        error = misses(self.residuals[self._judged]).text(self.start.length)
        about |= {"free": ", ".join(self.names), "error": error}
        return about | {"verdict": self.verdict.sentence}

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write the calibrated arm as a design file whose first lines say where it comes from.

        Raises:
            InvalidInput: Something is there, and `overwrite` is not given.
            NotWritten: It cannot be written.
        """
        lines = [f"{key}: {value}" for key, value in self.provenance.items()]
        for number, value in zip(self.fit.free.numbers, self.fit.values.tolist(), strict=True):
            sigma = f"{self.sigma[number.name]:.2g}"
            lines.append(f"{number.name} = {value:.6g} ± {sigma} {number.unit}")
        head = "\n# ".join(["# Calibrated from measured poses.", *lines])
        write_text(path, f"{head}\n\n{self.arm.file_text}", overwrite=overwrite)

    @property
    def errors(self) -> list[tuple[str, str, PlacementErrors]]:
        """Law, samples and its errors there: the calibrated arm, the design, rivals."""
        held = int(self.held.sum())
        fitted = f"{len(self.data) - held} fitted"
        on = self._held_text if held else fitted
        rows = [("calibrated", fitted, self.train)]
        rows += [("calibrated", on, self.held_out)] if held else []
        rows.append(("design, base fitted", on, self.before))
        for name, numbers, *errors in self.rivals:
            rows.append((f"{name}, {counted(numbers, 'number')}", on, errors[held > 0]))
        return rows

    def table(self, unit: str = "m") -> DataFrame:
        """Inputs, measured and predicted places and their distances, a row for each sample.

        Args:
            unit: Of lengths: m, cm, mm or L.
        """
        import pandas as pd

        data, arm, shown = self.data, self.arm, as_unit(unit, self.arm.length)
        runs = np.array(data.run_names)[data.runs]
        table: Any = {"row": data.rows, "run": runs, "held_out": self.held.astype(int)}
        for k, (name, own) in enumerate(zip(arm.input_names, arm.input_units, strict=True)):
            table[f"{name}{unit_suffix(own)}"] = data.inputs[:, k]
        distance = np.linalg.norm(self.residuals, axis=2)
        for m, marker in enumerate(data.marker_names):
            for words, places in (("", data.places), ("predicted_", data.places + self.residuals)):
                for k, axis in enumerate("xyz"):
                    table[f"{marker}_{words}{axis}_{shown.name}"] = shown.of(places[:, m, k])
            table[f"{marker}_error_{shown.name}"] = shown.of(distance[:, m])
        return pd.DataFrame(table)

    def report(self, unit: str | None = None) -> Report:
        """Numbers, errors, verdict and pictures, to be printed, or saved as an .html file.

        Args:
            unit: Of lengths: m, cm, mm or L; None for that of the design, or one that is handy.
        """
        from softreach.plot.results import plot_calibration

        arm, data = self.arm, self.data
        shown = arm.length_unit if unit is None else as_unit(unit, arm.length)
        fitted = counted(len(data) - int(self.held.sum()), "sample")
        numbers, seen = counted(len(self.names), "number"), ", ".join(data.marker_names)
        origin = [(_WORDS.get(key, key), text) for key, text in self.provenance.items()]
        for name, column in zip(arm.input_names, data.input_names, strict=True):
            origin.append((f"input {name}", f"column {column}" if column else "stays at 0"))
        rows, head = list(_number_rows(self, shown)), ("number", "calibrated", "design")
        fits = Section(title="Numbers", head=head, rows=rows, note="Each ± its standard deviation.")
        head = (shown.label("error of places"), "samples", *_ERRORS)
        rows, points = list(_error_rows(self, shown)), [*_remarks(self, shown), *self.doubts]
        draw = partial(plot_calibration, self, unit=shown)
        return Report(
            title=f"Calibration from {data.source}",
            verdict=self.verdict.sentence,
            state=self.verdict.limit,
            facts=[f"{numbers} from {fitted} of {seen}, {self.seconds:.1f} s"],
            sections=[
                fits,
                Section(title="Errors", head=head, rows=rows, note=_DISTANCES, points=points),
                Section(title="Pictures", figures=lambda: [(draw(), _PICTURE)]),
                Section(title="Provenance", rows=origin, printed=0),
                Section(title="The calibrated design", text=arm.to_toml()),
            ],
        )


def _number_rows(result: Calibration, unit: LengthUnit) -> Iterator[tuple[str, str, str]]:
    fit, widths = result.fit, result.uncertainty.sigma.tolist()
    pairs = zip(fit.free.numbers, fit.values.tolist(), widths, fit.at_bound, strict=True)
    # Pose and scale start from the data and not from the design.
    designed = zip((*POSE, SCALE), (*result.start.base.position, 0.0, 0.0, 0.0, 1.0), strict=True)
    pose = dict[str, float](designed)
    for number, value, sigma, at_bound in pairs:
        name, size = readable_unit(number.unit, value, unit)
        text = quantity(value / size, name, sigma / size, digits=2)
        text += ", at its bound" if at_bound else ", with its prior" if number.prior else ""
        text += ", which the data does not determine" if sigma == math.inf else ""
        yield number.name, text, f"{pose.get(number.name, number.start) / size:.4g}"


def _error_rows(result: Calibration, unit: LengthUnit) -> Iterator[tuple[str, ...]]:
    for law, samples, errors in result.errors:
        texts = [f"{value / unit.size:.3g}" for value in (errors.rms, errors.median, errors.most)]
        texts.append(f"{100 * errors.rms / result.start.length:.2g} %")
        yield law, samples, *(texts if errors.number else "----")


def _remarks(result: Calibration, unit: LengthUnit) -> Iterator[str]:
    if len(result.data.marker_names) > 1:
        each = ((name, errors.rms / unit.size) for name, errors in result.by_marker.items())
        listed = ", ".join(f"{name} {rms:.3g}" for name, rms in each)
        yield f"{unit.label('rms')} of each marker: {listed}"
    if result.held.any() and not result.held_runs and len(result.data.run_names) > 1:
        more = "errors at held-out rows say little about other motions; hold out whole runs"
        yield f"rows of one motion are neighbors: {more}"
    for first, second, share in result.correlated[:3]:
        yield f"hard to tell apart: {first} and {second} (correlation {share:+.3f})"
    if len(far := result.outliers):
        rows = ", ".join(map(str, far[:_MOST_ROWS])) + ", ..." * (len(far) > _MOST_ROWS)
        yield f"{counted(len(far), 'sample')} far off, in rows (counted from 0): {rows}"


def _doubtful_inputs(result: Calibration) -> Iterator[str]:
    """Inputs that move markers against the model, or hardly, by linear laws of both."""
    data = result.data
    moving = np.flatnonzero(np.ptp(data.inputs, axis=0) > 0)
    known = np.isfinite(result.residuals).all(axis=(1, 2))
    x = data.inputs[known][:, moving]
    if len(x) < _ROWS * (1 + len(moving)):
        return
    x = np.column_stack([np.ones(len(x)), (x - x.mean(axis=0)) / x.std(axis=0)])
    inverse = np.linalg.pinv(x.T @ x)
    left = result.residuals[known].reshape(len(x), -1)
    measured = data.places[known].reshape(len(x), -1)
    missed, moves = inverse @ x.T @ left, inverse @ x.T @ (measured + left)
    noise = ((left - x @ missed) ** 2).reshape(len(x), data.markers, 3).sum(axis=(0, 2)) / len(x)
    missed, moves = (each[1:].reshape(len(moving), data.markers, 3) for each in (missed, moves))
    square = (moves**2).sum(axis=2)
    matters = square > _MATTERS**2 * square.max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 - (missed * moves).sum(axis=2) / square
        sure = _WIDTHS * np.sqrt(noise * np.diag(inverse)[1:, None] / square)
    against = share + sure < _AGAINST, "the wrong way: check its sign and the input order"
    hardly = np.abs(share) + sure < _HARDLY, "hardly: check its column and its unit"
    for k, name in enumerate(result.arm.input_names[j] for j in moving):
        for wrong, words in (against, hardly):
            if (hits := np.flatnonzero(wrong[k] & matters[k])).size:
                seen = ", ".join(data.marker_names[m] for m in hits)
                times = share[k, hits[0]]
                yield f"{name} moves {seen} {words} ({times:.2f} times as far as the model)"
