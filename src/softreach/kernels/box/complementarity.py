"""Linear complementarity problems of symmetric matrices, for many right-hand sides at a time.

x >= 0 with A x - b >= 0 and x·(A x - b) = 0 is the minimum of ½ x·A x - b·x over x >= 0, for A
positive semidefinite. The active set of Lawson and Hanson finds it exactly: every exchange lowers
the function to its minimum on a face that it has not been on before, and there are finitely many
faces. Each sample starts from x = 0, so that it does not depend on those beside it.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

_ROUNDING = 1e-13  # of the terms of A x - b
_BARRED = 2
_SINGULAR = 1e-11  # of a diagonal element, below which a pivot is rounding


@kernel
def complementary(matrix, wanted, out, active, solved):
    """Write x into `out` (n, m), whether each may differ from 0 into `active`, and its success.

    Of matrices A (n, m, m), or (1, m, m) for all, and b (n, m). A function without a minimum, as
    where A x = 0 has solutions x >= 0 but 0, is not solved; `active` and `solved` are of int8.
    """
    count = wanted.shape[1]
    factor, solution = np.zeros((count, count)), np.zeros(count)
    order, null = np.zeros(count, np.int64), np.zeros(count)
    for n in range(wanted.shape[0]):
        a = matrix[n if matrix.shape[0] > 1 else 0]
        room = factor, solution, order, null
        solved[n] = _minimized(a, wanted[n], out[n], active[n], room)


@inline
def _minimized(a, b, x, free, room):
    """Minimize over x >= 0; 0 without a minimum."""
    size = _zeroed(x, free)
    for _ in range(10 * b.size + 10):
        entering = _most_violated(a, b, x, free)
        if entering < 0:
            _admit(free)
            return 1
        free[entering] = 1
        room[2][size] = entering
        size = _descended(a, b, x, free, size, room)
        if size < 0:
            break
        if free[entering] == 1:
            _admit(free)
    return 0


@inline
def _zeroed(x, free):
    for j in range(x.size):
        x[j] = 0.0
        free[j] = 0
    return 0


@inline
def _admit(free):
    for j in range(free.size):
        if free[j] == _BARRED:
            free[j] = 0


@inline
def _most_violated(a, b, x, free):
    """The variable at 0 along which the function falls most; -1 at the minimum."""
    best, entering = 0.0, -1
    for j in range(b.size):
        if free[j] == 0:
            slope, terms = b[j], abs(b[j])
            for i in range(b.size):
                slope -= a[j, i] * x[i]
                terms += abs(a[j, i] * x[i])
            gain = slope / math.sqrt(a[j, j])
            if slope > _ROUNDING * terms and gain > best:
                best, entering = gain, j
    return entering


@inline
def _descended(a, b, x, free, size, room):
    """Minimize with order[: size + 1] free; the number that is left, -1 without a minimum."""
    factor, solution, order, _ = room
    kept, entering = size, order[size]
    size += 1
    while size > 0:
        if _factored(a, order, kept, size, factor):
            kept = size
            for i in range(size):
                solution[i] = b[order[i]]
            _substituted(factor, size, solution)
        elif not _toward_null(a, x, size, room):
            return -1
        leaving = _stepped(x, order, size, solution)
        if leaving < 0:
            return size
        # What leaves as soon as it has entered would enter by rounding alone, again and again.
        free[order[leaving]] = _BARRED if order[leaving] == entering else 0
        size -= 1
        for i in range(leaving, size):
            order[i] = order[i + 1]
        kept = min(kept, leaving)
    return size


@inline
def _stepped(x, order, size, solution):
    """Move toward the solution until a variable is 0; its place, or -1 at the solution."""
    step, leaving = 1.0, -1
    for i in range(size):
        if solution[i] <= 0.0:
            share = x[order[i]] / (x[order[i]] - solution[i]) if x[order[i]] > 0.0 else 0.0
            if leaving < 0 or share < step:
                step, leaving = share, i
    for i in range(size):
        x[order[i]] += step * (solution[i] - x[order[i]])
    if leaving >= 0:
        x[order[leaving]] = 0.0
    return leaving


@inline
def _factored(a, order, kept, size, factor):
    """Cholesky of A over the free variables from row `kept`; False if the last is dependent."""
    for i in range(kept, size):
        for j in range(i + 1):
            total = a[order[i], order[j]]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if j < i:
                factor[i, j] = total / factor[j, j]
            elif i == size - 1 and total <= _SINGULAR * a[order[i], order[i]]:
                return False
            else:
                factor[i, i] = math.sqrt(max(total, _SINGULAR * a[order[i], order[i]]))
    return True


@inline
def _substituted(factor, size, values):
    for i in range(size):
        total = values[i]
        for k in range(i):
            total -= factor[i, k] * values[k]
        values[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        total = values[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * values[k]
        values[i] = total / factor[i, i]


@inline
def _toward_null(a, x, size, room):
    """A far point along v with A v = 0, where the function falls; False if it falls for ever."""
    factor, solution, order, null = room
    last = order[size - 1]
    for i in range(size - 1):
        null[i] = a[order[i], last]
    _substituted(factor, size - 1, null)
    far = -1.0
    for i in range(size - 1):
        if null[i] > 0.0:
            reach = x[order[i]] / null[i]
            far = reach if far < 0.0 else min(far, reach)
    if far < 0.0:
        return False
    far = 2.0 * far + 1e-300  # beyond, so that it leaves
    for i in range(size - 1):
        solution[i] = x[order[i]] - far * null[i]
    solution[size - 1] = x[last] + far
    return True
