"""Equilibria of many loaded rods by multiple shooting, theory (69) to (71).

An arm is walked from tip to base in segments. Unknown is how the section at the tip end of each
sees the world: the direction G of all forces, or, where they have several, a frame G, H. The moment
there is no unknown: what lies beyond is in equilibrium, so that it answers a turn φ of the world by
δM = S φ, and S is in the tangents that are walked anyway. Where a segment ends, its tangents become
those of unit turns at the next node; so each segment is walked with two or three of them, and one
segment alone is single shooting.

All turns at a node are along its world's axes G, H, G × H. Where all forces are along G a turn about
it changes nothing: it is left out, and H is any direction normal to G.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel, pasted
from softreach.kernels.lanes import LANES, get, load_all, put, turn_at
from softreach.kernels.loaded.explicit_rk8 import at_stages
from softreach.kernels.loaded.rod_step import direction_tip, direction_walk, frame_tip, frame_walk
from softreach.kernels.loaded.unloaded_frames import NODE_ROWS, STEP_ROWS, TURN, rest_frames
from softreach.kernels.loaded.unloaded_frames import WORK as REST_WORK
from softreach.kernels.quaternion import back, turned
from softreach.kernels.vector import combination, cross, dot, minus, plus, times

__all__ = [
    "FOUND",
    "base_directions",
    "solve_directions",
    "solve_frames",
]

# Rows of the workspace, LANES numbers each.
G, H, M, Y, F = (3 * k * LANES for k in range(5))  # of the section; F: what follows, along G, H, K
THETA, MOMENT, FORCE = (15 * LANES + 9 * k * LANES for k in range(3))  # three tangents
TURNS = 42 * LANES  # of the section by the tangents, along G, H, K, 3 x 3
CARRIED = 51 * LANES  # the same of the tip where the segment began, 2 x 2 of size 1
MARGIN, DONE, LEFT, SHARE = (55 * LANES + k * LANES for k in range(4))
SIZE = 59 * LANES

# Rows of a node.
WORLD = 0  # G, H: the unknown
INVERSE = 6 * LANES  # its turn per turn at the end of the segment, 3 x 3
MISSING = 15 * LANES  # the turn from what arrives to what is there
STEP = 18 * LANES  # the turn of the node that Newton's method asks for
ANSWER = 21 * LANES  # change of M per turn, then that of F, 3 x 3 each
NODE = 39 * LANES

AT_WORK, FOUND, GIVEN_UP = 0.0, 1.0, 3.0
_CONTRACTION = 0.6
_SINGULAR = 1e-12


@inline
def unit(v):
    """v / |v|."""
    return times(1.0 / math.sqrt(dot(v, v)), v)


@inline
def normal_to(g):
    """A unit vector normal to g."""
    s = math.copysign(1.0, g[2])
    a = -1.0 / (s + g[2])
    return 1.0 + s * g[0] * g[0] * a, s * g[0] * g[1] * a, -s * g[0]


@inline
def world(w, at, i):
    """G, H and G × H."""
    g, h = get(w, at, i), get(w, at + 3 * LANES, i)
    return g, h, cross(g, h)


@inline
def orthonormal(g, h):
    """G, H and G × H made of G, and of an H that may lean a little."""
    g = unit(g)
    h = unit(minus(h, times(dot(g, h), g)))
    return g, h, cross(g, h)


@inline
def put_world(w, at, i, g, h):
    """Write G, and H normal to it."""
    axes = orthonormal(g, h)
    put(w, at, i, axes[0])
    put(w, at + 3 * LANES, i, axes[1])


@inline
def three(w, at, i):
    """Three vectors of one lane: a matrix by its columns."""
    return get(w, at, i), get(w, at + 3 * LANES, i), get(w, at + 6 * LANES, i)


@inline
def put_three(w, at, i, s):
    """Write three vectors of one lane."""
    put(w, at, i, s[0])
    put(w, at + 3 * LANES, i, s[1])
    put(w, at + 6 * LANES, i, s[2])


@inline
def _product(columns, c):
    """Columns of a matrix times those of another."""
    return combination(c[0], columns), combination(c[1], columns), combination(c[2], columns)


@inline
def along(axes, v):
    """Components of v along three axes."""
    return dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)


@inline
def adjugate_rows(a):
    """Rows of det(A) A⁻¹ for a matrix of columns a."""
    return cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])


@inline
def size_of(a):
    """Frobenius norm of a matrix."""
    return math.sqrt(dot(a[0], a[0]) + dot(a[1], a[1]) + dot(a[2], a[2]))


@inline
def inverse_rows(a):
    """Rows of the inverse; of a singular matrix, where a conjugate point is, of one near it."""
    rows = adjugate_rows(a)
    determinant = dot(rows[0], a[0])
    least = _SINGULAR * size_of(a) * size_of(rows)
    scale = 1.0 / math.copysign(max(abs(determinant), least), determinant)
    return times(scale, rows[0]), times(scale, rows[1]), times(scale, rows[2])


@inline
def missing_turn(now, wanted):
    """The rotation from one frame to another, along their axes."""
    twice = plus(cross(now[0], wanted[0]), plus(cross(now[1], wanted[1]), cross(now[2], wanted[2])))
    sine = 0.5 * math.sqrt(dot(twice, twice))
    cosine = 0.5 * (dot(now[0], wanted[0]) + dot(now[1], wanted[1]) + dot(now[2], wanted[2]) - 1.0)
    scale = 0.5 * (math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0)
    return times(scale, along(now, twice))


@inline
def _missing_direction(now, wanted):
    """The same of the first axes alone, as the sine of the angle between them."""
    return 0.0, -dot(now[2], wanted[0]), dot(now[1], wanted[0])


# A segment: state and tangents at its tip end, its steps, and the signs of no conjugate point.


@inline
def begin_tip(w, tip, i):
    """The section at the tip, theory (67): weight along the axes, lever, force and moment there."""
    share, axes = w[SHARE + i], world(w, G, i)
    weight = combination((share * tip[0], share * tip[1], share * tip[2]), axes)
    m = cross((tip[3], tip[4], tip[5]), weight)
    put(w, M, i, plus(m, (share * tip[9], share * tip[10], share * tip[11])))
    put(w, F, i, along(axes, (share * tip[6], share * tip[7], share * tip[8])))
    put(w, Y, i, (0.0, 0.0, 0.0))


@inline
def _begin_tangents(w, tip, i):
    """What turns of the world about its axes change there, theory (68)."""
    share, axes = w[SHARE + i], world(w, G, i)
    weight = combination((share * tip[0], share * tip[1], share * tip[2]), axes)
    lever, f = (tip[3], tip[4], tip[5]), (share * tip[6], share * tip[7], share * tip[8])
    put_three(w, THETA, i, axes)
    for j in range(3):
        put(w, MOMENT + 3 * j * LANES, i, cross(lever, cross(axes[j], weight)))
        put(w, FORCE + 3 * j * LANES, i, along(axes, cross(f, axes[j])))


@inline
def _push(w, moment, tangents, i):
    """A dead moment at the tip end of a step, theory (67)."""
    share, axes = w[SHARE + i], world(w, G, i)
    m = combination((share * moment[0], share * moment[1], share * moment[2]), axes)
    put(w, M, i, plus(get(w, M, i), m))
    if tangents:
        for j in range(3):
            at = MOMENT + 3 * j * LANES
            turn = get(w, THETA + 3 * j * LANES, i)
            put(w, at, i, plus(get(w, at, i), cross(turn, m)))


@inline
def _place(rest, c, n, i):
    at = NODE_ROWS * n * LANES + i
    d = rest[at + LANES], rest[at + 2 * LANES], rest[at + 3 * LANES]
    return rest[at], rest[at + 4 * LANES], d, c[n, 0], c[n, 1], c[n, 2]


@inline
def _along_one(w, rest, c, n, i):
    return (*_place(rest, c, n, i), w[SHARE + i] * c[n, 3])


@inline
def _direction_nodes(w, r, c, i):
    return at_stages(
        (
            _along_one(w, r, c, 0, i),
            _along_one(w, r, c, 1, i),
            _along_one(w, r, c, 2, i),
            _along_one(w, r, c, 3, i),
            _along_one(w, r, c, 4, i),
        )
    )


@inline
def _dead_load(w, c, n, i):
    return plus(times(w[SHARE + i], (c[n, 3], c[n, 4], c[n, 5])), get(w, F, i))


@inline
def _in_space(w, rest, c, n, i):
    return (*_place(rest, c, n, i), _dead_load(w, c, n, i))


@inline
def _with_changes(w, rest, c, n, i):
    u = three(w, FORCE, i)
    return (*_place(rest, c, n, i), (_dead_load(w, c, n, i), u[0], u[1], u[2]))


@inline
def _frame_nodes(w, r, c, i):
    return at_stages(
        (
            _in_space(w, r, c, 0, i),
            _in_space(w, r, c, 1, i),
            _in_space(w, r, c, 2, i),
            _in_space(w, r, c, 3, i),
            _in_space(w, r, c, 4, i),
        )
    )


@inline
def _changing_nodes(w, r, c, i):
    return at_stages(
        (
            _with_changes(w, r, c, 0, i),
            _with_changes(w, r, c, 1, i),
            _with_changes(w, r, c, 2, i),
            _with_changes(w, r, c, 3, i),
            _with_changes(w, r, c, 4, i),
        )
    )


@inline
def _step_direction_walk(w, rest, c, i):
    _, t1, t2 = three(w, THETA, i)
    _, m1, m2 = three(w, MOMENT, i)
    s = get(w, G, i), get(w, M, i), t1, m1, t2, m2
    (g, m, t1, m1, t2, m2), _ = direction_walk(_direction_nodes(w, rest, c, i), s)
    put(w, G, i, g)
    put(w, M, i, m)
    put(w, THETA + 3 * LANES, i, t1)
    put(w, THETA + 6 * LANES, i, t2)
    put(w, MOMENT + 3 * LANES, i, m1)
    put(w, MOMENT + 6 * LANES, i, m2)


@inline
def _step_direction_tip(w, rest, c, i):
    s = get(w, G, i), get(w, M, i), get(w, Y, i)
    (g, m, y), _ = direction_tip(_direction_nodes(w, rest, c, i), s)
    put(w, G, i, g)
    put(w, M, i, m)
    put(w, Y, i, y)


@inline
def _step_frame_walk(w, rest, c, i):
    t, m = three(w, THETA, i), three(w, MOMENT, i)
    s = get(w, G, i), get(w, H, i), get(w, M, i), t[0], m[0], t[1], m[1], t[2], m[2]
    s, _ = frame_walk(_changing_nodes(w, rest, c, i), s)
    put(w, G, i, s[0])
    put(w, H, i, s[1])
    put(w, M, i, s[2])
    put_three(w, THETA, i, (s[3], s[5], s[7]))
    put_three(w, MOMENT, i, (s[4], s[6], s[8]))


@inline
def _step_frame_tip(w, rest, c, i):
    s = get(w, G, i), get(w, H, i), get(w, M, i), get(w, Y, i)
    (g, h, m, y), _ = frame_tip(_frame_nodes(w, rest, c, i), s)
    put(w, G, i, g)
    put(w, H, i, h)
    put(w, M, i, m)
    put(w, Y, i, y)


@inline
def turns_of(w, i):
    """The turns of the section by the tangents, along the axes of the world: columns of D."""
    axes, theta = world(w, G, i), three(w, THETA, i)
    return along(axes, theta[0]), along(axes, theta[1]), along(axes, theta[2])


@inline
def _turns_about(w, i):
    """The same without turns about G, which change nothing."""
    (_, h, k), (_, a, b) = world(w, G, i), three(w, THETA, i)
    return (1.0, 0.0, 0.0), (0.0, dot(h, a), dot(k, a)), (0.0, dot(h, b), dot(k, b))


@inline
def _carry_normal(w, at, h, i):
    """Turn H no more than it has to be to stay normal to G."""
    g = get(w, at, i)
    put(w, at + 3 * LANES, i, unit(minus(h, times(dot(g, h), g))))


@inline
def _watch_directions(w, i):
    """Note whether the turns lost their independence during the step, theory (77), (78).

    With P and Q the 2 x 2 matrices before and after, Q P⁻¹ is near a positive multiple of the
    identity for a short step. One conjugate point within makes its determinant negative, two its
    trace. Both are those of the whole arm beyond, of which `CARRIED` brings what lies beyond the
    segment.
    """
    _carry_normal(w, G, get(w, H, i), i)
    _, a, b = _turns_about(w, i)
    p, q, r, s = (
        w[TURNS + i],
        w[TURNS + LANES + i],
        w[TURNS + 2 * LANES + i],
        w[TURNS + 3 * LANES + i],
    )
    c, d, e, f = (
        w[CARRIED + i],
        w[CARRIED + LANES + i],
        w[CARRIED + 2 * LANES + i],
        w[CARRIED + 3 * LANES + i],
    )
    t, u, v, z = a[1] * c + b[1] * e, a[1] * d + b[1] * f, a[2] * c + b[2] * e, a[2] * d + b[2] * f
    before, after = p * p + q * q + r * r + s * s, t * t + u * u + v * v + z * z
    determinant = 2.0 * (t * z - u * v) / after
    trace = (t * s - u * r - v * q + z * p) / math.sqrt(before * after)
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, trace))
    _put_square(w, TURNS, i, t, u, v, z)


@inline
def _put_square(w, at, i, p, q, r, s):
    w[at + i] = p
    w[at + LANES + i] = q
    w[at + 2 * LANES + i] = r
    w[at + 3 * LANES + i] = s


@inline
def _first_directions(w, i):
    _put_square(w, TURNS, i, 1.0, 0.0, 0.0, 1.0)
    _put_square(w, CARRIED, i, 1.0, 0.0, 0.0, 1.0)


@inline
def _next_directions(w, i):
    p, q, r, s = (
        w[TURNS + i],
        w[TURNS + LANES + i],
        w[TURNS + 2 * LANES + i],
        w[TURNS + 3 * LANES + i],
    )
    f = 1.0 / math.sqrt(p * p + q * q + r * r + s * s)
    _put_square(w, TURNS, i, f * p, f * q, f * r, f * s)
    _put_square(w, CARRIED, i, f * p, f * q, f * r, f * s)


@inline
def watch_frames(w, i):
    """The same of 3 x 3 matrices.

    A conjugate point within gives Q P⁻¹ a negative eigenvalue, hence a negative trace, sum of
    principal minors or determinant. Each segment begins with the identity.
    """
    before, after = three(w, TURNS, i), turns_of(w, i)
    put_three(w, TURNS, i, after)
    p, q = adjugate_rows(before), adjugate_rows(after)
    sizes = size_of(before), size_of(after), size_of(p), size_of(q)
    trace = (dot(p[0], after[0]) + dot(p[1], after[1]) + dot(p[2], after[2])) / (
        sizes[2] * sizes[1]
    )
    minors = dot(q[0], before[0]) + dot(q[1], before[1]) + dot(q[2], before[2])
    determinant = 3.0 * dot(q[0], after[0]) / (sizes[3] * sizes[1])
    minors /= sizes[3] * sizes[0]
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, min(trace, minors)))


@inline
def first_frames(w, i):
    """Where a segment begins, the tangents are turns about the axes of the world."""
    put_three(w, TURNS, i, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


# Nodes between segments.


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
    put_three(node, ANSWER, i, _product(three(w, MOMENT, i), columns))
    put_three(node, ANSWER + 9 * LANES, i, _product(three(w, FORCE, i), columns))


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
                w[LEFT + i] = _CONTRACTION * size
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
def _aim(node, work, axes, again):
    """The world as the base sees it, in the frame of the walk, theory (65).

    Again, on other tables, the tangents know a normal of one direction already.
    """
    for i in range(LANES):
        q = turn_at(work, TURN, i)
        put(node, WORLD, i, turned(q, (axes[0, 0], axes[0, 1], axes[0, 2])))
        if not again:
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


def _search_with(in_space):
    """A search over all samples, for forces along one direction or, in space, for any loads."""
    step_walk, step_tip = _step_direction_walk, _step_direction_tip
    turns, missing = _turns_about, _missing_direction
    watch, begin, go_on = _watch_directions, _first_directions, _next_directions
    if in_space:
        step_walk, step_tip = _step_frame_walk, _step_frame_tip
        turns, missing = turns_of, missing_turn
        watch, begin, go_on = watch_frames, first_frames, first_frames

    @inline
    def start(w, nodes, tip, i):
        put(w, G, i, get(nodes[0], WORLD, i))
        put(w, H, i, get(nodes[0], WORLD + 3 * LANES, i))
        begin_tip(w, tip, i)

    @inline
    def arrive(w, node, i):
        put(node, MISSING, i, missing(world(w, G, i), world(node, WORLD, i)))

    @pasted
    def walk(w, nodes, rest, table, tip):
        firsts, scalars, moments = table[5], table[2], table[4]
        for i in range(LANES):
            start(w, nodes, tip, i)
            _begin_tangents(w, tip, i)
            begin(w, i)
            w[MARGIN + i] = 1.0
        for n in range(firsts.shape[0] - 1):
            for k in range(firsts[n], firsts[n + 1]):
                r, c = rest[k], scalars[k]
                if in_space and moments[k].any():
                    for i in range(LANES):
                        _push(w, moments[k], True, i)
                for i in range(LANES):
                    step_walk(w, r, c, i)
                for i in range(LANES):
                    watch(w, i)
            before, node = nodes[n], nodes[n + 1]
            for i in range(LANES):
                if not in_space:
                    _carry_normal(node, WORLD, get(w, H, i), i)
                arrive(w, node, i)
                _answer(w, turns(w, i), before, node, i)
                _enter(w, node, i)
                put_three(w, THETA, i, world(w, G, i))
                put_three(w, MOMENT, i, three(node, ANSWER, i))
                put_three(w, FORCE, i, three(node, ANSWER + 9 * LANES, i))
                go_on(w, i)

    @pasted
    def walk_tip(w, nodes, rest, table, tip):
        firsts, scalars, moments = table[5], table[2], table[4]
        for i in range(LANES):
            start(w, nodes, tip, i)
        for n in range(firsts.shape[0] - 1):
            for k in range(firsts[n], firsts[n + 1]):
                r, c = rest[k], scalars[k]
                if in_space and moments[k].any():
                    for i in range(LANES):
                        _push(w, moments[k], False, i)
                for i in range(LANES):
                    step_tip(w, r, c, i)
            node = nodes[n + 1]
            for i in range(LANES):
                if not in_space:
                    put_world(w, G, i, get(w, G, i), get(node, WORLD + 3 * LANES, i))
                arrive(w, node, i)
                _enter(w, node, i)

    @pasted
    def search(gamma, axes, tip, guesses, coarse, fine, limits, most, shares, out):
        widest, small, tiny = limits
        count = coarse[5].shape[0] - 1
        lanes = np.zeros((coarse[0].shape[2] - 1, LANES))
        work, w = np.zeros(REST_WORK), np.zeros(SIZE)
        nodes = np.zeros((count + 1, NODE))
        rest = np.zeros((max(coarse[1].shape[0], fine[1].shape[0]), STEP_ROWS * LANES))
        for first in range(0, gamma.shape[0], LANES):
            here = min(LANES, gamma.shape[0] - first)
            load_all(lanes, gamma, first, here)
            rest_frames(work, lanes, coarse[0], coarse[1], rest[: coarse[1].shape[0]])
            _aim(nodes[count], work, axes, False)
            _set_out(w, nodes, work, guesses, first, here)
            for i in range(LANES):
                w[SHARE + i] = shares[min(first + min(i, here - 1), shares.shape[0] - 1)]
                w[DONE + i], w[LEFT + i] = AT_WORK, widest
            for _ in range(most[0]):
                walk(w, nodes, rest, coarse, tip)
                if _newton(w, nodes, count, small) == 0:
                    break
            rest_frames(work, lanes, fine[0], fine[1], rest[: fine[1].shape[0]])
            _aim(nodes[count], work, axes, not in_space)
            for i in range(LANES):
                if w[DONE + i] == FOUND:
                    _move(nodes, count, i)
            for turn in range(most[1]):
                walk_tip(w, nodes, rest, fine, tip)
                if _chords(w, nodes, count, turn, tiny * tiny) == 0:
                    break
            _store(w, nodes, work, first, here, tiny, out)

    return search


_search_directions, _search_frames = _search_with(in_space=False), _search_with(in_space=True)


@kernel
def solve_directions(gamma, axes, tip, guesses, coarse, fine, limits, most, shares, out):
    """Equilibria under forces along one direction, with three numbers for each node.

    Args:
        gamma: Activations (n, bundle).
        axes: Orthonormal directions of the world in the base frame, as rows (3, 3).
        tip: Weight of the payload along them, its lever, force and moment that follow (12,).
        guesses: G of the nodes, tip first, as the base of the unloaded arm sees them, (n, 3 node)
            or (0, 3 node).
        coarse: Tables (pieces, lengths, scalars, bends, moments, firsts) for Newton steps.
        fine: Tables for the last steps.
        limits: Longest first Newton step [rad] that is trusted; step at which the coarse tables
            have done their work; what the fine ones may leave.
        most: Walks (coarse, fine) allowed.
        shares: Shares of the loads (n,), or (1,) for all.
        out: Filled with the tip, G of the nodes, the margin, and the state (0 not found, 1 found, 3
            given up), (n, 5 + 3 node).
    """
    _search_directions(gamma, axes, tip, guesses, coarse, fine, limits, most, shares, out)


@kernel
def solve_frames(gamma, axes, tip, guesses, coarse, fine, limits, most, shares, out):
    """The same under any loads, with six numbers for each node: G, H."""
    _search_frames(gamma, axes, tip, guesses, coarse, fine, limits, most, shares, out)


@kernel
def base_directions(gamma, tip, directions, fine, out):
    """Directions of the forces that the base must see, for those that the tip of one rod sees.

    Args:
        gamma: One activation (1, bundle).
        tip: As of `solve_directions`.
        directions: G(L) as the base of the unloaded arm sees them (n, 3).
        fine: As of `solve_directions`.
        out: Filled, (n, 3).
    """
    lanes = np.zeros((fine[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    rest = np.zeros((fine[1].shape[0], STEP_ROWS * LANES))
    load_all(lanes, gamma, 0, 1)
    rest_frames(work, lanes, fine[0], fine[1], rest)
    for first in range(0, directions.shape[0], LANES):
        here = min(LANES, directions.shape[0] - first)
        for i in range(LANES):
            w[SHARE + i] = 1.0
            g, h = node_world(turn_at(work, TURN, i), directions, first + min(i, here - 1), 0, 3)
            put_world(w, G, i, g, h)
            begin_tip(w, tip, i)
        for k in range(rest.shape[0]):
            r, c = rest[k], fine[2][k]
            for i in range(LANES):
                _step_direction_tip(w, r, c, i)
        for i in range(here):
            g = turned(back(turn_at(work, TURN, i)), get(w, G, i))
            for axis in range(3):
                out[first + i, axis] = g[axis]
