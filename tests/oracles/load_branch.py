"""The branch of equilibria of an arm under payload and weight, followed by its arc length.

In NumPy, by RK4 in the directors, with numerical derivatives: slow, and independent of the kernels.
The load is an unknown like the direction of gravity at the tip, so that folds are passed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.arm.tables import tables
from softreach.rod.free import FreeRod

_DIFFERENCE = 2e-7
_TOL = 1e-9


class Branch(NamedTuple):
    """Points of a branch from no load to all of it, or to where it was left."""

    loads: np.ndarray
    """Share of the load, shape (n,)."""
    directions: np.ndarray
    """Of gravity as the tip sees it, in its directors, shape (n, 3)."""
    determinants: np.ndarray
    """Of the map of directions, shape (n,)."""

    @property
    def fold(self):
        """Share of the load at which the branch turns back first, or None."""
        back = np.flatnonzero(np.diff(self.loads) < 0)
        return float(self.loads[back[0]]) if len(back) else None


def follow(rod, gamma, longest, *, steps=30, points=400):
    """The branch of one activation, until all of the load is on or it has turned back.

    Args:
        rod: A `LoadedRod` under gravity and payload without lever.
        gamma: Activation.
        longest: Arc length from point to point, in rad and shares of the load.
        steps: Of RK4.
        points: At most so many.
    """
    walk = _Walk(rod, gamma, steps)
    g, share, ahead, stride = walk.rest, 0.0, np.array([0.0, 0.0, 0.0, 1.0]), longest / 8
    _, slopes, planes = walk.linearized(g, share)
    ahead = _ahead(slopes, planes, ahead)
    found = [(share, g, _determinant(slopes))]
    while share < 1.0 and len(found) < points and (len(found) < 2 or share > found[-2][0]):
        point = walk.corrected(g, share, ahead, min(stride, longest))
        if point is None:
            stride *= 0.5
            assert stride > 1e-7
            continue
        g, share, slopes, planes = point
        ahead = _ahead(slopes, planes, ahead)
        found.append((share, g, _determinant(slopes)))
        stride = min(1.5 * stride, longest)
    return Branch(*(np.array(values) for values in zip(*found, strict=True)))


class _Walk:
    """Walks from tip to base."""

    def __init__(self, rod, gamma, steps):
        arm, weight = rod.arm, float(np.linalg.norm(rod.loads.gravity))
        self.z = z = np.linspace(arm.length, 0.0, 2 * steps + 1)
        at = tables(arm, z)
        self.stretch, self.curvature = 1.0 + at.extension @ gamma, at.curvature @ gamma
        self.axial, bending, torsion = rod.body.compliance(z)
        self.yields = np.stack([bending, bending, torsion], axis=1)
        mass = rod.body.mass_per_length(z)
        beyond = np.cumsum(np.append(0.0, 0.5 * (mass[1:] + mass[:-1]) * -np.diff(z)))
        self.force = weight * (rod.loads.payload + beyond)
        self.down = np.array(rod.loads.gravity) / weight
        self.rest = FreeRod(arm, 1e-9).frames(gamma[None], [arm.length]).directors[0, 0] @ self.down
        self.across = _tangents(self.down)

    def seen(self, g, share):
        """What the base would have to see, of directions (3, n) and shares (n,)."""
        m, h = np.zeros_like(g), 2 * (self.z[1] - self.z[0])
        for k in range(0, len(self.z) - 1, 2):
            g1, m1 = self._rates(k, g, m, share)
            g2, m2 = self._rates(k + 1, g + h / 2 * g1, m + h / 2 * m1, share)
            g3, m3 = self._rates(k + 1, g + h / 2 * g2, m + h / 2 * m2, share)
            g4, m4 = self._rates(k + 2, g + h * g3, m + h * m3, share)
            g = g + h / 6 * (g1 + 2 * g2 + 2 * g3 + g4)
            m = m + h / 6 * (m1 + 2 * m2 + 2 * m3 + m4)
        return g

    def _rates(self, k, g, m, share):
        u = self.curvature[k][:, None] + self.yields[k][:, None] * m
        a, b, c = self.stretch[k] * u
        force = share * self.force[k]
        push = self.stretch[k] * (1.0 + force * g[2] * self.axial[k]) * force
        turn = np.array([c * g[1] - b * g[2], a * g[2] - c * g[0], b * g[0] - a * g[1]])
        moment = np.array([c * m[1] - b * m[2], a * m[2] - c * m[0], b * m[0] - a * m[1]])
        moment[0] += push * g[1]
        moment[1] -= push * g[0]
        return turn, moment

    def linearized(self, g, share):
        """What the base lacks (2,), its derivatives (2, 3), and tangents at the tip (2, 3)."""
        first, second = _tangents(g)
        e = _DIFFERENCE
        places = [g, g + e * first, g - e * first, g + e * second, g - e * second, g, g]
        places = np.array([p / np.linalg.norm(p) for p in places]).T
        shares = np.array([share] * 5 + [share + e, share - e])
        seen = self.across @ self.seen(places, shares)
        slopes = (seen[:, 1::2] - seen[:, 2::2]) / (2 * e)
        return seen[:, 0], slopes, np.array([first, second])

    def corrected(self, g, share, ahead, stride):
        """The point in the plane across the branch, a stride ahead; None if it is not near."""
        at, load = g + stride * ahead[:3], share + stride * ahead[3]
        at /= np.linalg.norm(at)
        begin, before = at, load
        for turn in range(6):
            missing, slopes, planes = self.linearized(at, load)
            row = np.append(planes @ ahead[:3], ahead[3])
            off = (at - begin) @ ahead[:3] + (load - before) * ahead[3]
            step = np.linalg.solve(np.vstack([slopes, row]), -np.append(missing, off))
            if turn == 0 and np.linalg.norm(step) > 0.2 * stride:
                return None
            if np.linalg.norm(step) < _TOL:
                kept = _ahead(slopes, planes, ahead) @ ahead > 0.95
                return (at, load, slopes, planes) if kept else None
            at = at + step[:2] @ planes
            at /= np.linalg.norm(at)
            load += step[2]
        return None


def _tangents(g):
    other = np.eye(3)[np.abs(g).argmin()]
    first = np.cross(other, g) / np.linalg.norm(np.cross(other, g))
    return np.array([first, np.cross(g, first)])


def _determinant(slopes):
    return float(np.linalg.det(slopes[:, :2]))


def _ahead(slopes, planes, before):
    """Unit tangent of the branch in space and load, on the side of the one before."""
    along = np.cross(*slopes)
    tangent = np.append(along[:2] @ planes, along[2]) / np.linalg.norm(along)
    return tangent if tangent @ before > 0 else -tangent
