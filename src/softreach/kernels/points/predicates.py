"""The two signs that a Delaunay triangulation rests on, always right.

Each predicate first evaluates its determinant in floating point and returns the sign where the
rounding error cannot reach it; otherwise the determinant is expanded exactly [Shewchuk1997].

An expansion is an exact sum of floats, ordered by size, that do not overlap in their bits. Here it
is a pair ``(start, length)`` into one scratch array ``w``, so that no memory is allocated; every
operation writes its result at ``top``, above its operands. It is exact as long as nothing overflows
or underflows and the compiler neither reorders nor fuses operations: all of it is `strict`.

The bounds are Shewchuk's first stage, (7 + 56ε)ε and (16 + 224ε)ε times the permanent, with the
permanent replaced by a larger and cheaper product of the largest coordinate differences, so that
most calls cost little more than the determinant.

Exact while coordinates lie in [-1, 1] and are multiples of 2^-200 (`geometry.alpha_shape` ensures
it): then every product of five of them is a multiple of 2^-1000, and nothing under- or overflows.

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


EPS = 2.0**-53
ORIENT_BOUND = 6 * 7.1 * EPS  # permanent <= 6 x y z
INSPHERE_BOUND = 24 * 16.1 * EPS  # permanent <= 24 x y z lift


@strict
def max4(a, b, c, d):
    """The largest magnitude of four numbers."""
    return max(max(abs(a), abs(b)), max(abs(c), abs(d)))


@strict
def orient(points, a, b, c, d, w):
    """Sign of det[b-a, c-a, d-a]: +1 if d lies on the side to which the normal of abc points."""
    sure = orient_filter(points, a, b, c, d)
    return sure if sure != 0.0 else orient_exact(points, a, b, c, d, w)


@strict
def insphere(points, a, b, c, d, e, w):
    """+1 if e lies inside the sphere through a positively oriented abcd, 0 on it, -1 outside."""
    sure = insphere_filter(points, a, b, c, d, e)
    return sure if sure != 0.0 else insphere_exact(points, a, b, c, d, e, w)


@strict
def outside(x, bound):
    """Sign of x if it is beyond the bound of its error, else 0."""
    if abs(x) > bound:
        return 1.0 if x > 0.0 else -1.0
    return 0.0


@strict
def orient_filter(points, a, b, c, d):
    """`orient` where rounding cannot change it, else 0."""
    ax = points[a, 0] - points[d, 0]
    ay = points[a, 1] - points[d, 1]
    az = points[a, 2] - points[d, 2]
    bx = points[b, 0] - points[d, 0]
    by = points[b, 1] - points[d, 1]
    bz = points[b, 2] - points[d, 2]
    cx = points[c, 0] - points[d, 0]
    cy = points[c, 1] - points[d, 1]
    cz = points[c, 2] - points[d, 2]
    det = az * (cx * by - bx * cy) + bz * (ax * cy - cx * ay) + cz * (bx * ay - ax * by)
    x = max(max(abs(ax), abs(bx)), abs(cx))
    y = max(max(abs(ay), abs(by)), abs(cy))
    z = max(max(abs(az), abs(bz)), abs(cz))
    return outside(det, ORIENT_BOUND * x * y * z)


@strict
def insphere_filter(points, a, b, c, d, e):
    """`insphere` where rounding cannot change it, else 0."""
    ax = points[a, 0] - points[e, 0]
    ay = points[a, 1] - points[e, 1]
    az = points[a, 2] - points[e, 2]
    bx = points[b, 0] - points[e, 0]
    by = points[b, 1] - points[e, 1]
    bz = points[b, 2] - points[e, 2]
    cx = points[c, 0] - points[e, 0]
    cy = points[c, 1] - points[e, 1]
    cz = points[c, 2] - points[e, 2]
    dx = points[d, 0] - points[e, 0]
    dy = points[d, 1] - points[e, 1]
    dz = points[d, 2] - points[e, 2]
    ab = ax * by - bx * ay
    bc = bx * cy - cx * by
    cd = cx * dy - dx * cy
    da = dx * ay - ax * dy
    ac = ax * cy - cx * ay
    bd = bx * dy - dx * by
    abc = az * bc - bz * ac + cz * ab
    bcd = bz * cd - cz * bd + dz * bc
    cda = cz * da + dz * ac + az * cd
    dab = dz * ab + az * bd + bz * da
    a2 = ax * ax + ay * ay + az * az
    b2 = bx * bx + by * by + bz * bz
    c2 = cx * cx + cy * cy + cz * cz
    d2 = dx * dx + dy * dy + dz * dz
    det = (c2 * dab - d2 * abc) + (a2 * bcd - b2 * cda)
    size = max4(ax, bx, cx, dx) * max4(ay, by, cy, dy) * max4(az, bz, cz, dz)
    return outside(det, INSPHERE_BOUND * size * max(max(a2, b2), max(c2, d2)))


@strict
def end(e):
    """The first free place above an expansion."""
    return e[0] + e[1]


@strict
def minor(w, top, ax, ay, bx, by):
    """The expansion ax·by - bx·ay."""
    left = multiply(w, top, ax, by)
    right = multiply(w, end(left), bx, ay)
    return subtract(w, end(right), left, right)


@strict
def dot3(w, top, az, bc, bz, ca, cz, ab):
    """The expansion az·bc + bz·ca + cz·ab."""
    first = multiply(w, top, az, bc)
    second = multiply(w, end(first), bz, ca)
    both = add(w, end(second), first, second)
    third = multiply(w, end(both), cz, ab)
    return add(w, end(third), both, third)


@strict
def edge(w, top, points, a, e):
    """The three expansions of a - e."""
    x = difference(w, top, points[a, 0], points[e, 0])
    y = difference(w, end(x), points[a, 1], points[e, 1])
    z = difference(w, end(y), points[a, 2], points[e, 2])
    return x, y, z


@strict
def orient_exact(points, a, b, c, d, w):
    """`orient` without rounding."""
    ax, ay, az = edge(w, BOTTOM, points, a, d)
    bx, by, bz = edge(w, end(az), points, b, d)
    cx, cy, cz = edge(w, end(bz), points, c, d)
    bc = minor(w, end(cz), bx, by, cx, cy)
    ca = minor(w, end(bc), cx, cy, ax, ay)
    ab = minor(w, end(ca), ax, ay, bx, by)
    return -sign(w, dot3(w, end(ab), az, bc, bz, ca, cz, ab))


@strict
def insphere_exact(points, a, b, c, d, e, w):
    """`insphere` without rounding."""
    ax, ay, az = edge(w, BOTTOM, points, a, e)
    bx, by, bz = edge(w, end(az), points, b, e)
    cx, cy, cz = edge(w, end(bz), points, c, e)
    dx, dy, dz = edge(w, end(cz), points, d, e)
    ab = minor(w, end(dz), ax, ay, bx, by)
    bc = minor(w, end(ab), bx, by, cx, cy)
    cd = minor(w, end(bc), cx, cy, dx, dy)
    da = minor(w, end(cd), dx, dy, ax, ay)
    ac = minor(w, end(da), ax, ay, cx, cy)
    ca = minor(w, end(ac), cx, cy, ax, ay)
    bd = minor(w, end(ca), bx, by, dx, dy)
    db = minor(w, end(bd), dx, dy, bx, by)
    abc = dot3(w, end(db), az, bc, bz, ca, cz, ab)
    bcd = dot3(w, end(abc), bz, cd, cz, db, dz, bc)
    cda = dot3(w, end(bcd), cz, da, dz, ac, az, cd)
    dab = dot3(w, end(cda), dz, ab, az, bd, bz, da)
    a2 = dot3(w, end(dab), ax, ax, ay, ay, az, az)
    b2 = dot3(w, end(a2), bx, bx, by, by, bz, bz)
    c2 = dot3(w, end(b2), cx, cx, cy, cy, cz, cz)
    d2 = dot3(w, end(c2), dx, dx, dy, dy, dz, dz)
    ac_part = minor(w, end(d2), a2, b2, cda, bcd)
    bd_part = minor(w, end(ac_part), c2, d2, abc, dab)
    return sign(w, add(w, end(bd_part), ac_part, bd_part))


@strict
def collinear(points, a, b, c, w):
    """True if three points lie on one line, exactly."""
    ax, ay, az = edge(w, BOTTOM, points, a, c)
    bx, by, bz = edge(w, end(az), points, b, c)
    top = end(bz)
    return (
        sign(w, minor(w, top, ax, ay, bx, by)) == 0.0
        and sign(w, minor(w, top, ay, az, by, bz)) == 0.0
        and sign(w, minor(w, top, az, ax, bz, bx)) == 0.0
    )
