"""Choosing points that lie apart, best first, and starts among seeds near a target."""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel

MOST_IN_BINS = 1024  # seeds that are looked at for one target, a power of two
_MET = 0.1  # part of the squared way to a target that may be left
_LONG = 0.4  # step, in ranges, of which the linear map says little
_FAR = 1e6
_GONE = (1 << 63) - 1  # key of what counts no more


@kernel
def choose_apart(points, scales, most, least_distance, chosen):
    """Choose (t, k) of points (t, k, m), best first, those that lie apart, up to `most` of a set.

    The largest component of the distance, over `scales` (m,), is to exceed the least one.
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
def choose_in_bins(seeds, first, shape, targets, near, box, wanted, least_distance, room, starts):
    """Choose starts from seeds with tips near each target: those nearest to an activation.

    Looks at the bin of the target and its neighbors, in ever wider shells until there are enough,
    and chooses twice: from seeds moved to where their linearized tip meets the target, as far as
    the bounds allow, where those that come there without a long way are before those that do not;
    and from seeds as they are.

    Seeds (n, 4 m + 9) come bin by bin: activation, tip, slopes in ranges by axis, and the lower
    half of the inverse of their Gram matrix; lengths are in widths of a bin, from the corner of the
    first, and so are targets (t, 3). `first` (bins + 1,) holds the first row of each bin, `near`
    (t, m) the activations to be near to, `box` bounds and ranges; `wanted` seeds are looked at.
    `room` is scratch for rows, moved and other ends, their keys as numbers and as integers in the
    same order, and distances; `starts` (t, 2, chosen, m) is NaN for none.
    """
    rows, ends, (keys, ordered), away = room
    for t in range(targets.shape[0]):
        count = _looked_at(first, shape, targets[t], wanted, rows)
        for i in range(count):
            _moved(seeds[rows[i]], i, targets[t], near[t], box, ends, keys)
        for kind in range(2):
            _choose(ordered[kind], ends[kind], count, box[2], least_distance, away, starts[t, kind])


@inline
def _looked_at(first, shape, target, wanted, rows):
    """Write the rows of the seeds in bins around a target, or of some of them; their number."""
    nx, ny, nz = shape
    x = int(min(max(target[0], 0.0), nx - 1.0))
    y = int(min(max(target[1], 0.0), ny - 1.0))
    z = int(min(max(target[2], 0.0), nz - 1.0))
    reach, total, widest = 0, 0, max(nx, ny, nz)
    while reach == 0 or (total < wanted and reach < widest):
        reach, total = reach + 1, 0
        for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
            for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
                line = (i * ny + j) * nz
                below, above = max(z - reach, 0), min(z + reach + 1, nz)
                total += first[line + above] - first[line + below]
    stride, count = 1 + total // len(rows), 0
    ahead = stride - 1  # rows to pass by
    for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
        for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
            line = (i * ny + j) * nz
            row = first[line + max(z - reach, 0)] + ahead
            last = first[line + min(z + reach + 1, nz)]
            while row < last:
                rows[count] = row
                count += 1
                row += stride
            ahead = row - last
    return count


@inline
def _choose(keys, ends, count, scales, least_distance, away, starts):
    """Choose the ends of least keys that lie apart; keys of those that do not are lost."""
    for i in range(count):
        keys[i] = keys[i] & ~(MOST_IN_BINS - 1) | i
    starts[:] = math.nan
    chosen = 0
    while chosen < starts.shape[0]:
        least = _GONE
        for i in range(count):
            least = min(least, keys[i])
        if least == _GONE:
            return
        best = least & (MOST_IN_BINS - 1)
        keys[best] = _GONE
        beside = _beside(ends, best, scales, least_distance, starts, chosen)
        if beside < chosen:
            _pass_by(keys, ends, count, scales, least_distance, away, starts[beside])
        else:
            for k in range(len(scales)):
                starts[chosen, k] = ends[k, best]
            chosen += 1


@inline
def _beside(ends, i, scales, least_distance, starts, chosen):
    """The first of those chosen from which an end does not lie apart; `chosen` if from all."""
    for slot in range(chosen):
        distance = 0.0
        for k in range(len(scales)):
            distance = max(distance, abs(ends[k, i] - starts[slot, k]) / scales[k])
        if distance <= least_distance:
            return slot
    return chosen


@inline
def _pass_by(keys, ends, count, scales, least_distance, away, start):
    """Lose the keys of all that lie near to a start: where one does, many do."""
    for i in range(count):
        away[i] = 0.0
    for k in range(len(scales)):
        at, scale = start[k], 1.0 / scales[k]
        for i in range(count):
            away[i] = max(away[i], abs(ends[k, i] - at) * scale)
    for i in range(count):
        keys[i] = keys[i] if away[i] > least_distance else _GONE


@inline
def _moved(seed, i, target, near, box, ends, keys):
    """Write a seed, moved and as it is, to column i, and what they are to be sorted by."""
    low, high, scales = box
    m = len(near)
    tip, slope, inverse = seed[m : m + 3], seed[m + 3 : 4 * m + 3], seed[4 * m + 3 :]
    x, y, z = target[0] - tip[0], target[1] - tip[1], target[2] - tip[2]
    square = x * x + y * y + z * z
    a = inverse[0] * x + inverse[1] * y + inverse[3] * z
    b = inverse[1] * x + inverse[2] * y + inverse[4] * z
    c = inverse[3] * x + inverse[4] * y + inverse[5] * z
    key, plain, step = 0.0, 0.0, 0.0
    for k in range(m):
        u, v, w = slope[k], slope[m + k], slope[2 * m + k]
        at = min(max(float(seed[k]), low[k]), high[k])  # rounded
        end = min(max(at + scales[k] * (u * a + v * b + w * c), low[k]), high[k])
        way = (end - at) / scales[k]
        x -= u * way
        y -= v * way
        z -= w * way
        step = max(step, abs(way))
        ends[0, k, i], ends[1, k, i] = end, at
        key += (end - near[k]) ** 2
        plain += (at - near[k]) ** 2
    left = x * x + y * y + z * z
    keys[0, i] = key + (_FAR if left > _MET * square or step > _LONG else 0.0)
    keys[1, i] = plain
