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
from softreach.kernels.predicates import collinear, insphere, orient

__all__ = ["FACES", "GHOST", "triangulate"]

GHOST = -1
DEAD = -2
# Vertices of the face opposite vertex i, in the order that makes its normal point outwards.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class Mesh(NamedTuple):
    """Cells in their slots; a freed slot holds DEAD and, as neighbor 0, the next freed slot."""

    cells: np.ndarray
    neighbors: np.ndarray
    mark: np.ndarray


class Cavity(NamedTuple):
    """Cells to dig out, and walls to keep: three vertices, the cell behind, its slot for us."""

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
    cavity = Cavity(np.empty(256, np.int32), np.empty((512, 5), np.int32))
    table = np.empty((2, 2048), np.int64)
    for p in range(len(points)):
        if p in start:
            continue
        found = locate(points, mesh, p, last, w)
        twin = twin_in(points, mesh, p, found)
        if twin >= 0:
            same[p] = twin
            continue
        cavity, dug, walls = dig(points, mesh, cavity, p, found, w)
        if used + walls > len(mesh.mark):
            mesh = grown_mesh(mesh, walls)
        if 8 * walls > table.shape[1]:
            table = np.empty((2, 32 * walls), np.int64)
        used, free, last = fill(mesh, cavity, p, dug, walls, used, free, table)
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
        np.empty((size, 4), np.int32), np.empty((size, 4), np.int32), np.empty(size, np.int32)
    )


@njit(cache=True)
def grown_mesh(mesh, more):
    """A copy with at least ``more`` further slots."""
    size = len(mesh.mark)
    grown = empty_mesh(size + size // 2 + more)
    grown.cells[:size] = mesh.cells
    grown.neighbors[:size] = mesh.neighbors
    grown.mark[:size] = mesh.mark
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
def side(points, cells, t, i, p, w):
    """`orient` of cell t with its vertex i replaced by p."""
    a, b, c = cells[t, FACES[i, 0]], cells[t, FACES[i, 1]], cells[t, FACES[i, 2]]
    return -orient(points, a, b, c, p, w)


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
    slot = ghost_slot(mesh.cells, t)
    if slot >= 0:
        t = mesh.neighbors[t, slot]
    came_from, turn = -1, np.uint32(p)
    while ghost_slot(mesh.cells, t) < 0:
        turn = turn * np.uint32(1664525) + np.uint32(1013904223)
        onward = exit_face(points, mesh, p, t, came_from, np.int64(turn >> np.uint32(30)), w)
        if onward < 0:
            return t
        came_from, t = t, mesh.neighbors[t, onward]
    return t


@njit(cache=True)
def exit_face(points, mesh, p, t, came_from, first, w):
    """A face of finite cell t with p strictly beyond it; -1 if the cell holds p."""
    for k in range(4):
        i = (first + k) & 3
        if mesh.neighbors[t, i] != came_from and side(points, mesh.cells, t, i, p, w) < 0.0:
            return i
    return -1


@njit(cache=True)
def twin_in(points, mesh, p, t):
    """The vertex of cell t that equals p; -1 if none."""
    for i in range(4):
        v = mesh.cells[t, i]
        if v >= 0 and equal(points, v, p):
            return v
    return -1


@njit(cache=True)
def conflicts(points, mesh, p, t, w):
    """Whether p lies strictly inside the sphere of cell t (see the module on ghosts and ties)."""
    slot = ghost_slot(mesh.cells, t)
    if slot >= 0:
        beyond = side(points, mesh.cells, t, slot, p, w)
        if beyond != 0.0:
            return beyond > 0.0
        t = mesh.neighbors[t, slot]
    a, b, c, d = mesh.cells[t, 0], mesh.cells[t, 1], mesh.cells[t, 2], mesh.cells[t, 3]
    return insphere(points, a, b, c, d, p, w) > 0.0


@njit(cache=True)
def dig(points, mesh, cavity, p, start, w):
    """Find the cells in conflict with p, from one of them outwards, and the walls around them.

    Returns the cavity (enlarged if it had to be), its number of cells and its number of walls.
    """
    inside, outside = 2 * p + 1, 2 * p
    cells, neighbors, mark = mesh
    dug, walls = cavity
    dug[0], mark[start] = start, inside
    n_dug, n_walls, at = 1, 0, 0
    while at < n_dug:
        t = dug[at]
        at += 1
        if n_dug + 4 > len(dug):
            dug = np.concatenate((dug, np.empty_like(dug)))
        if n_walls + 4 > len(walls):
            walls = np.concatenate((walls, np.empty_like(walls)))
        for i in range(4):
            u = neighbors[t, i]
            if mark[u] != inside and mark[u] != outside:
                mark[u] = inside if conflicts(points, mesh, p, u, w) else outside
                if mark[u] == inside:
                    dug[n_dug] = u
                    n_dug += 1
            if mark[u] == outside:
                # the outward face turned round: p is inside, so (wall, p) is positive
                walls[n_walls, 0] = cells[t, FACES[i, 0]]
                walls[n_walls, 1] = cells[t, FACES[i, 2]]
                walls[n_walls, 2] = cells[t, FACES[i, 1]]
                walls[n_walls, 3] = u
                walls[n_walls, 4] = slot_of(neighbors, u, t)
                n_walls += 1
    return Cavity(dug, walls), n_dug, n_walls


@njit(cache=True)
def slot_of(neighbors, u, t):
    """Which neighbor of u is t."""
    for i in range(3):
        if neighbors[u, i] == t:
            return i
    return 3


@njit(cache=True)
def fill(mesh, cavity, p, n_dug, n_walls, used, free, table):
    """Join p to every wall; return slots used, the head of the freed slots, and the last cell."""
    size = 1
    while size < 4 * n_walls:
        size *= 2
    table[0, :size] = -1
    t = 0
    for k in range(n_walls):
        if k < n_dug:
            t = cavity.dug[k]
        elif free != DEAD:
            t, free = free, mesh.neighbors[free, 0]
        else:
            t, used = used, used + 1
            mesh.mark[t] = -1
        join(mesh, cavity.walls, k, p, t)
        for i in range(3):
            link(mesh, t, i, table, size)
    for k in range(n_walls, n_dug):
        bury(mesh, cavity.dug[k], free)
        free = cavity.dug[k]
    return used, free, t


@njit(cache=True)
def join(mesh, walls, k, p, t):
    """Make cell t of wall k and p, and tie it to the cell behind the wall."""
    for i in range(3):
        mesh.cells[t, i] = walls[k, i]
    mesh.cells[t, 3] = p
    mesh.neighbors[t, 3] = walls[k, 3]
    mesh.neighbors[walls[k, 3], walls[k, 4]] = t


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
    cells, neighbors, renumbered = mesh
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
