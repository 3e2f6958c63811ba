"""Equilibria of many loaded rods under forces along one direction, by shooting from the tip.

Unknown is the direction G(L) of gravity that the tip sees: two numbers. A walk from the tip to the
base gives the direction G(0) that the base would have to see; Newton's method, with the exact
tangents of the walk, makes it the one that it does see. The load grows from none to all of it, at
once if that converges, otherwise in steps.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel, pasted
from softreach.kernels.explicit_rk8 import at_stages
from softreach.kernels.loaded_step import tangent_step, tip_step
from softreach.kernels.rest_frames import STEP_ROWS, TURN, rest_frames
from softreach.kernels.rest_frames import WORK as REST_WORK
from softreach.kernels.rod import LANES, load
from softreach.kernels.vector import cross, dot

__all__ = ["FAILED", "FOUND", "base_directions", "solve"]

# Rows of the workspace, LANES numbers each.
X = 0  # G, M as walked
Y = 6 * LANES  # the tip as seen by the section
A = 9 * LANES  # tangents of G, M
B = 15 * LANES
AXIS = 21 * LANES  # first axis of the plane normal to G, carried along
PLANE = 24 * LANES  # the tangents of G in that plane, a 2 x 2 matrix
MARGIN = 28 * LANES  # smallest sign of no conjugate point so far
TARGET = 29 * LANES  # gravity as seen by the base, in the frame of the walk
TRIAL = 32 * LANES  # G(L)
LOAD = 35 * LANES  # share of the load on trial
HELD = 36 * LANES  # last G(L) found, and its share of the load
HELD_LOAD = 39 * LANES
PAST = 40 * LANES  # the one before
PAST_LOAD = 43 * LANES
INCREMENT = 44 * LANES  # of the load
LAST = 45 * LANES  # size of the last Newton step
TURNS = 46 * LANES  # Newton steps at this load
DONE = 47 * LANES  # 0 at work, 1 found, 2 given up
INVERSE = 48 * LANES  # change of G(L) per change of G(0), 3 x 3
BEFORE = 57 * LANES  # G(0) of the walk before, and the change of G(L) since
SHIFT = 60 * LANES
KEPT = 63 * LANES  # margin and determinant when the search was over
SIZE = 65 * LANES

FOUND, FAILED = 1, 2
_CONTRACTION = 0.6
_MOST_TURNS = 8
_SMALLEST_INCREMENT = 1 / 4096


@inline
def _three(w, at, i):
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i]


@inline
def _six(w, at, i):
    return _three(w, at, i) + _three(w, at + 3 * LANES, i)


@inline
def _put(w, at, i, v):
    w[at + i] = v[0]
    w[at + LANES + i] = v[1]
    w[at + 2 * LANES + i] = v[2]


@inline
def _put_six(w, at, i, v):
    _put(w, at, i, v[:3])
    _put(w, at + 3 * LANES, i, v[3:])


@inline
def _node(rest, scalars, n, i, share):
    at = 4 * n * LANES + i
    d = (rest[at + LANES], rest[at + 2 * LANES], rest[at + 3 * LANES])
    return rest[at], d, scalars[n, 0], scalars[n, 1], scalars[n, 2], scalars[n, 3] * share


@inline
def _nodes(w, rest, scalars, i):
    share = w[LOAD + i]
    return at_stages(
        (
            _node(rest, scalars, 0, i, share),
            _node(rest, scalars, 1, i, share),
            _node(rest, scalars, 2, i, share),
            _node(rest, scalars, 3, i, share),
            _node(rest, scalars, 4, i, share),
        )
    )


@inline
def _unit(v):
    s = 1.0 / math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return s * v[0], s * v[1], s * v[2]


@inline
def _tangents(g):
    """Two orthonormal directions t1, t2 with t1 × t2 = g."""
    s = math.copysign(1.0, g[2])
    a = -1.0 / (s + g[2])
    b = g[0] * g[1] * a
    return (1.0 + s * g[0] * g[0] * a, s * b, -s * g[0]), (b, s + g[1] * g[1] * a, -g[1])


@inline
def _begin_tip(w, tip, i):
    """State at the tip; `tip` holds the lever times the payload's weight, and a moment."""
    g, share = _three(w, TRIAL, i), w[LOAD + i]
    _put(w, X, i, g)
    m = cross((tip[0], tip[1], tip[2]), g)
    m = (share * (m[0] + tip[3]), share * (m[1] + tip[4]), share * (m[2] + tip[5]))
    _put(w, X + 3 * LANES, i, m)
    return g


@pasted
def _walk_tip(w, rest, scalars, tip):
    for i in range(LANES):
        _begin_tip(w, tip, i)
        _put(w, Y, i, (0.0, 0.0, 0.0))
    for k in range(rest.shape[0]):
        r, c = rest[k], scalars[k]
        for i in range(LANES):
            (x, y), _ = tip_step(_nodes(w, r, c, i), (_six(w, X, i), _three(w, Y, i)))
            _put_six(w, X, i, x)
            _put(w, Y, i, y)


@pasted
def _walk_tangents(w, rest, scalars, tip):
    for i in range(LANES):
        g, share = _begin_tip(w, tip, i), w[LOAD + i]
        t1, t2 = _tangents(g)
        lever = (share * tip[0], share * tip[1], share * tip[2])
        _put_six(w, A, i, t1 + cross(lever, t1))
        _put_six(w, B, i, t2 + cross(lever, t2))
        _put(w, AXIS, i, t1)
        w[PLANE + i] = 1.0
        w[PLANE + LANES + i] = 0.0
        w[PLANE + 2 * LANES + i] = 0.0
        w[PLANE + 3 * LANES + i] = 1.0
        w[MARGIN + i] = 1.0
    for k in range(rest.shape[0]):
        r, c = rest[k], scalars[k]
        for i in range(LANES):
            state = _six(w, X, i), _six(w, A, i), _six(w, B, i)
            (x, a, b), _ = tangent_step(_nodes(w, r, c, i), state)
            _put_six(w, X, i, x)
            _put_six(w, A, i, a)
            _put_six(w, B, i, b)
        for i in range(LANES):
            _watch(w, i)


@inline
def _watch(w, i):
    """Note whether the tangents of G lost their independence during the step.

    With P and Q the 2 x 2 matrices before and after, Q P⁻¹ is near a positive multiple of the
    identity for a short step. One conjugate point within makes its determinant negative, two its
    trace.
    """
    g, a, b = _three(w, X, i), _three(w, A, i), _three(w, B, i)
    e = _three(w, AXIS, i)
    s = dot(e, g)
    e = _unit((e[0] - s * g[0], e[1] - s * g[1], e[2] - s * g[2]))
    f = cross(g, e)
    p, q = w[PLANE + i], w[PLANE + LANES + i]
    r, s = w[PLANE + 2 * LANES + i], w[PLANE + 3 * LANES + i]
    t, u, v, z = dot(a, e), dot(b, e), dot(a, f), dot(b, f)
    before, after = p * p + q * q + r * r + s * s, t * t + u * u + v * v + z * z
    determinant = 2.0 * (t * z - u * v) / after
    trace = (t * s - u * r - v * q + z * p) / math.sqrt(before * after)
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, trace))
    _put(w, AXIS, i, e)
    w[PLANE + i] = t
    w[PLANE + LANES + i] = u
    w[PLANE + 2 * LANES + i] = v
    w[PLANE + 3 * LANES + i] = z


@inline
def _residual(w, i):
    """What is missing at the base, in the plane normal to G(0)."""
    g, t = _three(w, X, i), _three(w, TARGET, i)
    s = dot(g, t)
    return t[0] - s * g[0], t[1] - s * g[1], t[2] - s * g[2]


@inline
def _newton(w, i):
    """The Newton step of G(L), and the linear map that gave it, kept for the chord steps."""
    g, a, b = _three(w, X, i), _three(w, A, i), _three(w, B, i)
    t1, t2 = _tangents(_three(w, TRIAL, i))
    c1, c2 = cross(b, g), cross(g, a)
    determinant = dot(a, c1)
    determinant = math.copysign(max(abs(determinant), 1e-12), determinant)
    c1 = (c1[0] / determinant, c1[1] / determinant, c1[2] / determinant)
    c2 = (c2[0] / determinant, c2[1] / determinant, c2[2] / determinant)
    for j in range(3):
        at = INVERSE + 3 * j * LANES + i
        w[at] = t1[j] * c1[0] + t2[j] * c2[0]
        w[at + LANES] = t1[j] * c1[1] + t2[j] * c2[1]
        w[at + 2 * LANES] = t1[j] * c1[2] + t2[j] * c2[2]
    return _chord(w, i)


@inline
def _chord(w, i):
    r = _residual(w, i)
    return (
        dot(_three(w, INVERSE, i), r),
        dot(_three(w, INVERSE + 3 * LANES, i), r),
        dot(_three(w, INVERSE + 6 * LANES, i), r),
    )


@inline
def _move(w, i, step):
    g = _three(w, TRIAL, i)
    _put(w, TRIAL, i, _unit((g[0] + step[0], g[1] + step[1], g[2] + step[2])))


@inline
def _predict(w, i, widest):
    """The next load to try, and G(L) there by the secant through the last two."""
    w[LOAD + i] = min(1.0, w[HELD_LOAD + i] + w[INCREMENT + i])
    ratio = 0.0
    if w[HELD_LOAD + i] > w[PAST_LOAD + i]:
        ratio = (w[LOAD + i] - w[HELD_LOAD + i]) / (w[HELD_LOAD + i] - w[PAST_LOAD + i])
    g, p = _three(w, HELD, i), _three(w, PAST, i)
    guess = (
        g[0] + ratio * (g[0] - p[0]),
        g[1] + ratio * (g[1] - p[1]),
        g[2] + ratio * (g[2] - p[2]),
    )
    _put(w, TRIAL, i, _unit(guess))
    w[LAST + i] = widest
    w[TURNS + i] = 0.0


@inline
def _advance(w, i, small, widest):
    """Take a Newton step, go on to the next load, or go back to a smaller one."""
    step = _newton(w, i)
    size = math.sqrt(dot(step, step))
    trusted = size < small or (size < w[LAST + i] and w[TURNS + i] < _MOST_TURNS)
    if not trusted:
        w[INCREMENT + i] *= 0.5
        if w[INCREMENT + i] < _SMALLEST_INCREMENT:
            w[DONE + i] = FAILED
            return
        _predict(w, i, widest)
        return
    _move(w, i, step)
    w[LAST + i] = _CONTRACTION * size
    w[TURNS + i] += 1.0
    if size >= small:
        return
    if w[LOAD + i] >= 1.0:
        w[DONE + i] = FOUND
        w[KEPT + i] = w[MARGIN + i]
        w[KEPT + LANES + i] = w[PLANE + i] * w[PLANE + 3 * LANES + i]
        w[KEPT + LANES + i] -= w[PLANE + LANES + i] * w[PLANE + 2 * LANES + i]
        return
    _put(w, PAST, i, _three(w, HELD, i))
    w[PAST_LOAD + i] = w[HELD_LOAD + i]
    _put(w, HELD, i, _three(w, TRIAL, i))
    w[HELD_LOAD + i] = w[LOAD + i]
    if w[TURNS + i] <= 3.0:
        w[INCREMENT + i] *= 2.0
    _predict(w, i, widest)


@inline
def _turned_into(work, i, p):
    """A vector of the base as the tip of the unloaded arm sees it: q p q*."""
    w0 = work[TURN + i]
    v = work[TURN + LANES + i], work[TURN + 2 * LANES + i], work[TURN + 3 * LANES + i]
    t = cross(v, p)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    u = cross(v, t)
    return p[0] + w0 * t[0] + u[0], p[1] + w0 * t[1] + u[1], p[2] + w0 * t[2] + u[2]


@inline
def _turned_back(work, i, p):
    w0 = -work[TURN + i]
    v = work[TURN + LANES + i], work[TURN + 2 * LANES + i], work[TURN + 3 * LANES + i]
    t = cross(v, p)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    u = cross(v, t)
    return p[0] + w0 * t[0] + u[0], p[1] + w0 * t[1] + u[1], p[2] + w0 * t[2] + u[2]


@inline
def _aim(w, work, gravity):
    """What the base must see, in the frame of the walk."""
    for i in range(LANES):
        _put(w, TARGET, i, _turned_into(work, i, (gravity[0], gravity[1], gravity[2])))


@inline
def _set_out(w, work, guesses, first, count, increment, widest):
    """Begin from the unloaded arm, or where a guess is given, there."""
    for i in range(LANES):
        t = _three(w, TARGET, i)
        _put(w, HELD, i, t)
        _put(w, PAST, i, t)
        w[HELD_LOAD + i] = 0.0
        w[PAST_LOAD + i] = 0.0
        w[INCREMENT + i] = increment
        w[DONE + i] = 0.0
        _predict(w, i, widest)
        if guesses.shape[0] > 0:
            n = first + min(i, count - 1)
            g = (guesses[n, 0], guesses[n, 1], guesses[n, 2])
            _put(w, TRIAL, i, _unit(_turned_into(work, i, g)))


@inline
def _broyden(w, i):
    """Improve the chord by what the last step did, and keep what the next one needs."""
    g = _three(w, X, i)
    b, s = _three(w, BEFORE, i), _three(w, SHIFT, i)
    y = (g[0] - b[0], g[1] - b[1], g[2] - b[2])
    c0, c1 = _three(w, INVERSE, i), _three(w, INVERSE + 3 * LANES, i)
    c2 = _three(w, INVERSE + 6 * LANES, i)
    cy = (dot(c0, y), dot(c1, y), dot(c2, y))
    sc = (
        s[0] * c0[0] + s[1] * c1[0] + s[2] * c2[0],
        s[0] * c0[1] + s[1] * c1[1] + s[2] * c2[1],
        s[0] * c0[2] + s[1] * c1[2] + s[2] * c2[2],
    )
    scale = dot(s, cy)
    ok = scale > 0.2 * dot(s, s) and dot(s, s) > 0.0
    f = 1.0 / scale if ok else 0.0
    e = (f * (s[0] - cy[0]), f * (s[1] - cy[1]), f * (s[2] - cy[2]))
    for j in range(3):
        at = INVERSE + 3 * j * LANES + i
        w[at] += e[j] * sc[0]
        w[at + LANES] += e[j] * sc[1]
        w[at + 2 * LANES] += e[j] * sc[2]


@kernel
def solve(gamma, gravity, tip, guesses, coarse, fine, limits, most, out):
    """Equilibria, tips and stability margins.

    Args:
        gamma: Activations (n, bundle).
        gravity: Direction of gravity in the base frame (3,).
        tip: Lever times weight of the payload, then moment at the tip (6,) [N m].
        guesses: G(L) as the base of the unloaded arm sees it (n, 3), or (0, 3).
        coarse: Tables (pieces, lengths, scalars) for Newton steps.
        fine: Tables for the last steps.
        limits: First share of the load to try; longest first Newton step [rad] that is trusted;
            step at which the coarse tables have done their work; step at which the fine ones have.
        most: Walks (coarse, fine) allowed.
        out: Filled with the tip, G(L), the margin, the state (0 not found, 1 found, 2 given up),
            walks, and the determinant of the tangents at the base, (n, 10).
    """
    increment, widest, small, tiny = limits
    lanes = np.zeros((coarse[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    rest = np.zeros((coarse[1].shape[0], STEP_ROWS * LANES))
    fine_rest = np.zeros((fine[1].shape[0], STEP_ROWS * LANES))
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        _load_all(lanes, gamma, first, count)
        rest_frames(work, lanes, coarse[0], coarse[1], rest)
        _aim(w, work, gravity)
        _set_out(w, work, guesses, first, count, increment, widest)
        walks = 0
        while walks < most[0]:
            _walk_tangents(w, rest, coarse[2], tip)
            walks += 1
            if _advance_all(w, small, widest) == 0:
                break
        rest_frames(work, lanes, fine[0], fine[1], fine_rest)
        _aim(w, work, gravity)
        for turn in range(most[1]):
            _walk_tip(w, fine_rest, fine[2], tip)
            walks += 1
            if _chord_all(w, turn, tiny * tiny) == 0 or turn == most[1] - 1:
                break
            _move_all(w)
        _store(w, work, first, count, tiny, walks, out)


@inline
def _load_all(lanes, gamma, first, count):
    """Lay activations side by side; lanes to spare repeat the last one."""
    load(lanes, gamma, first, count)
    for j in range(lanes.shape[0]):
        for i in range(count, LANES):
            lanes[j, i] = lanes[j, count - 1]


@inline
def _advance_all(w, small, widest):
    """One Newton step for all lanes; how many are still at work."""
    waiting = 0
    for i in range(LANES):
        if w[DONE + i] == 0.0:
            _advance(w, i, small, widest)
        waiting += w[DONE + i] == 0.0
    return waiting


@inline
def _chord_all(w, turn, least):
    """Chord steps for all lanes, kept in SHIFT; how many are still longer than the least one.

    A lane that has arrived stays where it is, so that it does not depend on its neighbors.
    """
    waiting = 0
    for i in range(LANES):
        if turn > 0 and w[LAST + i] <= least:
            continue
        if turn > 0:
            _broyden(w, i)
        step = _chord(w, i)
        w[LAST + i] = dot(step, step)
        if w[LAST + i] <= least:
            step = (0.0, 0.0, 0.0)
        waiting += w[DONE + i] == FOUND and w[LAST + i] > least
        _put(w, BEFORE, i, _three(w, X, i))
        _put(w, SHIFT, i, step)
    return waiting


@inline
def _move_all(w):
    for i in range(LANES):
        s = _three(w, SHIFT, i)
        if dot(s, s) > 0.0:
            _move(w, i, s)


@inline
def _store(w, work, first, count, tiny, walks, out):
    for i in range(count):
        r, g = _turned_back(work, i, _three(w, Y, i)), _turned_back(work, i, _three(w, TRIAL, i))
        n = first + i
        for j in range(3):
            out[n, j] = r[j]
            out[n, 3 + j] = g[j]
        out[n, 6] = w[KEPT + i]
        out[n, 7] = w[DONE + i]
        if w[DONE + i] == FOUND and w[LAST + i] > tiny * tiny:
            out[n, 7] = 0.0
        out[n, 8] = walks
        out[n, 9] = w[KEPT + LANES + i]


@kernel
def base_directions(gamma, tip, directions, fine, out):
    """Directions of gravity that the base must see, for those that the tip of one rod sees.

    Args:
        gamma: One activation (1, bundle).
        tip: As of `solve`.
        directions: G(L) as the base of the unloaded arm sees them (n, 3).
        fine: As of `solve`.
        out: Filled, (n, 3).
    """
    lanes = np.zeros((fine[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    rest = np.zeros((fine[1].shape[0], STEP_ROWS * LANES))
    for j in range(gamma.shape[1]):
        for i in range(LANES):
            lanes[j, i] = gamma[0, j]
    rest_frames(work, lanes, fine[0], fine[1], rest)
    for first in range(0, directions.shape[0], LANES):
        count = min(LANES, directions.shape[0] - first)
        for i in range(LANES):
            n = first + min(i, count - 1)
            g = (directions[n, 0], directions[n, 1], directions[n, 2])
            _put(w, TRIAL, i, _turned_into(work, i, g))
            w[LOAD + i] = 1.0
        _walk_tip(w, rest, fine[2], tip)
        for i in range(count):
            g = _turned_back(work, i, _three(w, X, i))
            for axis in range(3):
                out[first + i, axis] = g[axis]
