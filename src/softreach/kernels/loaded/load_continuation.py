"""Newton's method while the load grows from none to all of it: at once, or in steps if it fails.

What is unknown is the direction, or the frame, that the tip sees. This file keeps the books of each
lane; how a Newton step is found and taken depends on the loads.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.lanes import LANES, copy, get
from softreach.kernels.vector import dot

__all__ = [
    "DETERMINANT",
    "DONE",
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
HELD_LOAD = 1 * LANES  # the largest share for which an equilibrium was found, and two before
PAST_LOAD = 2 * LANES
OLD_LOAD = 3 * LANES
INCREMENT = 4 * LANES  # of the load
LEFT = 5 * LANES  # size of the last step, or of what is missing still
TURNS = 6 * LANES  # Newton steps at this load
DONE = 7 * LANES  # 0 at work, 1 found, 2 the branch has ended, 3 given up
MARGIN = 8 * LANES  # smallest sign of no conjugate point so far
HALVED = 9 * LANES  # whether it was halved since the last equilibrium, and at last enlarged (2)
TRIED = 10 * LANES  # turn of the tip that was too much, at twice the increment
DETERMINANT = 11 * LANES  # of the tangents at the base: on trial, held and past
HELD_DETERMINANT = 12 * LANES
PAST_DETERMINANT = 13 * LANES
STEP = 14 * LANES  # of the unknown
TRIAL = 17 * LANES  # what the tip sees: one direction, or two
HELD = 23 * LANES
PAST = 29 * LANES
OLD = 35 * LANES
INVERSE = 41 * LANES  # change at the tip per change at the base, 3 x 3
BEFORE = 50 * LANES  # what was missing at the walk before
HEAD = 53 * LANES

FOUND, FOLD, UNSURE = 1, 2, 3
_CONTRACTION = 0.6
_MOST_TURNS = 8
_SMALLEST_INCREMENT = 2.0**-20
_SMALL = 4.0  # up to so many of these it cannot be halved any more
_LEAPT = 2.0
_DIVERGING = 1.1  # growth of the tip's turn per load, from step to step, before a fold
_NEAR_FOLD = 2.0**-12  # the longest last increment by which a fold is told
_COARSE_INCREMENT = 1 / 64  # below it Newton steps must end as much smaller
_FASTER, _CALM = 3.0, 1.0  # growth of the tip's turn per load in a step, and how much is none [rad]
_AS_FAST, _AS_CALM = 1.5, 0.5  # the same where an increment cannot be halved any more
_ON_BRANCH, _CROSSED, _AWAY = 0, 1, 2


def advance_with(newton, move, extrapolate):
    """A function that takes a Newton step in every lane at work, and counts those at work still.

    A step is as long as its turn of the tip or, where the arm hangs and that is small, as the turn
    that the base lacks. Once it is short, and the equilibrium one of the branch, the lane goes on
    to the next load; if all load is on, it is done, and the step is left to be taken. A step too
    long to be trusted, and an equilibrium of another branch, lead back to a smaller load.

    Args:
        newton: Puts the Newton step of a lane into STEP, what the base lacks into BEFORE, and det D
            into DETERMINANT.
        move: Takes it.
        extrapolate: Puts HELD and shares of HELD - PAST and PAST - OLD into TRIAL: the parabola
            through all three.
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
        share = w[LOAD + i] - w[HELD_LOAD + i]
        if size >= small * min(1.0, share / _COARSE_INCREMENT):
            if size >= w[LEFT + i] or w[TURNS + i] >= _MOST_TURNS:
                go_back(w, i, widest)
            else:
                move(w, i)
                w[LEFT + i] = _CONTRACTION * size
                w[TURNS + i] += 1.0
            return
        where, least = _whereabouts(w, i), share < _SMALL * _SMALLEST_INCREMENT
        if where == _AWAY or (where == _CROSSED and not least):
            go_back(w, i, widest)
        elif w[LOAD + i] >= 1.0:
            w[DONE + i] = FOUND
        else:
            move(w, i)
            go_on(w, i, widest)

    return advance


@inline
def _apart(w, a, b, i):
    square = 0.0
    for row in range(6):
        square += (w[a + row * LANES + i] - w[b + row * LANES + i]) ** 2
    return math.sqrt(square)


@inline
def _whereabouts(w, i):
    """Relation of the equilibrium on trial to the branch of those held.

    On a branch the tip turns no faster than before, in a limit, and det D goes on as it went. Where
    det D vanishes another branch meets or almost meets this one, and the next equilibrium may be of
    either: only where the load can hardly be less is it told by the turn of the tip.
    """
    held, past = w[HELD_LOAD + i], w[PAST_LOAD + i]
    if held == 0.0 and w[LOAD + i] >= 1.0:  # all at once: nothing is followed
        return _ON_BRANCH
    share, before, now = w[LOAD + i] - held, w[HELD_DETERMINANT + i], w[DETERMINANT + i]
    expected = before
    if held > past:
        faster, calm = _FASTER, _CALM
        if share < _SMALL * _SMALLEST_INCREMENT:
            faster, calm = _AS_FAST, _AS_CALM
        rate = _apart(w, HELD, PAST, i) / (held - past)
        if _is_too_far(w, i, (faster * rate + calm) * share):
            return _AWAY
        expected += (before - w[PAST_DETERMINANT + i]) * share / (held - past)
    half = 0.5 * before
    falling = expected * half < half * half
    if now * before <= 0.0 or (falling and abs(now - expected) > abs(half)):
        return _CROSSED
    return _ON_BRANCH


@inline
def _is_too_far(w, i, allowed):
    """True if the tip turned by more than allowed, and not by half as much for half the load.

    So it does where a branch turns ever faster; the way to another branch stays as long as it is.
    """
    turn, tried = _apart(w, TRIAL, HELD, i), w[TRIED + i]
    if turn <= allowed or 0.4 * tried <= turn <= 0.6 * tried:
        return False
    w[TRIED + i] = turn
    return True


def _predict_with(extrapolate):
    @inline
    def predict(w, i, widest):
        now, held, past = w[LOAD + i], w[HELD_LOAD + i], w[PAST_LOAD + i]
        now = min(1.0, held + w[INCREMENT + i])
        w[LOAD + i] = now
        old, last, first = w[OLD_LOAD + i], 0.0, 0.0
        if held > past:
            last = (now - held) / (held - past)
        if past > old:
            bend = (now - held) * (now - past) / (held - old)
            last += bend / (held - past)
            first = -bend / (past - old)
        extrapolate(w, i, last, first)
        w[LEFT + i] = widest
        w[TURNS + i] = 0.0

    return predict


def _go_back_with(predict):
    @inline
    def go_back(w, i, widest):
        if w[HALVED + i] == _LEAPT:
            w[DONE + i] = FOLD if _is_fold(w, i) else UNSURE
            return
        w[INCREMENT + i] = 0.5 * (w[LOAD + i] - w[HELD_LOAD + i])
        w[HALVED + i] = 1.0
        if w[INCREMENT + i] < _SMALLEST_INCREMENT:
            # Where D is singular no step is found, but one over that place is.
            w[INCREMENT + i] = 3.3 * _SMALLEST_INCREMENT
            w[HALVED + i] = _LEAPT
        predict(w, i, widest)

    return go_back


@inline
def _is_fold(w, i):
    """True if det D goes to zero as at a fold, like the root of the load that is left to it.

    Its square is then linear in the load, its zero no farther than what could not be done, and the
    tip turns ever faster. Where branches cross, it does not.
    """
    held, past, old = w[HELD_LOAD + i], w[PAST_LOAD + i], w[OLD_LOAD + i]
    square, before = w[HELD_DETERMINANT + i] ** 2, w[PAST_DETERMINANT + i] ** 2
    if past == old or square >= before or held - past > _NEAR_FOLD:
        return False
    rate, slower = _apart(w, HELD, PAST, i) / (held - past), _apart(w, PAST, OLD, i) / (past - old)
    if rate < _DIVERGING * slower:
        return False
    ahead = (held - past) * square / (before - square)
    return ahead <= 4.0 * _SMALLEST_INCREMENT + 0.25 * (held - past)


def _go_on_with(predict):
    @inline
    def go_on(w, i, widest):
        w[OLD_LOAD + i] = w[PAST_LOAD + i]
        w[PAST_LOAD + i] = w[HELD_LOAD + i]
        w[HELD_LOAD + i] = w[LOAD + i]
        w[PAST_DETERMINANT + i] = w[HELD_DETERMINANT + i]
        w[HELD_DETERMINANT + i] = w[DETERMINANT + i]
        for row in range(6):
            w[OLD + row * LANES + i] = w[PAST + row * LANES + i]
            w[PAST + row * LANES + i] = w[HELD + row * LANES + i]
            w[HELD + row * LANES + i] = w[TRIAL + row * LANES + i]
        if w[TURNS + i] <= 2.0 and w[HALVED + i] == 0.0:
            w[INCREMENT + i] *= 2.0
        w[HALVED + i] = 0.0
        w[TRIED + i] = 0.0
        predict(w, i, widest)

    return go_on


@inline
def start(w, increment, widest):
    """Begin at TRIAL, with a first share of the load; all that is held is of no load."""
    copy(w, HELD, w, TRIAL, 6 * LANES)
    copy(w, PAST, w, TRIAL, 6 * LANES)
    copy(w, OLD, w, TRIAL, 6 * LANES)
    for i in range(LANES):
        w[HELD_LOAD + i] = 0.0
        w[PAST_LOAD + i] = 0.0
        w[OLD_LOAD + i] = 0.0
        w[HELD_DETERMINANT + i] = 1.0
        w[PAST_DETERMINANT + i] = 1.0
        w[INCREMENT + i] = increment
        w[HALVED + i] = 0.0
        w[TRIED + i] = 0.0
        w[LOAD + i] = min(1.0, increment)
        w[LEFT + i] = widest
        w[TURNS + i] = 0.0
        w[DONE + i] = 0.0
