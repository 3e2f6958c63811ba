"""Errors of predicted places, what the data repeats, and what the residuals speak of."""

from typing import NamedTuple

import numpy as np

from softreach.calibration.measurements import Measurements
from softreach.support.arrays import Array, Mask

_NEAR = (0.05, 0.1)  # distances of inputs, over their ranges, within which two samples are near
_FEW = 8
_NOISE = 1.5  # held-out error over what the data repeats, up to which noise is all
_MEMORY = 0.05  # Share of squared residuals that last commands must explain, beyond laws of inputs
_LAW = 0.2  # Share of squared residuals that a law of inputs explains where noise is not all
_SURE = 2.5  # gain in a tenth of the samples, over its standard error, that is not chance
_WIDTHS = (0.5, 0.25)  # of the bells in laws of the inputs, over their ranges
_BELLS = 80
_SHUFFLES = 3  # orders of commands by chance, none of which may explain as much
_PENALTIES = np.logspace(-7, 1, 9)
_SLIPS = 0.03  # share of samples far off that may be slips


class PlacementErrors(NamedTuple):
    """Distances between predicted and measured places [m]."""

    median: float
    """Half of the distances are below it [m]."""
    mean: float
    """Mean distance [m]."""
    rms: float
    """Root of the mean square [m]."""
    most: float
    """95 % of the distances are below it [m]."""
    number: int
    """Number of places."""

    def text(self, length: float) -> str:
        """In words: "rms 5.2 mm (1.4 % of L), median 3.1, mean 4.0, 95 % below 9.9"."""
        median, mean, rms, most = (f"{1e3 * value:.3g}" for value in self[:4])
        share = 100.0 * self.rms / length
        return f"rms {rms} mm ({share:.2g} % of L), median {median}, mean {mean}, 95 % below {most}"


def misses(residuals: Array) -> PlacementErrors:
    """Of residuals of places (..., 3); those without a number do not count."""
    distance = np.linalg.norm(residuals, axis=-1).ravel()
    distance = distance[np.isfinite(distance)]
    if not len(distance):
        return PlacementErrors(np.nan, np.nan, np.nan, np.nan, 0)
    rms, most = float(np.sqrt((distance**2).mean())), float(np.quantile(distance, 0.95))
    median, mean = float(np.median(distance)), float(distance.mean())
    return PlacementErrors(median, mean, rms, most, len(distance))


class Repeatability(NamedTuple):
    """By how much places differ when inputs are the same."""

    rms: float
    """Scatter of a place about its mean [m]; NaN where no inputs are repeated."""
    pairs: int
    """Pairs of samples that it is of."""


def repeatability(data: Measurements, residuals: Array) -> Repeatability:
    """From residuals (n, marker, 3) [m], NaN where unknown, of pairs of same or near inputs.

    So the arm's own motion between near inputs does not count.
    """
    spans = np.ptp(data.inputs, axis=0)
    moving = spans > 0
    if not moving.any() or len(data) < 2:
        return Repeatability(np.nan, 0)
    from scipy.spatial import KDTree

    scaled = data.inputs[:, moving] / spans[moving]
    distances, near = (np.asarray(values) for values in KDTree(scaled).query(scaled, k=2))
    itself = near[:, 0] == np.arange(len(data))  # of two copies either may come first
    distance, partner = distances[:, 1], np.where(itself, near[:, 1], near[:, 0])
    many = len(data) >= 10 * (1 + 3 * moving.sum())  # so that laws of the inputs are judged too
    for limit in (1e-9, *_NEAR[: 1 + many]):
        rows = np.flatnonzero(distance <= limit)
        square = ((residuals[rows] - residuals[partner[rows]]) ** 2).sum(axis=2)
        square = square[np.isfinite(square)]
        if len(square) >= _FEW:
            return Repeatability(float(np.sqrt(0.5 * square.mean())), len(rows))
    return Repeatability(np.nan, 0)


class Verdict(NamedTuple):
    """Limitation of a fit."""

    limit: str
    """"noise", "memory", "physics" or "columns"; "data" where there is too little to tell."""
    sentence: str
    """The verdict in words, with its numbers."""


def judged(
    data: Measurements, residuals: Array, repeated: Repeatability, held: Mask, far: Mask
) -> Verdict:
    """Limitation of a fit, from its residuals in the order in which samples were taken.

    Residuals are predicted minus measured places, NaN where unknown, (n, marker, 3) [m]. The error
    that is judged is that of the samples `held` out of the fit, if there are some; samples `far`
    off are slips if they are few and of different inputs; shape (n,) each.
    """
    rows = held if held.any() else ~held
    finding = _finding(data, far)
    error = misses(residuals[rows]).rms
    text = f"{'held-out' if held.any() else 'fitted'} error {1e3 * error:.3g} mm rms"
    if not finding and (rows & far).any() and (rows & ~far).any():
        error = misses(residuals[rows & ~far]).rms
        text += f", {1e3 * error:.3g} mm without the rows far off"
        residuals = np.where(far[:, None, None], np.nan, residuals)
    known = bool(np.isfinite(repeated.rms))
    text += f", repeated inputs differ by {1e3 * repeated.rms:.3g} mm" if known else ""
    law, memory = _explained(data, residuals)
    share = memory or 0.0
    if share > max(_MEMORY, law) and not finding:
        limit = "memory"
        said = f"limited by memory: earlier commands explain {100 * share:.0f} % of the residuals, "
        said += "as friction, creep or slack of the drives would; no law of the inputs does"
    elif known and error <= _NOISE * repeated.rms and law < _LAW and not finding:
        limit, said = "noise", "limited by noise: repeated poses differ as much as the error"
        if memory is None:
            limit, said = "data", "repeated poses differ as much as the error; too few samples"
            said += " in a row to look for memory"
    elif len(data) < _FEW:
        limit, said = "data", "too few samples to say what limits the fit"
    elif law < _LAW and not known and not finding:
        said = "limited by missing physics or by noise: repeated inputs would tell which"
        limit = "data"
    else:
        limit, said = "physics", "repeated poses differ by less than the error"
        if law >= _LAW:
            said = f"a law of the inputs explains {100 * law:.0f} % of the residuals, such as "
            said += "another geometry or inputs that saturate"
            beyond = f", and earlier commands another {100 * share:.0f} %"
            said += beyond if share > _MEMORY else ""
        elif not known:
            said = "samples far off are no errors of measurement"
        said = f"limited by missing physics: {said}"
    return Verdict(limit, f"{said} ({text}){finding and '; '}{finding}")


def _finding(data: Measurements, far: Mask) -> str:
    """What samples far off have in common, or that they are too many for slips; else ""."""
    size = np.maximum(np.abs(data.inputs).max(axis=0), 1e-300)
    moved = np.abs(data.inputs) > 0.02 * size
    for cells in (moved, np.round(data.inputs / size / _NEAR[0])):
        _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        total, hit = (np.bincount(cell.ravel()[k], minlength=len(first)) for k in (..., far))
        k = int(hit.argmax())
        if hit[k] > max(1, 0.5 * total[k], 0.8 * far.sum() - 1) and total[k] < 0.5 * len(data):
            names = zip(data.input_names, data.inputs[first[k]], moved[first[k]], strict=True)
            like = ", ".join(f"{name} {value:.3g}" for name, value, on in names if on)
            return f"{hit[k]} of {total[k]} rows with inputs such as {like or 'none'} are far off"
    if far.sum() > max(2, _SLIPS * len(data)):
        return f"{far.sum()} of {len(data)} rows are far off, more than slips would be"
    return ""


def _explained(data: Measurements, residuals: Array) -> tuple[float, float | None]:
    """Shares of squared residuals that the inputs explain, and the last command beyond these.

    Both are cross-validated. Laws of the inputs are quadratic, and with bells of several widths;
    to each the change from the last command and its sign are added. A gain counts if it is the
    same all over the samples, and beyond that of last commands drawn by chance. The second is None
    where too few samples follow each other in a run.
    """
    order, moving = data.order, np.ptp(data.inputs, axis=0) > 0
    flat = residuals.reshape(len(residuals), -1)[order]
    x, runs = data.inputs[order][:, moving], data.runs[order]
    known = np.isfinite(flat).all(axis=1) & np.append(False, runs[1:] == runs[:-1])
    if known.sum() < 10 * (1 + 3 * x.shape[1]):
        return 0.0, None
    x = (x - x.mean(axis=0)) / np.ptp(x, axis=0)
    x, last, target = x[known], np.roll(x, 1, axis=0)[known], flat[known]
    plain, rng = with_products(x), np.random.default_rng(0)
    some = rng.permutation(len(x))[:_BELLS]
    square = ((x[:, None] - x[some]) ** 2).mean(axis=2)
    laws = [plain, *(np.concatenate([plain, np.exp(-0.5 * square / w**2)], 1) for w in _WIDTHS)]

    def after(last: Array) -> Array:
        change = last - x
        before = np.concatenate([change, np.tanh(change / 0.1)], axis=1)
        return min((_left(np.concatenate([law, before], 1), target) for law in laws), key=np.sum)

    total = float(((target - target.mean(axis=0)) ** 2).sum())

    def share(less: Array, more: Array) -> float:
        gain = more - less
        sure = gain.mean() > _SURE * gain.std(ddof=1) / np.sqrt(len(gain))
        return min(1.0, float(gain.sum()) / total) if sure and total > 0 else 0.0

    alone, wide = min((_left(law, target) for law in laws), key=np.sum), after(last)
    memory = share(wide, alone)
    if memory > _MEMORY:
        others = (after(last[rng.permutation(len(last))]) for _ in range(_SHUFFLES))
        memory = share(wide, min(alone, *others, key=np.sum))
    return share(alone, _left(np.zeros((len(x), 1)), target)), memory


def with_products(x: Array) -> Array:
    """Columns, their squares and products, shape (n, column)."""
    j, k = np.triu_indices(x.shape[1])
    return np.concatenate([x, x[:, j] * x[:, k]], axis=1)


def _left(features: Array, target: Array) -> Array:
    """Squares that a ridge leaves in each tenth of the samples in a row, by all others, (10,).

    The residuals of rows that are left out are (1 - H)^-1 times those of the fit to all.
    """
    size = features.std(axis=0)
    scaled = (features - features.mean(axis=0)) / np.where(size > 0, size, 1.0)
    axes, values, _ = np.linalg.svd(scaled, full_matrices=False)
    target, n = target - target.mean(axis=0), len(target)
    tenths = np.array_split(np.arange(n), 10)

    def left(penalty: float) -> Array:
        keep = values**2 / (values**2 + n * penalty)
        miss = target - axes @ (keep[:, None] * (axes.T @ target))
        hats = [np.eye(len(k)) - (axes[k] * keep) @ axes[k].T - 1.0 / n for k in tenths]
        each = zip(hats, tenths, strict=True)
        return np.array([(np.linalg.solve(hat, miss[k]) ** 2).sum() for hat, k in each])

    return min(map(left, _PENALTIES), key=np.sum)
