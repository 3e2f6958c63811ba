"""Choosing points that lie apart, best first."""

from __future__ import annotations

from softreach.kernels.compiler import inline, kernel

__all__ = ["choose_apart", "choose_in_bins"]


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
def choose_in_bins(points, first, grid, targets, near, scales, wanted, least_distance, room, rows):  # noqa: C901
    """Choose seeds with tips near each target: those nearest to an activation, that lie apart.

    Looks at the bin of the target and its neighbors, in ever wider shells until there are enough.

    Args:
        points: Activations, bin by bin, shape (n, m).
        first: The first row of each bin, and n, shape (bins + 1,).
        grid: Corner of the first bin [m], shape (3,); width of the bins [m]; their numbers along x,
            y and z.
        targets: Shape (t, 3) [m].
        near: Activations to which the chosen are nearest, shape (t, m).
        scales: By which distances along each axis are measured, shape (m,).
        wanted: Seeds to look at, at least.
        least_distance: The largest component of the distance between two chosen is to exceed it.
        room: Scratch for keys and rows of seeds, shape (most,) each; of more, some are left out.
        rows: Chosen rows, -1 for none, shape (t, chosen).
    """
    corner, width, (nx, ny, nz) = grid
    keys, heap = room
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
                    low, high = max(z - reach, 0), min(z + reach + 1, nz)
                    total += first[line + high] - first[line + low]
        stride, skip, count = 1 + total // len(keys), 0, 0
        for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
            for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
                line = (i * ny + j) * nz
                low, high = max(z - reach, 0), min(z + reach + 1, nz)
                for row in range(first[line + low], first[line + high]):
                    skip += 1
                    if skip < stride:
                        continue
                    skip, key = 0, 0.0
                    for k in range(points.shape[1]):
                        key += (points[row, k] - near[t, k]) ** 2
                    keys[count], heap[count] = key, row
                    count += 1
        for start in range(count // 2 - 1, -1, -1):
            _sift(keys, heap, start, count)
        chosen = 0
        for slot in range(rows.shape[1]):
            rows[t, slot] = -1
        while count > 0 and chosen < rows.shape[1]:
            row, apart = heap[0], True
            count -= 1
            keys[0], heap[0] = keys[count], heap[count]
            _sift(keys, heap, 0, count)
            for slot in range(chosen):
                if apart:
                    distance = 0.0
                    for k in range(points.shape[1]):
                        other = points[rows[t, slot], k]
                        distance = max(distance, abs(points[row, k] - other) / scales[k])
                    apart = distance > least_distance
            if apart:
                rows[t, chosen] = row
                chosen += 1


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
