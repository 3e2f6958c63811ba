"""The opponents of loaded tips: the same equations in the base frame, by SciPy.

Both take the strains without loads from the tables of the arm and know the force n(Z) in advance,
as any program for dead loads does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad_vec, solve_bvp, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import root

import softreach as sr
from softreach.arm.tables import compliance, tables

__all__ = ["METHODS"]

Array = np.ndarray
_KNOTS = 201
_TOL = 1e-6


class _Rod(NamedTuple):
    """Splines in Z of what the equations hold."""

    length: float
    rest: Callable[[Array], Array]
    """ζ̂ and û, then 1/K0, 1/K1, 1/K2 and 1/K3, (station, 8)."""
    force: Callable[[Array], Array]
    """n in the base frame [N], (station, 3)."""


def _rod(arm: sr.Manipulator, gamma: Array) -> _Rod:
    """An arm under its own weight and a payload."""
    z = np.linspace(0.0, arm.length, _KNOTS)
    at, loads = tables(arm, z), arm.loads
    assert loads is not None
    bent = [1.0 + at.extension @ gamma, *(at.curvature @ gamma).T]
    axial, yields = compliance(arm, z)

    def mass(station: float) -> Array:
        return arm.section.mass_per_length(arm.profile.radius(np.array([station])))

    beyond = [quad_vec(mass, one, arm.length)[0][0] + loads.payload for one in z]
    return _Rod(
        arm.length,
        CubicSpline(z, np.stack([*bent, axial, *yields.T], axis=-1)),
        CubicSpline(z, np.outer(beyond, loads.gravity)),
    )


def _rates(rod: _Rod, z: Array, y: Array) -> Array:
    """Of (r, q, m): place, frame as a quaternion, moment in the base frame; (10, station)."""
    at, force = rod.rest(z).T, rod.force(z).T
    directors = _matrix(y[3:7])
    m, n3 = np.einsum("jis,js->is", directors, y[7:10]), (directors[:, 2] * force).sum(axis=0)
    u = at[1:4] + at[5:8] * m
    tangent = directors[:, 2] * at[0] * (1.0 + at[4] * n3)
    spin = at[0] * np.einsum("ijs,js->is", directors, u)
    return np.concatenate([tangent, _turning(spin, y[3:7]), -np.cross(tangent, force, axis=0)])


def _matrix(q: Array) -> Array:
    """d1, d2, d3 as columns, (3, 3, station)."""
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def _turning(spin: Array, q: Array) -> Array:
    """q' of a frame that turns by `spin`."""
    x, y, z = spin
    return 0.5 * np.array(
        [
            -x * q[1] - y * q[2] - z * q[3],
            x * q[0] + y * q[3] - z * q[2],
            y * q[0] + z * q[1] - x * q[3],
            z * q[0] + x * q[2] - y * q[1],
        ]
    )


_CLAMPED = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def _walk(rod: _Rod, moment: Array, *, stations: Array | None = None) -> Array:
    """From the base to the tip by DOP853, (10, station)."""
    found = solve_ivp(
        lambda z, y: _rates(rod, np.array([z]), y[:, None])[:, 0],
        (0.0, rod.length),
        np.concatenate([_CLAMPED, moment]),
        "DOP853",
        t_eval=stations,
        rtol=0.1 * _TOL,
        atol=0.1 * _TOL,
    )
    return found.y


def by_shooting(arm: sr.Manipulator, gamma: Array) -> Array:
    """DOP853 and SciPy's root, the load grown in quarters; unknown is the moment on the base."""
    rod, moment = _rod(arm, gamma), np.zeros(3)
    for share in (0.25, 0.5, 0.75, 1.0):
        part = rod._replace(force=lambda z, share=share: share * rod.force(z))
        moment = root(lambda m, part=part: _walk(part, m)[7:, -1], moment, tol=0.1 * _TOL).x
    return _walk(rod, moment)[:3, -1]


def by_collocation(arm: sr.Manipulator, gamma: Array) -> Array:
    """SciPy's solve_bvp from the unloaded arm, the load grown in quarters."""
    rod = _rod(arm, gamma)
    z = np.linspace(0.0, rod.length, 41)
    free = rod._replace(force=lambda z: 0.0 * rod.force(z))
    guess = _walk(free, np.zeros(3), stations=z)

    def ends(base: Array, tip: Array) -> Array:
        return np.concatenate([base[:7] - _CLAMPED, tip[7:]])

    for share in (0.25, 0.5, 0.75, 1.0):
        part = rod._replace(force=lambda z, share=share: share * rod.force(z))
        found = solve_bvp(
            lambda z, y, part=part: _rates(part, z, y), ends, z, guess, tol=_TOL, max_nodes=20_000
        )
        z, guess = found.x, found.y
    return guess[:3, -1]


METHODS = {"SciPy, DOP853 shooting": by_shooting, "SciPy, solve_bvp": by_collocation}
