"""Response of tips to activations and forces: the tangents of a walk with the base fixed."""

from __future__ import annotations

from softreach.kernels.branches.chord import by_inverse
from softreach.kernels.compiler import inline
from softreach.kernels.lanes import LANES, get, turn_at
from softreach.kernels.loaded.frame_step import STATE
from softreach.kernels.loaded.frame_walk import rotation
from softreach.kernels.loaded.load_continuation import STEP, TRIAL
from softreach.kernels.loaded.unloaded_frames import TURN
from softreach.kernels.quaternion import back, turned
from softreach.kernels.vector import combination, cross, dot, plus, times

__all__ = ["corrected_tip", "respond"]


@inline
def _turned_too(columns, i, x, y):
    """y, and what a rotation x at the tip adds to it."""
    for n in range(3):
        y = plus(y, times(x[n], get(columns[n], 6 * LANES, i)))
    return y


@inline
def corrected_tip(w, columns, i):
    """The tip as the base sees it, with the step that is left taken linearly."""
    return _turned_too(columns, i, get(w, STEP, i), get(w, STATE + 9 * LANES, i))


@inline
def _world(w, at, i):
    g, h = get(w, at, i), get(w, at + 3 * LANES, i)
    return g, h, cross(g, h)


@inline
def respond(w, work, columns, first, count, bundles, slopes, compliance):
    """Fill slopes (v, ω), theory (74), and compliances, theory (75), whatever is asked for."""
    for i in range(count):
        q = back(turn_at(work, TURN, i))
        at_tip, at_base = _world(w, TRIAL, i), _world(w, STATE, i)
        tip = turned(q, corrected_tip(w, columns, i))
        for n in range(3, columns.shape[0]):
            x = by_inverse(w, i, times(-1.0, rotation(w, get(columns[n], 0, i), i)))
            v = turned(q, _turned_too(columns, i, x, get(columns[n], 6 * LANES, i)))
            if n < 3 + bundles:
                turn = -dot(x, at_tip[0]), -dot(x, at_tip[1]), -dot(x, at_tip[2])
                omega = turned(q, combination(turn, at_base))
                v = plus(v, cross(tip, omega))
                for row in range(3):
                    slopes[first + i, row, n - 3] = v[row]
                    slopes[first + i, 3 + row, n - 3] = omega[row]
            else:
                force = turned(q, at_base[n - 3 - bundles])
                for row in range(3):
                    for axis in range(3):
                        compliance[first + i, row, axis] += v[row] * force[axis]
