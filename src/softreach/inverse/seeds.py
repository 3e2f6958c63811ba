"""Activations all over the box with their tips: where searches for a minimum begin."""

from __future__ import annotations

import numpy as np

from softreach.kernels.branches.spread import choose_apart
from softreach.rod.tip_map import TipMap, no_stable_equilibrium
from softreach.sampling import sample_cube
from softreach.support.arrays import Array, Index

__all__ = ["Seeds", "face_seeds", "seeds"]


_MOST = 150_000  # seeds on a grid of the box
_DIMENSIONS = 6  # from which on a grid is too coarse to be worth more than a low-discrepancy set
_SOBOL = 1 << 17
_FACE_DIMENSION = 2  # of faces whose images bound the reachable set
_MOST_ON_FACES = 60_000
_SEED = 0
_CANDIDATES = 24
_STARTS = 3
_APART = 0.15  # of the ranges: two starts lead to different minima


class Seeds:
    """Activations with known tips."""

    def __init__(self, gamma: Array, tip: Array, scales: Array) -> None:
        """Index the tips.

        Args:
            gamma: Activations [-], shape (n, m).
            tip: Their tips [m], shape (n, 3).
            scales: By which distances of activations are measured, shape (m,).
        """
        from scipy.spatial import KDTree

        self.gamma, self.tip, self.scales = gamma, tip, scales
        self.tree = KDTree(tip)

    def nearest(self, targets: Array, count: int = _CANDIDATES) -> Array:
        """Activations whose tips are nearest to each target, nearest first, (t, count, m)."""
        count = min(count, len(self.tip))
        rows = np.asarray(self.tree.query(targets, k=count)[1], np.int64)
        return self.gamma[rows.reshape(-1, count)]

    def starts(
        self, candidates: Array, most: int = _STARTS, least_distance: float = _APART
    ) -> tuple[Index, Array]:
        """A few candidates for each target that lie far from each other in the box.

        Args:
            candidates: Activations for each target, best first, shape (t, k, m).
            most: Largest number for one target.
            least_distance: Between any two, in ranges.

        Returns:
            Number of the target and activation of each start, sorted by target.
        """
        chosen = np.zeros(candidates.shape[:2], bool)
        choose_apart(candidates, self.scales, most, least_distance, chosen)
        return np.nonzero(chosen)[0], candidates[chosen]


def seeds(rod: TipMap) -> Seeds:
    """Seeds on a grid over the box, or a low-discrepancy set where a grid is too coarse."""
    box, m = rod.box, rod.box.dimension
    if m == 0:
        gamma = np.empty((1, 0))
    elif m <= _DIMENSIONS:
        gamma = box.from_cube(np.array(sample_cube("grid", int(_MOST ** (1 / m)) ** m, m)))
    else:
        gamma = box.from_cube(np.array(sample_cube("sobol", _SOBOL, m)))
    samples = _with_tips(rod, gamma)
    if not len(samples.gamma):
        raise no_stable_equilibrium(len(gamma))
    return samples


def face_seeds(rod: TipMap) -> Seeds:
    """Seeds at corners of the box, on edges, and on faces with two free bundles."""
    box, m = rod.box, rod.box.dimension
    rng, count = np.random.default_rng(_SEED), _MOST_ON_FACES
    corner = rng.integers(0, 2, (count, m)).astype(float)
    dimension = rng.integers(0, min(m, _FACE_DIMENSION) + 1, count)
    free = rng.random((count, m)).argsort(axis=1).argsort(axis=1) < dimension[:, None]
    gamma = box.from_cube(np.where(free, rng.random((count, m)), corner))
    return _with_tips(rod, gamma)


def _with_tips(rod: TipMap, gamma: Array) -> Seeds:
    """Seeds at those activations that have a stable equilibrium."""
    tip = rod.tips(gamma)
    if rod.supports_unstable:
        known = np.isfinite(tip[:, 0])
        gamma, tip = gamma[known], tip[known]
    return Seeds(gamma, tip, rod.box.scales)
