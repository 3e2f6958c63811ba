"""A triangulation that grows: its cells, their neighbors, and cavities dug and filled.

A cell abcd has det[b-a, c-a, d-a] > 0; its neighbor i lies opposite vertex i. The ghost vertex
stands for all of space beyond the convex hull, so that every face has a cell on both its sides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import strict

GHOST, DEAD = np.intp(-1), np.intp(-2)  # typed: a literal compiles its functions once more
BITS = 6
SIDE = 1 << BITS
FEW = 2 * (SIDE - 2)  # walls of a cavity, which then has SIDE vertices at most (Euler)
# Vertices of the face opposite vertex i, in the order that makes its normal point outwards.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class Triangulation(NamedTuple):
    """Cells in their slots, and room to note a cavity.

    A freed slot holds DEAD and, as neighbor 0, the next freed slot. ``dug`` lists the cells of the
    cavity, ``walls`` its faces as 4 · cell + face.
    """

    cells: np.ndarray
    neighbors: np.ndarray
    mark: np.ndarray
    dug: np.ndarray
    walls: np.ndarray


class Edges(NamedTuple):
    """Where the cells that fill a cavity find each other along the edges of its walls."""

    number: np.ndarray
    """p · SIDE + number of each vertex around the cavity of point p, the ghost's first."""
    cells: np.ndarray
    """The cell on an edge from one number to another, shape (SIDE, SIDE)."""
    table: np.ndarray
    """A hash table of edges, for cavities with more than FEW walls."""


def empty_edges(points):
    """Room for cavities among so many points."""
    return Edges(np.full(points + 1, -1), np.empty((SIDE, SIDE), np.int32), empty_table())


def empty_table(walls=0):
    """Room for the edges of cavities of four times as many walls, or of 256."""
    return np.empty((2, max(2048, 32 * walls)), np.int64)


def empty_triangulation(size):
    """One with room for ``size`` cells; memory is touched only as cells come."""
    return Triangulation(
        np.empty((size, 4), np.int32),
        np.empty((size, 4), np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(2 * size + 4, np.int64),
    )


def enlarged(mesh, used, more):
    """A copy with at least ``more`` further slots, and no cavity noted."""
    larger = empty_triangulation(len(mesh.mark) + len(mesh.mark) // 2 + more)
    larger.cells[:used], larger.neighbors[:used] = mesh.cells[:used], mesh.neighbors[:used]
    larger.mark[:used] = -1
    return larger


@strict
def set_first_cell(mesh, start):
    """The first cell and the ghost cells on its four faces; return the number of slots used."""
    mesh.mark[0] = -1
    for i in range(4):
        mesh.mark[i + 1] = -1
        mesh.cells[0, i] = start[i]
        mesh.neighbors[0, i] = i + 1
        for k in range(3):
            mesh.cells[i + 1, k] = start[FACES[i, k]]
            mesh.neighbors[i + 1, k] = FACES[i, k] + 1
        mesh.cells[i + 1, 3] = GHOST
        mesh.neighbors[i + 1, 3] = 0
    return np.intp(5)


@strict
def corners(cells, t):
    """The four vertices of cell t."""
    return np.intp(cells[t, 0]), np.intp(cells[t, 1]), np.intp(cells[t, 2]), np.intp(cells[t, 3])


@strict
def face(cells, t, i):
    """The vertices of the face of cell t opposite its vertex i, normal outwards."""
    a, b, c = cells[t, FACES[i, 0]], cells[t, FACES[i, 1]], cells[t, FACES[i, 2]]
    return np.intp(a), np.intp(b), np.intp(c)


@strict
def ghost_slot(cells, t):
    """Number of the vertex of cell t that is the ghost; -1 if none."""
    for i in range(4):
        if cells[t, i] == GHOST:
            return i
    return -1


@strict
def slot_of(neighbors, u, t):
    """Number of t among the neighbors of u, without a branch, which no core would foresee."""
    first, second, third = neighbors[u, 0] == t, neighbors[u, 1] == t, neighbors[u, 2] == t
    return 3 - 3 * first - 2 * second - third


@strict
def fill(mesh, p, n_dug, n_walls, used, free, edges):
    """Join p to every wall; return slots used, the head of the freed slots, and the last cell."""
    size = cleared(edges.table, n_walls) if n_walls > FEW else 0
    known, t = 0, 0
    for k in range(n_walls):
        t, used, free = new_slot(mesh, used, free)
        join(mesh, mesh.walls[k] >> 2, mesh.walls[k] & 3, p, t)
        if size == 0:
            mesh.walls[k], known = note(mesh, t, p, edges, known)
        else:
            for i in range(3):
                link(mesh, t, i, edges.table, size)
    if size == 0:
        for k in range(n_walls):
            tie(mesh, mesh.walls[k], edges.cells)
    for k in range(n_dug):
        t_dug = np.intp(mesh.dug[k])
        bury(mesh, t_dug, free)
        free = t_dug
    return used, free, t


@strict
def cleared(table, n_walls):
    """Clear as much of a hash table as the edges of so many walls need; return how much."""
    size = 1
    while size < 4 * n_walls:
        size *= 2
    for k in range(size):
        table[0, k] = -1
    return size


@strict
def new_slot(mesh, used, free):
    """A slot for a cell, slots used, and the head of the freed slots."""
    if free != DEAD:
        return free, used, np.intp(mesh.neighbors[free, 0])
    mesh.mark[used] = -1
    return used, used + 1, free


@strict
def join(mesh, old, i, p, t):
    """Make cell t of p and face i of an old cell, and tie it to the cell behind that face."""
    # the outward face turned round: p is on its inner side, so (face, p) is positive
    a, b, c = face(mesh.cells, old, i)
    mesh.cells[t, 0], mesh.cells[t, 1], mesh.cells[t, 2], mesh.cells[t, 3] = a, c, b, p
    behind = np.intp(mesh.neighbors[old, i])
    mesh.neighbors[t, 3] = behind
    mesh.neighbors[behind, slot_of(mesh.neighbors, behind, old)] = t


@strict
def bury(mesh, t, free):
    """Put slot t on the list of freed ones."""
    mesh.cells[t, 0] = DEAD
    mesh.neighbors[t, 0] = free


@strict
def note(mesh, t, p, edges, known):
    """Enter new cell t of point p under the edges of its wall; it and its vertices in a number."""
    a, known = numbered(edges.number, mesh.cells[t, 0], p, known)
    b, known = numbered(edges.number, mesh.cells[t, 1], p, known)
    c, known = numbered(edges.number, mesh.cells[t, 2], p, known)
    edges.cells[b, c] = edges.cells[c, a] = edges.cells[a, b] = t
    return np.int64(t) << 3 * BITS | a << 2 * BITS | b << BITS | c, known


@strict
def numbered(number, v, p, known):
    """Number of vertex v around the cavity of p, the next one if it has none."""
    at = number[v + 1] - p * SIDE
    if at >= 0:
        return at, known
    number[v + 1] = p * SIDE + known
    return known, known + 1


@strict
def tie(mesh, noted, cells):
    """Tie the faces at the edges of a wall to the cells that came to their other sides."""
    t, last = noted >> 3 * BITS, SIDE - 1
    a, b, c = noted >> 2 * BITS & last, noted >> BITS & last, noted & last
    mesh.neighbors[t, 0], mesh.neighbors[t, 1] = cells[c, b], cells[a, c]
    mesh.neighbors[t, 2] = cells[b, a]


@strict
def link(mesh, t, i, table, size):
    """Tie face i of new cell t to the new cell on the same edge of the cavity, by a hash table."""
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


@strict
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
