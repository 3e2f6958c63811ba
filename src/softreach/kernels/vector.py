"""Vectors in space as tuples of three numbers, which stay in registers once inlined.

A matrix is a tuple of three such rows, a rotation a unit quaternion (w, x, y, z). Some functions
are there for `strict` kernels too, which call no others: these round each operation as written.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline, strict


@inline
def row(points, i):
    """Row i of an array (n, 3)."""
    return points[i, 0], points[i, 1], points[i, 2]


@inline
def spot(points, i, j):
    """Row j of array i of an array (n, m, 3), without a view, which would be counted."""
    return points[i, j, 0], points[i, j, 1], points[i, j, 2]


@inline
def difference(points, i, j):
    """Row i minus row j of an array (n, 3)."""
    return points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]


@inline
def minus(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def plus(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def times(s, a):
    """s a."""
    return s * a[0], s * a[1], s * a[2]


@inline
def cross(a, b):
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def squared(a, b):
    """|a - b|²."""
    apart = minus(a, b)
    return dot(apart, apart)


@inline
def matrix(matrices, n):
    """Matrix n of an array (n, 3, 3), row by row."""
    return (
        (matrices[n, 0, 0], matrices[n, 0, 1], matrices[n, 0, 2]),
        (matrices[n, 1, 0], matrices[n, 1, 1], matrices[n, 1, 2]),
        (matrices[n, 2, 0], matrices[n, 2, 1], matrices[n, 2, 2]),
    )


@inline
def combination(s, a):
    """Σ si ai over the rows of a matrix: aᵀ s."""
    return (
        a[0][0] * s[0] + a[1][0] * s[1] + a[2][0] * s[2],
        a[0][1] * s[0] + a[1][1] * s[1] + a[2][1] * s[2],
        a[0][2] * s[0] + a[1][2] * s[1] + a[2][2] * s[2],
    )


@inline
def cofactors(a):
    """Cofactors C of a matrix, det(a) a⁻¹ = Cᵀ: its rows are the cross products of the others."""
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = a
    return (
        (y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2),
        (y2 * z0 - z2 * y0, z2 * x0 - x2 * z0, x2 * y0 - y2 * x0),
        (y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1),
    )


@inline
def turned(q, p):
    """q p q*."""
    v = q[1], q[2], q[3]
    t = times(2.0, cross(v, p))
    return plus(p, plus(times(q[0], t), cross(v, t)))


@inline
def back(q):
    """The quaternion that turns back."""
    return -q[0], q[1], q[2], q[3]


strict_difference = strict(difference)
strict_minus, strict_times = strict(minus), strict(times)
strict_cross, strict_dot = strict(cross), strict(dot)
