"""Samples drawn by their numbers, and counted where their tips lie: in cells and in sectors.

Number i of a seed is that of SplitMix64 [Steele2014], whose state after i steps is the seed plus i
times an odd constant, so that it needs no number before it. Sums are of whole numbers. So neither
the device nor blocks, threads and the order of samples change a result.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import dot, minus

SECTORS = 512
"""Sectors of directions along each side of the square that the octahedral map unfolds."""
PARTS = 1 << 20
"""Parts into which a number within [0, 1) is cut before it is summed."""
_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_27, _30, _31, _11 = np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(11)
_UNIT = 2.0**-53


@inline
def uniform(seed, i):
    """Number i [-] of a seed, both uint64."""
    z = seed + (i + np.uint64(1)) * _STEP
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return np.float64((z ^ (z >> _31)) >> _11) * _UNIT


@inline
def cell_of(point, corner, edge, shape):
    """Number of the cell that holds a point, in C order; -1 outside the grid."""
    i = math.floor(point[0] / edge) - corner[0]
    j = math.floor(point[1] / edge) - corner[1]
    k = math.floor(point[2] / edge) - corner[2]
    if 0 <= i < shape[0] and 0 <= j < shape[1] and 0 <= k < shape[2]:
        return (np.int64(i) * shape[1] + np.int64(j)) * shape[2] + np.int64(k)
    return np.int64(-1)


@inline
def sector_of(v):
    """Sector of a direction: the octahedron |x| + |y| + |z| = 1, its lower half folded outward."""
    size = abs(v[0]) + abs(v[1]) + abs(v[2])
    if not size > 0.0:
        return np.int64(0)
    p, q = v[0] / size, v[1] / size
    if v[2] < 0.0:
        p, q = math.copysign(1.0 - abs(q), p), math.copysign(1.0 - abs(p), q)
    column = min(np.int64(0.5 * (p + 1.0) * SECTORS), SECTORS - 1)
    row = min(np.int64(0.5 * (q + 1.0) * SECTORS), SECTORS - 1)
    return row * SECTORS + column


@inline
def rank_of(v, farthest, sample):
    """Distance over `farthest` in the upper 32 bits, the number of a sample in the lower ones."""
    far = math.sqrt(dot(v, v)) / farthest
    return (np.uint64(min(far, 1.0) * 4294967295.0) << np.uint64(32)) | np.uint64(sample)


@kernel
def fill(seed, numbers, out):
    """Put the points of the unit cube with these numbers into place, shape (n, dim)."""
    n, dim = out.shape
    for i in range(n):
        for j in range(dim):
            out[i, j] = uniform(seed, numbers[i] * np.uint64(dim) + np.uint64(j))


@kernel
def tally(tips, cube, samples, weights, grid, shape, counts, sums, ranks):
    """Add tips (n, 3) of points (n, dim) of the cube and their numbers within a block.

    Args:
        tips: Finite ones [m].
        cube: Points of the unit cube [-].
        samples: Numbers of the samples, below 2^32.
        weights: Of the square of each coordinate of the cube, of sum 1 at most.
        grid: Lower corner in edges, edge [m], center of directions [m], largest distance [m].
        shape: Cells along each axis.
        counts: Samples of each cell.
        sums: Of each coordinate and of the weighted squares, in `PARTS`, of each cell; or empty.
        ranks: The largest `rank_of` in each sector.
    """
    corner, center = (grid[0], grid[1], grid[2]), (grid[4], grid[5], grid[6])
    for i in range(tips.shape[0]):
        point = tips[i, 0], tips[i, 1], tips[i, 2]
        v = minus(point, center)
        sector, rank = sector_of(v), rank_of(v, grid[7], samples[i])
        ranks[sector] = max(ranks[sector], rank)
        cell = cell_of(point, corner, grid[3], shape)
        if cell < 0:
            continue
        counts[cell] += 1
        square = 0.0
        for j in range(cube.shape[1]):
            sums[cell, j] += np.int64(cube[i, j] * PARTS)
            square += weights[j] * cube[i, j] * cube[i, j]
        sums[cell, cube.shape[1]] += np.int64(square * PARTS)
