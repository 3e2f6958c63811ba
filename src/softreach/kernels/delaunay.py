"""Delaunay triangulation of points in space, one point at a time (Bowyer 1981, Watson 1981).

Each new point digs out every cell whose circumscribed sphere holds it and fills the cavity with
cells that join its walls to the point. One ghost vertex (`GHOST`) beyond the convex hull closes the
mesh: every hull face is the base of a ghost cell, whose "sphere" is the half-space outside.

Ties. A cell is dug out only if the point lies *strictly* inside its sphere; a ghost cell if the
point lies strictly beyond its base, or in the plane of its base and in the sphere of the finite
cell behind it. With exact signs this is the placing ("pushing") triangulation of the lifted points:
always a valid Delaunay triangulation, whatever is cospherical or coplanar. The cavity is
star-shaped: a wall in one plane with the point would have the point inside the circle of that wall,
hence inside the spheres on both its sides, and would not be a wall. So every cell has volume.

Conventions: a cell abcd has det[b-a, c-a, d-a] > 0; neighbor i lies opposite vertex i.

References:
    Bowyer (1981), Computing Dirichlet tessellations, The Computer Journal 24, 162-166.
    Devillers, Pion, Teillaud (2002), Walking in a triangulation, Int. J. Found. Comput. Sci. 13.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from softreach.kernels.expansions import scratch
from softreach.kernels.predicates import (
    collinear,
    insphere,
    insphere_filter,
    orient,
    orient_filter,
)

__all__ = ["FACES", "GHOST", "triangulate"]

GHOST = -1
DEAD = -2
INSIDE, UNSURE = -1, -2
# Vertices of the face opposite vertex i, in the order that makes its normal point outwards.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class Mesh(NamedTuple):
    """Cells in their slots, and room to note a cavity.

    A freed slot holds DEAD and, as neighbor 0, the next freed slot. ``dug`` lists the cells of the
    cavity, ``walls`` its faces as 4 · cell + face.
    """

    cells: np.ndarray
    neighbors: np.ndarray
    mark: np.ndarray
    dug: np.ndarray
    walls: np.ndarray


@njit(cache=True, nogil=True)
def triangulate(points):
    """Insert points in the given order.

    Args:
        points: Coordinates in [-1, 1], multiples of 2^-200 (see `predicates`), shape (n, 3).

    Returns:
        Cells (m, 4), neighbors (m, 4) with -1 outside the hull, and for every point itself or the
        equal point inserted before it, shape (n,). No cells if the points lie in one plane.
    """
    w = scratch()
    same = np.arange(len(points))
    start = first_cell(points, w)
    if start[3] < 0:
        return np.empty((0, 4), np.int32), np.empty((0, 4), np.int32), same
    mesh = empty_mesh(8 * len(points) + 64)
    used = set_first_cell(mesh, start)
    free, last = DEAD, 0
    table = np.empty((2, 2048), np.int64)
    for p in range(len(points)):
        if p in start:
            continue
        found = locate(points, mesh, p, last, w)
        twin = twin_in(points, mesh, p, found)
        if twin >= 0:
            same[p] = twin
            continue
        dug, walls = dig(points, mesh, p, found, w)
        if used + walls > len(mesh.mark):
            mesh = grown_mesh(mesh, walls)
        if 8 * walls > table.shape[1]:
            table = np.empty((2, 32 * walls), np.int64)
        used, free, last = fill(mesh, p, dug, walls, used, free, table)
    count = compact(mesh, used)
    return mesh.cells[:count], mesh.neighbors[:count], same


@njit(cache=True)
def first_cell(points, w):
    """Four points that span space, positively oriented; (0, 0, 0, -1) if there are none."""
    n = len(points)
    b = 1
    while b < n and equal(points, 0, b):
        b += 1
    c = b + 1
    while c < n and collinear(points, 0, b, c, w):
        c += 1
    d = c + 1
    while d < n and orient(points, 0, b, c, d, w) == 0.0:
        d += 1
    if d >= n:
        return 0, 0, 0, -1
    if orient(points, 0, b, c, d, w) > 0.0:
        return 0, b, c, d
    return 0, c, b, d


@njit(cache=True)
def equal(points, a, b):
    """Whether two points are the same."""
    return (
        points[a, 0] == points[b, 0]
        and points[a, 1] == points[b, 1]
        and points[a, 2] == points[b, 2]
    )


@njit(cache=True)
def empty_mesh(size):
    """A mesh with room for ``size`` cells; memory is touched only as cells come."""
    return Mesh(
        np.empty((size, 4), np.int32),
        np.empty((size, 4), np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(2 * size + 4, np.int64),
    )


@njit(cache=True)
def grown_mesh(mesh, more):
    """A copy with at least ``more`` further slots."""
    size = len(mesh.mark)
    grown = empty_mesh(size + size // 2 + more)
    grown.cells[:size] = mesh.cells
    grown.neighbors[:size] = mesh.neighbors
    grown.mark[:size] = mesh.mark
    grown.dug[:size] = mesh.dug
    grown.walls[: 2 * size] = mesh.walls[: 2 * size]
    return grown


@njit(cache=True)
def set_first_cell(mesh, start):
    """The first cell and the ghost cells on its four faces; return the number of slots used."""
    mesh.mark[:5] = -1
    for i in range(4):
        mesh.cells[0, i] = start[i]
        mesh.neighbors[0, i] = i + 1
        for k in range(3):
            mesh.cells[i + 1, k] = start[FACES[i, k]]
            mesh.neighbors[i + 1, k] = FACES[i, k] + 1
        mesh.cells[i + 1, 3] = GHOST
        mesh.neighbors[i + 1, 3] = 0
    return 5


@njit(cache=True)
def ghost_slot(cells, t):
    """Which vertex of cell t is the ghost; -1 if none."""
    for i in range(4):
        if cells[t, i] == GHOST:
            return i
    return -1


@njit(cache=True)
def locate(points, mesh, p, t, w):
    """Walk from cell t to the finite cell that holds p, or a ghost cell whose base p is beyond.

    At every cell step through a face that has p on its other side. The face looked at first
    changes from step to step, so that no walk runs in circles among cospherical points.
    """
    cells, neighbors = mesh.cells, mesh.neighbors
    slot = ghost_slot(cells, t)
    if slot >= 0:
        t = neighbors[t, slot]
    came_from, turn = -1, np.uint32(p)
    while ghost_slot(cells, t) < 0:
        turn = turn * np.uint32(1664525) + np.uint32(1013904223)
        first = np.int64(turn >> np.uint32(30))
        onward = sure_exit(points, cells, neighbors, p, t, came_from, first)
        if onward == UNSURE:
            onward = exact_exit(points, cells, p, t, first, w)
        if onward == INSIDE:
            return t
        came_from, t = t, neighbors[t, onward]
    return t


@njit(cache=True)
def sure_exit(points, cells, neighbors, p, t, came_from, first):
    """A face of finite cell t with p beyond it, INSIDE, or UNSURE because of rounding."""
    answer = INSIDE
    for k in range(4):
        i = (first + k) & 3
        if neighbors[t, i] != came_from:
            a, b, c = cells[t, FACES[i, 0]], cells[t, FACES[i, 1]], cells[t, FACES[i, 2]]
            beyond = orient_filter(points, a, b, c, p)
            if beyond > 0.0:
                return i
            if beyond == 0.0:
                answer = UNSURE
    return answer


@njit(cache=True)
def exact_exit(points, cells, p, t, first, w):
    """A face of finite cell t with p strictly beyond it, or INSIDE."""
    for k in range(4):
        i = (first + k) & 3
        if beyond(points, cells, p, t, i, w) > 0.0:
            return i
    return INSIDE


@njit(cache=True)
def beyond(points, cells, p, t, i, w):
    """+1 if p lies beyond face i of cell t, 0 in its plane, -1 on the side of the cell."""
    a, b, c = cells[t, FACES[i, 0]], cells[t, FACES[i, 1]], cells[t, FACES[i, 2]]
    return orient(points, a, b, c, p, w)


@njit(cache=True)
def twin_in(points, mesh, p, t):
    """The vertex of cell t that equals p; -1 if none."""
    for i in range(4):
        v = mesh.cells[t, i]
        if v >= 0 and equal(points, v, p):
            return v
    return -1


@njit(cache=True)
def sure_conflict(points, cells, p, t):
    """+1 if p lies inside the sphere of cell t, -1 if outside, 0 if rounding or a ghost hides it."""
    a, b, c, d = cells[t, 0], cells[t, 1], cells[t, 2], cells[t, 3]
    return insphere_filter(points, a, b, c, d, p) if (a | b | c | d) >= 0 else 0.0


@njit(cache=True)
def exact_conflict(points, cells, neighbors, p, t, w):
    """+1 if p lies strictly inside the sphere of cell t (see the module on ghosts and ties)."""
    slot = ghost_slot(cells, t)
    if slot >= 0:
        # the base of a ghost cell, seen from the ghost, faces the hull
        within = -beyond(points, cells, p, t, slot, w)
        if within != 0.0:
            return within
        t = neighbors[t, slot]
    return insphere(points, cells[t, 0], cells[t, 1], cells[t, 2], cells[t, 3], p, w)


@njit(cache=True)
def dig(points, mesh, p, start, w):
    """Find the cells in conflict with p, from one of them outwards; return how many, and walls."""
    cells, neighbors, mark, dug, walls = mesh
    inside, outside = 2 * p + 1, 2 * p
    dug[0], mark[start] = start, inside
    n_dug, n_walls, at = 1, 0, 0
    while at < n_dug:
        t = dug[at]
        at += 1
        for i in range(4):
            u = neighbors[t, i]
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


@njit(cache=True)
def slot_of(neighbors, u, t):
    """Which neighbor of u is t."""
    for i in range(3):
        if neighbors[u, i] == t:
            return i
    return 3


@njit(cache=True)
def fill(mesh, p, n_dug, n_walls, used, free, table):
    """Join p to every wall; return slots used, the head of the freed slots, and the last cell."""
    size = 1
    while size < 4 * n_walls:
        size *= 2
    table[0, :size] = -1
    t = 0
    for k in range(n_walls):
        if free != DEAD:
            t, free = free, mesh.neighbors[free, 0]
        else:
            t, used = used, used + 1
            mesh.mark[t] = -1
        join(mesh, mesh.walls[k] >> 2, mesh.walls[k] & 3, p, t)
        for i in range(3):
            link(mesh, t, i, table, size)
    for k in range(n_dug):
        bury(mesh, mesh.dug[k], free)
        free = mesh.dug[k]
    return used, free, t


@njit(cache=True)
def join(mesh, old, i, p, t):
    """Make cell t of p and face i of an old cell, and tie it to the cell behind that face."""
    # the outward face turned round: p is on its inner side, so (face, p) is positive
    mesh.cells[t, 0] = mesh.cells[old, FACES[i, 0]]
    mesh.cells[t, 1] = mesh.cells[old, FACES[i, 2]]
    mesh.cells[t, 2] = mesh.cells[old, FACES[i, 1]]
    mesh.cells[t, 3] = p
    behind = mesh.neighbors[old, i]
    mesh.neighbors[t, 3] = behind
    mesh.neighbors[behind, slot_of(mesh.neighbors, behind, old)] = t


@njit(cache=True)
def bury(mesh, t, free):
    """Put slot t on the list of freed ones."""
    mesh.cells[t, 0] = DEAD
    mesh.neighbors[t, 0] = free


@njit(cache=True)
def link(mesh, t, i, table, size):
    """Tie face i of new cell t to the new cell on the same edge of the cavity, once both exist.

    The two walls that meet in an edge find each other in a small hash table keyed by that edge.
    """
    a = np.int64(mesh.cells[t, (i + 1) % 3]) + 1
    b = np.int64(mesh.cells[t, (i + 2) % 3]) + 1
    key = (min(a, b) << 32) | max(a, b)
    at = (min(a, b) * 31 + max(a, b)) & (size - 1)
    while table[0, at] != -1:
        if table[0, at] == key:
            u, j = table[1, at] >> 2, table[1, at] & 3
            mesh.neighbors[t, i] = u
            mesh.neighbors[u, j] = t
            return
        at = (at + 1) & (size - 1)
    table[0, at] = key
    table[1, at] = (t << 2) | i


@njit(cache=True)
def compact(mesh, used):
    """Move the finite cells to the front, in place; return how many there are."""
    cells, neighbors, renumbered = mesh.cells, mesh.neighbors, mesh.mark
    count = 0
    for t in range(used):
        renumbered[t] = -1
        if min(min(cells[t, 0], cells[t, 1]), min(cells[t, 2], cells[t, 3])) >= 0:
            renumbered[t] = count
            count += 1
    for t in range(used):
        to = renumbered[t]
        if to >= 0:
            for i in range(4):
                cells[to, i] = cells[t, i]
                neighbors[to, i] = renumbered[neighbors[t, i]]
    return count
