"""Uncertainty of fitted numbers, by clusters of residuals that may share errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.calibration.fit import SAME, Fit, robust_width
from softreach.calibration.measurements import Measurements
from softreach.support.arrays import Array, Mask

FEWEST_RUNS = 8  # Runs from which these share errors and are held out, not samples
_SEEN = 0.1  # least share of a variance that the residuals would show if they were plain noise
_VAGUE = 30.0  # Standard deviation, in changes that matter, of what the data does not tell


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of the fitted numbers."""

    covariance: Array
    """Of what the data tells, shape (number, number)."""
    told: Mask
    """False for a number that the data does not tell at the end of the fit, of which no residuals
    are left to say how well, or which is at a bound; shape (number,)."""
    freedom: Array
    """Degrees of freedom of the interval of each number, shape (number,)."""
    clusters: str
    """"run" or "sample": what shares errors."""

    @property
    def sigma(self) -> Array:
        """Standard deviations, infinite for what the data does not tell, shape (number,)."""
        return np.where(self.told, np.sqrt(np.diag(self.covariance)), np.inf)

    @property
    def correlation(self) -> Array:
        """Shape (number, number)."""
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
    slopes = fit.prediction.slopes
    free = ~fit.at_bound
    count = len(fit.values)
    scale = np.maximum(fit.free.scale, 0.1 * np.abs(fit.values))
    weight = np.sqrt(fit.weights)[..., None]
    seen = (fit.weights > 0) & np.isfinite(slopes).all(axis=(2, 3))
    rows = np.where(seen[..., None, None], weight[..., None] * slopes * scale, 0.0)
    miss = np.where(seen[..., None], weight * fit.residuals, 0.0)
    by_run = len(data.run_names) >= max(FEWEST_RUNS, 2 * count)
    keys = data.runs if by_run else np.arange(len(data))
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
    by = "run" if by_run else "sample"
    return Uncertainty(whole * np.outer(scale, scale), told, degrees, by)


def _bent(fit: Fit, seen: Mask, scale: Array) -> Array:
    """Difference between the second derivatives of a robust loss and of weighted squares.

    Of 2W²(√(1 + d²/W²) - 1) in the distance d of a place it is w - w (1 - w²) along the residual,
    with w = 1/√(1 + d²/W²).
    """
    slopes, weight = fit.prediction.slopes, fit.weights
    square = np.where(seen, (fit.residuals**2).sum(axis=2), 0.0)
    share = np.divide(
        weight * (1.0 - weight**2), square, out=np.zeros_like(square), where=square > 0
    )
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
