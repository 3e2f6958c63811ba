"""Chord steps on the inverse that Newton's method left, corrected after each by Broyden's rule."""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.lanes import LANES, get, put
from softreach.kernels.loaded.load_continuation import BEFORE, DONE, FOUND, INVERSE, LEFT, STEP
from softreach.kernels.vector import dot, minus, times

__all__ = ["by_inverse", "chord_with", "keep_inverse"]


@inline
def by_inverse(w, i, r):
    """The step at the tip that makes up for what is missing at the base."""
    return (
        dot(get(w, INVERSE, i), r),
        dot(get(w, INVERSE + 3 * LANES, i), r),
        dot(get(w, INVERSE + 6 * LANES, i), r),
    )


@inline
def keep_inverse(w, i, rows):
    """Put an inverse into place."""
    put(w, INVERSE, i, rows[0])
    put(w, INVERSE + 3 * LANES, i, rows[1])
    put(w, INVERSE + 6 * LANES, i, rows[2])


@inline
def _correct(w, i, y):
    """Broyden's correction, theory (70), after the last step changed what is missing by -y."""
    s, cy = get(w, STEP, i), by_inverse(w, i, y)
    c0, c1 = get(w, INVERSE, i), get(w, INVERSE + 3 * LANES, i)
    c2 = get(w, INVERSE + 6 * LANES, i)
    sc = (
        s[0] * c0[0] + s[1] * c1[0] + s[2] * c2[0],
        s[0] * c0[1] + s[1] * c1[1] + s[2] * c2[1],
        s[0] * c0[2] + s[1] * c1[2] + s[2] * c2[2],
    )
    scale = dot(s, cy)
    ok = scale > 0.2 * dot(s, s) and dot(s, s) > 0.0
    e = times(1.0 / scale if ok else 0.0, minus(s, cy))
    for j in range(3):
        at = INVERSE + 3 * j * LANES + i
        w[at] += e[j] * sc[0]
        w[at + LANES] += e[j] * sc[1]
        w[at + 2 * LANES] += e[j] * sc[2]


def chord_with(missing, move):
    """A function that takes a chord step in every lane found, and counts those not there yet.

    A lane has arrived when neither the step nor what is missing at the base is longer than the
    least one [rad²]: where a load is heavy, a small turn of the tip turns the base far. It stays
    where it is then, so that it does not depend on its neighbors.

    Args:
        missing: Residual at the base.
        move: Takes the step in STEP.
    """

    @inline
    def step(w, i, turn, least):
        r = missing(w, i)
        if turn > 0:
            _correct(w, i, minus(get(w, BEFORE, i), r))
        s = by_inverse(w, i, r)
        put(w, BEFORE, i, r)
        put(w, STEP, i, s)
        w[LEFT + i] = max(dot(s, s), dot(r, r))
        if w[LEFT + i] > least:
            move(w, i)

    @inline
    def chord_all(w, turn, least):
        waiting = 0
        for i in range(LANES):
            if w[DONE + i] == FOUND and (turn == 0 or w[LEFT + i] > least):
                step(w, i, turn, least)
                waiting += w[LEFT + i] > least
        return waiting

    return chord_all
