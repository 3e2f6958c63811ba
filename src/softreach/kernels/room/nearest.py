"""Where arms come nearest to solids around them, and to themselves.

Half-spaces take the least value of the cubic of each step. Past others it is cut into halves where
a nearer point may be.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from softreach.kernels.compiler import inline, lean_kernel
from softreach.kernels.room import HALF_SPACE, MESH
from softreach.kernels.room.cubics import at, measure
from softreach.kernels.room.folded import folded
from softreach.kernels.room.shapes import signed_distance
from softreach.kernels.room.triangles import FIELD_ERROR, least_in_field, nearest_in
from softreach.kernels.vector import minus, plus, row, spot, squared, times
from softreach.support.arrays import Array, Index

NONE, ITSELF = -1, -2
"""In place of the number of a solid."""
_FARTHEST = 1e150  # as kernels know no infinity
_SLACK = 0.5  # of the tolerance, in distances from meshes


class Solids(NamedTuple):
    """Solids around arms; the last row of each is none, of side 1 if the arm itself counts."""

    kinds: Index  # Kind, and the side that is free, shape (solid, 2)
    numbers: Array  # As `shapes` takes them, and the distance wanted, shape (solid, number)
    ends: Index  # First and last edges of the part of the arm that they concern, shape (solid, 2)


@inline
def _height(x, q):
    return (x[0] - q[0]) * q[3] + (x[1] - q[1]) * q[4] + (x[2] - q[2]) * q[5]


@inline
def _along(x, q):
    return x[0] * q[3] + x[1] * q[4] + x[2] * q[5]


@inline
def _over_plane(arms, disks, lengths, i, q, first, last, best):
    """The least height over a plane that is below `best`, and its place; that itself if none is."""
    place = -1.0
    below, r = _height(spot(arms.points, i, first), q), arms.radius[i, first]
    slope = _along(spot(arms.tangents, i, first), q)
    for k in range(first, last + 1):
        if below - r < best:
            best, place = below - r, k
        if disks[k] > 0.0 and below - disks[k] < best:
            best, place = below - disks[k], k
        if k == last:
            break
        above, rim = _height(spot(arms.points, i, k + 1), q), arms.radius[i, k + 1]
        end = _along(spot(arms.tangents, i, k + 1), q)
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
    if kind == MESH:
        return least_in_field(x, side, int(q[0]), meshes[0], meshes[1])
    d, u, v, w = signed_distance(kind, q, x)
    return side * d, minus(x, (d * u, d * v, d * w)), 0


@inline
def _distance(kind, side, q, meshes, stack, x, most, tol):
    """Distance of a point from a solid, one that is no larger, and a place of its surface there.

    Or from all but the solid where side is -1. That of a mesh may be too large by some of the
    tolerance, and for one farther than `most` some smaller distance does that is no less than that.
    """
    near, foot, node = _bound(kind, side, q, meshes, x)
    if kind != MESH or near > most:
        return near, near, foot
    (trees, fields), m = meshes, int(q[0])
    about, error = side * fields.distance[node], FIELD_ERROR * fields.grids[m, 3]
    most, enough = most if about > error else _FARTHEST, 1.0 - _SLACK * tol / (abs(about) + error)
    d, u, v, w, _ = nearest_in(x, m, fields.face[node], most, trees, stack, enough)
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
    here, there = squared(x, foot), squared(y, other)
    first, second = (
        max(squared(x, other) - here, 0.0),
        max(squared(y, foot) - there, 0.0),
    )
    share = first / max(first + second, 1e-300)
    middle = (1.0 - share) * here + share * (there + second) - share * (1.0 - share) * squared(x, y)
    return -math.sqrt(max(middle, here, there))


@inline
def _past(solid, meshes, arms, disks, steps, room, i, first, last, best, tol):
    """The least gap between two edges that is below `best`, and its place; -1 if none is.

    Gaps at the edges come first, as the nearest of them spares most of the others.
    """
    (kind, side, q), (stack, edges, _) = solid, room
    place, count, near, least = -1.0, len(steps.lengths), first, _FARTHEST
    for e in range(first, last + 1):
        x = spot(arms.points, i, e) if e <= count else row(arms.tool, i)
        d, foot, _ = _bound(kind, side, q, meshes, x)
        _keep(edges, e, 0, max(arms.radius[i, e], disks[e]) if e <= count else 0.0, d, foot)
        if d - edges[e, 0] < least:
            least, near = d - edges[e, 0], e
    for j in range(first - 1, last + 1 if kind == MESH else first):
        e = near if j < first else j
        width = edges[e, 0]
        if edges[e, 1] - width >= best + tol or j == near:
            continue
        x = spot(arms.points, i, e) if e <= count else row(arms.tool, i)
        d, least, foot = _distance(kind, side, q, meshes, stack, x, best + tol + width, tol)
        _keep(edges, e, 0, width, least, foot)
        if d - width < best:
            best, place = d - width, float(e)
    for k in range(first, last):
        best, place = _past_step(solid, meshes, arms, steps, room, i, k, best, place, tol)
    return best, place


@inline
def _past_step(solid, meshes, arms, steps, room, i, k, best, place, tol):
    """The same with what is between the ends of step k."""
    (kind, side, q), (stack, edges, pieces) = solid, room
    r, change, bulge, size = 0.0, 0.0, 0.0, 1
    if k < len(steps.lengths):
        r, change = arms.radius[i, k], arms.radius[i, k + 1] - arms.radius[i, k]
        speed, bulge = steps.speeds[k], steps.bends[k] / 8.0
    else:
        speed = math.sqrt(squared(row(arms.tool, i), spot(arms.points, i, k)))
    _keep(pieces, 0, 0, 0.0, edges[k, 1], _kept(edges, k, 2))
    _keep(pieces, 0, 5, 1.0, edges[k + 1, 1], _kept(edges, k + 1, 2))
    while size:
        size -= 1
        lower, below, foot = pieces[size, 0], pieces[size, 1], _kept(pieces, size, 2)
        upper, above, other = pieces[size, 5], pieces[size, 6], _kept(pieces, size, 7)
        share, w0, w1 = upper - lower, r + lower * change, r + upper * change
        bound = _least_between(below, above, w0, w1, share * speed, share * share * bulge)
        if bound < best - tol and below <= 0.0 and above <= 0.0:
            x, y = _place(arms, steps, i, k, lower), _place(arms, steps, i, k, upper)
            bound = _least_inside(x, y, foot, other) - max(w0, w1) - share * share * bulge
        if bound >= best - tol or share * speed <= tol:  # nor where rounding hides the bound
            continue
        t, width = 0.5 * (lower + upper), 0.5 * (w0 + w1)
        x = _place(arms, steps, i, k, t)
        d, least, foot = _distance(kind, side, q, meshes, stack, x, best + tol + width, tol)
        if d - width < best:
            best, place = d - width, k + t
        _keep(pieces, size + 1, 0, t, least, foot)
        _keep(pieces, size + 1, 5, upper, above, other)
        _keep(pieces, size, 5, t, least, foot)
        size += 2
    return best, place


@inline
def _place(arms, steps, i, k, t):
    """A point of step k, or of the line to a tool that the tip holds."""
    if k < len(steps.lengths):
        return at(arms, steps, i, k, t)
    x = spot(arms.points, i, k)
    return plus(x, times(t, minus(row(arms.tool, i), x)))


@inline
def _keep(table, n, first, number, distance, foot):
    table[n, first], table[n, first + 1], table[n, first + 2] = number, distance, foot[0]
    table[n, first + 3], table[n, first + 4] = foot[1], foot[2]


@inline
def _kept(table, n, first):
    return table[n, first], table[n, first + 1], table[n, first + 2]


@lean_kernel
def nearest(arms, disks, solids, meshes, tol, steps, room, value, which, place):
    """Least gaps (n,), with which solid (n,), and where along the arm (n, 2), of `Arms`.

    Disks (edge,) have radii where there are some. Meshes are trees and fields. Places are edges and
    shares of the arc to the next; the second is another on the arm.
    """
    count, edge, (middles, curvature), own = len(solids.kinds) - 1, len(disks) - 1, room[0], room[1]
    for i in range(len(arms.points)):
        measure(arms, i, steps)
        best, found, at_first, at_other = _FARTHEST, NONE, -1.0, -1.0
        for o in range(count):
            (first, last), q = (solids.ends[o, 0], solids.ends[o, 1]), solids.numbers[o]
            if solids.kinds[o, 0] == HALF_SPACE:
                near, its = _over_plane(arms, disks, steps.lengths, i, q, first, last, best + q[-1])
                if len(arms.tool) and last == edge:
                    height = _height(row(arms.tool, i), q)
                    near, its = (height, edge + 1.0) if height < near else (near, its)
            else:
                last += len(arms.tool) > 0 and last == edge
                solid = solids.kinds[o, 0], solids.kinds[o, 1], q
                near, its = _past(
                    solid, meshes, arms, disks, steps, own, i, first, last, best + q[-1], tol
                )
            if its >= 0.0:
                best, found, at_first = near - q[-1], o, its
        if solids.kinds[count, 1] > 0:
            near, its, there = folded(arms, steps, middles, curvature, i, tol, best)
            if its >= 0.0:
                best, found, at_first, at_other = near, ITSELF, its, there
        value[i], which[i] = best, found
        place[i, 0], place[i, 1] = at_first, at_other
