"""Equilibria of many loaded rods under forces along one direction, by shooting from the tip.

Unknown is the direction G(L) of gravity that the tip sees: two numbers. A walk from the tip to the
base gives the direction G(0) that the base would have to see; Newton's method, with the exact
tangents of the walk, makes it the one that it does see.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.branches.chord import by_inverse, chord_with, keep_inverse
from softreach.kernels.compiler import inline, kernel
from softreach.kernels.lanes import LANES, get, load_all, put, turn_at
from softreach.kernels.loaded.direction_walk import (
    SIZE,
    A,
    B,
    X,
    Y,
    tangents,
    unit,
    walk_tangents,
    walk_tip,
)
from softreach.kernels.loaded.load_continuation import (
    BEFORE,
    DETERMINANT,
    DONE,
    FOUND,
    HELD,
    LEFT,
    LOAD,
    MARGIN,
    OLD,
    PAST,
    STEP,
    TRIAL,
    advance_with,
    start,
)
from softreach.kernels.loaded.unloaded_frames import STEP_ROWS, TURN, rest_frames
from softreach.kernels.loaded.unloaded_frames import WORK as REST_WORK
from softreach.kernels.quaternion import back, turned
from softreach.kernels.vector import combination, cross, dot, minus, plus, times

__all__ = ["base_directions", "solve"]

TARGET = SIZE  # gravity as seen by the base, in the frame of the walk
WHOLE = SIZE + 3 * LANES


@inline
def _missing(w, i):
    """Residual at the base, in the plane normal to G(0), whose size steps do not keep at 1."""
    g, t = get(w, X, i), get(w, TARGET, i)
    return minus(t, times(dot(g, t) / dot(g, g), g))


@inline
def _newton(w, i):
    """The Newton step of G(L), theory (69), and its linear map, kept for the chord steps."""
    g, a, b = get(w, X, i), get(w, A, i), get(w, B, i)
    t1, t2 = tangents(get(w, TRIAL, i))
    c1, c2 = cross(b, g), cross(g, a)
    determinant = dot(a, c1)
    w[DETERMINANT + i] = determinant
    determinant = math.copysign(max(abs(determinant), 1e-12), determinant)
    c = times(1.0 / determinant, c1), times(1.0 / determinant, c2), (0.0, 0.0, 0.0)
    rows = (
        combination((t1[0], t2[0], 0.0), c),
        combination((t1[1], t2[1], 0.0), c),
        combination((t1[2], t2[2], 0.0), c),
    )
    keep_inverse(w, i, rows)
    missing = _missing(w, i)
    put(w, BEFORE, i, missing)
    put(w, STEP, i, by_inverse(w, i, missing))


@inline
def _move(w, i):
    put(w, TRIAL, i, unit(plus(get(w, TRIAL, i), get(w, STEP, i))))


@inline
def _move_all(w):
    for i in range(LANES):
        _move(w, i)


@inline
def _extrapolate(w, i, last, first):
    """The parabola of theory (71)."""
    g, p, o = get(w, HELD, i), get(w, PAST, i), get(w, OLD, i)
    ahead = plus(times(last, minus(g, p)), times(first, minus(p, o)))
    put(w, TRIAL, i, unit(plus(g, ahead)))


_advance_all = advance_with(_newton, _move, _extrapolate)
_chord_all = chord_with(_missing, _move)


@inline
def _aim(w, work, gravity):
    """Directions that the base must see, in the frame of the walk, theory (65)."""
    for i in range(LANES):
        q = turn_at(work, TURN, i)
        put(w, TARGET, i, turned(q, (gravity[0], gravity[1], gravity[2])))


@inline
def _set_out(w, work, guesses, first, count, increment, widest):
    for i in range(LANES):
        put(w, TRIAL, i, get(w, TARGET, i))
    start(w, increment, widest)
    if guesses.shape[0] > 0:
        for i in range(LANES):
            n = first + min(i, count - 1)
            g = (guesses[n, 0], guesses[n, 1], guesses[n, 2])
            put(w, TRIAL, i, unit(turned(turn_at(work, TURN, i), g)))


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
            step at which the coarse tables have done their work; what the fine ones may leave.
        most: Walks (coarse, fine) allowed.
        out: Filled with the tip, G(L), the margin, and the state (0 not found, 1 found, 2 the
            branch has ended, 3 given up), (n, 8).
    """
    increment, widest, small, tiny = limits
    lanes = np.zeros((coarse[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(WHOLE)
    unloaded = np.zeros((coarse[1].shape[0], STEP_ROWS * LANES))
    fine_rest = np.zeros((fine[1].shape[0], STEP_ROWS * LANES))
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load_all(lanes, gamma, first, count)
        rest_frames(work, lanes, coarse[0], coarse[1], unloaded)
        _aim(w, work, gravity)
        _set_out(w, work, guesses, first, count, increment, widest)
        walks = 0
        while walks < most[0]:
            walk_tangents(w, unloaded, coarse[2], tip)
            walks += 1
            if _advance_all(w, small, widest) == 0:
                break
        rest_frames(work, lanes, fine[0], fine[1], fine_rest)
        _aim(w, work, gravity)
        _move_all(w)
        for turn in range(most[1]):
            walk_tip(w, fine_rest, fine[2], tip)
            if _chord_all(w, turn, tiny * tiny) == 0:
                break
        _store(w, work, first, count, tiny, out)


@inline
def _store(w, work, first, count, tiny, out):
    for i in range(count):
        q, n = back(turn_at(work, TURN, i)), first + i
        r, g = turned(q, get(w, Y, i)), turned(q, get(w, TRIAL, i))
        for j in range(3):
            out[n, j] = r[j]
            out[n, 3 + j] = g[j]
        out[n, 6] = w[MARGIN + i]
        out[n, 7] = w[DONE + i]
        if w[DONE + i] == FOUND and w[LEFT + i] > tiny * tiny:
            out[n, 7] = 0.0


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
    work, w = np.zeros(REST_WORK), np.zeros(WHOLE)
    unloaded = np.zeros((fine[1].shape[0], STEP_ROWS * LANES))
    load_all(lanes, gamma, 0, 1)
    rest_frames(work, lanes, fine[0], fine[1], unloaded)
    for first in range(0, directions.shape[0], LANES):
        count = min(LANES, directions.shape[0] - first)
        for i in range(LANES):
            n = first + min(i, count - 1)
            g = (directions[n, 0], directions[n, 1], directions[n, 2])
            put(w, TRIAL, i, turned(turn_at(work, TURN, i), g))
            w[LOAD + i] = 1.0
        walk_tip(w, unloaded, fine[2], tip)
        for i in range(count):
            g = turned(back(turn_at(work, TURN, i)), get(w, X, i))
            for axis in range(3):
                out[first + i, axis] = g[axis]
