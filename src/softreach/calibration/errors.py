"""Errors of predicted places, what the data repeats, and what the residuals speak of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.measurements import Measurements

__all__ = ["Misses", "Repeatability", "Verdict", "judged", "misses", "repeatability"]

Array = NDArray[np.float64]

_NEAR = 0.05
"""Distance of inputs, over their ranges, within which two samples count as repeated."""
_FEW = 8
_NOISE = 1.5
"""Held-out error over what the data repeats, up to which noise is all."""
_MEMORY = 0.05
"""Share of the squared residuals that the last command must explain."""


class Misses(NamedTuple):
    """Distances between predicted and measured places [m]."""

    median: float
    mean: float
    rms: float
    most: float
    """95 % of them are below it."""
    number: int
    """Number of places."""

    def text(self, length: float) -> str:
        """Of the command line: "median 3.1, mean 4.0, rms 5.2, 95 % below 9.9 mm (1.4 % of L)"."""
        median, mean, rms, most = (f"{1e3 * value:.3g}" for value in self[:4])
        share = 100.0 * self.rms / length
        return f"rms {rms} mm ({share:.2g} % of L), median {median}, mean {mean}, 95 % below {most}"


def misses(residuals: Array) -> Misses:
    """Of residuals of places (..., 3); those without a number do not count."""
    distance = np.linalg.norm(residuals, axis=-1).ravel()
    distance = distance[np.isfinite(distance)]
    if not len(distance):
        return Misses(np.nan, np.nan, np.nan, np.nan, 0)
    return Misses(
        float(np.median(distance)),
        float(distance.mean()),
        float(np.sqrt((distance**2).mean())),
        float(np.quantile(distance, 0.95)),
        len(distance),
    )


class Repeatability(NamedTuple):
    """By how much places differ when inputs are the same."""

    rms: float
    """Of a place about its mean [m]; NaN where no inputs are repeated."""
    pairs: int
    """Pairs of samples that it is of."""
    exact: bool
    """True if their inputs are equal, else near."""


def repeatability(data: Measurements) -> Repeatability:
    """From pairs of samples with the same inputs, or the nearest ones within 5 % of their ranges.

    Of near inputs it is an upper bound: places differ by what the inputs do, too.
    """
    spans = np.ptp(data.inputs, axis=0)
    moving = spans > 0
    if not moving.any() or len(data) < 2:
        return Repeatability(np.nan, 0, False)
    from scipy.spatial import KDTree

    scaled = data.inputs[:, moving] / spans[moving]
    near = KDTree(scaled).query(scaled, k=2)
    distance, partner = (np.asarray(values)[:, 1] for values in near)
    for limit, exact in ((1e-9, True), (_NEAR, False)):
        rows = np.flatnonzero(distance <= limit)
        apart = (data.places[rows] - data.places[partner[rows]])[..., :]
        square = (apart**2).sum(axis=2)
        square = square[np.isfinite(square)]
        if len(square) >= _FEW:
            return Repeatability(float(np.sqrt(0.5 * square.mean())), len(rows), exact)
    return Repeatability(np.nan, 0, False)


@dataclass(frozen=True)
class Verdict:
    """Limitation of a fit."""

    limit: str
    """"noise", "memory" or "physics"; "data" where there is too little to tell."""
    sentence: str
    memory: float
    """Share of the squared residuals that the last command explains, by cross-validation [-]."""


def judged(
    data: Measurements, residuals: Array, error: float, repeated: Repeatability, name: str
) -> Verdict:
    """Limitation of a fit, from its residuals in the order in which samples were taken.

    Args:
        data: All samples.
        residuals: Predicted minus measured places, NaN where unknown, (n, marker, 3) [m].
        error: Error that is judged, rms [m].
        repeated: What the data repeats.
        name: "held-out error" or "fitted error".
    """
    share = _memory(data, residuals)
    text = f"{name} {1e3 * error:.3g} mm rms"
    known = np.isfinite(repeated.rms)
    if known:
        text += f", repeated inputs differ by {1e3 * repeated.rms:.3g} mm"
    if share > _MEMORY:
        said = (
            f"limited by memory: the commands before explain {100 * share:.0f} % of what is left "
            "(friction, creep or slack of the drives); no law of the inputs alone can do better"
        )
        return Verdict("memory", f"{said} ({text})", share)
    if known and error <= _NOISE * repeated.rms:
        said = "limited by noise: the error is that of the data itself"
        return Verdict("noise", f"{said} ({text})", share)
    if len(data) < _FEW:
        return Verdict("data", f"too few samples to say what limits the fit ({text})", share)
    said = (
        "limited by missing physics: the error is beyond what the data repeats"
        if known
        else "limited by missing physics, or by noise: no inputs are repeated, so nothing tells"
    )
    return Verdict("physics" if known else "data", f"{said} ({text})", share)


def _memory(data: Measurements, residuals: Array) -> float:
    """Share of squared residuals that earlier commands explain, cross-validated by blocks.

    A ridge on the change from the last command, its sign, and the residual's own inputs; what the
    inputs alone explain does not count.
    """
    order = data.order
    flat = residuals.reshape(len(residuals), -1)[order]
    moving = np.ptp(data.inputs, axis=0) > 0
    inputs, runs = data.inputs[order][:, moving], data.runs[order]
    follows = np.append(False, runs[1:] == runs[:-1])
    known = np.isfinite(flat).all(axis=1) & follows
    if known.sum() < 10 * (1 + 3 * inputs.shape[1]):
        return 0.0
    scale = np.ptp(inputs, axis=0)
    inputs = (inputs - inputs.mean(axis=0)) / scale
    change = np.zeros_like(inputs)
    change[1:] = inputs[:-1] - inputs[1:]
    wide = np.concatenate([inputs, change, np.tanh(change / 0.1)], axis=1)[known]
    target = flat[known]
    alone = _left(inputs[known], target)
    return float(max(0.0, 1.0 - _left(wide, target) / alone)) if alone > 0 else 0.0


def _left(features: Array, target: Array) -> float:
    """Squares that a ridge leaves, each tenth of the samples in a row predicted from the others."""
    from softreach.calibration.baselines import ridge

    total = 0.0
    for rows in np.array_split(np.arange(len(target)), 10):
        rest = np.setdiff1d(np.arange(len(target)), rows)
        predict = ridge(features[rest], target[rest])
        total += float(((predict(features[rows]) - target[rows]) ** 2).sum())
    return total
