"""Equilibria of rods under any loads, how they respond, and what they look like.

Unknown is the whole frame of the tip: three numbers. Each walk carries a column of tangents for
each of them; once the equilibrium is found, further columns follow for every activation and for
three unit forces at the tip.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.frame_walk import (
    DONE,
    HELD,
    HELD_LOAD,
    INCREMENT,
    LAST,
    LOAD,
    MARGIN,
    PAST,
    PAST_LOAD,
    PLANE,
    SIZE,
    STATE,
    STEP,
    TARGET,
    TRIAL,
    TURNS,
    adjugate_rows,
    rotation,
    walk,
)
from softreach.kernels.lanes import along, back, get, get_five, plus, put, times, turn_at, turned
from softreach.kernels.rest_frames import STEP_ROWS, TURN, TURN_ROWS, rest_frames
from softreach.kernels.rest_frames import WORK as REST_WORK
from softreach.kernels.rod import LANES, load
from softreach.kernels.vector import cross, dot

__all__ = ["TRACE", "solve"]

TRACE = 19
"""Numbers kept of a section: G, H, M, y, the turn of the unloaded arm as a quaternion, F."""

_FOUND, _GIVEN_UP = 1.0, 2.0
_CONTRACTION = 0.6
_MOST_TURNS = 8
_SMALLEST_INCREMENT = 1 / 4096


@inline
def _solved(w, i, r):
    """x with P x = r for the 3 x 3 matrix of rotations at the base."""
    a, b, c = (
        get(w, PLANE, i),
        get(w, PLANE + 3 * LANES, i),
        get(w, PLANE + 6 * LANES, i),
    )
    p1, p2, p3 = adjugate_rows(a, b, c)
    determinant = dot(p1, a)
    determinant = math.copysign(max(abs(determinant), 1e-12), determinant)
    return times(1.0 / determinant, (dot(p1, r), dot(p2, r), dot(p3, r)))


@inline
def _missing(w, i):
    """The rotation that the base lacks, in the directions of the world."""
    g, h = get(w, STATE, i), get(w, STATE + 3 * LANES, i)
    t, u = get(w, TARGET, i), get(w, TARGET + 3 * LANES, i)
    k, v = cross(g, h), cross(t, u)
    twice = plus(cross(g, t), plus(cross(h, u), cross(k, v)))
    sine = 0.5 * math.sqrt(dot(twice, twice))
    cosine = 0.5 * (dot(g, t) + dot(h, u) + dot(k, v) - 1.0)
    scale = 0.5 * (math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0)
    return times(scale, (dot(twice, g), dot(twice, h), dot(twice, k)))


@inline
def _orthonormal(g, h):
    g = times(1.0 / math.sqrt(dot(g, g)), g)
    s = dot(g, h)
    h = (h[0] - s * g[0], h[1] - s * g[1], h[2] - s * g[2])
    return g, times(1.0 / math.sqrt(dot(h, h)), h)


@inline
def _move(w, i, x):
    """Turn the frame of the tip by the rotation x."""
    angle = math.sqrt(dot(x, x))
    a = times(math.tan(0.5 * min(angle, 3.0)) / angle if angle > 1e-9 else 0.5, x)
    f = 2.0 / (1.0 + dot(a, a))
    g, h = get(w, TRIAL, i), get(w, TRIAL + 3 * LANES, i)
    c, d = cross(a, g), cross(a, h)
    g = plus(g, times(f, plus(c, cross(a, c))))
    h = plus(h, times(f, plus(d, cross(a, d))))
    g, h = _orthonormal(g, h)
    put(w, TRIAL, i, g)
    put(w, TRIAL + 3 * LANES, i, h)


@inline
def _predict(w, i, widest):
    w[LOAD + i] = min(1.0, w[HELD_LOAD + i] + w[INCREMENT + i])
    ratio = 0.0
    if w[HELD_LOAD + i] > w[PAST_LOAD + i]:
        ratio = (w[LOAD + i] - w[HELD_LOAD + i]) / (w[HELD_LOAD + i] - w[PAST_LOAD + i])
    g, p = get(w, HELD, i), get(w, PAST, i)
    h, q = get(w, HELD + 3 * LANES, i), get(w, PAST + 3 * LANES, i)
    g = plus(times(1.0 + ratio, g), times(-ratio, p))
    h = plus(times(1.0 + ratio, h), times(-ratio, q))
    g, h = _orthonormal(g, h)
    put(w, TRIAL, i, g)
    put(w, TRIAL + 3 * LANES, i, h)
    w[LAST + i] = widest
    w[TURNS + i] = 0.0


@inline
def _advance(w, i, small, widest):
    """Take a Newton step, go on to the next load, or go back to a smaller one."""
    x = get(w, STEP, i)
    size = math.sqrt(dot(x, x))
    trusted = size < small or (size < w[LAST + i] and w[TURNS + i] < _MOST_TURNS)
    if not trusted:
        w[INCREMENT + i] *= 0.5
        if w[INCREMENT + i] < _SMALLEST_INCREMENT:
            w[DONE + i] = _GIVEN_UP
            return
        _predict(w, i, widest)
        return
    w[LAST + i] = _CONTRACTION * size
    w[TURNS + i] += 1.0
    _move(w, i, x)
    if size >= small:
        return
    if w[LOAD + i] >= 1.0:
        w[DONE + i] = _FOUND
        return
    w[PAST_LOAD + i] = w[HELD_LOAD + i]
    w[HELD_LOAD + i] = w[LOAD + i]
    for row in range(6):
        w[PAST + row * LANES + i] = w[HELD + row * LANES + i]
        w[HELD + row * LANES + i] = w[TRIAL + row * LANES + i]
    if w[TURNS + i] <= 3.0:
        w[INCREMENT + i] *= 2.0
    _predict(w, i, widest)


@inline
def _set_out(w, work, axes, guesses, first, count, increment, widest):
    for i in range(LANES):
        q = turn_at(work, TURN, i)
        g = turned(q, (axes[0, 0], axes[0, 1], axes[0, 2]))
        h = turned(q, (axes[1, 0], axes[1, 1], axes[1, 2]))
        put(w, TARGET, i, g)
        put(w, TARGET + 3 * LANES, i, h)
        for row in range(6):
            w[HELD + row * LANES + i] = w[TARGET + row * LANES + i]
            w[PAST + row * LANES + i] = w[TARGET + row * LANES + i]
        w[HELD_LOAD + i] = 0.0
        w[PAST_LOAD + i] = 0.0
        w[INCREMENT + i] = increment
        w[DONE + i] = 0.0
        _predict(w, i, widest)
        if guesses.shape[0] > 0:
            n = first + min(i, count - 1)
            g = turned(q, (guesses[n, 0], guesses[n, 1], guesses[n, 2]))
            h = turned(q, (guesses[n, 3], guesses[n, 4], guesses[n, 5]))
            g, h = _orthonormal(g, h)
            put(w, TRIAL, i, g)
            put(w, TRIAL + 3 * LANES, i, h)


@kernel
def solve(gamma, axes, jumps, guesses, tables, limits, most, found, slopes, compliance, trace):
    """Equilibria of n rods and what the answers ask for.

    Args:
        gamma: Activations (n, bundle).
        axes: Two orthonormal directions of the world in the base frame (2, 3).
        jumps: Loads at the tip end of every step, (step, 18).
        guesses: G, H at the tip as the base of the unloaded arm sees them (n, 6), or (0, 6).
        tables: (pieces, lengths, scalars, bends).
        limits: First share of the load to try; longest first Newton step [rad] that is trusted;
            step at which an equilibrium counts as found.
        most: Walks allowed.
        found: Filled with the tip, G, H as in `guesses`, the margin of stability, the state (0 not
            found, 1 found, 2 given up), walks, (n, 12).
        slopes: Filled with (v, ω) of the tip per activation, (n, 6, bundle); or (0, 6, bundle).
        compliance: Filled with the change of the tip per force there, (n, 3, 3); or (0, 3, 3).
        trace: Filled with the sections between steps, tip first, (n, step + 1,
            `TRACE`); or (0, 1, `TRACE`).
    """
    increment, widest, small = limits
    lanes = np.zeros((tables[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    rest = np.zeros((tables[1].shape[0], (STEP_ROWS + TURN_ROWS) * LANES))
    bundles = gamma.shape[1] if slopes.shape[0] > 0 else 0
    units = 3 if compliance.shape[0] > 0 else 0
    rotations = np.zeros((3, 15 * LANES))
    columns = np.zeros((3 + bundles + units, 15 * LANES))
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load(lanes, gamma, first, count)
        _repeat_last(lanes, count)
        rest_frames(work, lanes, tables[0], tables[1], rest)
        _set_out(w, work, axes, guesses, first, count, increment, widest)
        walks, waiting = 0, LANES
        while True:
            last = waiting == 0 or walks >= most
            current = columns if last else rotations
            walk(w, current, lanes, rest, tables, jumps, bundles, 3 + bundles, trace[first:])
            _steps(w)
            if last:
                break
            walks, waiting = walks + 1, _advance_all(w, small, widest)
        _respond(w, columns, axes, first, count, slopes, compliance)
        _store(w, work, columns, first, count, walks, found)


@inline
def _repeat_last(lanes, count):
    """Lanes to spare repeat the last activation."""
    for j in range(lanes.shape[0]):
        for i in range(count, LANES):
            lanes[j, i] = lanes[j, count - 1]


@inline
def _steps(w):
    for i in range(LANES):
        put(w, STEP, i, _solved(w, i, _missing(w, i)))


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
def _at_base(column, w, i, x, columns):
    """The change of the tip and the rotation of its frame, base held, per unit of a column."""
    y = get(column, 12 * LANES, i)
    for n in range(3):
        y = plus(y, times(x[n], get(columns[n], 12 * LANES, i)))
    return y


@inline
def _in_base(axes, g, h, k, v):
    """A vector in the base frame from its parts along the directions of the world."""
    a, b = (axes[0, 0], axes[0, 1], axes[0, 2]), (axes[1, 0], axes[1, 1], axes[1, 2])
    return along(dot(v, g), dot(v, h), dot(v, k), a, b, cross(a, b))


@inline
def _respond(w, columns, axes, first, count, slopes, compliance):
    for i in range(count):
        g, h = get(w, STATE, i), get(w, STATE + 3 * LANES, i)
        k = cross(g, h)
        state = get_five(w, STATE, i)
        tip = _in_base(axes, g, h, k, get(w, STATE + 12 * LANES, i))
        tg, th = get(w, TRIAL, i), get(w, TRIAL + 3 * LANES, i)
        tk = cross(tg, th)
        for n in range(3, columns.shape[0]):
            r = rotation(state, get_five(columns[n], 0, i))
            x = _solved(w, i, times(-1.0, r))
            v = _in_base(axes, g, h, k, _at_base(columns[n], w, i, x, columns))
            if n < 3 + slopes.shape[2] and slopes.shape[0] > 0:
                omega = times(-1.0, _in_base(axes, tg, th, tk, x))
                v = plus(v, cross(tip, omega))
                for row in range(3):
                    slopes[first + i, row, n - 3] = v[row]
                    slopes[first + i, 3 + row, n - 3] = omega[row]
            else:
                u = n - (columns.shape[0] - 3)
                for row in range(3):
                    compliance[first + i, row, u] = v[row]


@inline
def _store(w, work, columns, first, count, walks, found):
    for i in range(count):
        q, x = back(turn_at(work, TURN, i)), get(w, STEP, i)
        y = get(w, STATE + 12 * LANES, i)
        for n in range(3):
            y = plus(y, times(x[n], get(columns[n], 12 * LANES, i)))
        r, g = turned(q, y), turned(q, get(w, TRIAL, i))
        h = turned(q, get(w, TRIAL + 3 * LANES, i))
        for axis in range(3):
            found[first + i, axis] = r[axis]
            found[first + i, 3 + axis] = g[axis]
            found[first + i, 6 + axis] = h[axis]
        found[first + i, 9] = w[MARGIN + i]
        found[first + i, 10] = w[DONE + i]
        found[first + i, 11] = walks
