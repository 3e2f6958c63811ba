"""Rows of LANES numbers: component after component, rods under loads side by side."""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.rod.tips import load

LANES = 32
"""Rods side by side: whole blocks only, so that a rod's result never depends on its neighbors.

A block of rods under loads is searched until the last of them is found, and what one step of it
needs should stay in the nearest cache: fewer than the tips of free rods take.
"""


@inline
def get(w, at, i):
    """Three rows of one lane."""
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i]


@inline
def put(w, at, i, v):
    """Write three rows of one lane."""
    w[at + i] = v[0]
    w[at + LANES + i] = v[1]
    w[at + 2 * LANES + i] = v[2]


@inline
def get_four(w, at, i):
    """Four vectors of one lane."""
    return (
        get(w, at, i),
        get(w, at + 3 * LANES, i),
        get(w, at + 6 * LANES, i),
        get(w, at + 9 * LANES, i),
    )


@inline
def put_four(w, at, i, s):
    """Write four vectors of one lane."""
    put(w, at, i, s[0])
    put(w, at + 3 * LANES, i, s[1])
    put(w, at + 6 * LANES, i, s[2])
    put(w, at + 9 * LANES, i, s[3])


@inline
def turn_at(w, at, i):
    """A quaternion in four rows of one lane."""
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i], w[at + 3 * LANES + i]


@inline
def copy(into, at, values, start, count):
    """A loop: an assignment of slices would compile messages for shapes that do not fit."""
    for i in range(count):
        into[at + i] = values[start + i]


@inline
def load_all(lanes, gamma, first, count):
    """Lay activations side by side; lanes to spare repeat the last one."""
    load(lanes, gamma, first, count)
    for j in range(lanes.shape[0]):
        for i in range(count, LANES):
            lanes[j, i] = lanes[j, count - 1]
