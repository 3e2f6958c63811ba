"""Where arms come nearest to solids around them, and to themselves.

Between two edges of its steps an arm is the cubic through their centers and tangents, which are as
long as the arc, and its radius is linear. Half-spaces take the least value of that cubic. Past
others it is cut into halves where a nearer point may be, as distances change no faster than
places. Two pieces come near each other only if the arm turns
by 1.77 rad between them: less keeps the chord of an arc above 2/π of its length.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.room import HALF_SPACE, MESH
from softreach.kernels.room.shapes import signed_distance
from softreach.kernels.room.triangles import in_field, nearest_in
from softreach.kernels.vector import dot, minus, plus, row, spot, times

NONE, ITSELF = -1, -2
"""In place of the number of a solid."""
FIELD_ERROR = 0.87
"""Of the spacing of a field: √3/2."""
MOST_PARTS = 64
"""Chords of the polyline of a step."""
_FARTHEST = 1e300  # as kernels know no infinity
_BACK, _TURN = 2.0 / math.pi, 1.76  # chord over arc of half a circle; twice its arc cosine


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
def _arc(points, tangents, i, k):
    """Length of the arc between two edges, that of a circle with their chord and tangents."""
    chord, square = 0.0, 0.0
    for axis in range(3):
        chord += (points[i, k + 1, axis] - points[i, k, axis]) ** 2
        square += (tangents[i, k + 1, axis] - tangents[i, k, axis]) ** 2
    s = 0.25 * square
    series = 1.0 + s * (1 / 6 + s * (3 / 40 + s * (5 / 112 + s * (35 / 1152 + s * (63 / 2816)))))
    return math.sqrt(chord) * series


@inline
def _at(points, tangents, i, k, length, t):
    """The point of the cubic of step k at a share t of its arc."""
    a, b = (1.0 + 2.0 * t) * (1.0 - t) ** 2, t * t * (3.0 - 2.0 * t)
    c, d = length * t * (1.0 - t) ** 2, length * t * t * (t - 1.0)
    p, q = spot(points, i, k), spot(points, i, k + 1)
    u, v = spot(tangents, i, k), spot(tangents, i, k + 1)
    return (
        a * p[0] + b * q[0] + c * u[0] + d * v[0],
        a * p[1] + b * q[1] + c * u[1] + d * v[1],
        a * p[2] + b * q[2] + c * u[2] + d * v[2],
    )


@inline
def _bend(points, tangents, i, k, length):
    """Largest second derivative of the cubic of step k by its share, at an end."""
    first, second = 0.0, 0.0
    for axis in range(3):
        apart = 6.0 * (points[i, k + 1, axis] - points[i, k, axis])
        u, v = length * tangents[i, k, axis], length * tangents[i, k + 1, axis]
        first += (apart - 4.0 * u - 2.0 * v) ** 2
        second += (apart - 2.0 * u - 4.0 * v) ** 2
    return math.sqrt(max(first, second))


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
def _gap(
    kind, side, wanted, q, meshes, stack, points, tangents, radius, tool, lengths, i, k, t, exact,
    most
):  # fmt: skip
    """Gap between a solid and the ball around a point of an arm.

    Or to all but the solid where side is -1; to meshes by their fields, if not `exact` or `most`
    is nearer by far.
    """
    width = wanted
    if k < len(lengths):
        x = _at(points, tangents, i, k, lengths[k], t)
        width += radius[i, k] + t * (radius[i, k + 1] - radius[i, k])
    else:  # a tool that the tip holds
        x = spot(points, i, k)
        x = plus(x, times(t, minus(row(tool, i), x)))
    if kind == MESH:
        return _of_mesh(side, int(q[0]), meshes, stack, x, exact, most + width) - width
    return side * signed_distance(kind, q, x)[0] - width


@inline
def _of_mesh(side, m, meshes, stack, x, exact, most):
    # Arrays of a tuple are counted when they have names: they have none here.
    near, node = in_field(x, meshes[5], meshes[6], meshes[7], meshes[0][m, 2], m)
    if not exact or side * near - FIELD_ERROR * meshes[5][m, 3] > most:
        return side * near
    root, begin = meshes[0][m, 0], meshes[0][m, 1]
    found = nearest_in(
        x, meshes[8][node], meshes[1], root, meshes[2], begin, meshes[0][m + 1, 1] - begin - 1,
        meshes[3], meshes[4], stack, 1.0,
    )  # fmt: skip
    return side * found[0]


@inline
def _past_mesh(
    side, wanted, q, meshes, stack, points, tangents, radius, disks, tool, lengths, parts, i,
    first, last, best, tol
):  # fmt: skip
    """As `_past` by the field of a mesh, and exactly where that cannot tell whether arms touch."""
    error = FIELD_ERROR * meshes[5][int(q[0]), 3]
    near, place = _past(
        MESH, side, wanted, q, meshes, stack, points, tangents, radius, disks, tool, lengths,
        parts, i, first, last, best + error, tol, False,
    )  # fmt: skip
    if place < 0.0:
        return best, place
    k = min(int(place), max(len(lengths) - 1, last - 1))
    gap = _gap(
        MESH, side, wanted, q, meshes, stack, points, tangents, radius, tool, lengths, i, k,
        place - k, True, _FARTHEST,
    )  # fmt: skip
    e = int(place)
    if place == e and e < len(disks) and disks[e] > 0.0:
        gap += radius[i, e] - disks[e]
    place = place if gap < best else -1.0
    best = min(gap, best)
    if near - error < 0.0 < best:
        again, its = _past(
            MESH, side, wanted, q, meshes, stack, points, tangents, radius, disks, tool, lengths,
            parts, i, first, last, best, tol, True,
        )  # fmt: skip
        if its >= 0.0:
            best, place = again, its
    return best, place


@inline
def _speed(points, tangents, radius, tool, lengths, i, k):
    """How fast the gap of step k may change with the share of its arc at most."""
    middle, apart = 0.0, 0.0
    if k == len(lengths):
        for axis in range(3):
            apart += (tool[i, axis] - points[i, k, axis]) ** 2
        return math.sqrt(apart)
    for axis in range(3):
        each = 3.0 * (points[i, k + 1, axis] - points[i, k, axis])
        each -= lengths[k] * (tangents[i, k, axis] + tangents[i, k + 1, axis])
        middle += each * each
    change = abs(radius[i, k + 1] - radius[i, k])
    return max(lengths[k], math.sqrt(middle)) + change


@inline
def _past(
    kind, side, wanted, q, meshes, stack, points, tangents, radius, disks, tool, lengths, parts, i,
    first, last, best, tol, exact
):  # fmt: skip
    """The least gap between two edges that is below `best`, and its place.

    Between two points with gaps a and b, that may change by d between them, it is at least
    (a + b - d)/2. Gaps at the edges come first, as the nearest of them spares most of the others.
    """
    place, steps, size = -1.0, len(lengths), 0
    for e in range(first, last + 1):
        k = min(e, steps - 1) if e <= steps else steps
        gap = _gap(
            kind, side, wanted, q, meshes, stack, points, tangents, radius, tool, lengths, i, k,
            float(e - k), exact, best + tol,
        )  # fmt: skip
        parts[e, 4] = gap
        if e <= steps and disks[e] > 0.0:
            gap += radius[i, e] - disks[e]
        if gap < best:
            best, place = gap, float(e)
    for k in range(first, last):
        speed = _speed(points, tangents, radius, tool, lengths, i, k)
        parts[0, 0], parts[0, 1], size = 0.0, parts[k, 4], 1
        parts[0, 2], parts[0, 3] = 1.0, parts[k + 1, 4]
        if k == steps:  # without the width of the tip
            parts[0, 1] += radius[i, k]
        while size:
            size -= 1
            lower, below, upper, above = (
                parts[size, 0], parts[size, 1], parts[size, 2], parts[size, 3]
            )  # fmt: skip
            if 0.5 * (below + above - (upper - lower) * speed) >= best - tol:
                continue
            middle = 0.5 * (lower + upper)
            gap = _gap(
                kind, side, wanted, q, meshes, stack, points, tangents, radius, tool, lengths, i, k,
                middle, exact, best + tol,
            )  # fmt: skip
            if gap < best:
                best, place = gap, k + middle
            parts[size, 2], parts[size, 3] = middle, gap
            size += 1
            parts[size, 0], parts[size, 1], parts[size, 2], parts[size, 3] = (
                middle, gap, upper, above
            )  # fmt: skip
            size += 1
    return best, place


@inline
def _lay(points, tangents, radius, lengths, i, sag, spots, widths, arc, share, firsts):
    """Put a polyline of an arm into place."""
    n = 0
    for k in range(len(lengths)):
        firsts[k] = n
        bend = _bend(points, tangents, i, k, lengths[k])
        parts = min(max(math.ceil(math.sqrt(bend / (8.0 * sag))), 1), MOST_PARTS)
        for j in range(parts + 1):
            t = j / parts
            x = _at(points, tangents, i, k, lengths[k], t)
            spots[n, 0], spots[n, 1], spots[n, 2] = x
            widths[n], share[n] = radius[i, k] + t * (radius[i, k + 1] - radius[i, k]), k + t
            arc[n] = (arc[n - 1] if n else 0.0) + (lengths[k] / parts if j else 0.0)
            n += 1
    firsts[len(lengths)] = n


@inline
def _apart(spots, a, b):
    """Shares of chords a and b at which they come nearest, and the distance there."""
    p, r = row(spots, a), row(spots, b)
    u = minus(row(spots, a + 1), p)
    v = minus(row(spots, b + 1), r)
    w = minus(p, r)
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
def _from_start_to_end(spots, a, b):
    apart = minus(row(spots, a), row(spots, b + 1))
    return math.sqrt(dot(apart, apart))


@inline
def _folded(
    points, tangents, radius, lengths, i, sag, spots, widths, arc, share, firsts, best
):  # fmt: skip
    """The least gap between parts of an arm below `best` and half their width, and both places."""
    place, other, count, laid = -1.0, -1.0, len(lengths), False
    for k in range(count):
        turn = _bend(points, tangents, i, k, lengths[k]) / max(lengths[k], 1e-300)
        passed = lengths[k]
        for m in range(k + 1, count):
            turn += _bend(points, tangents, i, m, lengths[m]) / max(lengths[m], 1e-300)
            passed += lengths[m]
            if turn < _TURN:
                continue
            square = 0.0
            for axis in range(3):
                here = points[i, k, axis] + points[i, k + 1, axis]
                square += (0.5 * (here - points[i, m, axis] - points[i, m + 1, axis])) ** 2
            wide = max(radius[i, k], radius[i, k + 1]) + max(radius[i, m], radius[i, m + 1])
            least = math.sqrt(square) - 0.5 * (lengths[k] + lengths[m])
            if least > _BACK * passed or least - wide > min(best, 0.5 * wide):
                continue
            if not laid:
                laid = True
                _lay(points, tangents, radius, lengths, i, sag, spots, widths, arc, share, firsts)
            for a in range(firsts[k], firsts[k + 1] - 1):
                for b in range(firsts[m], firsts[m + 1] - 1):
                    s, t, gap = _apart(spots, a, b)
                    along = arc[b] + t * (arc[b + 1] - arc[b]) - arc[a] - s * (arc[a + 1] - arc[a])
                    if gap >= _BACK * along:  # where both are nearest; farther apart they may count
                        s, t, along = 0.0, 1.0, arc[b + 1] - arc[a]
                        gap = _from_start_to_end(spots, a, b)
                        if gap >= _BACK * along:
                            continue
                    wide = widths[a] + s * (widths[a + 1] - widths[a])
                    wide += widths[b] + t * (widths[b + 1] - widths[b])
                    gap -= wide
                    if gap < min(best, 0.5 * wide):
                        best = gap
                        place = share[a] + s * (share[a + 1] - share[a])
                        other = share[b] + t * (share[b + 1] - share[b])
    return best, place, other


@kernel
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
    lengths, stack, parts, spots, widths, arc, share, firsts = room
    solids, edge = len(kinds) - 1, len(disks) - 1
    for i in range(points.shape[0]):
        for k in range(edge):
            lengths[k] = _arc(points, tangents, i, k)
        best, found, at, other = _FARTHEST, NONE, -1.0, -1.0
        for o in range(solids):
            first, last, wanted = ends[o, 0], ends[o, 1], numbers[o, -1]
            if kinds[o, 0] == HALF_SPACE:
                near, its = _over_plane(
                    points, tangents, radius, disks, lengths, i, numbers[o], first, last,
                    best + wanted,
                )  # fmt: skip
                near -= wanted
                if len(tool) and last == edge:
                    height = _height(row(tool, i), numbers[o]) - wanted
                    near, its = (height, edge + 1.0) if height < near else (near, its)
            else:
                last += len(tool) > 0 and last == edge
                if kinds[o, 0] == MESH:
                    near, its = _past_mesh(
                        kinds[o, 1], wanted, numbers[o], meshes, stack, points, tangents, radius,
                        disks, tool, lengths, parts, i, first, last, best, tol,
                    )  # fmt: skip
                else:
                    near, its = _past(
                        kinds[o, 0], kinds[o, 1], wanted, numbers[o], meshes, stack, points,
                        tangents, radius, disks, tool, lengths, parts, i, first, last, best, tol,
                        True,
                    )  # fmt: skip
            if its >= 0.0:
                best, found, at = near, o, its
        if kinds[solids, 1] > 0:
            near, its, there = _folded(
                points, tangents, radius, lengths, i, tol, spots, widths, arc, share, firsts, best
            )
            if its >= 0.0:
                best, found, at, other = near, ITSELF, its, there
        value[i], which[i] = best, found
        place[i, 0], place[i, 1] = at, other
