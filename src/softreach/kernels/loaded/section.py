"""Sections of loaded rods, and steps of them from tip to base, theory (64) to (68), (77), (78).

A section is the world as it sees it, the moment and the tip. Walks with tangents carry turns of the
world too, at the tip end of a segment along the axes of that, and what they change. Where all
forces are along G a turn about it changes nothing: it is left out, and H is any direction normal to
G.

Frames of the world as sections see them are two directions G, H, with G × H as third axis. A matrix
is a tuple of its three columns.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from softreach.kernels.compiler import inline
from softreach.kernels.loaded import rod_step
from softreach.kernels.loaded.rod_step import at_stages
from softreach.kernels.loaded.unloaded_frames import (
    LANES,
    NODE_ROWS,
    STEP_ROWS,
    get,
    put,
    turn_at,
)
from softreach.kernels.vector import combination, cross, dot, minus, plus, times, turned

# Rows of the workspace, LANES numbers each.
G, H, M, Y, F = (3 * k * LANES for k in range(5))  # of the section; F: what follows, along G, H, K
THETA, MOMENT, FORCE = (15 * LANES + 9 * k * LANES for k in range(3))  # three tangents
TURNS = 42 * LANES  # of the section by the tangents, along G, H, K, 3 x 3
CARRIED = 51 * LANES  # the same of the tip where the segment began, 2 x 2 of size 1
MARGIN, SHARE, SIZE = (55 * LANES + k * LANES for k in range(3))
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
def product(columns, c):
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
def missing_direction(now, wanted):
    """The same of the first axes alone, as the sine of the angle between them."""
    return 0.0, -dot(now[2], wanted[0]), dot(now[1], wanted[0])


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
def begin_tangents(w, tip, i):
    """What turns of the world about its axes change there, theory (68)."""
    share, axes = w[SHARE + i], world(w, G, i)
    weight = combination((share * tip[0], share * tip[1], share * tip[2]), axes)
    lever, f = (tip[3], tip[4], tip[5]), (share * tip[6], share * tip[7], share * tip[8])
    put_three(w, THETA, i, axes)
    for j in range(3):
        put(w, MOMENT + 3 * j * LANES, i, cross(lever, cross(axes[j], weight)))
        put(w, FORCE + 3 * j * LANES, i, along(axes, cross(f, axes[j])))


@inline
def push(w, moment, i):
    """A dead moment at the tip end of a step, theory (67); the moment."""
    share, axes = w[SHARE + i], world(w, G, i)
    m = combination((share * moment[0], share * moment[1], share * moment[2]), axes)
    put(w, M, i, plus(get(w, M, i), m))
    return m


@inline
def push_tangents(w, m, i):
    """What the moment changes in the tangents."""
    for at in range(0, 9 * LANES, 3 * LANES):
        dm = cross(get(w, THETA + at, i), m)
        put(w, MOMENT + at, i, plus(get(w, MOMENT + at, i), dm))


def _round_node(load):
    """A function that has a node of a step, with what loads it.

    The unloaded arm is in the rows of `rest` from one on, the constants of the nodes are in `c`.
    """

    @inline
    def node(w, rest, first, c, n, i):
        at = first + NODE_ROWS * n * LANES
        place = rest[at + i], rest[at + 4 * LANES + i], get(rest, at + LANES, i)
        return (*place, c[n, 0], c[n, 1], c[n, 2], load(w, c, n, i))

    return node


def _flat_node(load):
    """The same with the axis of K2, from the turn of the unloaded arm, which is kept for it."""
    round_node = _round_node(load)

    @inline
    def node(w, rest, first, c, n, i):
        q = turn_at(rest, first + (STEP_ROWS + 4 * n) * LANES, i)
        axis = turned(q, (c[n, 7], c[n, 8], 0.0))
        return (*round_node(w, rest, first, c, n, i), c[n, 6], axis)

    return node


def _at_stages_of(node):
    """A function that has the nodes of the stages of a step."""

    @inline
    def nodes(w, rest, first, c, i):
        return at_stages(
            (
                node(w, rest, first, c, 0, i),
                node(w, rest, first, c, 1, i),
                node(w, rest, first, c, 2, i),
                node(w, rest, first, c, 3, i),
                node(w, rest, first, c, 4, i),
            )
        )

    return nodes


@inline
def _weight(w, c, n, i):
    return w[SHARE + i] * c[n, 3]


@inline
def _force(w, c, n, i):
    return plus(times(w[SHARE + i], (c[n, 3], c[n, 4], c[n, 5])), get(w, F, i))


@inline
def _changing_force(w, c, n, i):
    u = three(w, FORCE, i)
    return _force(w, c, n, i), u[0], u[1], u[2]


def _steps_along_one(steps, node_under):
    """Steps of sections under forces along one direction, with tangents and with the tip."""
    nodes, walk, tip = _at_stages_of(node_under(_weight)), steps.direction_walk, steps.direction_tip

    @inline
    def step_walk(w, rest, c, i):
        _, t1, t2 = three(w, THETA, i)
        _, m1, m2 = three(w, MOMENT, i)
        s = get(w, G, i), get(w, M, i), t1, m1, t2, m2
        (g, m, t1, m1, t2, m2), _ = walk(nodes(w, rest, 0, c, i), s)
        put(w, G, i, g)
        put(w, M, i, m)
        put(w, THETA + 3 * LANES, i, t1)
        put(w, THETA + 6 * LANES, i, t2)
        put(w, MOMENT + 3 * LANES, i, m1)
        put(w, MOMENT + 6 * LANES, i, m2)

    @inline
    def step_tip(w, rest, c, i):
        s = get(w, G, i), get(w, M, i), get(w, Y, i)
        (g, m, y), _ = tip(nodes(w, rest, 0, c, i), s)
        put(w, G, i, g)
        put(w, M, i, m)
        put(w, Y, i, y)

    return step_walk, step_tip


def _steps_in_space(steps, node_under):
    """The same under any loads."""
    changing, frame_walk = _at_stages_of(node_under(_changing_force)), steps.frame_walk
    nodes, frame_tip = _at_stages_of(node_under(_force)), steps.frame_tip

    @inline
    def step_walk(w, rest, c, i):
        t, m = three(w, THETA, i), three(w, MOMENT, i)
        s = get(w, G, i), get(w, H, i), get(w, M, i), t[0], m[0], t[1], m[1], t[2], m[2]
        s, _ = frame_walk(changing(w, rest, 0, c, i), s)
        put(w, G, i, s[0])
        put(w, H, i, s[1])
        put(w, M, i, s[2])
        put_three(w, THETA, i, (s[3], s[5], s[7]))
        put_three(w, MOMENT, i, (s[4], s[6], s[8]))

    @inline
    def step_tip(w, rest, c, i):
        s = get(w, G, i), get(w, H, i), get(w, M, i), get(w, Y, i)
        (g, h, m, y), _ = frame_tip(nodes(w, rest, 0, c, i), s)
        put(w, G, i, g)
        put(w, H, i, h)
        put(w, M, i, m)
        put(w, Y, i, y)

    return step_walk, step_tip


@inline
def _turns_of(w, i):
    """The turns of the section by the tangents, along the axes of the world: columns of D."""
    axes, theta = world(w, G, i), three(w, THETA, i)
    return along(axes, theta[0]), along(axes, theta[1]), along(axes, theta[2])


@inline
def _turns_about(w, i):
    """The same without turns about G, which change nothing."""
    (_, h, k), (_, a, b) = world(w, G, i), three(w, THETA, i)
    return (1.0, 0.0, 0.0), (0.0, dot(h, a), dot(k, a)), (0.0, dot(h, b), dot(k, b))


@inline
def carry_normal(w, at, h, i):
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
    carry_normal(w, G, get(w, H, i), i)
    _, a, b = _turns_about(w, i)
    (p, q, r, s), (c, d, e, f) = turn_at(w, TURNS, i), turn_at(w, CARRIED, i)
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
    p, q, r, s = turn_at(w, TURNS, i)
    f = 1.0 / math.sqrt(p * p + q * q + r * r + s * s)
    _put_square(w, TURNS, i, f * p, f * q, f * r, f * s)
    _put_square(w, CARRIED, i, f * p, f * q, f * r, f * s)


@inline
def _watch_frames(w, i):
    """The same of 3 x 3 matrices.

    A conjugate point within gives Q P⁻¹ a negative eigenvalue, hence a negative trace, sum of
    principal minors or determinant. Each segment begins with the identity.
    """
    before, after = three(w, TURNS, i), _turns_of(w, i)
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
def _first_frames(w, i):
    """Where a segment begins, the tangents are turns about the axes of the world."""
    put_three(w, TURNS, i, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


_ALONG_ONE = (
    _watch_directions,
    _first_directions,
    _next_directions,
    _turns_about,
    missing_direction,
)
_IN_SPACE = (_watch_frames, _first_frames, _first_frames, _turns_of, missing_turn)


class Kind(NamedTuple):
    """Functions of one kind of sections.

    Those of forces along one direction and of any loads are: steps with tangents and without; the
    watch, where it begins and where it goes on; turns of tangents, and of what is missing.
    """

    along_one: tuple[Any, ...]
    in_space: tuple[Any, ...]
    frame_nodes: Any
    """Nodes of a step under any loads."""
    steps: rod_step.Steps
    keeps_turns: bool
    """The unloaded arm needs its turns at the nodes."""


def _kind(steps, node_under, keeps_turns):
    along_one = (*_steps_along_one(steps, node_under), *_ALONG_ONE)
    in_space = (*_steps_in_space(steps, node_under), *_IN_SPACE)
    return Kind(along_one, in_space, _at_stages_of(node_under(_force)), steps, keeps_turns)


ROUND, FLAT = _kind(rod_step.ROUND, _round_node, False), _kind(rod_step.FLAT, _flat_node, True)
"""Sections with one bending stiffness and with two."""
