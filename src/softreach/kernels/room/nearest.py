"""Where arms come nearest to solids around them, and to themselves.

Between two edges of its steps an arm is the cubic through their centers and tangents, which are as
long as the arc, and its radius is linear. Half-spaces take the least value of that cubic. Past
others it is cut into halves where a nearer point may be. Two pieces come near each other only if
the arm turns by 1.77 rad between them: less keeps the chord of an arc above 2/π of its length.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel, lean_kernel
from softreach.kernels.room import HALF_SPACE, MESH
from softreach.kernels.room.shapes import signed_distance
from softreach.kernels.room.triangles import FIELD_ERROR, least_in_field, nearest_in
from softreach.kernels.vector import difference, dot, minus, plus, row, spot, times

NONE, ITSELF = -1, -2
"""In place of the number of a solid."""
ARC_SERIES = 1.0, 1 / 6, 3 / 40, 5 / 112, 35 / 1152, 63 / 2816
"""Of asin(√s)/√s: the arc of a circle over its chord, of which tangents differ by 2√s."""
_FARTHEST = 1e150  # as kernels know no infinity
_BACK, _TURN = 2.0 / math.pi, 1.76  # chord over arc of half a circle; twice its arc cosine
_MOST_PARTS = 64  # chords of a step
_SLACK = 0.25  # of the tolerance, in distances from meshes
_MOST_MOVES = 40  # of two places toward each other
_FARTHEST_MOVE = 0.25  # over the gap
_SMALL = 1e-9  # last of these moves, over the gap
_SMALLEST = 1e-3  # curvature of the gap in a move, times it


@kernel
def swollen(gamma, rates, radius, power, out):
    """Radii R (1 + z·γ)^-power (n, edge) of activations (n, bundle) and z (edge, bundle)."""
    for i in range(gamma.shape[0]):
        for e in range(len(radius)):
            extension = 1.0
            for j in range(gamma.shape[1]):
                extension += rates[e, j] * gamma[i, j]
            out[i, e] = extension
        if power == 0.5:
            for e in range(len(radius)):
                out[i, e] = radius[e] / math.sqrt(out[i, e])
        else:
            for e in range(len(radius)):
                out[i, e] = radius[e] * out[i, e] ** -power


@inline
def _measure(points, tangents, i, k):
    """Length of the arc between two edges, that of a circle with their chord and tangents.

    And the largest second derivative of the cubic by its share, which it has at an end.
    """
    chord, square = 0.0, 0.0
    for axis in range(3):
        chord += (points[i, k + 1, axis] - points[i, k, axis]) ** 2
        square += (tangents[i, k + 1, axis] - tangents[i, k, axis]) ** 2
    s, series = 0.25 * square, 0.0
    for n in range(5, -1, -1):
        series = ARC_SERIES[n] + s * series
    length, first, second = math.sqrt(chord) * series, 0.0, 0.0
    for axis in range(3):
        apart = 6.0 * (points[i, k + 1, axis] - points[i, k, axis])
        u, v = length * tangents[i, k, axis], length * tangents[i, k + 1, axis]
        first += (apart - 4.0 * u - 2.0 * v) ** 2
        second += (apart - 2.0 * u - 4.0 * v) ** 2
    return length, math.sqrt(max(first, second))


@inline
def weights(length, t):
    """Those of both centers and of both tangents at a share t of the arc of a step."""
    return (
        (1.0 + 2.0 * t) * (1.0 - t) ** 2,
        t * t * (3.0 - 2.0 * t),
        length * t * (1.0 - t) ** 2,
        length * t * t * (t - 1.0),
    )


@inline
def _sum(points, tangents, i, k, w):
    p, q = spot(points, i, k), spot(points, i, k + 1)
    u, v = spot(tangents, i, k), spot(tangents, i, k + 1)
    return plus(plus(times(w[0], p), times(w[1], q)), plus(times(w[2], u), times(w[3], v)))


@inline
def _at(points, tangents, i, k, length, t):
    """The point of the cubic of step k at a share t of its arc."""
    return _sum(points, tangents, i, k, weights(length, t))


@inline
def _turning(points, tangents, i, k, length, t):
    """First and second derivatives of that point by the arc."""
    e = 6.0 * t * (1.0 - t) / length
    first = -e, e, (1.0 - t) * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)
    e = (6.0 - 12.0 * t) / (length * length)
    second = -e, e, (6.0 * t - 4.0) / length, (6.0 * t - 2.0) / length
    return _sum(points, tangents, i, k, first), _sum(points, tangents, i, k, second)


@inline
def _radius(radius, i, k, t):
    return radius[i, k] + t * (radius[i, k + 1] - radius[i, k])


@inline
def _height(x, q):
    return (x[0] - q[0]) * q[3] + (x[1] - q[1]) * q[4] + (x[2] - q[2]) * q[5]


@inline
def _along(x, q):
    return x[0] * q[3] + x[1] * q[4] + x[2] * q[5]


@inline
def _over_plane(points, tangents, radius, disks, lengths, i, q, first, last, best):
    """The least height over a plane that is below `best`, and its place; that itself if none is."""
    place = -1.0
    below, r = _height(spot(points, i, first), q), radius[i, first]
    slope = _along(spot(tangents, i, first), q)
    for k in range(first, last + 1):
        if below - r < best:
            best, place = below - r, k
        if disks[k] > 0.0 and below - disks[k] < best:
            best, place = below - disks[k], k
        if k == last:
            break
        above, rim = _height(spot(points, i, k + 1), q), radius[i, k + 1]
        end = _along(spot(tangents, i, k + 1), q)
        start, stop = below - r, above - rim
        one = below + lengths[k] * slope / 3.0 - (2.0 * r + rim) / 3.0
        two = above - lengths[k] * end / 3.0 - (r + 2.0 * rim) / 3.0
        if min(one, two) < best:  # else none of the cubic is, which lies within its control points
            b, c = one - start, start - 2.0 * one + two
            d = stop - 3.0 * (two - one) - start
            root = c * c - d * b
            if root > 0.0 and b < 0.0:
                t = -b / (c + math.sqrt(root))
                if 0.0 < t < 1.0:
                    value = start + t * (3.0 * b + t * (3.0 * c + t * d))
                    if value < best:
                        best, place = value, k + t
        below, r, slope = above, rim, end
    return best, place


@inline
def _bound(kind, side, q, meshes, x):
    """As `_distance`, but for meshes no larger, and a node of their field."""
    if kind != MESH:
        d, u, v, w = signed_distance(kind, q, x)
        return side * d, minus(x, (d * u, d * v, d * w)), 0
    # Arrays of a tuple are counted when they have names: they have none here.
    first, m = meshes[0][int(q[0]), 2], int(q[0])
    return least_in_field(
        x, side, meshes[5], meshes[6], meshes[7], meshes[8], meshes[3], first, m
    )  # fmt: skip


@inline
def _distance(kind, side, q, meshes, stack, x, most, tol):
    """Distance of a point from a solid, one that is no larger, and a place of its surface there.

    Or from all but the solid where side is -1. That of a mesh may be too large by some of the
    tolerance, and for one farther than `most` some smaller distance does that is no less than that.
    """
    near, foot, node = _bound(kind, side, q, meshes, x)
    if kind != MESH or near > most:
        return near, near, foot
    m = int(q[0])
    about, error = side * meshes[7][node], FIELD_ERROR * meshes[5][m, 3]
    root, begin, enough = (
        meshes[0][m, 0],
        meshes[0][m, 1],
        1.0 - _SLACK * tol / (abs(about) + error),
    )
    d, u, v, w, _ = nearest_in(
        x, meshes[8][node], most if about > error else _FARTHEST, meshes[1], root, meshes[2], begin,
        meshes[0][m + 1, 1] - begin - 1, meshes[3], meshes[4], stack, enough,
    )  # fmt: skip
    foot, d = minus(x, (d * u, d * v, d * w)), abs(d) if about > error else side * d
    return d, min(d, enough * d), foot


@inline
def _least_between(d0, d1, w0, w1, apart, bulge):
    """Least gap on an arc of a length between two points at distances from a solid.

    No point of the solid is nearer than those distances: to the chord, none is nearer than the
    one at just these from both ends. Widths w are linear in between, and the arc bulges.
    """
    slope = (w1 - w0) / max(apart, 1e-300)
    if min(d0, d1) <= 0.0 or d0 + d1 <= apart or abs(slope) >= 1.0:  # as it changes by 1 per arc
        return 0.5 * (d0 + d1 - apart) - max(w0, w1)
    along = 0.5 * (apart * apart + d0 * d0 - d1 * d1) / apart
    away = math.sqrt(max(d0 * d0 - along * along, 0.0))
    cosine = math.sqrt(1.0 - slope * slope)
    foot = along * cosine + away * slope
    if foot <= 0.0 or foot >= apart * cosine:
        return min(d0 - w0, d1 - w1) - bulge
    return away * cosine - slope * along - w0 - bulge


@inline
def _least_inside(x, y, foot, other):
    """Least distance on a chord in a solid: none is deeper than it is away from both feet."""
    here, there = _square(x, foot), _square(y, other)
    first, second = max(_square(x, other) - here, 0.0), max(_square(y, foot) - there, 0.0)
    share = first / max(first + second, 1e-300)
    middle = (1.0 - share) * here + share * (there + second) - share * (1.0 - share) * _square(x, y)
    return -math.sqrt(max(middle, here, there))


@inline
def _square(x, y):
    apart = minus(x, y)
    return dot(apart, apart)


@inline
def _speed(points, tangents, lengths, i, k):
    """How long the arc of step k would be at the largest speed of its cubic."""
    square = 0.0
    for axis in range(3):
        each = 3.0 * (points[i, k + 1, axis] - points[i, k, axis])
        square += (each - lengths[k] * (tangents[i, k, axis] + tangents[i, k + 1, axis])) ** 2
    return max(lengths[k], math.sqrt(square))


@inline
def _past(
    kind, side, q, meshes, stack, points, tangents, radius, disks, tool, lengths, bends, edges,
    pieces, i, first, last, best, tol
):  # fmt: skip
    """The least gap between two edges that is below `best`, and its place; -1 if none is.

    Gaps at the edges come first, as the nearest of them spares most of the others.
    """
    place, steps, near, least = -1.0, len(lengths), first, _FARTHEST
    for e in range(first, last + 1):
        x = spot(points, i, e) if e <= steps else row(tool, i)
        d, foot, _ = _bound(kind, side, q, meshes, x)
        _keep(edges, e, 0, max(radius[i, e], disks[e]) if e <= steps else 0.0, d, foot)
        if d - edges[e, 0] < least:
            least, near = d - edges[e, 0], e
    for j in range(first - 1, last + 1 if kind == MESH else first):
        e = near if j < first else j
        width = edges[e, 0]
        if edges[e, 1] - width >= best + tol or j == near:
            continue
        x = spot(points, i, e) if e <= steps else row(tool, i)
        d, least, foot = _distance(kind, side, q, meshes, stack, x, best + tol + width, tol)
        _keep(edges, e, 0, width, least, foot)
        if d - width < best:
            best, place = d - width, float(e)
    for k in range(first, last):
        best, place = _past_step(
            kind, side, q, meshes, stack, points, tangents, radius, tool, lengths, bends, edges,
            pieces, i, k, best, place, tol,
        )  # fmt: skip
    return best, place


@inline
def _past_step(
    kind, side, q, meshes, stack, points, tangents, radius, tool, lengths, bends, edges, pieces, i,
    k, best, place, tol
):  # fmt: skip
    """The same with what is between the ends of step k."""
    r, change, bulge, size = 0.0, 0.0, 0.0, 1
    if k < len(lengths):
        r, change, bulge = radius[i, k], radius[i, k + 1] - radius[i, k], bends[k] / 8.0
        speed = _speed(points, tangents, lengths, i, k)
    else:
        speed = math.sqrt(_square(row(tool, i), spot(points, i, k)))
    _keep(pieces, 0, 0, 0.0, edges[k, 1], _kept(edges, k, 2))
    _keep(pieces, 0, 5, 1.0, edges[k + 1, 1], _kept(edges, k + 1, 2))
    while size:
        size -= 1
        lower, below, upper, above = (
            pieces[size, 0], pieces[size, 1], pieces[size, 5], pieces[size, 6]
        )  # fmt: skip
        share, w0, w1 = upper - lower, r + lower * change, r + upper * change
        bound = _least_between(below, above, w0, w1, share * speed, share * share * bulge)
        if bound >= best - tol:
            continue
        foot, other = _kept(pieces, size, 2), _kept(pieces, size, 7)
        if below <= 0.0 and above <= 0.0:
            x = _place(points, tangents, tool, lengths, i, k, lower)
            y = _place(points, tangents, tool, lengths, i, k, upper)
            bound = _least_inside(x, y, foot, other) - max(w0, w1) - share * share * bulge
            if bound >= best - tol:
                continue
        t, width = 0.5 * (lower + upper), 0.5 * (w0 + w1)
        x = _place(points, tangents, tool, lengths, i, k, t)
        d, least, foot = _distance(kind, side, q, meshes, stack, x, best + tol + width, tol)
        if d - width < best:
            best, place = d - width, k + t
        _keep(pieces, size + 1, 0, t, least, foot)
        _keep(pieces, size + 1, 5, upper, above, other)
        _keep(pieces, size, 5, t, least, foot)
        size += 2
    return best, place


@inline
def _place(points, tangents, tool, lengths, i, k, t):
    """A point of step k, or of the line to a tool that the tip holds."""
    if k < len(lengths):
        return _at(points, tangents, i, k, lengths[k], t)
    x = spot(points, i, k)
    return plus(x, times(t, minus(row(tool, i), x)))


@inline
def _keep(table, n, first, number, distance, foot):
    table[n, first], table[n, first + 1], table[n, first + 2] = number, distance, foot[0]
    table[n, first + 3], table[n, first + 4] = foot[1], foot[2]


@inline
def _kept(table, n, first):
    return table[n, first], table[n, first + 1], table[n, first + 2]


@inline
def _chords(p, q, r, x):
    """Shares of chords from p to q and from r to x at which these come nearest, and how near."""
    u, v, w = minus(q, p), minus(x, r), minus(p, r)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    size, s = uu * vv - uv * uv, 0.0
    if size > 1e-12 * uu * vv:
        s = min(max((uv * vw - uw * vv) / size, 0.0), 1.0)
    t = (uv * s + vw) / max(vv, 1e-300)
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - uw) / max(uu, 1e-300), 0.0), 1.0)
    apart = plus(w, minus(times(s, u), times(t, v)))
    return s, t, math.sqrt(dot(apart, apart))


@inline
def _refined(points, tangents, radius, lengths, passed, i, k, s, m, t):
    """The least gap between two parts of an arm close to shares s, t of steps k, m, and places.

    By Newton's method along the arc, of which each step must shorten the gap.
    """
    best, along, across = _FARTHEST, 0.0, 0.0
    for _ in range(_MOST_MOVES):
        (a, u), (b, v) = _moved(lengths, k, s, along), _moved(lengths, m, t, across)
        x = _at(points, tangents, i, a, lengths[a], u)
        apart = minus(x, _at(points, tangents, i, b, lengths[b], v))
        size = math.sqrt(dot(apart, apart))
        gap = size - _radius(radius, i, a, u) - _radius(radius, i, b, v)
        arc = passed[b] + v * lengths[b] - passed[a] - u * lengths[a]
        if gap >= best or (best < _FARTHEST and not _is_back(size, arc, lengths[k])):
            along, across = 0.5 * along, 0.5 * across
        else:
            best, k, s, m, t = gap, a, u, b, v
            along, across = _toward(points, tangents, radius, lengths, i, k, s, m, t, apart, size)
        if abs(along) + abs(across) < _SMALL * size:
            break
    return best, k + s, m + t


@inline
def _moved(lengths, k, t, arc):
    """Step and share at an arc from a share of step k, at the most in the step next to it."""
    t += arc / lengths[k]
    if t > 1.0 and k + 1 < len(lengths):
        return k + 1, min((t - 1.0) * lengths[k] / lengths[k + 1], 1.0)
    if t < 0.0 and k > 0:
        return k - 1, max(1.0 + t * lengths[k] / lengths[k - 1], 0.0)
    return k, min(max(t, 0.0), 1.0)


@inline
def _toward(points, tangents, radius, lengths, i, k, s, m, t, apart, size):
    """Newton's step to the least gap between two places, in arc; none beyond ends of the arm."""
    n, one = times(1.0 / size, apart), radius[i, k + 1] - radius[i, k]
    u, du = _turning(points, tangents, i, k, lengths[k], s)
    v, dv = _turning(points, tangents, i, m, lengths[m], t)
    f, g = dot(n, u) - one / lengths[k], -dot(n, v) - (radius[i, m + 1] - radius[i, m]) / lengths[m]
    a = dot(n, du) + (dot(u, u) - dot(n, u) ** 2) / size
    c = -dot(n, dv) + (dot(v, v) - dot(n, v) ** 2) / size
    b = (dot(n, u) * dot(n, v) - dot(u, v)) / size
    if k + s <= 0.0 and f > 0.0:
        f, b = 0.0, 0.0
    if m + t >= len(lengths) and g < 0.0:
        g, b = 0.0, 0.0
    least = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
    more = max(_SMALLEST / size - least, 0.0)
    a, c = a + more, c + more
    along, across, scale = b * g - c * f, b * f - a * g, a * c - b * b
    scale = 1.0 / max(scale, (abs(along) + abs(across)) / (_FARTHEST_MOVE * size))
    return scale * along, scale * across


@inline
def _folded(points, tangents, radius, lengths, bends, middles, passed, curvature, i, sag, best):
    """The least gap between parts of an arm below `best` and half their width, and both places."""
    place, other, count, most, wide = -1.0, -1.0, len(lengths), 0.0, 0.0
    for k in range(count):
        curvature[k] = bends[k] / (lengths[k] * lengths[k])
        most, wide = max(most, curvature[k]), max(wide, 2.0 * max(radius[i, k], radius[i, k + 1]))
        for axis in range(3):
            middles[k, axis] = 0.5 * (points[i, k, axis] + points[i, k + 1, axis])
    if _is_open(most, passed[count], wide):
        return best, place, other
    for k in range(count):
        turn, sharp = curvature[k] * lengths[k], curvature[k]
        for m in range(k + 1, count):
            turn, sharp = turn + curvature[m] * lengths[m], max(sharp, curvature[m])
            wide = max(radius[i, k], radius[i, k + 1]) + max(radius[i, m], radius[i, m + 1])
            if turn < _TURN or _is_open(sharp, passed[m + 1] - passed[k], wide):
                continue
            reach = min(wide + min(best, 0.5 * wide), _BACK * (passed[m + 1] - passed[k]))
            ball = max(reach + 0.5 * (lengths[k] + lengths[m]), 0.0)
            apart = difference(middles, k, m)
            if dot(apart, apart) >= ball * ball:
                continue
            bulge = (bends[k] + bends[m]) / 8.0
            p, q = spot(points, i, k), spot(points, i, k + 1)
            near = _chords(p, q, spot(points, i, m), spot(points, i, m + 1))[2]
            if near - bulge >= reach:
                continue
            gap, s, t = _nearest_chords(
                points, tangents, radius, lengths, bends, passed, i, sag, k, m, reach
            )
            if gap - 2.0 * sag >= min(best, 0.5 * wide):
                continue
            gap, s, t = _refined(points, tangents, radius, lengths, passed, i, k, s, m, t)
            if gap < min(best, 0.5 * wide):
                best, place, other = gap, s, t
    return best, place, other


@inline
def _is_open(curvature, arc, wide):
    """Whether a bend is too weak for ends apart by 1.5 widths and 2/π of the arc at most.

    By Schur's theorem they are at least as far apart as on a circle of that curvature, 2/κ
    sin(κs/2): then κs >= π, and 2π - 2 asin(3/4 κw), whose arc sine is 1.145 times it at most, or
    π/2 times. Constants are a little smaller, as curvatures are those of cubics.
    """
    sharp = curvature * wide
    return curvature * arc < max(3.1, 6.2 - (1.72 if sharp < 1.02 else 2.36) * sharp)


@inline
def _nearest_chords(points, tangents, radius, lengths, bends, passed, i, sag, k, m, reach):
    """The least gap between chords of two steps, and the shares of these at which it is."""
    best, place, other = _FARTHEST, 0.0, 0.0
    some, many = _parts(bends[k], sag), _parts(bends[m], sag)
    first, last, q = spot(points, i, m), spot(points, i, m + 1), spot(points, i, k)
    for a in range(some):
        p, q = q, _at(points, tangents, i, k, lengths[k], (a + 1) / some)
        if _chords(p, q, first, last)[2] - sag - bends[m] / 8.0 >= reach:
            continue
        y = first
        for b in range(many):
            x, y = y, _at(points, tangents, i, m, lengths[m], (b + 1) / many)
            s, t, apart = _chords(p, q, x, y)
            s, t = (a + s) / some, (b + t) / many
            between = passed[m] - passed[k]
            if not _is_back(apart, between + t * lengths[m] - s * lengths[k], lengths[k]):
                # Both are nearest here; the parts that are farther apart along the arm may count.
                s, t, away = a / some, (b + 1) / many, minus(p, y)
                apart = math.sqrt(dot(away, away))
                if not _is_back(apart, between + t * lengths[m] - s * lengths[k], lengths[k]):
                    continue
            apart -= _radius(radius, i, k, s) + _radius(radius, i, m, t)
            if apart < best:
                best, place, other = apart, s, t
    return best, place, other


@inline
def _is_back(apart, arc, length):
    """Whether an arm turns back between two places; not so where rounding alone parts them."""
    return apart + _SMALL * length < _BACK * arc


@inline
def _parts(bend, sag):
    """Number of chords from which the cubic of a step bulges by no more than the sag."""
    return min(max(math.ceil(math.sqrt(bend / (8.0 * sag))), 1), _MOST_PARTS)


@lean_kernel
def nearest(
    points, tangents, radius, disks, tool, kinds, numbers, ends, meshes, tol, room, value, which,
    place
):  # fmt: skip
    """Least gaps (n,), with which solid (n,), and where along the arm (n, 2), of arms at edges.

    Arms are centers (n, edge, 3), tangents (n, edge, 3) and radii (n, edge); disks (edge,) have
    radii where there are some, and a tool is a point (n, 3) that a line leads to from the tip, or
    (0, 3). Solids have a kind and the side that is free (solid, 2), numbers,
    and the distance wanted behind these; and first and last edges (solid, 2) of the part of the arm
    that they concern. The last row of each is no solid, and of the side 1 if the arm itself
    counts. Places are edges and shares of the arc to the next; the second is another on the arm.
    """
    lengths, bends, stack, edges, pieces, middles, passed, curvature = room
    solids, edge = len(kinds) - 1, len(disks) - 1
    for i in range(points.shape[0]):
        passed[0] = 0.0
        for k in range(edge):
            lengths[k], bends[k] = _measure(points, tangents, i, k)
            passed[k + 1] = passed[k] + lengths[k]
        best, found, at, other = _FARTHEST, NONE, -1.0, -1.0
        for o in range(solids):
            first, last, wanted = ends[o, 0], ends[o, 1], numbers[o, -1]
            if kinds[o, 0] == HALF_SPACE:
                near, its = _over_plane(
                    points, tangents, radius, disks, lengths, i, numbers[o], first, last,
                    best + wanted,
                )  # fmt: skip
                if len(tool) and last == edge:
                    height = _height(row(tool, i), numbers[o])
                    near, its = (height, edge + 1.0) if height < near else (near, its)
            else:
                last += len(tool) > 0 and last == edge
                near, its = _past(
                    kinds[o, 0], kinds[o, 1], numbers[o], meshes, stack, points, tangents, radius,
                    disks, tool, lengths, bends, edges, pieces, i, first, last, best + wanted, tol,
                )  # fmt: skip
            near -= wanted
            if its >= 0.0:
                best, found, at = near, o, its
        if kinds[solids, 1] > 0:
            near, its, there = _folded(
                points, tangents, radius, lengths, bends, middles, passed, curvature, i, tol, best
            )
            if its >= 0.0:
                best, found, at, other = near, ITSELF, its, there
        value[i], which[i] = best, found
        place[i, 0], place[i, 1] = at, other
