"""Samples counted where their tips lie: the cells of a grid, and sectors of directions.

The parts serve the loops of every device. Sums are of whole numbers, so that they depend neither on
the order of the samples nor on blocks and threads.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import minus

SECTORS = 512
"""Sectors of directions along each side of the square that the octahedral map unfolds."""
PARTS = 1 << 20
"""Parts into which a number within [0, 1) is cut before it is summed."""


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
    far = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / farthest
    return (np.uint64(min(far, 1.0) * 4294967295.0) << np.uint64(32)) | np.uint64(sample)


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
