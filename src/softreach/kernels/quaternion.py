"""Rotations by unit quaternions (w, x, y, z)."""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.vector import cross, plus, times

__all__ = ["back", "turned"]


@inline
def turned(q, p):
    """q p q*."""
    v = q[1], q[2], q[3]
    t = times(2.0, cross(v, p))
    return plus(p, plus(times(q[0], t), cross(v, t)))


@inline
def back(q):
    """The quaternion that turns back."""
    return -q[0], q[1], q[2], q[3]
