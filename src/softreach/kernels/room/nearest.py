"""Where arms come nearest to solids around them, and to themselves.

Between two edges of its steps an arm is the cubic through their centers and tangents, which are as
long as the arc, and its radius is linear. Half-spaces take the least value of that cubic. Other
solids are marched past along a polyline of it, by steps that nothing nearer can lie in, as
distances change no faster than places. Two pieces come near each other only if the arm turns
by 1.77 rad between them: less keeps the chord of an arc above 2/π of its length.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.room.shapes import HALF_SPACE, MESH, signed_distance
from softreach.kernels.room.triangles import nearest_in, node_near
from softreach.kernels.vector import dot, minus, plus, row, times

NONE, ITSELF = -1, -2
"""In place of the number of a solid."""
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
    p, q, u, v = points[i, k], points[i, k + 1], tangents[i, k], tangents[i, k + 1]
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
    below, r = _height(points[i, first], q), radius[i, first]
    slope = _along(tangents[i, first], q)
    for k in range(first, last + 1):
        if below - r < best:
            best, place = below - r, k
        if disks[k] > 0.0 and below - disks[k] < best:
            best, place = below - disks[k], k
        if k == last:
            break
        above, rim = _height(points[i, k + 1], q), radius[i, k + 1]
        end = _along(tangents[i, k + 1], q)
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
def _lay(points, tangents, radius, disks, tool, lengths, i, sag, line):
    """Put the polyline of an arm into place; the number of its points."""
    spots, widths, way, arc, share, firsts = line
    n = 0
    for k in range(len(lengths)):
        firsts[k] = n
        bend = _bend(points, tangents, i, k, lengths[k])
        parts = min(max(math.ceil(math.sqrt(bend / (8.0 * sag))), 1), MOST_PARTS)
        r, rim = radius[i, k], radius[i, k + 1]
        for j in range(parts + 1):
            t = j / parts
            x = _at(points, tangents, i, k, lengths[k], t)
            if j == 0 and disks[k] > 0.0:
                n = _put(spots, widths, way, arc, share, n, x, disks[k], k)
            n = _put(spots, widths, way, arc, share, n, x, r + t * (rim - r), k + t)
    edge = len(lengths)
    firsts[edge] = n
    if disks[edge] > 0.0 or len(tool):
        x = row(points[i], edge)
        n = _put(spots, widths, way, arc, share, n, x, disks[edge], edge)
    if len(tool):
        n = _put(spots, widths, way, arc, share, n, x, 0.0, edge)
        n = _put(spots, widths, way, arc, share, n, row(tool, i), 0.0, edge + 1)
    return n


@inline
def _put(spots, widths, way, arc, share, n, x, width, place):
    spots[n, 0], spots[n, 1], spots[n, 2] = x
    widths[n], share[n] = width, place
    if n:
        apart = minus(x, row(spots, n - 1))
        step = math.sqrt(dot(apart, apart))
        arc[n] = arc[n - 1] + step
        way[n] = way[n - 1] + step + abs(width - widths[n - 1])
    else:
        arc[n], way[n] = 0.0, 0.0
    return n + 1


@inline
def _between(spots, n, t):
    return (
        spots[n, 0] + t * (spots[n + 1, 0] - spots[n, 0]),
        spots[n, 1] + t * (spots[n + 1, 1] - spots[n, 1]),
        spots[n, 2] + t * (spots[n + 1, 2] - spots[n, 2]),
    )


@inline
def _gap(kind, side, q, meshes, stack, x, most):
    """Distance of x from a solid, or from all but it where side is -1; or less beyond `most`."""
    if kind != MESH:
        return side * signed_distance(kind, q, x)[0]
    sizes, boxes, starts, corners, normals, grids, shapes, field, faces = meshes
    m = int(q[0])
    node, away = node_near(x, grids[m], shapes[m])
    node += sizes[m, 3]
    least = side * field[node] - away
    if least > most:
        return least
    b, s, f = sizes[m, 0], sizes[m, 1], sizes[m, 2]
    c, d, e = sizes[m + 1, 0], sizes[m + 1, 1], sizes[m + 1, 2]
    tree = boxes[b:c], starts[s:d], corners[f:e], normals[f:e]
    return side * nearest_in(x, faces[node], tree[0], tree[1], tree[2], tree[3], stack, 1.0)[0]


@inline
def _marched(solid, meshes, stack, line, first, last, best, tol):
    """The least gap between points of a polyline that is below `best`, and its place."""
    kind, side, bulges, wanted, q = solid
    spots, widths, way, share = line[0], line[1], line[2], line[4]
    place, n, t, here = -1.0, first, 0.0, way[first]
    while True:
        width = widths[n] + (t * (widths[n + 1] - widths[n]) if n < last else 0.0)
        x = _between(spots, n, t) if n < last else row(spots, n)
        ahead = _gap(kind, side, q, meshes, stack, x, best + width + wanted + tol)
        value = ahead - width - wanted
        if value < best:
            best = value
            place = share[n] + (t * (share[n + 1] - share[n]) if n < last else 0.0)
        if n >= last:
            return best, place
        here += max(value - best, 0.0) + tol
        while n < last and way[n + 1] <= here:
            n += 1
        if n >= last:
            n, t = last, 0.0
        elif bulges:  # between two points the gap is no less than at one of them
            n, t = n + 1, 0.0
            here = way[n]
        else:
            t = (here - way[n]) / max(way[n + 1] - way[n], 1e-300)


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
def _folded(points, tangents, radius, lengths, i, line, best):
    """The least gap between two parts of an arm that is below `best`, and both places."""
    spots, widths, _, arc, share, firsts = line
    place, other, count = -1.0, -1.0, len(lengths)
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
            if least > _BACK * passed or least - wide > best:
                continue
            for a in range(firsts[k], firsts[k + 1] - 1):
                for b in range(firsts[m], firsts[m + 1] - 1):
                    if share[a + 1] == share[a] or share[b + 1] == share[b]:
                        continue
                    s, t, gap = _apart(spots, a, b)
                    along = arc[b] + t * (arc[b + 1] - arc[b]) - arc[a] - s * (arc[a + 1] - arc[a])
                    if gap >= _BACK * along:  # where both are nearest; farther apart they may count
                        s, t, along = 0.0, 1.0, arc[b + 1] - arc[a]
                        gap = _from_start_to_end(spots, a, b)
                        if gap >= _BACK * along:
                            continue
                    gap -= widths[a] + s * (widths[a + 1] - widths[a])
                    gap -= widths[b] + t * (widths[b + 1] - widths[b])
                    if gap < best:
                        best = gap
                        place = share[a] + s * (share[a + 1] - share[a])
                        other = share[b] + t * (share[b + 1] - share[b])
    return best, place, other


@inline
def _is_folded(points, tangents, i, lengths):
    """True if an arm turns far enough to come near itself."""
    turn = 0.0
    for k in range(len(lengths)):
        turn += _bend(points, tangents, i, k, lengths[k]) / max(lengths[k], 1e-300)
    return turn >= _TURN


@kernel
def nearest(
    points,
    tangents,
    radius,
    disks,
    tool,
    kinds,
    numbers,
    ends,
    meshes,
    tol,
    room,
    value,
    which,
    place,
):
    """Least gaps (n,), with which solid (n,), and where along the arm (n, 2), of arms at edges.

    Arms are centers (n, edge, 3), tangents (n, edge, 3) and radii (n, edge); disks (edge,) have
    radii where there are some, and a tool is a point (n, 3) that a line leads to from the tip, or
    (0, 3). Solids have a kind, the side that is free and whether that bulges (solid, 3), numbers,
    and the distance wanted behind these; and first and last edges (solid, 2) of the part of the arm
    that they concern. The last row of each is no solid, and of the side 1 if the arm itself
    counts. Places are edges and shares of the arc to the next; the second is another on the arm.
    """
    lengths, stack, line = room
    solids, edge = len(kinds) - 1, len(disks) - 1
    for i in range(points.shape[0]):
        for k in range(edge):
            lengths[k] = _arc(points, tangents, i, k)
        arm = points, tangents, radius, disks, lengths
        best, found, at, other = _FARTHEST, NONE, -1.0, -1.0
        laid = kinds[solids, 1] > 0 and _is_folded(points, tangents, i, lengths)
        folded, count = laid, 0
        for o in range(solids):
            if kinds[o, 0] == HALF_SPACE:
                near, share = _over(arm, tool, i, numbers[o], ends[o, 0], ends[o, 1], best)
                if share >= 0.0:
                    best, found, at = near, o, share
            else:
                laid = True
        if laid:
            count = _lay(points, tangents, radius, disks, tool, lengths, i, tol, line)
        for o in range(solids):
            if kinds[o, 0] != HALF_SPACE:
                solid = kinds[o, 0], kinds[o, 1], kinds[o, 2] > 0, numbers[o, -1], numbers[o]
                first = line[5][ends[o, 0]]
                last = count - 1 if ends[o, 1] == edge else line[5][ends[o, 1]]
                near, share = _marched(solid, meshes, stack, line, first, last, best, tol)
                if share >= 0.0:
                    best, found, at = near, o, share
        if folded:
            near, share, its = _folded(points, tangents, radius, lengths, i, line, best)
            if share >= 0.0:
                best, found, at, other = near, ITSELF, share, its
        value[i], which[i] = best, found
        place[i, 0], place[i, 1] = at, other


@inline
def _over(arm, tool, i, q, first, last, best):
    """The same for a half-space with the distance wanted, and a tool that the tip holds."""
    points, tangents, radius, disks, lengths = arm
    wanted, edge = q[-1], len(disks) - 1
    near, place = _over_plane(
        points, tangents, radius, disks, lengths, i, q, first, last, best + wanted
    )
    if len(tool) and last == edge and _height(tool[i], q) < near:
        near, place = _height(tool[i], q), edge + 1.0
    return near - wanted, place
