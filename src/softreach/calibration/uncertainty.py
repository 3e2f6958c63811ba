"""Uncertainty of fitted numbers, by clusters of residuals that may share errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.fit import Fit, robust_width
from softreach.calibration.measurements import Measurements

__all__ = ["Uncertainty", "uncertainty"]

Array = NDArray[np.float64]

_FEWEST_RUNS = 8
"""Runs from which they are the clusters; with fewer, samples are."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of the fitted numbers."""

    covariance: Array
    """Shape (number, number)."""
    freedom: Array
    """Degrees of freedom of the interval of each number, shape (number,)."""
    clusters: str
    """"run" or "sample": what shares errors."""

    @property
    def sigma(self) -> Array:
        """Standard deviations, shape (number,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Shape (number, number)."""
        sigma = np.where(self.sigma > 0, self.sigma, 1.0)
        return self.covariance / np.outer(sigma, sigma)

    def half_widths(self, level: float = 0.95) -> Array:
        """Of intervals that hold the number with this probability, by Student's t."""
        from scipy.special import stdtrit

        return self.sigma * stdtrit(self.freedom, 0.5 + 0.5 * level)


def uncertainty(fit: Fit, data: Measurements, noise: float | None) -> Uncertainty:
    """The sandwich of clusters, each freed of its own leverage [BellMcCaffrey2002].

    Numbers at a bound are held there: their variance is 0 and that of the others is as if they
    were known.

    Args:
        fit: The fit.
        data: What it was made of.
        noise: Standard deviation of a coordinate [m], against which priors are weighed.
    """
    slopes = fit.prediction.slopes
    assert slopes is not None
    open_ = ~fit.at_bound
    count = len(fit.values)
    scale = fit.free.scale
    weight = np.sqrt(fit.weights)[..., None]
    seen = (fit.weights > 0) & np.isfinite(slopes).all(axis=(2, 3))
    rows = np.where(seen[..., None, None], weight[..., None] * slopes * scale, 0.0)
    miss = np.where(seen[..., None], weight * fit.residuals, 0.0)
    by_run = len(data.run_names) >= max(_FEWEST_RUNS, 2 * count)
    keys = data.runs if by_run else np.arange(len(data))
    rows = rows.reshape(len(data), -1, count)[:, :, open_]
    miss = miss.reshape(len(data), -1)
    bread = np.einsum("nrp,nrq->pq", rows, rows)
    width = noise or robust_width(miss.reshape(-1, 3)[seen.ravel()])
    priors = [number.prior for number in fit.free.numbers]
    known = np.array(
        [0.0 if p is None else (width * s / p[1]) ** 2 for p, s in zip(priors, scale, strict=True)]
    )[open_]
    inverse = np.linalg.pinv(bread + np.diag(known))
    meat, spread = np.diag(known * width**2), []
    half = _root(inverse)
    for key in np.unique(keys):
        own, left = rows[keys == key].reshape(-1, rows.shape[2]), miss[keys == key].ravel()
        if not own.any():
            continue
        score = own.T @ _without_leverage(own @ half, left)
        meat = meat + np.outer(score, score)
        spread.append(np.einsum("pr,rq->pq", half, own.T @ own @ half).diagonal())
    whole = np.zeros((count, count))
    whole[np.ix_(open_, open_)] = inverse @ meat @ inverse
    freedom = np.full(count, np.inf)
    freedom[open_] = _freedom(np.array(spread), rows.shape[2])
    return Uncertainty(whole * np.outer(scale, scale), freedom, "run" if by_run else "sample")


def _root(matrix: Array) -> Array:
    values, axes = np.linalg.eigh(matrix)
    return axes * np.sqrt(np.maximum(values, 0.0))


def _without_leverage(half: Array, left: Array) -> Array:
    """(1 - H)^-1/2 of the residuals of a cluster, with H = half halfᵀ."""
    axes, values, _ = np.linalg.svd(half, full_matrices=False)
    factor = 1.0 / np.sqrt(np.maximum(1.0 - values**2, 1e-6)) - 1.0
    return left + axes @ (factor * (axes.T @ left))


def _freedom(shares: Array, numbers: int) -> Array:
    """Degrees of freedom: of clusters that share the information evenly, one less than they are.

    Args:
        shares: Share of each cluster in the information on each number, shape (cluster, number).
        numbers: How many there are.
    """
    del numbers
    even = 1.0 / np.maximum((shares**2).sum(axis=0), 1e-12)
    return np.maximum(even.min() - 1.0, 1.0) * np.ones(shares.shape[1])
