"""Choosing points that lie apart, best first, and starts among seeds near a target."""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel

__all__ = ["choose_apart", "choose_in_bins"]

_MET = 0.1  # part of the squared way to a target that may be left
_LONG = 0.4  # step, in ranges, of which the linear map says little
_FAR = 1e6


@kernel
def choose_apart(points, scales, most, least_distance, chosen):
    """Choose each point that lies apart from those chosen before it, until there are `most`.

    Args:
        points: Candidates of each set, best first, shape (t, k, m).
        scales: By which distances along each axis are measured, shape (m,).
        most: Largest number of one set.
        least_distance: The largest component of the distance between two is to exceed it.
        chosen: Whether each is chosen, shape (t, k).
    """
    for t in range(points.shape[0]):
        count = 0
        for k in range(points.shape[1]):
            apart = count < most
            for i in range(k):
                if not apart:
                    break
                if chosen[t, i]:
                    distance = 0.0
                    for j in range(points.shape[2]):
                        distance = max(distance, abs(points[t, i, j] - points[t, k, j]) / scales[j])
                    apart = distance > least_distance
            chosen[t, k] = apart
            count += apart


@kernel
def choose_in_bins(  # noqa: C901
    seeds, first, grid, targets, near, box, wanted, least_distance, moves, room, starts
):
    """Choose starts from seeds with tips near each target: those nearest to an activation.

    Looks at the bin of the target and its neighbors, in ever wider shells until there are enough.

    Args:
        seeds: Bin by bin: activations (n, m), tips [m] (n, 3), slopes in ranges [m] (n, 3, m) and
            the inverses of their Gram matrices (n, 3, 3).
        first: The first row of each bin, and n, shape (bins + 1,).
        grid: Corner of the first bin [m], shape (3,); width of the bins [m]; their numbers along x,
            y and z.
        targets: Shape (t, 3) [m].
        near: Activations to which the chosen are nearest, shape (t, m).
        box: Lower and upper bounds and ranges, shape (m,) each.
        wanted: Seeds to look at, at least.
        least_distance: The largest component of the distance between two chosen is to exceed it.
        moves: Whether each seed is moved to where its linearized tip meets the target, as far as
            the bounds allow; those that come there without a long way are before those that do not.
        room: Scratch for keys and rows of seeds, shape (most,) each, and an activation; of more
            seeds, some are left out.
        starts: Chosen activations, NaN for none, shape (t, chosen, m).
    """
    corner, width, (nx, ny, nz) = grid
    scales = box[2]
    keys, heap, moved = room
    widest = max(nx, ny, nz)
    for t in range(targets.shape[0]):
        x = int(min(max((targets[t, 0] - corner[0]) / width, 0.0), nx - 1.0))
        y = int(min(max((targets[t, 1] - corner[1]) / width, 0.0), ny - 1.0))
        z = int(min(max((targets[t, 2] - corner[2]) / width, 0.0), nz - 1.0))
        reach, total = 0, 0
        while reach == 0 or (total < wanted and reach < widest):
            reach, total = reach + 1, 0
            for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
                for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
                    line = (i * ny + j) * nz
                    below, above = max(z - reach, 0), min(z + reach + 1, nz)
                    total += first[line + above] - first[line + below]
        stride, skip, count = 1 + total // len(keys), 0, 0
        for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
            for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
                line = (i * ny + j) * nz
                below, above = max(z - reach, 0), min(z + reach + 1, nz)
                for row in range(first[line + below], first[line + above]):
                    skip += 1
                    if skip < stride:
                        continue
                    skip = 0
                    keys[count] = _moved(seeds, row, targets, near, t, box, moves, moved)
                    heap[count] = row
                    count += 1
        for start in range(count // 2 - 1, -1, -1):
            _sift(keys, heap, start, count)
        chosen = 0
        starts[t] = math.nan
        while count > 0 and chosen < starts.shape[1]:
            row, apart = heap[0], True
            count -= 1
            keys[0], heap[0] = keys[count], heap[count]
            _sift(keys, heap, 0, count)
            _moved(seeds, row, targets, near, t, box, moves, moved)
            for slot in range(chosen):
                if apart:
                    distance = 0.0
                    for k in range(len(moved)):
                        distance = max(distance, abs(moved[k] - starts[t, slot, k]) / scales[k])
                    apart = distance > least_distance
            if apart:
                starts[t, chosen] = moved
                chosen += 1


@inline
def _moved(seeds, row, targets, near, t, box, moves, moved):
    """Move a seed if it `moves`; what it is to be sorted by."""
    gamma, tips, slopes, inverses = seeds
    low, high, scales = box
    x, y, z = (
        targets[t, 0] - tips[row, 0],
        targets[t, 1] - tips[row, 1],
        targets[t, 2] - tips[row, 2],
    )
    square = x * x + y * y + z * z
    a = inverses[row, 0, 0] * x + inverses[row, 0, 1] * y + inverses[row, 0, 2] * z
    b = inverses[row, 1, 0] * x + inverses[row, 1, 1] * y + inverses[row, 1, 2] * z
    c = inverses[row, 2, 0] * x + inverses[row, 2, 1] * y + inverses[row, 2, 2] * z
    key, step = 0.0, 0.0
    for k in range(gamma.shape[1]):
        u, v, w = slopes[row, 0, k], slopes[row, 1, k], slopes[row, 2, k]
        at = gamma[row, k]
        end = min(max(at + scales[k] * (u * a + v * b + w * c), low[k]), high[k]) if moves else at
        way = (end - at) / scales[k]
        x -= u * way
        y -= v * way
        z -= w * way
        step = max(step, abs(way))
        moved[k] = end
        key += (end - near[t, k]) ** 2
    left = x * x + y * y + z * z
    return key + (_FAR if moves and (left > _MET * square or step > _LONG) else 0.0)


@inline
def _sift(keys, heap, start, count):
    """Let an entry of a heap of the least sink to its place."""
    at = start
    while True:
        child = 2 * at + 1
        if child >= count:
            return
        if child + 1 < count and keys[child + 1] < keys[child]:
            child += 1
        if keys[at] <= keys[child]:
            return
        keys[at], keys[child] = keys[child], keys[at]
        heap[at], heap[child] = heap[child], heap[at]
        at = child
