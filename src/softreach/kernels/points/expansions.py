"""Exact sums and products of floating-point numbers (Shewchuk 1997).

An expansion is an exact sum of floats, ordered by size, that do not overlap in their bits. Here it
is a pair ``(start, length)`` into one scratch array ``w``, so that no memory is allocated; every
operation writes its result at ``top``, above its operands.

Exact as long as nothing overflows or underflows and the compiler neither reorders nor fuses
operations: all of it is `strict`.

References:
    Shewchuk (1997), Adaptive precision floating-point arithmetic and fast robust geometric
    predicates, Discrete & Computational Geometry 18, 305-363. Theorem numbers below are his.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict

SCRATCH = 65_536  # floats; an expansion of the predicates has fewer than 1,100 terms
BOTTOM = np.intp(0)  # typed: a literal 0 would compile every function once more
SPLITTER = 134_217_729.0  # 2^27 + 1, cuts 53 bits in two halves


def scratch():
    """A work array large enough for every predicate; made by those who call a kernel."""
    return np.empty(SCRATCH)


@strict
def two_sum(a, b):
    """Return a + b as rounded sum and exact rest (Theorem 7)."""
    total = a + b
    b_seen = total - a
    return total, (a - (total - b_seen)) + (b - b_seen)


@strict
def split(a):
    """The high and the low half of the bits of a (Theorem 17)."""
    shifted = SPLITTER * a
    high = shifted - (shifted - a)
    return high, a - high


@strict
def two_product(a, b):
    """Return a · b as rounded product and exact rest (Theorem 18)."""
    product = a * b
    a_high, a_low = split(a)
    b_high, b_low = split(b)
    tail = ((a_high * b_high - product) + a_high * b_low) + a_low * b_high
    return product, tail + a_low * b_low


@strict
def push(w, at, term):
    """Append a term unless it is zero; return where the next one goes."""
    w[at] = term
    return at + (term != 0.0)


@strict
def difference(w, top, a, b):
    """The expansion of a - b, at most two terms."""
    high, low = two_sum(a, -b)
    at = push(w, push(w, top, low), high)
    return top, at - top


@strict
def merge_add(w, top, e, f, factor):
    """The expansion e + factor·f for a factor of +1 or -1 (Theorem 13, zeros dropped)."""
    i, j, i_end, j_end = e[0], f[0], e[0] + e[1], f[0] + f[1]
    at, total = top, 0.0
    while i < i_end or j < j_end:
        if j == j_end or (i < i_end and abs(w[i]) < abs(w[j])):
            term = w[i]
            i += 1
        else:
            term = factor * w[j]
            j += 1
        total, tail = two_sum(total, term)
        at = push(w, at, tail)
    at = push(w, at, total)
    return top, at - top


@strict
def add(w, top, e, f):
    """The expansion e + f."""
    return merge_add(w, top, e, f, 1.0)


@strict
def subtract(w, top, e, f):
    """The expansion e - f."""
    return merge_add(w, top, e, f, -1.0)


@strict
def scale(w, top, e, b):
    """The expansion e · b for one float b (Theorem 19, zeros dropped)."""
    at, total = top, 0.0
    for i in range(e[0], e[0] + e[1]):
        product, low = two_product(w[i], b)
        total, tail = two_sum(total, low)
        at = push(w, at, tail)
        total, tail = two_sum(product, total)
        at = push(w, at, tail)
    at = push(w, at, total)
    return top, at - top


@strict
def move_down(w, top, e):
    """Move an expansion down to ``top``, over what is no longer needed."""
    for i in range(e[1]):
        w[top + i] = w[e[0] + i]
    return top, e[1]


@strict
def multiply(w, top, e, f):
    """The expansion e · f: the sum of e scaled by every term of f."""
    if f[1] == 0:
        return top, 0
    total = scale(w, top, e, w[f[0]])
    for j in range(f[0] + 1, f[0] + f[1]):
        term = scale(w, top + total[1], e, w[j])
        both = add(w, term[0] + term[1], total, term)
        total = move_down(w, top, both)
    return total


@strict
def sign(w, e):
    """The sign of an expansion: that of its last, largest term."""
    return 0.0 if e[1] == 0 else np.sign(w[e[0] + e[1] - 1])


@strict
def value(w, e):
    """The float nearest to an expansion, to within one rounding."""
    total = 0.0
    for i in range(e[0], e[0] + e[1]):
        total += w[i]
    return total
