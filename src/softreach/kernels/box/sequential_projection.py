"""Searches for the least change of activation, many at a time: steps between evaluations, starts.

Each step minimizes ½|x - near|² + ½σ|x - γ|² where the linearized map meets the target, inside the
bounds: `box_projection`. It is taken if the change and the weighted miss fall as they should. σ is
what the last step says of the curvature of the Lagrangian, so that steps are those of a secant
method. Searches that end make room for the next. They start from points that lie apart, best first,
and from seeds near a target.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel

NOWHERE = 1e100  # coordinate of tips that do not count
FIRST_PROXIMITY = 0.3
_LEAST_PROXIMITY, _LARGEST_PROXIMITY = -0.7, 1e7
LONGEST_STEP = 0.5  # in ranges
_MET = 1e-2  # part of a miss that may be left where the linearized target is met
_MISS = 1e-9  # in L, that counts as none
_CREDIBLE = 1e4  # penalty above which the multiplier says no more than that nothing meets it
_RESTORING = 1e6  # penalty of a miss where it is not met: nothing else counts
_PROGRESS, _PATIENCE = 0.02, 6  # part of a miss, and steps after which less ends a search
_SHORT = 0.1  # steps that tell the curvature, in ranges
_LEAST_PENALTY = 1000.0  # in merits that are compared
_SOFTNESS, _SOFTNESS_NEARBY = 1e-6, 1e-15  # of the linearized target, in |J|²
_NEARBY = 1e-3  # miss in L


class Running(NamedTuple):
    """Searches side by side, scaled with L, and the step each takes next."""

    row: np.ndarray  # number of the search, (n,), int64
    steps: np.ndarray  # steps it has taken, (n,), int64
    gamma: np.ndarray  # present points [-], (n, m)
    miss: np.ndarray  # (tip - target)/L there, (n, 3)
    slope: np.ndarray  # (∂r/∂γ)/L there, (n, 3, m)
    penalty: np.ndarray  # penalty of a miss of L, beside ½|γ - near|², (n,)
    proximity: np.ndarray  # σ: ½σ|step|² is added to what a step minimizes, (n,)
    reach: np.ndarray  # longest step, in ranges, (n,)
    weight: np.ndarray  # penalty by which the step under trial is judged, (n,)
    gain: np.ndarray  # decrease promised by the step under trial, (n,)
    center: np.ndarray  # least of what the step minimizes without the target [-], (n, m)
    wanted: np.ndarray  # wanted values of the linearized map, (n, 3)
    softness: np.ndarray  # of the linearized target, (n,)
    low: np.ndarray  # lower bounds of the step's end, (n, m)
    high: np.ndarray  # upper bounds of the step's end, (n, m)
    trial: np.ndarray  # activations to evaluate next [-], (n, m)
    multiplier: np.ndarray  # of the linearized target, over 1 + σ, (n, 3)


@kernel
def judge(running, n, tips, ahead, owner, targets, near, box, length, limits, ends):
    """Take in the trials of the first n; set up the next steps and return how many of them go on.

    Trials have tips (n, 3) and ∂r/∂γ `ahead` (n, 3, m); owners (all,) are the targets (t, 3) of all
    searches, which stay near to activations (t, m). `box` holds bounds and ranges, `limits` the
    step in ranges at which a search has settled and the most steps, and `ends` receives
    activations, |tip - target|/L, merits, σ and penalties.
    """
    kept = 0
    for i in range(n):
        row, steps = running.row[i], running.steps[i]
        target = owner[row]
        x = (tips[i, 0] - targets[target, 0]) / length
        y = (tips[i, 1] - targets[target, 1]) / length
        z = (tips[i, 2] - targets[target, 2]) / length
        miss = math.sqrt(x * x + y * y + z * z)
        if steps == 0:
            sigma, reach, ratio = running.proximity[i], running.reach[i], 0.0
            accepted, ended = True, miss * length >= NOWHERE
        else:
            judged = _judged(running, i, miss, ahead, near[target], box[2], length, limits[0])
            accepted, ended, sigma, reach, ratio = judged
        _move(running, i, kept, accepted, (x, y, z), ahead, length)
        if ended or steps >= limits[1]:
            _end(running, i, kept, row, near[target], sigma, ends)
            continue
        running.row[kept], running.steps[kept] = row, steps + 1
        running.penalty[kept], running.proximity[kept] = running.penalty[i], sigma
        running.reach[kept] = reach
        for a in range(3):
            running.multiplier[kept, a] = running.multiplier[i, a] * ratio
        _aim(running, kept, near[target], sigma, reach, box)
        kept += 1
    return kept


@inline
def _judged(running, i, miss, ahead, near, scales, length, settled):
    """Whether a trial is accepted, or its search ended; next σ, reach and ratio of multipliers."""
    weight, sigma, reach, ratio = running.weight[i], running.proximity[i], running.reach[i], 0.0
    after, step, square, bend = weight * miss, 0.0, 0.0, 0.0
    for j in range(len(scales)):
        change = running.trial[i, j] - near[j]
        after += 0.5 * change * change
        moved = running.trial[i, j] - running.gamma[i, j]
        step = max(step, abs(moved) / scales[j])
        square += moved * moved
        for a in range(3):
            turn = ahead[i, a, j] / length - running.slope[i, a, j]
            bend += running.multiplier[i, a] * turn * moved
    gain, gained = running.gain[i], _merit(running, i, near, weight) - after
    accepted = gained >= 0.1 * gain - 1e-14
    ended = step * (1.0 + sigma) < settled
    if accepted:
        reach = min(LONGEST_STEP, 2.0 * reach)
        # A minimum of the distance that is no root is approached ever more slowly.
        stuck = gained < _PROGRESS * weight * miss and running.steps[i] > _PATIENCE
        ended = ended or (weight >= _RESTORING and stuck)
        if weight < _RESTORING and step < _SHORT:
            bend = (1.0 + sigma) * bend / max(square, 1e-300)
            sigma = min(max(bend, _LEAST_PROXIMITY), 4.0 * max(sigma, 0.0) + 1.0)
            ratio = (1.0 + running.proximity[i]) / (1.0 + sigma)
        else:
            sigma = (0.4 if gained >= 0.7 * gain else 1.0) * max(sigma, 0.0)
    elif weight < _RESTORING:
        sigma = 4.0 * max(sigma, 0.0) + 0.1
    else:
        reach = 0.3 * step
    ended = ended or sigma >= _LARGEST_PROXIMITY or reach < settled
    return accepted, ended, sigma, reach, ratio


@inline
def _move(running, i, kept, accepted, miss, ahead, length):
    """Put search i, at its trial if that is accepted, into place `kept`."""
    for j in range(running.gamma.shape[1]):
        running.gamma[kept, j] = running.trial[i, j] if accepted else running.gamma[i, j]
        for a in range(3):
            slope = ahead[i, a, j] / length if accepted else running.slope[i, a, j]
            running.slope[kept, a, j] = slope
    x, y, z = running.miss[i, 0], running.miss[i, 1], running.miss[i, 2]
    if accepted:
        x, y, z = miss
    running.miss[kept, 0], running.miss[kept, 1], running.miss[kept, 2] = x, y, z


@inline
def _end(running, i, kept, row, near, sigma, ends):
    """Write where a search ended."""
    gamma, residual, merit, proximity, penalties = ends
    x, y, z = running.miss[kept, 0], running.miss[kept, 1], running.miss[kept, 2]
    for j in range(gamma.shape[1]):
        gamma[row, j] = running.gamma[kept, j]
    residual[row] = math.sqrt(x * x + y * y + z * z)
    merit[row] = _merit(running, kept, near, _LEAST_PENALTY)
    proximity[row], penalties[row] = sigma, running.penalty[i]


@inline
def _aim(running, kept, near, sigma, reach, box):
    """Set up what the next step minimizes, and the linearized target."""
    low, high, scales = box
    square = 0.0
    for a in range(3):
        running.wanted[kept, a] = -running.miss[kept, a]
        for j in range(len(low)):
            slope = running.slope[kept, a, j]
            square += slope * slope
            running.wanted[kept, a] += slope * running.gamma[kept, j]
    x, y, z = running.miss[kept, 0], running.miss[kept, 1], running.miss[kept, 2]
    nearby = x * x + y * y + z * z < _NEARBY * _NEARBY
    running.softness[kept] = (_SOFTNESS_NEARBY if nearby else _SOFTNESS) * square + 1e-30
    for j in range(len(low)):
        at, farthest = running.gamma[kept, j], reach * scales[j]
        running.center[kept, j] = (near[j] + sigma * at) / (1.0 + sigma)
        running.low[kept, j] = max(low[j], at - farthest)
        running.high[kept, j] = min(high[j], at + farthest)


@inline
def _merit(running, i, near, penalty):
    """½|γ - near|² + penalty·|miss| where a search is."""
    x, y, z = running.miss[i, 0], running.miss[i, 1], running.miss[i, 2]
    merit = penalty * math.sqrt(x * x + y * y + z * z)
    for j in range(running.gamma.shape[1]):
        change = running.gamma[i, j] - near[j]
        merit += 0.5 * change * change
    return merit


@kernel
def next_trials(running, n, owner, near):
    """Decrease promised by the steps of the first n, with the penalty of their multipliers."""
    for i in range(n):
        target, foreseen = owner[running.row[i]], 0.0
        x, y, z = running.miss[i, 0], running.miss[i, 1], running.miss[i, 2]
        before = math.sqrt(x * x + y * y + z * z)
        for j in range(running.gamma.shape[1]):
            moved = running.trial[i, j] - running.gamma[i, j]
            change = running.trial[i, j] - near[target, j]
            foreseen += 0.5 * change * change + 0.5 * running.proximity[i] * moved * moved
            x += running.slope[i, 0, j] * moved
            y += running.slope[i, 1, j] * moved
            z += running.slope[i, 2, j] * moved
        ahead = math.sqrt(x * x + y * y + z * z)
        x, y, z = running.multiplier[i, 0], running.multiplier[i, 1], running.multiplier[i, 2]
        asked = 1.5 * (1.0 + running.proximity[i]) * math.sqrt(x * x + y * y + z * z)
        if ahead <= max(_MET * before, _MISS) and asked < _CREDIBLE:
            weight = max(running.penalty[i], asked)
            running.penalty[i] = weight
        else:
            weight = _RESTORING
            for a in range(3):
                running.multiplier[i, a] = 0.0
        foreseen += weight * ahead
        running.weight[i] = weight
        running.gain[i] = _merit(running, i, near[target], weight) - foreseen


MOST_IN_BINS = 1024  # seeds that are looked at for one target, a power of two
_NEAR_ENOUGH = 0.1  # part of the squared way to a target that may be left
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
    keys[0, i] = key + (_FAR if left > _NEAR_ENOUGH * square or step > _LONG else 0.0)
    keys[1, i] = plain
