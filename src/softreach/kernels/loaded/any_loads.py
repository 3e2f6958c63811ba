"""Equilibria of rods under any loads, how they respond, and what they look like.

Unknown is the whole frame of the tip: three numbers. Walks with a tangent for each of them give
Newton steps; walks without lead from there to the equilibrium. Where slopes or shapes are asked
for, near a known equilibrium, further tangents follow for every activation and for three unit
forces at the tip.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.branches.chord import by_inverse, chord_with, keep_inverse
from softreach.kernels.compiler import inline, kernel
from softreach.kernels.lanes import LANES, copy, get, load_all, put, turn_at
from softreach.kernels.loaded.direction_walk import unit
from softreach.kernels.loaded.frame_step import AXIAL, COLUMN_ROWS, PLANE, SIZE, STATE, TARGET
from softreach.kernels.loaded.frame_walk import TRACE, adjugate_rows, walk
from softreach.kernels.loaded.load_continuation import (
    BEFORE,
    DETERMINANT,
    DONE,
    FOUND,
    HELD,
    LEFT,
    MARGIN,
    OLD,
    PAST,
    STEP,
    TRIAL,
    advance_with,
    start,
)
from softreach.kernels.loaded.tip_response import corrected_tip, respond
from softreach.kernels.loaded.unloaded_frames import STEP_ROWS, TURN, TURN_ROWS, rest_frames
from softreach.kernels.loaded.unloaded_frames import WORK as REST_WORK
from softreach.kernels.quaternion import back, turned
from softreach.kernels.vector import cross, dot, minus, plus, times

__all__ = ["TRACE", "solve"]


@inline
def _missing(w, i):
    """The rotation that the base lacks, along the directions of the world.

    Where nothing depends on the rotation about the first of them, none is lacking.
    """
    g, h = get(w, STATE, i), get(w, STATE + 3 * LANES, i)
    t, u = get(w, TARGET, i), get(w, TARGET + 3 * LANES, i)
    k, v = cross(g, h), cross(t, u)
    if w[AXIAL] > 0.0:
        return 0.0, -dot(k, t), dot(h, t)
    twice = plus(cross(g, t), plus(cross(h, u), cross(k, v)))
    sine = 0.5 * math.sqrt(dot(twice, twice))
    cosine = 0.5 * (dot(g, t) + dot(h, u) + dot(k, v) - 1.0)
    scale = 0.5 * (math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0)
    return times(scale, (dot(twice, g), dot(twice, h), dot(twice, k)))


@inline
def _newton(w, i):
    """The Newton step of the frame at the tip, theory (69), and the inverse that gives it."""
    a, b, c = get(w, PLANE, i), get(w, PLANE + 3 * LANES, i), get(w, PLANE + 6 * LANES, i)
    p1, p2, p3 = adjugate_rows(a, b, c)
    determinant = dot(p1, a)
    w[DETERMINANT + i] = determinant
    scale = 1.0 / math.copysign(max(abs(determinant), 1e-12), determinant)
    keep_inverse(w, i, (times(scale, p1), times(scale, p2), times(scale, p3)))
    missing = _missing(w, i)
    put(w, BEFORE, i, missing)
    put(w, STEP, i, by_inverse(w, i, missing))


@inline
def _orthonormal(g, h):
    g = unit(g)
    return g, unit(minus(h, times(dot(g, h), g)))


@inline
def _put_frame(w, i, g, h):
    g, h = _orthonormal(g, h)
    put(w, TRIAL, i, g)
    put(w, TRIAL + 3 * LANES, i, h)


@inline
def _move(w, i):
    x = get(w, STEP, i)
    angle = math.sqrt(dot(x, x))
    a = times(math.tan(0.5 * min(angle, 3.0)) / angle if angle > 1e-9 else 0.5, x)
    f = 2.0 / (1.0 + dot(a, a))
    g, h = get(w, TRIAL, i), get(w, TRIAL + 3 * LANES, i)
    c, d = cross(a, g), cross(a, h)
    g = plus(g, times(f, plus(c, cross(a, c))))
    h = plus(h, times(f, plus(d, cross(a, d))))
    _put_frame(w, i, g, h)


@inline
def _extrapolate(w, i, last, first):
    """The parabola of theory (71)."""
    _put_frame(w, i, _ahead(w, i, 0, last, first), _ahead(w, i, 3 * LANES, last, first))


@inline
def _ahead(w, i, at, last, first):
    g, p, o = get(w, HELD + at, i), get(w, PAST + at, i), get(w, OLD + at, i)
    return plus(g, plus(times(last, minus(g, p)), times(first, minus(p, o))))


_advance_all = advance_with(_newton, _move, _extrapolate)
_chord_all = chord_with(_missing, _move)


@inline
def _aim(w, work, axes):
    """Directions that the base must see, in the frame of the walk, theory (65)."""
    for i in range(LANES):
        q = turn_at(work, TURN, i)
        put(w, TARGET, i, turned(q, (axes[0, 0], axes[0, 1], axes[0, 2])))
        put(w, TARGET + 3 * LANES, i, turned(q, (axes[1, 0], axes[1, 1], axes[1, 2])))


@inline
def _set_out(w, work, guesses, first, count, increment, widest):
    copy(w, TRIAL, w, TARGET, 6 * LANES)
    start(w, increment, widest)
    if guesses.shape[0] > 0:
        for i in range(LANES):
            q, n = turn_at(work, TURN, i), first + min(i, count - 1)
            g = turned(q, (guesses[n, 0], guesses[n, 1], guesses[n, 2]))
            h = turned(q, (guesses[n, 3], guesses[n, 4], guesses[n, 5]))
            _put_frame(w, i, g, h)


@inline
def _improve(w, turn, limits):
    """A Newton step before the first turn of chord steps; how many lanes are at work still."""
    if turn < 0:
        return _advance_all(w, limits[2], limits[1])
    return _chord_all(w, turn, limits[3] * limits[3])


@inline
def _move_all(w):
    for i in range(LANES):
        _move(w, i)


@kernel
def solve(gamma, axes, guesses, coarse, fine, limits, most, ends, slopes, compliance, trace):
    """Equilibria of n rods and what the answers ask for.

    Args:
        gamma: Activations (n, bundle).
        axes: Two orthonormal directions of the world in the base frame (2, 3).
        guesses: G, H at the tip as the base of the unloaded arm sees them (n, 6), or (0, 6).
        coarse: Tables (pieces, lengths, scalars, bends, jumps) for Newton steps and responses.
        fine: Tables for the last steps.
        limits: First share of the load to try; longest first Newton step [rad] that is trusted;
            step at which the coarse tables have done their work; what the fine ones may leave;
            1 if all loads are along the first axis, so that no turn about it is looked for, else 0.
        most: Walks (coarse, fine) allowed; with none on fine tables, the last Newton step is taken
            linearly.
        ends: Filled with the tip, G, H as in `guesses`, the margin of stability, and the state (0
            not found, 1 found, 2 the branch has ended, 3 given up), (n, 11).
        slopes: Filled with (v, ω) of the tip per activation, (n, 6, bundle); or (0, 6, bundle).
        compliance: Zeros, to which the change of the tip per force there is added, (n, 3, 3); or
            (0, 3, 3).
        trace: Filled with the sections between steps, tip first, (n, step + 1, `TRACE`); or
            (0, 1, `TRACE`).
    """
    increment, widest, _, tiny, axial = limits
    lanes = np.zeros((coarse[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    w[AXIAL] = axial
    steps = max(coarse[1].shape[0], fine[1].shape[0])
    unloaded = np.zeros((steps, (STEP_ROWS + TURN_ROWS) * LANES))
    bundles = gamma.shape[1] if slopes.shape[0] > 0 else 0
    units = 3 if compliance.shape[0] > 0 else 0
    columns = np.zeros((3 + bundles + units, COLUMN_ROWS * LANES))
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load_all(lanes, gamma, first, count)
        walks, turn, tables, tangents = 0, -1, coarse, columns.shape[0]
        while True:
            if walks == 0 or turn == 0:
                rest_frames(work, lanes, tables[0], tables[1], unloaded[: tables[1].shape[0]])
                _aim(w, work, axes)
            if walks == 0:
                _set_out(w, work, guesses, first, count, increment, widest)
            walk(w, columns, tangents, lanes, unloaded, tables, bundles, trace[first:])
            walks += 1
            waiting = _improve(w, turn, limits)
            turn += turn >= 0
            if waiting > 0 and (walks < most[0] if turn < 0 else turn < most[1]):
                continue
            if turn > 0 or most[1] == 0:
                break
            turn, tables, tangents = 0, fine, 0
            _move_all(w)
        respond(w, work, columns, first, count, bundles, slopes, compliance)
        _store(w, work, columns, first, count, turn, tiny, ends)


@inline
def _store(w, work, columns, first, count, turn, tiny, ends):
    for i in range(count):
        q, n = back(turn_at(work, TURN, i)), first + i
        r = corrected_tip(w, columns, i) if turn < 0 else get(w, STATE + 9 * LANES, i)
        r, g = turned(q, r), turned(q, get(w, TRIAL, i))
        h = turned(q, get(w, TRIAL + 3 * LANES, i))
        for axis in range(3):
            ends[n, axis] = r[axis]
            ends[n, 3 + axis] = g[axis]
            ends[n, 6 + axis] = h[axis]
        ends[n, 9] = w[MARGIN + i]
        ends[n, 10] = w[DONE + i]
        if turn >= 0 and w[DONE + i] == FOUND and w[LEFT + i] > tiny * tiny:
            ends[n, 10] = 0.0
