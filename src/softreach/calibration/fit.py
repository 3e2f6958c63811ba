"""Least squares of measured places: robust, bounded, with priors; how sure the numbers are."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.errors import misses
from softreach.calibration.free_numbers import POSE, SCALE, FreeNumbers
from softreach.calibration.measurements import Measurements
from softreach.calibration.model import MarkerModel, Prediction
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible
from softreach.support.progress import Progress

SAME = 1e-7  # Least singular value over the largest, in scales of numbers, that data can tell
_IDLE = 1e-9  # motion of markers in L, or over that of the other numbers, that is rounding
_ROBUST = 3.0  # residuals beyond so many widths count less than their squares
_FINE, _COARSE = 1e-7, 1e-3  # Least share by which a step improves: last round, those before
_MOST = 60
_SAMPLES = 100  # samples by which exchanges are compared
_PROMISING, _BETTER = 0.8, 0.5  # Error over that of the columns as they are: before a fit, after it
_ALIKE, _FAR_BETTER = 1.2, 0.35  # between errors that nothing tells apart, or refuse a fit
_FAR = 1.0  # m, what a sample without equilibrium misses
FEWEST_RUNS = 8  # Runs from which these share errors and are held out, not samples
_SEEN = 0.1  # least share of a variance that the residuals would show if they were plain noise
_VAGUE = 30.0  # Standard deviation, in changes that matter, of what the data does not tell


@dataclass(frozen=True, eq=False)
class Fit:
    """Values of the free numbers at which residuals are least."""

    free: FreeNumbers
    values: Array
    prediction: Prediction
    residuals: Array  # Predicted minus measured places [m], NaN where none was seen, (n, marker, 3)
    weights: Array  # Of each marker of each sample in the fit: 1, less for outliers; (n, marker)
    at_bound: Mask  # Numbers that end at a bound, shape (number,)
    evaluations: int
    converged: bool


def started(model: MarkerModel, places: Array) -> FreeNumbers:
    """Numbers to start from: the pose that puts predicted places on measured ones [Kabsch1976]."""
    free = model.free
    if not {*POSE[:3]} & {*free.names}:
        return free
    each = model.predict(free.start).places
    predicted, measured = each.reshape(-1, 3), places.reshape(-1, 3)
    known = np.isfinite(predicted).all(axis=1) & np.isfinite(measured).all(axis=1)
    if not known.any():
        return free
    predicted, measured = predicted[known], measured[known]
    start = np.array(free.arm.base.position)
    if {*POSE} - {*free.names}:
        shift = np.median(measured - predicted, axis=0)
        return free.started_at(dict(zip(POSE[:3], start + shift, strict=True)))
    _refuse_exchanged(model, each, places)
    rotation, scale, place = _kabsch(free, predicted - start, measured)
    from scipy.spatial.transform import Rotation

    vector = Rotation.from_matrix(rotation).as_rotvec()
    return free.started_at(dict(zip((*POSE, SCALE), [*place, *vector, scale], strict=True)))


def _kabsch(free: FreeNumbers, predicted: Array, measured: Array) -> tuple[Array, float, Array]:
    """Rotation, scale and shift that carry predicted places to measured ones, least squares."""
    here, there = predicted.mean(axis=0), measured.mean(axis=0)
    left, _, right = np.linalg.svd((measured - there).T @ (predicted - here))
    rotation = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    turned, scale = (predicted - here) @ rotation.T, 1.0
    if SCALE in free.names and turned.any():
        scale = max(float(((measured - there) * turned).sum() / (turned**2).sum()), 1e-3)
    return rotation, scale, there - scale * rotation @ here


def _miss(free: FreeNumbers, predicted: Array, measured: Array) -> float:
    """Distance in the middle of places, moved together as far as the pose is free [m]."""
    predicted, measured = predicted.reshape(-1, 3), measured.reshape(-1, 3)
    known = np.isfinite(predicted + measured).all(axis=1)
    if known.sum() < 3:
        return np.inf
    predicted, measured = predicted[known], measured[known]
    if not {*POSE} - {*free.names}:
        rotation, scale, shift = _kabsch(free, predicted, measured)
        off = scale * predicted @ rotation.T + shift - measured
    else:
        off = predicted - measured
        off -= [np.median(off[:, k]) if POSE[k] in free.names else 0.0 for k in range(3)]
    return float(np.median(np.linalg.norm(off, axis=1)))


class _Order(NamedTuple):
    """Columns of inputs and of coordinates in another order, and the error in the middle then."""

    text: str  # What is exchanged
    inputs: NDArray[np.intp]
    columns: NDArray[np.intp]
    miss: float = np.inf


def _orders(model: MarkerModel, values: Array, own: Array, places: Array) -> list[_Order]:
    """All exchanges, the one that leaves least first; `own` are the places as predicted."""
    orders, plain = [], np.arange(model.inputs.shape[1])
    for order in _exchanges(model):
        other = own
        if (order.inputs != plain).any():
            other = replace(model, inputs=model.inputs[:, order.inputs]).predict(values).places
        miss = _miss(model.free, other, _ordered(places, order.columns))
        orders.append(order._replace(miss=miss))
    return sorted(orders, key=lambda order: order.miss)


def _exchanges(model: MarkerModel) -> Iterator[_Order]:
    """Exchanges of two inputs of one unit, axes, markers or columns, and all senses of bundles."""
    arm, names = model.free.arm, model.names
    inputs, columns = np.arange(arm.inputs), np.arange(3 * len(names))
    each, words = columns.reshape(-1, 3), [f"{name} {axis}" for name in names for axis in "xyz"]
    for j, k in combinations(range(arm.inputs), 2):
        if arm.input_units[j] == arm.input_units[k]:
            text = f"the inputs {arm.input_names[j]} and {arm.input_names[k]}"
            yield _Order(text, _exchanged(inputs, j, k), columns)
    counts = [] if arm.drives else [actuator.bundles for actuator in arm.actuators]
    if sum(count > 2 for count in counts) > 1:
        parts = np.split(inputs, np.cumsum(counts)[:-1])
        turned = np.concatenate([[*part[:1], *part[:0:-1]] for part in parts])
        yield _Order("the senses in which bundles are counted", turned, columns)
    groups = [("axes", "xyz", each.T), ("markers", names, each)]
    groups += [("columns", words, columns[:, None])] if len(names) > 1 else []
    for kind, known, places in groups:
        for j, k in combinations(range(len(known)), 2):
            order = _exchanged(columns, places[j], places[k])
            yield _Order(f"the {kind} {known[j]} and {known[k]}", inputs, order)


def _exchanged(order: NDArray[np.intp], here: Any, there: Any) -> NDArray[np.intp]:
    order = order.copy()
    order[here], order[there] = there, here
    return order


def _ordered(places: Array, order: NDArray[np.intp]) -> Array:
    return places.reshape(len(places), -1)[:, order].reshape(places.shape)


def _said(orders: list[_Order]) -> str:
    alike = [order.text for order in orders if order.miss <= _ALIKE * orders[0].miss]
    return f"{' or '.join(alike[:4])} seem to be exchanged or reversed"


def _refuse_exchanged(model: MarkerModel, predicted: Array, places: Array) -> None:
    own = _miss(model.free, predicted, places)
    middle = np.nanmean(places, axis=(0, 1))
    if own > 0.1 * np.nanmedian(np.linalg.norm(places - middle, axis=2)):
        orders = _orders(model, model.free.start, predicted, places)
        if orders[0].miss < _FAR_BETTER * own:
            less = f"{1e3 * orders[0].miss:.3g} mm, not {1e3 * own:.3g} mm"
            fit = f"the columns of the data fit no arm with right-handed axes: {_said(orders)}"
            raise NotPossible(f"{fit}; put right, they miss by {less}")


def identifiable(free: FreeNumbers, slopes: Array) -> None:
    """Refuse numbers that the data cannot tell: those that do nothing, and those that trade.

    `slopes` are derivatives of all residuals and priors, shape (residual, number).
    """
    scaled = slopes * free.scale
    sizes = np.linalg.norm(scaled, axis=0)
    still = _IDLE * max(sizes.max(), free.arm.length * np.sqrt(len(slopes)))
    idle = [name for name, size in zip(free.names, sizes, strict=True) if size <= still]
    if idle:
        allowed = "numbers that move a marker in some sample: leave out those that move none"
        raise InvalidInput("free", ", ".join(idle), allowed)
    _, values, axes = np.linalg.svd(scaled, full_matrices=False)
    if len(scaled) < len(free):
        allowed = f"at most {len(scaled)} numbers, as many as the data has"
        raise InvalidInput("free", f"{len(free)} numbers", allowed)
    if values[-1] > SAME * values[0]:
        return
    null = axes[values <= SAME * values[0]]
    trading = [free.names[k] for k in _fewest(null * sizes)]
    allowed = "numbers that the data can tell apart: markers show only their ratio or their sum"
    hint = f"leave out one, such as {trading[-1]}, or give it a prior"
    raise InvalidInput("free", ", ".join(trading), allowed, hint)


def _fewest(directions: Array) -> list[int]:
    """The fewest numbers that change in one of all combinations of these directions."""
    from scipy.linalg import qr, solve

    # Each number of a basis changes in one combination and not in the others.
    _, order = cast(tuple[Array, Index], qr(directions, mode="r", pivoting=True))
    sparse = np.abs(solve(directions[:, order[: len(directions)]], directions))
    changes = sparse > 0.05 * sparse.max(axis=1, keepdims=True)
    return np.flatnonzero(changes[changes.sum(axis=1).argmin()]).tolist()


def fitted(
    model: MarkerModel, places: Array, *, robust: bool, noise: float | None, progress: Progress
) -> Fit:
    """The numbers at which predicted places are nearest to measured ones, as `calibrate` says.

    `places` are measured [m], NaN where none was seen, shape (n, marker, 3).
    """
    model = replace(model, free=started(model, places))
    problem = _Problem(model, places, progress)
    values = np.clip(model.free.start, *problem.bounds)
    identifiable(model.free, problem.slopes(values))
    if not np.isfinite(problem.residuals(values)).all():
        raise NotPossible("the design that the fit starts from has no equilibrium at any sample")
    converged, count = False, 0
    for is_last in (False, True) if robust else (True,):
        if robust and is_last:
            problem.width = _ROBUST * robust_width(problem.miss(values))
        if any(number.prior for number in model.free.numbers):
            problem.unit = noise or robust_width(problem.miss(values))
        result = problem.solved(values, _FINE if is_last else _COARSE)
        values, converged = result.x, bool(result.status > 0)
        count += int(result.nfev)
    prediction = problem.at(values)
    residuals = prediction.places - places
    (low, high), hair = problem.bounds, 1e-6 * model.free.scale
    at_bound = (values <= low + hair) | (values >= high - hair)
    weights = problem.seen.astype(float)
    if problem.width is not None:
        distance = np.linalg.norm(np.where(problem.seen[..., None], residuals, 0.0), axis=2)
        weights = problem.seen / np.sqrt(1.0 + (distance / problem.width) ** 2)
    return Fit(model.free, values, prediction, residuals, weights, at_bound, count, converged)


class _Problem:
    """Residuals and their derivatives, the last evaluation kept."""

    def __init__(self, model: MarkerModel, places: Array, progress: Progress) -> None:
        self.model, self.places, self.progress = model, places, progress
        self.seen = np.asarray(np.isfinite(places).all(axis=2))
        self.bounds = model.free.bounds
        self.width: float | None = None  # beyond which residuals count less, in m
        self.unit = 1.0  # of priors, which count as a coordinate of one width, in m
        self.kept: tuple[bytes, Prediction] | None = None
        numbers = model.free.numbers
        priors = [(k, *number.prior) for k, number in enumerate(numbers) if number.prior]
        self.rows, self.means = np.zeros((len(priors), len(numbers))), np.zeros(len(priors))
        for row, (k, mean, width) in enumerate(priors):
            self.rows[row, k], self.means[row] = 1.0 / width, mean / width

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
            return np.full(3 * int(self.seen.sum()) + len(self.rows), _FAR)
        miss = np.where(np.isfinite(miss), miss, _FAR * 0.1 * free.arm.length)
        return np.concatenate([miss.ravel(), self.unit * (self.rows @ values - self.means)])

    def slopes(self, values: Array) -> Array:
        slopes = self.at(values).slopes[self.seen].reshape(-1, len(self.model.free))
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)
        return np.concatenate([slopes, self.unit * self.rows])

    def solved(self, values: Array, fine: float) -> Any:
        from scipy.optimize import least_squares

        loss = _loss(int(self.seen.sum()), self.width)
        scales: Any = {"jac": self.slopes, "bounds": self.bounds, "x_scale": self.model.free.scale}
        ends: Any = {"loss": loss, "ftol": fine, "xtol": fine, "gtol": 1e-14, "max_nfev": _MOST}
        return least_squares(self.residuals, values, **scales, **ends)


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
    fit: Fit, model: MarkerModel, places: Array, refitted: Callable[[MarkerModel, Array], Fit]
) -> tuple[str, float] | None:
    """What seems exchanged, as the same numbers then fit twice as well, and their error, rms [m].

    `fit` is that of a model to places [m]; `refitted` fits another model to other places.
    """
    some = slice(None, None, -(-len(places) // _SAMPLES))
    few, seen = replace(model, inputs=model.inputs[some]), places[some]
    least, best = _BETTER * misses(fit.residuals).rms, None
    for values in (model.free.start, fit.values):
        own = few.predict(values).places
        orders = _orders(few, values, own, seen)
        if orders[0].miss > _PROMISING * _miss(model.free, own, seen):
            continue
        other = replace(model, inputs=model.inputs[:, orders[0].inputs])
        try:
            error = misses(refitted(other, _ordered(places, orders[0].columns)).residuals).rms
        except (InvalidInput, NotPossible):
            continue
        if error < least:
            least, best = error, (_said(orders), error)
    return best


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of the fitted numbers."""

    covariance: Array
    """Covariance that the data supports [units of both numbers], shape (number, number)."""
    told: Mask
    """False for a number that the data does not tell at the end of the fit, of which no residuals
    are left to say how well, or which is at a bound; shape (number,)."""
    freedom: Array
    """Degrees of freedom of the interval of each number [-], shape (number,)."""

    @property
    def sigma(self) -> Array:
        """Standard deviations [unit of each], infinite where unknown, (number,)."""
        return np.where(self.told, np.sqrt(np.diag(self.covariance)), np.inf)

    @property
    def correlation(self) -> Array:
        """Correlation of the numbers [-], shape (number, number)."""
        sigma = np.sqrt(np.diag(self.covariance))
        sigma = np.where(sigma > 0, sigma, 1.0)
        return self.covariance / np.outer(sigma, sigma)

    def half_widths(self, level: float = 0.95) -> Array:
        """Of intervals that hold each number with this probability, by Student's t, (number,)."""
        from scipy.special import stdtrit

        return self.sigma * stdtrit(self.freedom, 0.5 + 0.5 * level)


def uncertainty(fit: Fit, data: Measurements, noise: float | None) -> Uncertainty:
    """The sandwich of clusters, each freed of its own leverage [BellMcCaffrey2002].

    Numbers at a bound are held there, and the variance of the others is as if they were known. The
    noise is the standard deviation of a coordinate [m], against which priors are weighed.
    """
    slopes, free, count = fit.prediction.slopes, ~fit.at_bound, len(fit.values)
    scale = np.maximum(fit.free.scale, 0.1 * np.abs(fit.values))
    weight = np.sqrt(fit.weights)[..., None]
    seen = (fit.weights > 0) & np.isfinite(slopes).all(axis=(2, 3))
    rows = np.where(seen[..., None, None], weight[..., None] * slopes * scale, 0.0)
    miss = np.where(seen[..., None], weight * fit.residuals, 0.0)
    by_run = len(data.run_names) >= max(FEWEST_RUNS, 2 * count)
    keys = data.runs if by_run else np.arange(len(data))  # what shares errors
    rows = rows.reshape(len(data), -1, count)[:, :, free]
    miss = miss.reshape(len(data), -1)
    squares = np.einsum("nrp,nrq->pq", rows, rows)
    bread = squares - _bent(fit, seen, scale)[np.ix_(free, free)]
    width = noise or robust_width(miss.reshape(-1, 3)[seen.ravel()])
    widths = [np.inf if number.prior is None else number.prior[1] for number in fit.free.numbers]
    known = ((width * scale / np.array(widths)) ** 2)[free]
    plain = squares + np.diag(known)
    sizes, axes = np.linalg.eigh(plain)
    dropped = axes[:, sizes <= SAME**2 * sizes.max(initial=0.0)]
    inverse = np.linalg.pinv(bread + np.diag(known), SAME**2, hermitian=True)
    expected = np.linalg.pinv(plain, SAME**2, hermitian=True)
    meat, freedom, shown = _sandwich(rows, miss, keys, expected)
    prior = np.diag(expected @ np.diag(known) @ expected)
    whole = np.zeros((count, count))
    whole[np.ix_(free, free)] = inverse @ (meat + np.diag(known * width**2)) @ inverse
    degrees = np.full(count, np.inf)
    degrees[free] = freedom
    told = np.ones(count, bool)
    told[free] = (np.abs(dropped) < 1e-3).all(axis=1) & (shown + prior > _SEEN * np.diag(expected))
    told &= ~fit.at_bound & (np.diag(whole) <= _VAGUE**2)
    whole[~told] = whole[:, ~told] = 0.0
    return Uncertainty(whole * np.outer(scale, scale), told, degrees)


def _bent(fit: Fit, seen: Mask, scale: Array) -> Array:
    """Difference between the second derivatives of a robust loss and of weighted squares.

    Of 2W²(√(1 + d²/W²) - 1) in the distance d of a place it is w - w (1 - w²) along the residual,
    with w = 1/√(1 + d²/W²).
    """
    slopes, weight = fit.prediction.slopes, fit.weights
    square = np.where(seen, (fit.residuals**2).sum(axis=2), 0.0)
    lost = weight * (1.0 - weight**2)
    share = np.divide(lost, square, out=np.zeros_like(square), where=square > 0)
    along = np.einsum("nma,nmap->nmp", np.where(seen[..., None], fit.residuals, 0.0), slopes)
    along = np.where(seen[..., None], along * scale, 0.0)
    return np.einsum("nm,nmp,nmq->pq", share, along, along)


def _sandwich(
    rows: Array, miss: Array, keys: NDArray[np.intp], inverse: Array
) -> tuple[Array, Array, Array]:
    """Squares of the scores of clusters, degrees of freedom, variances to expect of plain noise.

    The residuals of a cluster are freed of its own leverage, (1 - H)^-1/2; the degrees of freedom
    are those of the chi square with the same mean and variance (Satterthwaite). `inverse` is that
    of the sum of squares of all rows, derivatives of residuals, shape (n, residual, number).
    """
    count = rows.shape[2]
    values, axes = np.linalg.eigh(inverse)
    half, meat = axes * np.sqrt(np.maximum(values, 0.0)), np.zeros((count, count))
    squares, total, mixed = np.zeros((3, count))
    spread = np.zeros((count, count, count))
    order = np.argsort(keys, kind="stable")
    ends = np.flatnonzero(np.diff(keys[order], append=-1)) + 1
    for cluster in np.split(order, ends[:-1]):
        own, left = rows[cluster].reshape(-1, count), miss[cluster].ravel()
        if not own.any():
            continue
        score = own.T @ _without_leverage(own @ half, left[:, None])[:, 0]
        meat += np.outer(score, score)
        part = _without_leverage(own @ half, own @ inverse)
        size, moved = (part**2).sum(axis=0), own.T @ part
        total += size
        squares += size**2
        mixed += size * np.einsum("pc,pq,qc->c", moved, inverse, moved)
        spread += np.einsum("pc,qc->cpq", moved, moved)
    product = np.einsum("pq,cqr->cpr", inverse, spread)
    lost = np.einsum("cpp->c", product)
    variance = squares - 2.0 * mixed + np.einsum("cpq,cqp->c", product, product)
    freedom = np.maximum((total - lost) ** 2 / np.maximum(variance, 1e-300), 1.0)
    return meat, freedom, total - lost


def _without_leverage(half: Array, left: Array) -> Array:
    """(1 - H)^-1/2 of columns of residuals of a cluster, with H = half halfᵀ."""
    axes, values, _ = np.linalg.svd(half, full_matrices=False)
    factor = 1.0 / np.sqrt(np.maximum(1.0 - values**2, 1e-6)) - 1.0
    return left + axes @ (factor[:, None] * (axes.T @ left))
