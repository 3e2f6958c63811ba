"""Delaunay triangulation of points in space, one point at a time (Bowyer 1981, Watson 1981).

Each new point digs out every cell whose circumscribed sphere holds it and fills the cavity with
cells that join its walls to the point. One ghost vertex beyond the convex hull closes the
mesh: every hull face is the base of a ghost cell, whose "sphere" is the half-space outside.

Ties. A cell is dug out only if the point lies *strictly* inside its sphere; a ghost cell if the
point lies strictly beyond its base, or in the plane of its base and in the sphere of the finite
cell behind it. With exact signs this is the placing ("pushing") triangulation of the lifted points:
always a valid Delaunay triangulation, whatever is cospherical or coplanar. The cavity is
star-shaped: a wall in one plane with the point would have the point inside the circle of that wall,
hence inside the spheres on both its sides, and would not be a wall. So every cell has volume.

Points enter in random rounds, each along a Hilbert curve: a random eighth of the points goes first,
an eighth of that before it, and so on (biased randomized insertion order), which keeps the
expected work low for any input; along the curve each point lies close to the one before, so that
walks are short and memory is reused.

The arrays and their conventions are in `kernels.points.triangulation`.

References:
    Amenta, Choi, Rote (2003), Incremental constructions con BRIO, SoCG, 211-219.
    Bowyer (1981), Computing Dirichlet tessellations, The Computer Journal 24, 162-166.
    Devillers, Pion, Teillaud (2002), Walking in a triangulation, Int. J. Found. Comput. Sci. 13.
    Skilling (2004), Programming the Hilbert curve, AIP Conference Proceedings 707, 381-387.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict
from softreach.kernels.points.predicates import (
    collinear,
    insphere,
    insphere_filter,
    orient,
    orient_filter,
    scratch,
)
from softreach.kernels.points.triangulation import (
    DEAD,
    GHOST,
    compact,
    corners,
    empty_edges,
    empty_table,
    empty_triangulation,
    enlarged,
    face,
    fill,
    ghost_slot,
    set_first_cell,
)

BITS = 16  # per axis; the round stands above the 48 bits of the curve
ROUNDS = 6
QUANTILES = 1024


def insertion_order(points, members=None, early=None):
    """Order in which to insert points (n, 3), or increasing members; those of a mask `early` first.

    A part keeps the order of the whole.
    """
    members = np.arange(len(points)) if members is None else members
    early = np.ones(len(points), np.bool_) if early is None else early
    if len(members) == 0:
        return members
    places = np.empty((len(members), 3), np.uint16)
    for axis in range(3):
        places[:, axis] = _crowding_scale(points[:, axis], members)
    keys = np.empty(len(members), np.uint64)
    _sort_keys(places, members, early, keys)
    return members[np.argsort(keys, kind="stable")]


def _crowding_scale(x, members):
    """Coordinates mapped to [0, 2^BITS), half by length, half by rank for the sake of outliers."""
    sample = np.sort(x[:: max(1, len(x) // QUANTILES)])
    spread = sample[-1] - sample[0]
    level = np.linspace(0.0, 1.0, len(sample))
    if spread > 0:
        level = 0.5 * level + 0.5 * (sample - sample[0]) / spread
    return np.interp(x[members], sample, level * (2**BITS - 1)).astype(np.uint16)


@strict
def _sort_keys(places, members, early, keys):
    """Write one integer per point: its round, then its place on the Hilbert curve."""
    for i in range(len(places)):
        x, y, z = np.uint32(places[i, 0]), np.uint32(places[i, 1]), np.uint32(places[i, 2])
        late = np.uint64(ROUNDS - _round_from_end(members[i]))
        if not early[members[i]]:
            late = np.uint64(ROUNDS + 1)
        keys[i] = (late << np.uint64(3 * BITS)) | _hilbert(x, y, z)


@strict
def _round_from_end(i):
    """0 for seven points of eight, 1 for seven eighths of the rest, ...: a hash of the index."""
    bits = np.uint64(i + 1) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    bits ^= bits >> np.uint64(32)
    early = 0
    while early < ROUNDS and bits & np.uint64(7) == np.uint64(0):
        bits >>= np.uint64(3)
        early += 1
    return early


@strict
def _hilbert(x, y, z):
    """Position of the cell (x, y, z) along the Hilbert curve through 2^(3 BITS) cells."""
    x, y, z = _untwist(x, y, z)
    position = np.uint64(0)
    for bit in range(BITS - 1, -1, -1):
        shift = np.uint32(bit)
        for axis in (x, y, z):
            position = (position << np.uint64(1)) | np.uint64((axis >> shift) & np.uint32(1))
    return position


@strict
def _untwist(x, y, z):
    """Skilling's transform of axes to the transposed Hilbert index."""
    for bit in range(BITS - 1, 0, -1):
        q = np.uint32(1) << np.uint32(bit)
        low = q - np.uint32(1)
        if x & q:
            x ^= low
        x, y = _reflect(x, y, q, low)
        x, z = _reflect(x, z, q, low)
    y ^= x
    z ^= y
    flip = np.uint32(0)
    for bit in range(BITS - 1, 0, -1):
        q = np.uint32(1) << np.uint32(bit)
        if z & q:
            flip ^= q - np.uint32(1)
    return x ^ flip, y ^ flip, z ^ flip


@strict
def _reflect(x, other, q, low):
    """Invert the low bits of x where the other axis has bit q set, else exchange them."""
    if other & q:
        return x ^ low, other
    swap = (x ^ other) & low
    return x ^ swap, other ^ swap


CROWDED = 50_000  # cells beside those that are usual
USUAL = 16  # cells of a point, at most
REMADE = 3  # times that a cell is made and dug out again, at most
INSIDE, UNSURE = np.intp(-1), np.intp(-2)


def triangulate(points, lies_on_curve, early=0, look=None):
    """Insert points (n, 3) in [-1, 1], multiples of 2^-200 (see `predicates`), in the given order.

    Points in space and on surfaces have four to eight cells each, of some thirty that are made;
    those on a curve have as many as there are points: when cells crowd, `lies_on_curve()` gives up.
    `look` is called with the cells of the first `early` points; those with negative vertices are
    none. Cells (m, 4), neighbors (m, 4) with -1 outside the hull, and for every point itself or the
    equal point inserted before it. No cells if the points lie in one plane, or it was given up.
    """
    crowded = CROWDED
    w, start, same = scratch(), np.zeros(4, np.int64), np.arange(len(points))
    mesh = empty_triangulation(8 * len(points) + 64)
    edges = empty_edges(len(points))
    at, used, free, last = 0, 0, DEAD, 0
    for stop in (early, len(points)) if 0 < early < len(points) else (len(points),):
        while True:
            at, walls, used, free, last = _insert(
                points, mesh, start, same, edges, w, at, used, free, last, crowded, stop
            )
            if at >= stop:
                break
            if walls > 0:
                mesh = enlarged(mesh, used, walls)
                edges = edges._replace(table=empty_table(walls))
            elif lies_on_curve():
                return mesh.cells[:0], mesh.neighbors[:0], same
            else:
                crowded = np.iinfo(np.int64).max // (2 * REMADE)
        if look is not None and at == early and start.max() < early:
            look(mesh.cells[:used])
    return mesh.cells[:used], mesh.neighbors[:used], same


@strict
def _insert(points, mesh, start, same, edges, w, at, used, free, last, crowded, stop):
    """Insert points from number `at` up to `stop` while there is room; no cells yet if `at` is 0.

    Memory is left to the caller: a kernel that asks for it takes longer to compile. Returned are
    the first point that was not inserted, and the walls of its cavity, or 0 if there are more than
    `crowded` cells beside 16 for each point, or three times as many were made; slots used (by
    finite cells in the end), the head of the freed slots and the last cell, to go on with.
    """
    if at == 0:
        used = first_cell(points, mesh, start, w)
        if used == 0:
            return len(points), 0, used, free, last
    made = 0
    for p in range(at, stop):
        if used > crowded + USUAL * p or made > REMADE * (crowded + USUAL * (p - at)):
            return p, 0, used, free, last
        if p == start[0] or p == start[1] or p == start[2] or p == start[3]:
            continue
        cell = locate(points, mesh, p, last, w)
        twin = twin_in(points, mesh, p, cell)
        if twin >= 0:
            same[p] = twin
            continue
        dug, walls = dig(points, mesh, p, cell, w)
        if used + walls > len(mesh.mark) or 8 * walls > edges.table.shape[1]:
            return p, walls, used, free, last
        used, free, last = fill(mesh, p, dug, walls, used, free, edges)
        made += walls
    return stop, 0, compact(mesh, used) if stop == len(points) else used, free, last


@strict
def first_cell(points, mesh, start, w):
    """Start from four points that span space; return the slots used, 0 if there are none."""
    n = len(points)
    a, b = np.intp(0), np.intp(1)
    while b < n and equal(points, a, b):
        b += 1
    c = b + 1
    while c < n and collinear(points, a, b, c, w):
        c += 1
    d, side = c + 1, 0.0
    while d < n:
        side = orient(points, a, b, c, d, w)
        if side != 0.0:
            break
        d += 1
    if d >= n:
        return 0
    if side < 0.0:
        b, c = c, b
    start[0], start[1], start[2], start[3] = a, b, c, d
    return set_first_cell(mesh, start)


@strict
def equal(points, a, b):
    """True if two points are the same."""
    return (
        points[a, 0] == points[b, 0]
        and points[a, 1] == points[b, 1]
        and points[a, 2] == points[b, 2]
    )


@strict
def locate(points, mesh, p, t, w):
    """Walk from cell t to the finite cell that holds p, or a ghost cell whose base p is beyond.

    At every cell step through a face that has p on its other side. The face looked at first
    changes from step to step, so that no walk runs in circles among cospherical points.
    """
    cells, neighbors = mesh.cells, mesh.neighbors
    slot = ghost_slot(cells, t)
    if slot >= 0:
        t = np.intp(neighbors[t, slot])
    came_from, turn = GHOST, np.uint32(p)
    while ghost_slot(cells, t) < 0:
        turn = turn * np.uint32(1664525) + np.uint32(1013904223)
        first = np.int64(turn >> np.uint32(30))
        onward = sure_exit(points, cells, neighbors, p, t, came_from, first)
        if onward == UNSURE:
            onward = exact_exit(points, cells, p, t, first, w)
        if onward == INSIDE:
            return t
        came_from, t = t, np.intp(neighbors[t, onward])
    return t


@strict
def sure_exit(points, cells, neighbors, p, t, came_from, first):
    """A face of finite cell t with p beyond it, INSIDE, or UNSURE because of rounding."""
    answer = INSIDE
    for k in range(4):
        i = (first + k) & 3
        if neighbors[t, i] != came_from:
            a, b, c = face(cells, t, i)
            beyond = orient_filter(points, a, b, c, p)
            if beyond > 0.0:
                return i
            if beyond == 0.0:
                answer = UNSURE
    return answer


@strict
def exact_exit(points, cells, p, t, first, w):
    """A face of finite cell t with p strictly beyond it, or INSIDE."""
    for k in range(4):
        i = (first + k) & 3
        if beyond(points, cells, p, t, i, w) > 0.0:
            return i
    return INSIDE


@strict
def beyond(points, cells, p, t, i, w):
    """+1 if p lies beyond face i of cell t, 0 in its plane, -1 on the side of the cell."""
    a, b, c = face(cells, t, i)
    return orient(points, a, b, c, p, w)


@strict
def twin_in(points, mesh, p, t):
    """The vertex of cell t that equals p; -1 if none."""
    for i in range(4):
        v = np.intp(mesh.cells[t, i])
        if v >= 0 and equal(points, v, p):
            return v
    return -1


@strict
def sure_conflict(points, cells, p, t):
    """+1 if p lies inside the sphere of cell t, -1 if outside, 0 if unsure or a ghost cell."""
    a, b, c, d = corners(cells, t)
    return insphere_filter(points, a, b, c, d, p) if (a | b | c | d) >= 0 else 0.0


@strict
def exact_conflict(points, cells, neighbors, p, t, w):
    """+1 if p lies strictly inside the sphere of cell t (see the module on ghosts and ties)."""
    slot = ghost_slot(cells, t)
    if slot >= 0:
        # the base of a ghost cell, seen from the ghost, faces the hull
        within = -beyond(points, cells, p, t, slot, w)
        if within != 0.0:
            return within
        t = np.intp(neighbors[t, slot])
    a, b, c, d = corners(cells, t)
    return insphere(points, a, b, c, d, p, w)


@strict
def dig(points, mesh, p, start, w):
    """Find the cells in conflict with p, from one of them outwards; return how many, and walls."""
    cells, neighbors, mark, dug, walls = mesh
    inside, outside = 2 * p + 1, 2 * p
    dug[0], mark[start] = start, inside
    n_dug, n_walls, at = 1, 0, 0
    while at < n_dug:
        t = np.intp(dug[at])
        at += 1
        for i in range(4):
            u = np.intp(neighbors[t, i])
            if mark[u] != inside and mark[u] != outside:
                within = sure_conflict(points, cells, p, u)
                if within == 0.0:
                    within = exact_conflict(points, cells, neighbors, p, u, w)
                if within > 0.0:
                    mark[u], dug[n_dug] = inside, u
                    n_dug += 1
                else:
                    mark[u] = outside
            if mark[u] == outside:
                walls[n_walls] = 4 * t + i
                n_walls += 1
    return n_dug, n_walls
