"""Equilibria of many loaded rods by multiple shooting, theory (69) to (71).

An arm is walked from tip to base in segments. Unknown is how the section at the tip end of each
sees the world: the direction G of all forces, or, where they have several, a frame G, H. The moment
there is no unknown: what lies beyond is in equilibrium, so that it answers a turn φ of the world by
δM = S φ, and S is in the tangents that are walked anyway. Where a segment ends, its tangents become
those of unit turns at the next node; so each segment is walked with two or three of them, and one
segment alone is single shooting.

All turns at a node are along its world's axes G, H, G × H.

Searches begin at directions that are known on a grid of activations: `interpolate`.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel, pasted
from softreach.kernels.loaded.section import (
    FLAT,
    FORCE,
    MARGIN,
    MOMENT,
    ROUND,
    SHARE,
    THETA,
    F,
    G,
    H,
    M,
    Y,
    along,
    begin_tangents,
    begin_tip,
    carry_normal,
    inverse_rows,
    normal_to,
    product,
    push,
    push_tangents,
    put_three,
    put_world,
    three,
    unit,
    world,
)
from softreach.kernels.loaded.section import SIZE as SECTION
from softreach.kernels.loaded.unloaded_frames import (
    LANES,
    STEP_ROWS,
    TURN,
    TURN_ROWS,
    get,
    load_all,
    put,
    rest_frames,
    turn_at,
)
from softreach.kernels.loaded.unloaded_frames import WORK as REST_WORK
from softreach.kernels.vector import back, combination, cross, dot, plus, turned

# Rows of the workspace behind those of the section.
DONE, LEFT, SIZE = (SECTION + k * LANES for k in range(3))
# Rows of a node.
WORLD = 0  # G, H: the unknown
INVERSE = 6 * LANES  # its turn per turn at the end of the segment, 3 x 3
MISSING = 15 * LANES  # the turn from what arrives to what is there
STEP = 18 * LANES  # the turn of the node that Newton's method asks for
ANSWER = 21 * LANES  # change of M per turn, then that of F, 3 x 3 each
NODE = 39 * LANES

AT_WORK, FOUND, GIVEN_UP = 0.0, 1.0, 3.0


@inline
def _enter(w, node, i):
    """Go on with what the node sees, and with the moment and force that belong to it."""
    phi, answer = get(node, MISSING, i), three(node, ANSWER, i)
    put(w, M, i, plus(get(w, M, i), combination(phi, answer)))
    put(w, F, i, plus(get(w, F, i), combination(phi, three(node, ANSWER + 9 * LANES, i))))
    put(w, G, i, get(node, WORLD, i))
    put(w, H, i, get(node, WORLD + 3 * LANES, i))


@inline
def _answer(w, turns, before, node, i):
    """Tangents of unit turns at a node, theory (70), from those that arrive there."""
    rows = inverse_rows(turns)
    put_three(before, INVERSE, i, rows)
    columns = (
        (rows[0][0], rows[1][0], rows[2][0]),
        (rows[0][1], rows[1][1], rows[2][1]),
        (rows[0][2], rows[1][2], rows[2][2]),
    )
    put_three(node, ANSWER, i, product(three(w, MOMENT, i), columns))
    put_three(node, ANSWER + 9 * LANES, i, product(three(w, FORCE, i), columns))


@inline
def _solve(nodes, count, i):
    """Newton's step of every node, theory (71), from base to tip; the largest turn, squared."""
    step, largest = (0.0, 0.0, 0.0), 0.0
    for n in range(count - 1, -1, -1):
        missing = get(nodes[n + 1], MISSING, i)
        step = along(three(nodes[n], INVERSE, i), plus(step, missing))
        put(nodes[n], STEP, i, step)
        largest = max(largest, max(dot(missing, missing), dot(step, step)))
    return largest


@inline
def _move(nodes, count, i):
    for n in range(count):
        axes = world(nodes[n], WORLD, i)
        turn = combination(get(nodes[n], STEP, i), axes)
        g, h = plus(axes[0], cross(turn, axes[0])), plus(axes[1], cross(turn, axes[1]))
        put_world(nodes[n], WORLD, i, g, h)


@inline
def _newton(w, nodes, count, small):
    """A step in every lane at work; how many are at work still.

    A step counts by its longest turn or, where the arm hangs and that is small, by what a node
    misses. Once it is short the lane is done, and the step is left to be taken: walked again with
    others, it gets the same bits.
    """
    waiting = 0
    for i in range(LANES):
        if w[DONE + i] == AT_WORK:
            size = math.sqrt(_solve(nodes, count, i))
            if size < small:
                w[DONE + i] = FOUND
            elif size < w[LEFT + i]:
                _move(nodes, count, i)
                w[LEFT + i] = size
            else:
                w[DONE + i] = GIVEN_UP
        waiting += w[DONE + i] == AT_WORK
    return waiting


@inline
def _chords(w, nodes, count, turn, least):
    """Steps by the matrices that Newton's method left, in every lane that is not there yet."""
    waiting = 0
    for i in range(LANES):
        if w[DONE + i] == FOUND and (turn == 0 or w[LEFT + i] > least):
            w[LEFT + i] = _solve(nodes, count, i)
            if w[LEFT + i] > least:
                _move(nodes, count, i)
                waiting += 1
    return waiting


@inline
def _aim(node, work, axes):
    """The world as the base sees it, in the frame of the walk, theory (65)."""
    for i in range(LANES):
        q = turn_at(work, TURN, i)
        put(node, WORLD, i, turned(q, (axes[0, 0], axes[0, 1], axes[0, 2])))
        put(node, WORLD + 3 * LANES, i, turned(q, (axes[1, 0], axes[1, 1], axes[1, 2])))


@inline
def node_world(q, guesses, row, n, size):
    """G, H of a node as the frame of the walk sees them; of a direction alone some H."""
    at = size * n
    g = unit(turned(q, (guesses[row, at], guesses[row, at + 1], guesses[row, at + 2])))
    h = normal_to(g)
    if size > 3:
        h = turned(q, (guesses[row, at + 3], guesses[row, at + 4], guesses[row, at + 5]))
    return g, h


@inline
def _set_out(w, nodes, work, guesses, first, here):
    """Begin at guesses or, without any, where the unloaded arm is."""
    count = nodes.shape[0] - 1
    for i in range(LANES):
        row, q = first + min(i, here - 1), turn_at(work, TURN, i)
        for n in range(count):
            g, h = get(nodes[count], WORLD, i), get(nodes[count], WORLD + 3 * LANES, i)
            if guesses.shape[0] > 0:
                g, h = node_world(q, guesses, row, n, guesses.shape[1] // count)
            put_world(nodes[n], WORLD, i, g, h)


@inline
def _store(w, nodes, work, first, here, tiny, out):
    count = nodes.shape[0] - 1
    size = (out.shape[1] - 5) // count
    for i in range(here):
        q, row = back(turn_at(work, TURN, i)), first + i
        r = turned(q, get(w, Y, i))
        for axis in range(3):
            out[row, axis] = r[axis]
        for n in range(count):
            for axis in range(size // 3):
                seen = turned(q, get(nodes[n], WORLD + 3 * axis * LANES, i))
                at = 3 + size * n + 3 * axis
                out[row, at], out[row, at + 1], out[row, at + 2] = seen
        out[row, -2], out[row, -1] = w[MARGIN + i], w[DONE + i]
        if w[DONE + i] == FOUND and w[LEFT + i] > tiny * tiny:
            out[row, -1] = AT_WORK


def _entry_with(in_space, tangents, missing, turns):
    """The way into the next segment, with what lies beyond turned to what the node sees."""

    @inline
    def enter(w, before, node, i):
        if not in_space and tangents:
            carry_normal(node, WORLD, get(w, H, i), i)
        elif not in_space:
            put_world(w, G, i, get(w, G, i), get(node, WORLD + 3 * LANES, i))
        put(node, MISSING, i, missing(world(w, G, i), world(node, WORLD, i)))
        if tangents:
            _answer(w, turns(w, i), before, node, i)
        _enter(w, node, i)
        if tangents:
            put_three(w, THETA, i, world(w, G, i))
            put_three(w, MOMENT, i, three(node, ANSWER, i))
            put_three(w, FORCE, i, three(node, ANSWER + 9 * LANES, i))

    return enter


def _walk_with(kind, in_space, tangents):  # noqa: C901
    """A walk from tip to base, with tangents of turns of the world or with the tip."""
    functions = kind.in_space if in_space else kind.along_one
    step_walk, step_tip, watch, begin, go_on, turns, missing = functions
    step = step_walk if tangents else step_tip
    enter = _entry_with(in_space, tangents, missing, turns)

    @inline
    def set_out(w, node, tip, i):
        put(w, G, i, get(node, WORLD, i))
        put(w, H, i, get(node, WORLD + 3 * LANES, i))
        begin_tip(w, tip, i)
        if tangents:
            begin_tangents(w, tip, i)
            begin(w, i)
            w[MARGIN + i] = 1.0

    @pasted
    def walk(w, nodes, rest, table, tip):
        firsts, scalars, moments = table[5], table[2], table[4]
        for i in range(LANES):
            set_out(w, nodes[0], tip, i)
        for n in range(firsts.shape[0] - 1):
            for k in range(firsts[n], firsts[n + 1]):
                r, c = rest[k], scalars[k]
                if in_space and moments[k].any():
                    for i in range(LANES):
                        m = push(w, moments[k], i)
                        if tangents:
                            push_tangents(w, m, i)
                for i in range(LANES):
                    step(w, r, c, i)
                if tangents:
                    for i in range(LANES):
                        watch(w, i)
            before, node = nodes[n], nodes[n + 1]
            for i in range(LANES):
                enter(w, before, node, i)
                if tangents:
                    go_on(w, i)

    return walk


def _rest_rows(kind):
    """Rows of a step of the unloaded arm."""
    return (STEP_ROWS + kind.keeps_turns * TURN_ROWS) * LANES


def _search_with(kind, in_space):
    """A search over all samples, for forces along one direction or, in space, for any loads."""
    walk, walk_tip = (_walk_with(kind, in_space, tangents) for tangents in (True, False))
    rest_rows = _rest_rows(kind)

    @pasted
    def search(gamma, axes, tip, guesses, steps, limits, most, shares, out):
        widest, small, tiny = limits
        count = steps[5].shape[0] - 1
        lanes = np.zeros((steps[0].shape[2] - 1, LANES))
        work, w = np.zeros(REST_WORK), np.zeros(SIZE)
        nodes = np.zeros((count + 1, NODE))
        rest = np.zeros((steps[1].shape[0], rest_rows))
        for first in range(0, gamma.shape[0], LANES):
            here = min(LANES, gamma.shape[0] - first)
            load_all(lanes, gamma, first, here)
            rest_frames(work, lanes, steps[0], steps[1], rest)
            _aim(nodes[count], work, axes)
            _set_out(w, nodes, work, guesses, first, here)
            for i in range(LANES):
                w[SHARE + i] = shares[min(first + min(i, here - 1), shares.shape[0] - 1)]
                w[DONE + i], w[LEFT + i] = AT_WORK, widest
            for _ in range(most[0]):
                walk(w, nodes, rest, steps, tip)
                if _newton(w, nodes, count, small) == 0:
                    break
            for i in range(LANES):
                if w[DONE + i] == FOUND:
                    _move(nodes, count, i)
            for turn in range(most[1]):
                walk_tip(w, nodes, rest, steps, tip)
                if _chords(w, nodes, count, turn, tiny * tiny) == 0:
                    break
            _store(w, nodes, work, first, here, tiny, out)

    return search


_search_directions, _search_frames = (_search_with(ROUND, in_space) for in_space in (False, True))
_search_flat_directions, _search_flat_frames = (_search_with(FLAT, s) for s in (False, True))


@kernel
def solve_directions(gamma, axes, tip, guesses, steps, limits, most, shares, out):
    """Equilibria under forces along one direction, with three numbers for each node.

    Args:
        gamma: Activations (n, bundle).
        axes: Orthonormal directions of the world in the base frame, as rows (3, 3).
        tip: Weight of the payload along them, its lever, force and moment that follow (12,).
        guesses: G of the nodes, tip first, as the base of the unloaded arm sees them, (n, 3 node)
            or (0, 3 node).
        steps: Tables (pieces, lengths, scalars, bends, moments, firsts).
        limits: Longest first Newton step [rad] that is trusted; step from which on the last
            matrices do; what may be left.
        most: Walks allowed, with tangents and without.
        shares: Shares of the loads (n,), or (1,) for all.
        out: Filled with the tip, G of the nodes, the margin, and the state (0 not found, 1 found, 3
            given up), (n, 5 + 3 node).
    """
    _search_directions(gamma, axes, tip, guesses, steps, limits, most, shares, out)


@kernel
def solve_frames(gamma, axes, tip, guesses, steps, limits, most, shares, out):
    """The same under any loads, with six numbers for each node: G, H."""
    _search_frames(gamma, axes, tip, guesses, steps, limits, most, shares, out)


@kernel
def solve_flat_directions(gamma, axes, tip, guesses, steps, limits, most, shares, out):
    """As `solve_directions`, of arms with two bending stiffnesses."""
    _search_flat_directions(gamma, axes, tip, guesses, steps, limits, most, shares, out)


@kernel
def solve_flat_frames(gamma, axes, tip, guesses, steps, limits, most, shares, out):
    """As `solve_frames`, of arms with two bending stiffnesses."""
    _search_flat_frames(gamma, axes, tip, guesses, steps, limits, most, shares, out)


def _base_with(kind):
    """A walk from tip to base from each of many directions."""
    step, rest_rows = kind.along_one[1], _rest_rows(kind)

    @pasted
    def walk(gamma, tip, directions, steps, out):
        lanes = np.zeros((steps[0].shape[2] - 1, LANES))
        work, w = np.zeros(REST_WORK), np.zeros(SIZE)
        rest = np.zeros((steps[1].shape[0], rest_rows))
        load_all(lanes, gamma, 0, 1)
        rest_frames(work, lanes, steps[0], steps[1], rest)
        for first in range(0, directions.shape[0], LANES):
            here = min(LANES, directions.shape[0] - first)
            for i in range(LANES):
                w[SHARE + i], row = 1.0, first + min(i, here - 1)
                g, h = node_world(turn_at(work, TURN, i), directions, row, 0, 3)
                put_world(w, G, i, g, h)
                begin_tip(w, tip, i)
            for k in range(rest.shape[0]):
                r, c = rest[k], steps[2][k]
                for i in range(LANES):
                    step(w, r, c, i)
            for i in range(here):
                g = turned(back(turn_at(work, TURN, i)), get(w, G, i))
                for axis in range(3):
                    out[first + i, axis] = g[axis]

    return walk


_base_directions, _base_flat_directions = _base_with(ROUND), _base_with(FLAT)


@kernel
def base_directions(gamma, tip, directions, steps, out):
    """Directions of the forces that the base must see, for those that the tip of one rod sees.

    Args:
        gamma: One activation (1, bundle).
        tip: As of `solve_directions`.
        directions: G(L) as the base of the unloaded arm sees them (n, 3).
        steps: As of `solve_directions`.
        out: Filled, (n, 3).
    """
    _base_directions(gamma, tip, directions, steps, out)


@kernel
def base_flat_directions(gamma, tip, directions, steps, out):
    """As `base_directions`, of arms with two bending stiffnesses."""
    _base_flat_directions(gamma, tip, directions, steps, out)


UNEVEN = 1e3
"""Roughness of cells beside one that is cut."""


@kernel
def interpolate(values, rough, points, sizes, out, rough_there):
    """Interpolate by Lagrange's polynomials, in smooth cells cubic in each axis, linear in others.

    Args:
        values: Directions at the nodes (node, 3 direction), the last axis of the grid varying
            fastest.
        rough: Roughness of the cells (cell,).
        points: Places in cells from the first node (n, 3); outside the nearest cell is continued.
        sizes: Nodes of every axis, 1 or at least 4 (3,).
        out: Filled with unit vectors, (n, 3 direction).
        rough_there: Filled with the roughness of the cell of each place (n,).
    """
    weights, first, count = np.zeros((3, 4)), np.zeros(3, np.int64), np.zeros(3, np.int64)
    for n in range(points.shape[0]):
        cell = 0
        for axis in range(3):
            first[axis] = min(max(int(np.floor(points[n, axis])), 0), max(sizes[axis] - 2, 0))
            cell = cell * max(sizes[axis] - 1, 1) + first[axis]
        rough_there[n] = rough[cell]
        for axis in range(3):
            count[axis] = min(sizes[axis], 4 if rough[cell] < UNEVEN else 2)
            if count[axis] == 4:
                first[axis] = min(max(first[axis] - 1, 0), sizes[axis] - 4)
            _weigh(weights[axis], points[n, axis] - first[axis], count[axis])
        for c in range(0, out.shape[1], 3):
            x = y = z = 0.0
            for i in range(count[0]):
                for j in range(count[1]):
                    row = ((first[0] + i) * sizes[1] + first[1] + j) * sizes[2] + first[2]
                    of_row = weights[0, i] * weights[1, j]
                    for k in range(count[2]):
                        weight = of_row * weights[2, k]
                        x += weight * values[row + k, c]
                        y += weight * values[row + k, c + 1]
                        z += weight * values[row + k, c + 2]
            size = max(math.sqrt(x * x + y * y + z * z), 1e-300)
            out[n, c], out[n, c + 1], out[n, c + 2] = x / size, y / size, z / size


@inline
def _weigh(weights, x, count):
    if count == 4:
        weights[0] = (x - 1.0) * (x - 2.0) * (3.0 - x) / 6.0
        weights[1] = x * (x - 2.0) * (x - 3.0) / 2.0
        weights[2] = x * (x - 1.0) * (3.0 - x) / 2.0
        weights[3] = x * (x - 1.0) * (x - 2.0) / 6.0
    else:
        weights[0], weights[1] = (1.0, 0.0) if count == 1 else (1.0 - x, x)
