"""Least squares of measured places: robust, bounded, with priors; what the data cannot tell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.errors import misses
from softreach.calibration.free_numbers import POSE, FreeNumbers
from softreach.calibration.model import MarkerModel, Prediction, exchanged_inputs
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.progress import Progress

__all__ = [
    "SAME",
    "Fit",
    "exchanged_columns",
    "fitted",
    "identifiable",
    "robust_width",
    "started",
]

Array = NDArray[np.float64]

SAME = 1e-7
"""Smallest singular value over the largest, in scales of the numbers, that data can tell."""
_IDLE = 1e-9
"""Motion of markers in L, or over that of the other numbers, that is rounding."""
_ROBUST = 3.0
"""Residuals beyond so many widths count less than their squares."""
_FINE, _COARSE = 1e-7, 1e-3
"""Least share by which a step must improve: of the last round, of those before."""
_MOST = 60
_PERMUTED = 5
"""Markers of which all orders are tried."""
_SAMPLES = 100
"""Samples by which exchanges are compared."""
_PROMISING, _BETTER = 0.8, 0.5
"""Error over that of the columns as they are: before a fit, and after it."""
_ALIKE = 1.2
"""Factor between errors that nothing tells apart."""
_FAR = 1.0  # m, what a sample without equilibrium misses


@dataclass(frozen=True, eq=False)
class Fit:
    """Values of the free numbers at which residuals are least."""

    free: FreeNumbers
    values: Array
    prediction: Prediction
    residuals: Array
    """Predicted minus measured places [m], NaN where none was seen, (n, marker, 3)."""
    weights: Array
    """Of each marker of each sample in the fit: 1, less for outliers; (n, marker)."""
    at_bound: NDArray[np.bool_]
    """Numbers that end at a bound, shape (number,)."""
    evaluations: int
    converged: bool


def started(model: MarkerModel, places: Array) -> FreeNumbers:
    """Numbers to start from: the pose by which predicted places match measured ones [Kabsch1976].

    Raises:
        InvalidInput: Axes that only a mirror brings together.
    """
    free = model.free
    turning = [name for name in POSE[3:] if name in free.names]
    moving = [name for name in POSE[:3] if name in free.names]
    if not moving:
        return free
    each = model.predict(free.start).places
    predicted, measured = each.reshape(-1, 3), places.reshape(-1, 3)
    known = np.isfinite(predicted).all(axis=1) & np.isfinite(measured).all(axis=1)
    if not known.any():
        return free
    predicted, measured = predicted[known], measured[known]
    start = np.array(free.arm.base.position)
    if len(turning) < 3 or len(moving) < 3:
        shift = np.median(measured - predicted, axis=0)
        moved = zip(POSE[:3], start + shift, strict=True)
        return free.started_at({name: place for name, place in moved if name in moving})
    rotation, shift = _kabsch(predicted, measured)
    _refuse_mirror(model, places, predicted, measured)
    _refuse_exchanged(each, places, model.names)
    from scipy.spatial.transform import Rotation

    place, vector = rotation @ start + shift, Rotation.from_matrix(rotation).as_rotvec()
    return free.started_at(dict(zip(POSE, [*place, *vector], strict=True)))


def _kabsch(predicted: Array, measured: Array, mirror: bool = False) -> tuple[Array, Array]:
    """Rotation and shift that carry predicted places to measured ones, least squares."""
    here, there = predicted.mean(axis=0), measured.mean(axis=0)
    left, _, right = np.linalg.svd((measured - there).T @ (predicted - here))
    sign = np.sign(np.linalg.det(left @ right)) * (-1.0 if mirror else 1.0)
    rotation = left @ np.diag([1.0, 1.0, sign]) @ right
    return rotation, there - rotation @ here


def _miss(predicted: Array, measured: Array, mirror: bool = False) -> float:
    """Distance in the middle of places that are brought together."""
    rotation, shift = _kabsch(predicted, measured, mirror)
    return float(np.median(np.linalg.norm(predicted @ rotation.T + shift - measured, axis=1)))


def _moved_miss(free: FreeNumbers, predicted: Array, measured: Array) -> float:
    """Distance in the middle of places, moved together as far as the pose is free [m]."""
    predicted, measured = predicted.reshape(-1, 3), measured.reshape(-1, 3)
    known = np.isfinite(predicted + measured).all(axis=1)
    if known.sum() < 3:
        return np.inf
    if set(POSE) <= set(free.names):
        return _miss(predicted[known], measured[known])
    off = predicted[known] - measured[known]
    off -= [float(np.median(off[:, k])) if POSE[k] in free.names else 0.0 for k in range(3)]
    return float(np.median(np.linalg.norm(off, axis=1)))


def _refuse_exchanged(predicted: Array, measured: Array, names: tuple[str, ...]) -> None:
    """Refuse markers that match far better under each other's names, shapes (n, marker, 3)."""
    missed: dict[tuple[int, ...], float] = {}
    for order in permutations(range(min(len(names), _PERMUTED))):
        others = predicted[:, list(order)], measured[:, : len(order)]
        known = np.isfinite(others[0] + others[1]).all(axis=2)
        if known.sum() > 2:
            missed[order] = _miss(others[0][known], others[1][known])
    own = tuple(range(min(len(names), _PERMUTED)))
    best = min(missed, key=missed.__getitem__, default=own)
    if best != own and own in missed and missed[best] < 0.35 * missed[own]:
        size = float(np.nanmedian(np.linalg.norm(np.diff(predicted, axis=1), axis=2)))
        if missed[own] > 0.1 * size:
            given = ", ".join(names[: len(own)])
            seem = ", ".join(names[k] for k in best)
            allowed = f"in their order along the arm; they seem to be {seem}"
            raise InvalidInput("markers of the data", given, allowed)


def _refuse_mirror(model: MarkerModel, places: Array, predicted: Array, measured: Array) -> None:
    missed = [_miss(predicted, measured, mirror) for mirror in (False, True)]
    size = np.median(np.linalg.norm(measured - measured.mean(axis=0), axis=1))
    if missed[1] < 0.35 * missed[0] and missed[0] > 0.1 * size:
        free, alike = model.free, []
        for text, order in exchanged_inputs(free.arm):
            other = replace(model, inputs=model.inputs[:, order]).predict(free.start).places
            if _moved_miss(free, other, places) < 0.35 * missed[0]:
                alike.append(text)
        cause = f"; or exchange {' or '.join(alike[:4])}, which looks the same" if alike else ""
        raise InvalidInput(
            "axes of the data",
            f"a miss of {1e3 * missed[0]:.3g} mm in the middle, {1e3 * missed[1]:.3g} mm mirrored",
            "right-handed, as those of the design: exchange two of x, y and z, or turn one over"
            + cause,
        )


def identifiable(free: FreeNumbers, slopes: Array) -> None:
    """Refuse numbers that the data cannot tell: those that do nothing, and those that trade.

    Args:
        free: The numbers.
        slopes: Derivatives of all residuals, those of priors among them, shape (residual, number).

    Raises:
        InvalidInput: The names of the numbers, and which to leave out.
    """
    scaled = slopes * free.scale
    sizes = np.linalg.norm(scaled, axis=0)
    still = _IDLE * max(sizes.max(), free.arm.length * np.sqrt(len(slopes)))
    idle = [name for name, size in zip(free.names, sizes, strict=True) if size <= still]
    if idle:
        allowed = "numbers that move some marker of some sample: leave out what does nothing here"
        raise InvalidInput("free", ", ".join(idle), allowed)
    _, values, axes = np.linalg.svd(scaled, full_matrices=False)
    if len(scaled) < len(free):
        allowed = f"at most {len(scaled)} numbers, as many as the data has"
        raise InvalidInput("free", f"{len(free)} numbers", allowed)
    if values[-1] > SAME * values[0]:
        return
    moves = np.abs(axes[-1]) * sizes
    trading = [free.names[k] for k in np.flatnonzero(moves > 0.05 * moves.max())]
    allowed = (
        "numbers that the data can tell apart: these change together without moving any marker, "
        f"as only their ratio or their sum shows; leave out one, such as {trading[-1]}, or give "
        "it a prior"
    )
    raise InvalidInput("free", ", ".join(trading), allowed)


def fitted(
    model: MarkerModel, places: Array, *, robust: bool, noise: float | None, progress: Progress
) -> Fit:
    """The numbers at which predicted places are nearest to measured ones.

    Args:
        model: Markers as functions of the free numbers.
        places: Measured places [m], NaN where none was seen, shape (n, marker, 3).
        robust: Let samples far off count less.
        noise: Standard deviation of a coordinate [m], against which priors are weighed; None to
            take that of the residuals.
        progress: Called with 1 for each step.

    Raises:
        InvalidInput: Numbers that the data cannot tell, or no equilibrium at the start.
    """
    problem = _Problem(model, places, progress)
    values = np.clip(model.free.start, *problem.bounds)
    identifiable(model.free, problem.slopes(values))
    if not np.isfinite(problem.residuals(values)).all():
        raise InvalidInput("arm", "no equilibrium", "one at the start for some sample at least")
    rounds = [None, _ROBUST] if robust else [None]
    converged, count = False, 0
    for width in rounds:
        if width is not None:
            problem.width = width * robust_width(problem.miss(values))
        if any(number.prior for number in model.free.numbers):
            problem.unit = noise or robust_width(problem.miss(values))
        result = problem.solved(values, _FINE if width == rounds[-1] else _COARSE)
        values, converged = result.x, bool(result.status > 0)
        count += int(result.nfev)
    prediction = problem.at(values)
    residuals = prediction.places - places
    low, high = problem.bounds
    hair = 1e-6 * model.free.scale
    return Fit(
        model.free,
        values,
        prediction,
        residuals,
        problem.weights_of(residuals),
        (values <= low + hair) | (values >= high - hair),
        count,
        converged,
    )


class _Problem:
    """Residuals and their derivatives, the last evaluation kept."""

    def __init__(self, model: MarkerModel, places: Array, progress: Progress) -> None:
        self.model, self.places, self.progress = model, places, progress
        self.seen = np.asarray(np.isfinite(places).all(axis=2))
        self.bounds = model.free.bounds
        self.width: float | None = None  # beyond which residuals count less, in m
        self.unit = 1.0  # of priors, which count as a coordinate of one width, in m
        self.kept: tuple[bytes, Prediction] | None = None

    def at(self, values: Array) -> Prediction:
        key = values.tobytes()
        if self.kept is None or self.kept[0] != key:
            self.kept = (key, self.model.predict(values, slopes=True))
            self.progress(1)
        return self.kept[1]

    def miss(self, values: Array) -> Array:
        """Predicted minus measured places that were seen [m]."""
        return (self.at(values).places - self.places)[self.seen]

    def residuals(self, values: Array) -> Array:
        """Of all that was seen [m], then of the priors."""
        free = self.model.free
        try:
            miss = self.miss(values)
        except InvalidDesign:
            return np.full(3 * int(self.seen.sum()) + self._priors(values)[0].size, _FAR)
        miss = np.where(np.isfinite(miss), miss, _FAR * 0.1 * free.arm.length)
        return np.concatenate([miss.ravel(), self._priors(values)[0]])

    def slopes(self, values: Array) -> Array:
        prediction = self.at(values)
        assert prediction.slopes is not None
        slopes = prediction.slopes[self.seen].reshape(-1, len(self.model.free))
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)
        return np.concatenate([slopes, self._priors(values)[1]])

    def _priors(self, values: Array) -> tuple[Array, Array]:
        numbers = self.model.free.numbers
        known = [k for k, number in enumerate(numbers) if number.prior is not None]
        rows, slopes = np.zeros(len(known)), np.zeros((len(known), len(numbers)))
        for row, k in enumerate(known):
            mean, width = numbers[k].prior or (0.0, 1.0)
            rows[row] = self.unit * (values[k] - mean) / width
            slopes[row, k] = self.unit / width
        return rows, slopes

    def solved(self, values: Array, fine: float) -> Any:
        from scipy.optimize import least_squares

        return least_squares(
            self.residuals,
            values,
            jac=self.slopes,  # pyright: ignore[reportArgumentType]
            bounds=self.bounds,
            x_scale=self.model.free.scale,
            loss=_loss(int(self.seen.sum()), self.width),  # pyright: ignore[reportArgumentType]
            f_scale=1.0,
            ftol=fine,
            xtol=fine,
            gtol=1e-14,
            max_nfev=_MOST,
        )

    def weights_of(self, residuals: Array) -> Array:
        """Weight of each marker of each sample in the fit, (n, marker)."""
        if self.width is None:
            return self.seen.astype(float)
        distance = np.linalg.norm(np.where(self.seen[..., None], residuals, 0.0), axis=2)
        return self.seen / np.sqrt(1.0 + (distance / self.width) ** 2)


def _loss(count: int, width: float | None) -> str | Callable[[Array], Array]:
    """Loss of places, by their distance, so that it does not depend on the axes; pseudo-Huber."""
    if width is None:
        return "linear"

    def loss(squares: Array) -> Array:
        # SciPy takes ρ of each squared residual: that of a place is shared by its three.
        rho = np.stack([squares, np.ones_like(squares), np.zeros_like(squares)])
        place = squares[: 3 * count].reshape(count, 3)
        whole = place.sum(axis=1) / width**2
        root = np.sqrt(1.0 + whole)
        share = np.where(whole > 1e-12, 2.0 * (root - 1.0) / np.maximum(whole, 1e-12), 1.0)
        rho[0, : 3 * count] = (place * share[:, None]).ravel()
        rho[1, : 3 * count] = np.repeat(1.0 / root, 3)
        return rho

    return loss


def robust_width(miss: Array) -> float:
    """Standard deviation of a coordinate from the middle of the distances of places."""
    distance = np.linalg.norm(miss, axis=-1)
    known = distance[np.isfinite(distance)]
    return max(float(np.median(known)) / 1.5382 if known.size else 0.0, 1e-9)  # χ of 3 degrees


def exchanged_columns(
    fit: Fit,
    model: MarkerModel,
    places: Array,
    *,
    robust: bool,
    noise: float | None,
    progress: Progress,
) -> tuple[str, float] | None:
    """The exchange of two columns that halves the error of a fit at least, and its error, rms [m].

    Arguments are those of `fitted` and the fit with the columns as they are.
    """
    some = slice(None, None, -(-len(places) // _SAMPLES))
    few, seen = replace(model, inputs=model.inputs[some]), places[some]
    least, best = _BETTER * misses(fit.residuals).rms, None
    for values in (model.free.start, fit.values):
        own = few.predict(values).places
        each = {text: (order, None) for text, order in exchanged_inputs(model.free.arm)}
        each |= {text: (None, order) for text, order in _coordinates(model.names)}
        found = {}
        for text, (inputs, columns) in each.items():
            other = few if inputs is None else replace(few, inputs=few.inputs[:, inputs])
            predicted = own if inputs is None else other.predict(values).places
            found[text] = _moved_miss(model.free, predicted, _ordered(seen, columns))
        first = min(found, key=found.__getitem__)
        if found[first] > _PROMISING * _moved_miss(model.free, own, seen):
            continue
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
            least, best = error, (" or ".join(alike[:4]), error)
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
