"""Calibration: from measured poses to the arm on the bench, and laws without a rod beside it."""

import datetime as dt
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple, Self

import numpy as np

from softreach.arm.driving import Driving, body_of
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.tables import tables
from softreach.calibration.errors import PlacementErrors, misses, with_products
from softreach.calibration.fit import FEWEST_RUNS, exchanged_columns, fitted, uncertainty
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import Measurements, read_measurements
from softreach.calibration.model import MarkerModel, marker_stations
from softreach.calibration.result import Calibration, Rival
from softreach.rod.summary import design_warnings
from softreach.support.arguments import as_flag, as_integer, as_number
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, NotPossible, Range, warn
from softreach.support.progress import Progress, as_progress, silent

_LEAVES = 3.0  # factor by which a number has left its design
_SHARES = (1.0, 0.2)  # of the bends of the design, at which the fit of arcs begins
_PENALTIES = np.logspace(-8, 2, 21)
_POOR = 0.1  # error over the motion of the markers from which columns may be exchanged


def calibrate(
    arm: Manipulator,
    data: Any,
    *,
    free: Sequence[str],
    prior: Mapping[str, Any] | None = None,
    hold_out: float = 0.0,
    hold_out_runs: bool | None = None,
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
        hold_out_runs: Hold out whole runs, which shows what to expect of other motions, or single
            samples; by default runs where the data has eight or more.
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

    Examples:
        >>> from softreach.arm.parameters import changed
        >>> arm, pulls = sr.designs.three_tendon_robot(), np.eye(3) * 5.0
        >>> x, y, z = sr.tip_positions(arm, pulls).T
        >>> data = {f"tendon {k + 1}_N": pulls[:, k] for k in range(3)}
        >>> data |= {"tip_x_m": x, "tip_y_m": y, "tip_z_m": z}
        >>> modulus = "rings[0].material.young_modulus"
        >>> stiff = changed(arm, {modulus: 60e9})
        >>> found = sr.calibrate(stiff, data, free=[modulus], rivals=False)
        >>> print(f"{found.values[modulus] / 1e9:.1f} GPa")
        54.0 GPa
    """
    begin = perf_counter()
    arm = a_manipulator("arm", arm)
    hold_out = as_number("hold_out", hold_out, Range(0.0, 0.9))
    robust, rivals = as_flag("robust", robust), as_flag("rivals", rivals)
    by_run = None if hold_out_runs is None else as_flag("hold_out_runs", hold_out_runs)
    noise = None if noise is None else as_number("noise", noise, Range(0.0, 1.0, "m", True))
    table = read_measurements(arm, data, inputs=inputs, markers=markers, run=run, order=order)
    rows = np.concatenate([table.inputs, table.places.reshape(len(table), -1)], axis=1)
    if copies := len(rows) - len(np.unique(rows, axis=0, equal_nan=True)):
        warn(f"{copies} samples repeat others exactly: remove them, or errors come out too small")
    held = _held_out(table, hold_out, by_run, as_integer("seed", seed))
    train, progress = table.of(~held), as_progress(progress)
    model = MarkerModel.of(free_numbers(arm, free, prior), train)
    fit_to = partial(fitted, robust=robust, noise=noise, progress=progress)
    fit = fit_to(model, train.places)
    sure, date = uncertainty(fit, train, noise), dt.datetime.now(dt.UTC).date().isoformat()
    result = Calibration(fit.free.made(fit.values), arm, table, held, fit, sure, date)
    _warn_of_numbers(result)
    spread = misses(train.places - np.nanmean(train.places, axis=0)).rms
    if any(map(_left, result.ratios.values())) or result.train.rms > _POOR * spread:
        result = replace(result, exchange=exchanged_columns(fit, model, train.places, fit_to))
    result = replace(result, seconds=perf_counter() - begin)
    if not rivals:
        return result
    laws = {"constant curvature": constant_curvature(arm, train, table, progress)}
    laws["quadratic ridge"] = quadratic(train, table)
    off = [(name, count, places - table.places) for name, (places, count) in laws.items()]
    others = (Rival(name, n, misses(x[~held]), misses(x[held])) for name, n, x in off)
    return replace(result, rivals=tuple(others))


def _held_out(table: Measurements, share: float, by_run: bool | None, seed: int) -> Mask:
    """Samples that the fit does not see: all of some runs, or some of all samples, by chance."""
    runs = len(table.run_names)
    by_run = runs >= FEWEST_RUNS if by_run is None else by_run
    if share and by_run and runs < 2:
        raise NotPossible("holding out runs needs two runs or more: name their column by `run`")
    every = np.arange(len(table))
    parts, count, what = (table.runs, runs, "runs") if by_run else (every, len(every), "samples")
    out = max(round(share * count), 1 if by_run and share else 0)
    if out == count:
        raise InvalidInput("hold_out", share, f"small enough to leave some of {count} {what}")
    chosen = np.random.default_rng(seed).permutation(count)[:out]
    return np.isin(parts, chosen)


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
    columns = ("inputs", "markers", "run", "order")
    table = read_measurements(arm, data, **{k: options.pop(k, None) for k in columns})
    if len(table.run_names) < 2:
        raise NotPossible("leaving out a run needs two runs or more: name their column by `run`")
    errors = {}
    for number, name in enumerate(table.run_names):
        out = table.runs == number
        if out.any() and not out.all():
            others = calibrate(arm, table.of(~out), free=free, **{"rivals": False, **options})
            errors[name] = others.errors_on(table.of(out))
    return errors


def _left(ratio: float) -> bool:
    return not 1.0 / _LEAVES < ratio < _LEAVES


def _warn_of_numbers(result: Calibration) -> None:
    fit, names = result.fit, np.array(result.names)
    if not fit.converged:
        warn(f"the fit did not converge in {fit.evaluations} evaluations: look at its residuals")
    if fit.at_bound.any():
        warn(f"numbers that end at a bound of their range: {', '.join(names[fit.at_bound])}")
    own = [n.name for n in fit.free.numbers if n.prior is not None]
    for name, ratio in result.ratios.items():
        if _left(ratio) and name not in own:
            more = "check the order of the inputs, then hold this number or give it a prior"
            warn(f"{name} became {ratio:.3g} times what the design says: {more}")
    if len(vague := names[~(result.uncertainty.told | fit.at_bound)]):
        more = "standard deviation infinite; hold it, give it a prior, or measure more"
        warn(f"the data does not determine {', '.join(vague)}: {more}")
    before = {re.sub(r"[\d.]+", "", text) for text in design_warnings(result.start)}
    for text in design_warnings(result.arm):
        if re.sub(r"[\d.]+", "", text) not in before:
            warn(f"the calibrated arm: {text}")


def _ridge(features: Array, target: Array, wanted: Array) -> Array:
    """Targets at wanted features, by the ridge of least generalized cross-validation."""
    middle, size = features.mean(axis=0), features.std(axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled, mean = (features - middle) / size, target.mean(axis=0)
    left, values, axes = np.linalg.svd(scaled, full_matrices=False)
    along, n = left.T @ (target - mean), len(features)
    total = ((target - mean) ** 2).sum() - (along**2).sum()

    def cross_validation(penalty: float) -> float:
        keep = values**2 / (values**2 + n * penalty)
        left = total + (((1.0 - keep)[:, None] * along) ** 2).sum()
        return left / max(n - 1.0 - keep.sum(), 1e-3) ** 2

    best = min(_PENALTIES, key=cross_validation)
    weights = axes.T @ ((values / (values**2 + n * best))[:, None] * along)
    return mean + ((wanted - middle) / size) @ weights


def quadratic(train: Measurements, test: Measurements) -> tuple[Array, int]:
    """Places (n, marker, 3) by a ridge on inputs and their products; count of its numbers."""
    middle, span = train.inputs.mean(axis=0), np.ptp(train.inputs, axis=0)
    size = np.where(span > 0, span, 1.0)
    seen, wanted = (with_products((each.inputs - middle) / size) for each in (train, test))
    places = np.full((len(test), test.markers, 3), np.nan)
    for marker in range(test.markers):
        known = np.isfinite(train.places[:, marker]).all(axis=1)
        if known.sum() > 1:
            places[:, marker] = _ridge(seen[known], train.places[known, marker], wanted)
    return places, 3 * train.markers * (1 + seen.shape[1])


def constant_curvature(
    arm: Manipulator, train: Measurements, test: Measurements, progress: Progress = silent
) -> tuple[Array, int]:
    """Places (n, marker, 3) by arcs of circles between ends of actuators; count of numbers.

    The bend of an arc is linear in the inputs that act on it; the base stands anywhere.
    """
    from scipy.optimize import least_squares

    arcs, seen = _Arcs.of(arm, train), np.isfinite(train.places)

    def residuals(values: Array) -> Array:
        progress(0)  # which may end the fit
        return (arcs.places(values, train.inputs) - train.places)[seen]

    starts = (arcs.start(arm, share) for share in _SHARES)
    ends = (least_squares(residuals, start, x_scale="jac", max_nfev=60) for start in starts)
    best = min(ends, key=lambda end: end.cost).x
    return arcs.places(best, test.inputs), len(best)


class _Arcs(NamedTuple):
    ends: Array
    acts: Mask
    scale: Array
    markers: Array
    offsets: Array

    @classmethod
    def of(cls, arm: Manipulator, data: Measurements) -> Self:
        ends = [part.span(arm.length)[1] for part in arm.actuators]
        ends = np.unique(np.round([*ends, arm.length], 9))
        middles = 0.5 * (np.append(0.0, ends[:-1]) + ends)
        each = (part.acts(arm.profile, middles) for part in arm.actuators)
        acts = np.concatenate([np.empty((len(ends), 0)), *each], axis=1)
        moves = np.ptp(data.inputs, axis=0) > 0
        acts = (acts @ np.abs(Driving(arm).gains)[: arm.bundles] > 0) & moves
        scale = np.where(moves, np.abs(data.inputs).max(axis=0), 1.0)
        return cls(ends, acts, scale, *marker_stations(arm, data.marker_names))

    def start(self, arm: Manipulator, share: float) -> Array:
        """A share of the bends that the design has in the middle of each arc, without loads."""
        from scipy.spatial.transform import Rotation

        middles = 0.5 * (np.append(0.0, self.ends[:-1]) + self.ends)
        slopes = tables(body_of(arm), middles).curvature[:, :2] @ Driving(arm).gains
        slopes = np.moveaxis(slopes, 1, 2) * self.scale[:, None]
        most = np.abs(slopes).max(initial=0.0)
        if any(unit == "m" for unit in arm.bundle_units) or not np.isfinite(most):
            slopes *= 1.0 / (arm.length * max(most, 1e-12))
        vector = Rotation.from_matrix(arm.base.rotation).as_rotvec()
        rest = np.zeros(2 * len(self.ends))
        return np.concatenate([arm.base.position, vector, rest, share * slopes[self.acts].ravel()])

    def places(self, values: Array, inputs: Array) -> Array:
        """Of the markers, (n, marker, 3)."""
        from scipy.spatial.transform import Rotation

        count = len(self.ends)
        rest = values[6 : 6 + 2 * count].reshape(count, 2)
        slopes = np.zeros((count, inputs.shape[1], 2))
        slopes[self.acts] = values[6 + 2 * count :].reshape(-1, 2)
        x, frame = inputs / self.scale, Rotation.from_rotvec(values[3:6]).as_matrix()
        place, frame = np.tile(values[:3], (len(x), 1)), np.tile(frame, (len(x), 1, 1))
        result, begin = np.empty((len(x), len(self.markers), 3)), 0.0
        own = np.searchsorted(self.ends[:-1], self.markers, "right")  # arc of each marker
        for k, end in enumerate(self.ends):
            bend = rest[k] + x @ slopes[k]
            for m in np.flatnonzero(own == k):
                along, turn = _arc(bend, self.markers[m] - begin)
                along = along + turn @ self.offsets[m]
                result[:, m] = place + np.einsum("nab,nb->na", frame, along)
            along, turn = _arc(bend, end - begin)
            place = place + np.einsum("nab,nb->na", frame, along)
            frame, begin = frame @ turn, end
        return result


def _arc(bend: Array, length: float) -> tuple[Array, Array]:
    """End of arcs that bend by (u1, u2), and their rotations."""
    from scipy.spatial.transform import Rotation

    size = np.linalg.norm(bend, axis=1)
    angle = size * length
    across = np.stack([bend[:, 1], -bend[:, 0]], axis=1)  # toward which u bends e3
    lean = 0.5 * length**2 * np.sinc(angle / (2 * np.pi)) ** 2
    rise = length * np.sinc(angle / np.pi)
    place = np.concatenate([across * lean[:, None], rise[:, None]], axis=1)
    vector = np.concatenate([bend * length, np.zeros((len(bend), 1))], axis=1)
    return place, Rotation.from_rotvec(vector).as_matrix()
