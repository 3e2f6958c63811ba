"""A rod with tendons as follower loads, without the linear law.

After D. C. Rucker and R. J. Webster III, Statics and dynamics of continuum robots with general
tendon routing and external loading, IEEE Transactions on Robotics 27, 1033-1044 (2011), for a rod
that stretches, bends and twists but does not shear. In the directors, with ω the curvature per
length at rest, a tendon at p(Z) has the tangent t = b/|b|, b = p' + ω × p + ζ e3. Frictionless
and under the tension τ it pulls along its path with the force f = τ (t' + ω × t) per length and
the couple p × f, and at its anchor with the force -τ t and the couple -p × τ t:

    n' + ω × n + f = 0,    m' + ω × m + ζ e3 × n + p × f = 0

The solution starts at the tip, where nothing is left to bear, and walks to the base as an initial
value problem: f contains ω' and ζ', for which the balances are solved at each point.

With m = K ω and n3 = K0 (ζ - 1): an elastic rod whose energy is per length at rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

Array = NDArray[np.float64]
Function = Callable[[Array], ArrayLike]

_E3 = np.array([0.0, 0.0, 1.0])
_DEGREE = 40


@dataclass(frozen=True, kw_only=True)
class Tendon:
    """A tendon from the base to its anchor."""

    radius: Function
    """ρt(Z), distance from the axis [m]."""
    angle: Function
    """θ(Z), polar angle [rad]."""
    tension: float
    """τ [N]."""
    anchor: float
    """Zend [m]."""

    @cached_property
    def path(self) -> tuple[tuple[Chebyshev, ...], ...]:
        """x(Z), y(Z) with their first and second derivatives."""
        x, y = (
            _smooth(lambda z, turn=turn: np.asarray(self.radius(z)) * turn(self.angle(z)), self)
            for turn in (np.cos, np.sin)
        )
        return tuple((x.deriv(k), y.deriv(k)) for k in range(3))

    def at(self, z: float) -> tuple[Array, Array, Array]:
        """p, p', p'' in the directors."""
        p, dp, ddp = (np.array([x(z), y(z), 0.0]) for x, y in self.path)
        return p, dp, ddp


@dataclass(frozen=True, kw_only=True)
class Rod:
    """A straight rod, clamped at Z = 0 with d3 along z, and what it resists along Z."""

    length: float
    """[m]."""
    axial: Function
    """K0(Z) [N]."""
    bending: Function
    """K1(Z) = K2(Z) [N m²]."""
    torsion: Function
    """K3(Z) [N m²]."""

    @cached_property
    def stiffness(self) -> tuple[Chebyshev, ...]:
        """K1, K1, K3, K0 as polynomials."""
        k0, k1, k3 = (
            Chebyshev.interpolate(
                lambda z, f=f: np.broadcast_to(f(z), np.shape(z)), _DEGREE, [0.0, self.length]
            )
            for f in (self.axial, self.bending, self.torsion)
        )
        return k1, k1, k3, k0


class Shape(NamedTuple):
    """A rod at stations."""

    place: Array
    """r [m], shape (station, 3)."""
    frame: Array
    """Rows d1, d2, d3, shape (station, 3, 3)."""
    extension: Array
    """ζ, shape (station,)."""
    curvature: Array
    """ω per length at rest, in the directors [1/m], shape (station, 3)."""


def follower_shape(rod: Rod, tendons: Sequence[Tendon], stations: ArrayLike) -> Shape:
    """The rod pulled by the tendons, from the balances of force and moment."""
    z = np.asarray(stations, float)
    ends = _breaks(rod, tendons)[::-1]
    slack = [np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)]  # strains (ω, ζ) and n above the tip
    pose, above, parts = np.concatenate([np.zeros(3), np.eye(3).ravel()]), (), []
    for top, bottom in pairwise(ends):
        pulled = [tendon for tendon in tendons if tendon.anchor >= top]
        strains, n = _across(rod, above, pulled, top, slack)
        walk = solve_ivp(
            _Walk(rod, pulled),
            (top, bottom),
            np.concatenate([pose, n[:2], strains]),
            method="DOP853",
            dense_output=True,
            rtol=1e-11,
            atol=1e-13,
        )
        parts.append((bottom, top, walk.sol))
        end = walk.y[:, -1]
        k0 = rod.stiffness[3](bottom)
        pose, above = end[:12], pulled
        slack = [end[14:], np.array([*end[12:14], k0 * (end[17] - 1)])]
    return _from_base(_sampled(parts, z), pose)


def balanced_strains(rod: Rod, tendons: Sequence[Tendon], z: float) -> Array:
    """(ω, ζ) where the section at Z bears what the tendons that cross it pull.

    Cut at Z, the part beyond is held by n + Σ τ t = 0 and m + Σ p × τ t = 0. The same follows from
    the least of elastic energy plus tension times length, for which no derivative in Z matters.
    """
    pulled = [tendon for tendon in tendons if tendon.anchor >= z]

    def unbalanced(strains: Array) -> Array:
        return _resultants(rod, z, strains) + _pull(pulled, z, strains)[[3, 4, 5, 2]]

    return _solved(unbalanced, np.array([0.0, 0.0, 0.0, 1.0]))


class _Walk:
    """d/dZ of (r, d1, d2, d3, n1, n2, ω, ζ)."""

    def __init__(self, rod: Rod, tendons: Sequence[Tendon]) -> None:
        self.rod, self.tendons = rod, tendons
        self.slopes = [k.deriv() for k in rod.stiffness]

    def __call__(self, z: float, y: Array) -> Array:
        directors, omega, zeta = y[3:12].reshape(3, 3), y[14:17], y[17]
        stiff, slope = (np.array([k(z) for k in ks]) for ks in (self.rod.stiffness, self.slopes))
        n = np.array([y[12], y[13], stiff[3] * (zeta - 1)])
        pull, pull_rate = self._tendons(z, omega, zeta)
        # (m, n3)' = own_rate (ω', ζ') + own, and the tendons add pull_rate (ω', ζ') + pull
        m = stiff[:3] * omega
        own = np.append(slope[:3] * omega, slope[3] * (zeta - 1))
        own_rate = np.diag(stiff)
        turning = np.append(np.cross(omega, m) + zeta * np.cross(_E3, n), np.cross(omega, n)[2])
        order = [3, 4, 5, 2]
        strain_rate = np.linalg.solve(own_rate + pull_rate[order], -(own + turning + pull[order]))
        shear_rate = -(np.cross(omega, n) + pull[:3] + pull_rate[:3] @ strain_rate)[:2]
        turned = np.cross(omega @ directors, directors)
        return np.concatenate([zeta * directors[2], turned.ravel(), shear_rate, strain_rate])

    def _tendons(self, z: float, omega: Array, zeta: float) -> tuple[Array, Array]:
        """(f, p × f) without ω' and ζ', shape (6,), and for each unit of them, (6, 4)."""
        pull, pull_rate = np.zeros(6), np.zeros((6, 4))
        for tendon in self.tendons:
            p, dp, ddp = tendon.at(z)
            b = dp + np.cross(omega, p) + zeta * _E3
            size = np.linalg.norm(b)
            t = b / size
            bend = tendon.tension * (np.eye(3) - np.outer(t, t)) / size
            f = bend @ (ddp + np.cross(omega, dp)) + tendon.tension * np.cross(omega, t)
            rate = bend @ np.column_stack([-_cross_matrix(p), _E3])
            pull += np.concatenate([f, np.cross(p, f)])
            pull_rate += np.concatenate([rate, _cross_matrix(p) @ rate])
        return pull, pull_rate


def _across(
    rod: Rod,
    above: Sequence[Tendon],
    below: Sequence[Tendon],
    z: float,
    known: Sequence[Array],
) -> tuple[Array, Array]:
    """Strains and n just below an anchor, where those just above are known.

    The anchor takes the force of its tendon, and a tendon that runs on turns with the curvature:
    n + Σ τ t and m + Σ p × τ t do not jump.
    """
    strains, n = known
    m = _resultants(rod, z, strains)[:3]
    whole = np.concatenate([n, m]) + _pull(above, z, strains)

    def jump(below_strains: Array) -> Array:
        held = _resultants(rod, z, below_strains)
        return held + _pull(below, z, below_strains)[[3, 4, 5, 2]] - whole[[3, 4, 5, 2]]

    found = _solved(jump, strains)
    return found, (whole - _pull(below, z, found))[:3]


def _resultants(rod: Rod, z: float, strains: Array) -> Array:
    """(m, n3) of the strains (ω, ζ)."""
    *bending, axial = (k(z) for k in rod.stiffness)
    return np.append(np.array(bending) * strains[:3], axial * (strains[3] - 1))


def _pull(tendons: Sequence[Tendon], z: float, strains: Array) -> Array:
    """Σ τ t and Σ p × τ t of the tendons that cross the section."""
    total = np.zeros(6)
    for tendon in tendons:
        p, dp, _ = tendon.at(z)
        b = dp + np.cross(strains[:3], p) + strains[3] * _E3
        tau_t = tendon.tension * b / np.linalg.norm(b)
        total += np.concatenate([tau_t, np.cross(p, tau_t)])
    return total


def _breaks(rod: Rod, tendons: Sequence[Tendon]) -> list[float]:
    """Base, anchors and tip."""
    return sorted({0.0, rod.length, *(tendon.anchor for tendon in tendons)})


def _sampled(parts: Sequence[tuple[float, float, Function]], z: Array) -> Array:
    """States at stations, shape (18, station); an anchor belongs to the piece below it."""
    states = np.empty((18, len(z)))
    for bottom, top, solution in parts:
        inside = (z >= bottom) & (z <= top)
        if inside.any():
            states[:, inside] = solution(z[inside])
    return states


def _from_base(states: Array, base: Array) -> Shape:
    """The shape as seen from its base, which the walk left at a pose of its own."""
    frame = base[3:].reshape(3, 3)
    place = (states[:3].T - base[:3]) @ frame.T
    directors = states[3:12].T.reshape(-1, 3, 3) @ frame.T
    return Shape(place, directors, states[17], states[14:17].T)


def _solved(equations: Callable[[Array], Array], start: Array) -> Array:
    """The root near a start, each equation in its own size."""
    scale = np.maximum(np.abs(equations(start)), 1e-300)
    scale[scale < 1e-12 * scale.max()] = scale.max()
    found = root(lambda e: equations(e) / scale, start, method="hybr", options={"xtol": 1e-14})
    if np.abs(found.fun).max() > 1e-9:
        raise ArithmeticError(f"no balance found: {found.message}")
    return found.x


def _smooth(function: Function, tendon: Tendon) -> Chebyshev:
    return Chebyshev.interpolate(
        lambda z: np.broadcast_to(function(z), np.shape(z)), _DEGREE, [0.0, tendon.anchor]
    )


def _cross_matrix(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
