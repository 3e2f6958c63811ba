"""Activations all over the box with their tips: where searches for a minimum begin."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from softreach.kernels.box.sequential_projection import MOST_IN_BINS, choose_apart, choose_in_bins
from softreach.rod.tip_map import TipMap, no_equilibrium
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arrays import Array, Index
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_MOST = 150_000  # seeds on a grid of the box
_DIMENSIONS = 6  # from which on a grid is too coarse to be worth more than a low-discrepancy set
_SOBOL = 1 << 17
_FACE_DIMENSION = 2  # of faces whose images bound the reachable set
_MOST_ON_FACES = 60_000
_SEED = 0
_CANDIDATES = 24
_STARTS = 3
_IN_BIN, _BINS = 4, 512  # seeds in a bin, roughly, and the most bins along an axis
_BLOCK = 256
_DAMPING = 1e-5  # of a Gram matrix, part of its trace
_APART = 0.15  # of the ranges: two starts lead to different minima

_Grid = tuple[Array, float, tuple[int, int, int]]


class Seeds:
    """Activations with known tips."""

    def __init__(self, gamma: Array, tip: Array, coarse: TipMap) -> None:
        """Keep activations (n, m) and their tips (n, 3) [m], and a map by which seeds are moved."""
        self.gamma, self.tip, self.scales, self._coarse = gamma, tip, coarse.box.scales, coarse

    @lazy
    def tree(self) -> KDTree:
        """The tips."""
        from scipy.spatial import KDTree

        return KDTree(self.tip)

    @lazy
    def _bins(self) -> tuple[np.ndarray, Index, _Grid]:
        """Seeds bin by bin of their tips, the first row of each bin, and the bins."""
        corner, extent = self.tip.min(axis=0), np.ptp(self.tip, axis=0)
        extent = np.maximum(extent, 1e-3 * extent.max() + 1e-300)
        width = float(np.cbrt(extent.prod() * _IN_BIN / len(self.tip)))
        width = max(width, float(extent.max()) / _BINS)
        nx, ny, nz = (int(n) for n in extent // width + 1)
        place = (self.tip - corner) / width
        bins, count = _bins_of(place, (nx, ny, nz)), nx * ny * nz
        first = np.zeros(count + 1, np.int64)
        first[1:] = np.bincount(bins, minlength=count).cumsum()
        order = bins.argsort(kind="stable")
        gamma, place = self.gamma[order], place[order]
        slope = self._coarse.tips_and_slopes(gamma)[1] * (self.scales / width)
        gram = np.einsum("nij,nkj->nik", slope, slope)
        size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
        # Slack tendons move no tip, so that nothing is moved to a target there.
        inverse = np.linalg.inv(gram + np.where(size == 0.0, 1.0, _DAMPING * size) * np.eye(3))
        half = inverse[:, *np.tril_indices(3)]
        columns = np.concatenate([gamma, place, slope.reshape(len(gamma), -1), half], axis=1)
        return columns.astype(np.float32), first, (corner, width, (nx, ny, nz))

    def near(
        self, targets: Array, near: Array, count: int, most: int, least_distance: float
    ) -> tuple[Index, Array]:
        """Numbers of targets (t, 3) [m], and seeds with tips nearby, closest to activations (t, m).

        Chosen twice: after each is moved to where its linearized tip meets the target, and as they
        are. At least `count` are looked at; of either kind a target gets `most` that lie apart.
        """
        seeds, first, (corner, width, shape) = self._bins
        places, m = (targets - corner) / width, near.shape[1]
        # Targets that follow each other look at the same seeds.
        order = _bins_of(places, shape).argsort(kind="stable")
        places, near = places[order], near[order]
        starts = np.empty((len(targets), 2, most, m))
        limits = self._coarse.box
        box = limits.low.copy(), limits.high.copy(), limits.scales.copy()

        def task(block: slice) -> None:
            keys = np.empty((2, MOST_IN_BINS))
            # Longer than a power of two, as columns would share places in the cache.
            ends = np.empty((2, m, MOST_IN_BINS + 8))
            numbers = (keys, keys.view(np.int64)), np.empty(MOST_IN_BINS)
            room = np.empty(MOST_IN_BINS, np.int64), ends, *numbers
            wanted = near[block], box, count, least_distance, room
            choose_in_bins(seeds, first, shape, places[block], *wanted, starts[block])

        parallel.run(partial(task, block) for block in parallel.blocks(len(targets), _BLOCK))
        starts[order] = starts.copy()
        owner, kind, slot = np.nonzero(~np.isnan(starts[..., 0]))
        return owner, starts[owner, kind, slot]

    def nearest(self, targets: Array, count: int = _CANDIDATES) -> Array:
        """Activations whose tips are nearest to each target, nearest first, (t, count, m)."""
        count = min(count, len(self.tip))
        rows = np.asarray(self.tree.query(targets, k=count)[1], np.int64)
        return self.gamma[rows.reshape(-1, count)]

    def starts(
        self, candidates: Array, most: int = _STARTS, least_distance: float = _APART
    ) -> tuple[Index, Array]:
        """Numbers of targets and a few candidates (t, k, m) of each, best first, that lie apart."""
        chosen = np.zeros(candidates.shape[:2], bool)
        choose_apart(candidates, self.scales, most, least_distance, chosen)
        return np.nonzero(chosen)[0], candidates[chosen]


def _bins_of(places: Array, shape: tuple[int, int, int]) -> Index:
    """Number of the bin of each place (n, 3) in widths, or of the bin nearest to it."""
    bins = np.clip(places, 0.0, np.array(shape) - 1.0).astype(np.int64)
    return bins @ np.array([shape[1] * shape[2], shape[2], 1])


def seeds(tip_map: TipMap, coarse: TipMap) -> Seeds:
    """Seeds on a grid over the box, or a low-discrepancy set where a grid is too coarse."""
    box, m = tip_map.box, tip_map.box.dimension
    if m == 0:
        gamma = np.empty((1, 0))
    elif m <= _DIMENSIONS:
        gamma = box.from_cube(np.array(sample_cube("grid", int(_MOST ** (1 / m)) ** m, m)))
    else:
        gamma = box.from_cube(np.array(sample_cube("sobol", _SOBOL, m)))
    samples = _with_tips(tip_map, gamma, coarse)
    if not len(samples.gamma):
        raise no_equilibrium(len(gamma))
    return samples


def face_seeds(tip_map: TipMap, coarse: TipMap) -> Seeds:
    """Seeds at corners of the box, on edges, and on faces with two free bundles."""
    box, m = tip_map.box, tip_map.box.dimension
    rng, count = np.random.default_rng(_SEED), _MOST_ON_FACES
    corner = rng.integers(0, 2, (count, m)).astype(float)
    dimension = rng.integers(0, min(m, _FACE_DIMENSION) + 1, count)
    free = rng.random((count, m)).argsort(axis=1).argsort(axis=1) < dimension[:, None]
    gamma = box.from_cube(np.where(free, rng.random((count, m)), corner))
    return _with_tips(tip_map, gamma, coarse)


def _with_tips(tip_map: TipMap, gamma: Array, coarse: TipMap) -> Seeds:
    tip = tip_map.tips(gamma)
    known = np.isfinite(tip[:, 0])
    return Seeds(gamma[known], tip[known], coarse)
