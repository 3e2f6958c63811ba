"""Newton's method while the load grows from none to all of it: at once, or in steps if it fails.

What is unknown is the direction, or the frame, that the tip sees. This file keeps the books of each
lane; how a Newton step is found and taken depends on the loads.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.lanes import copy, get
from softreach.kernels.rod.tips import LANES
from softreach.kernels.vector import dot

__all__ = [
    "DONE",
    "FAILED",
    "FOUND",
    "HEAD",
    "HELD",
    "INVERSE",
    "LEFT",
    "LOAD",
    "MARGIN",
    "PAST",
    "STEP",
    "TRIAL",
    "advance_with",
    "start",
]

# Rows with which every workspace begins, LANES numbers each.
LOAD = 0  # share of the load on trial
HELD_LOAD = 1 * LANES  # the largest share for which an equilibrium was found, and the one before
PAST_LOAD = 2 * LANES
INCREMENT = 3 * LANES  # of the load
LEFT = 4 * LANES  # size of the last step, or of what is missing still
TURNS = 5 * LANES  # Newton steps at this load
DONE = 6 * LANES  # 0 at work, 1 found, 2 given up
MARGIN = 7 * LANES  # smallest sign of no conjugate point so far
STEP = 8 * LANES  # of the unknown
TRIAL = 11 * LANES  # what the tip sees: one direction, or two
HELD = 17 * LANES
PAST = 23 * LANES
INVERSE = 29 * LANES  # change at the tip per change at the base, 3 x 3
BEFORE = 38 * LANES  # what was missing at the walk before
HEAD = 41 * LANES

FOUND, FAILED = 1, 2
_CONTRACTION = 0.6
_MOST_TURNS = 8
_SMALLEST_INCREMENT = 1 / 4096


def advance_with(newton, move, extrapolate):
    """A function that takes a Newton step in every lane at work, and counts those at work still.

    A step is as long as its turn of the tip or, where the arm hangs and that is small, as the turn
    that the base lacks. Once it is short, the lane goes on to the next load; if all load is on, it
    is done, and the step is left to be taken. A step too long to be trusted leads back to a smaller
    load.

    Args:
        newton: Puts the Newton step of a lane into STEP, and what the base lacks into BEFORE.
        move: Takes it.
        extrapolate: Puts the secant through HELD and PAST into TRIAL, for a ratio of increments.
    """
    predict = _predict_with(extrapolate)
    advance = _advance_with(newton, move, _go_back_with(predict), _go_on_with(predict))

    @inline
    def advance_all(w, small, widest):
        waiting = 0
        for i in range(LANES):
            if w[DONE + i] == 0.0:
                advance(w, i, small, widest)
            waiting += w[DONE + i] == 0.0
        return waiting

    return advance_all


def _advance_with(newton, move, go_back, go_on):
    @inline
    def advance(w, i, small, widest):
        newton(w, i)
        step, missing = get(w, STEP, i), get(w, BEFORE, i)
        size = math.sqrt(max(dot(step, step), dot(missing, missing)))
        if size >= small and (size >= w[LEFT + i] or w[TURNS + i] >= _MOST_TURNS):
            go_back(w, i, widest)
        elif size < small and w[LOAD + i] >= 1.0:
            w[DONE + i] = FOUND
        else:
            move(w, i)
            w[LEFT + i] = _CONTRACTION * size
            w[TURNS + i] += 1.0
            if size < small:
                go_on(w, i, widest)

    return advance


def _predict_with(extrapolate):
    @inline
    def predict(w, i, widest):
        w[LOAD + i] = min(1.0, w[HELD_LOAD + i] + w[INCREMENT + i])
        ratio = 0.0
        if w[HELD_LOAD + i] > w[PAST_LOAD + i]:
            ratio = (w[LOAD + i] - w[HELD_LOAD + i]) / (w[HELD_LOAD + i] - w[PAST_LOAD + i])
        extrapolate(w, i, ratio)
        w[LEFT + i] = widest
        w[TURNS + i] = 0.0

    return predict


def _go_back_with(predict):
    @inline
    def go_back(w, i, widest):
        w[INCREMENT + i] *= 0.5
        if w[INCREMENT + i] < _SMALLEST_INCREMENT:
            w[DONE + i] = FAILED
        else:
            predict(w, i, widest)

    return go_back


def _go_on_with(predict):
    @inline
    def go_on(w, i, widest):
        w[PAST_LOAD + i] = w[HELD_LOAD + i]
        w[HELD_LOAD + i] = w[LOAD + i]
        for row in range(6):
            w[PAST + row * LANES + i] = w[HELD + row * LANES + i]
            w[HELD + row * LANES + i] = w[TRIAL + row * LANES + i]
        if w[TURNS + i] <= 3.0:
            w[INCREMENT + i] *= 2.0
        predict(w, i, widest)

    return go_on


@inline
def start(w, increment, widest):
    """Begin at TRIAL, with a first share of the load; HELD and PAST are of no load."""
    copy(w, HELD, w, TRIAL, 6 * LANES)
    copy(w, PAST, w, TRIAL, 6 * LANES)
    for i in range(LANES):
        w[HELD_LOAD + i] = 0.0
        w[PAST_LOAD + i] = 0.0
        w[INCREMENT + i] = increment
        w[LOAD + i] = min(1.0, increment)
        w[LEFT + i] = widest
        w[TURNS + i] = 0.0
        w[DONE + i] = 0.0
