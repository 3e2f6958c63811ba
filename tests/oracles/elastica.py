"""The planar inextensible cantilever: elliptic integrals, and shooting in its angle."""

from __future__ import annotations

import math

from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc


def tip_loaded(load: float) -> tuple[float, float]:
    """(deflection, distance along the undeformed axis) of the tip over L.

    Bisshopp and Drucker (1945): with p² = (1 + sin φ0)/2 for the slope φ0 of the tip and
    sin θ1 = 1/(p√2), √load = K(p) - F(p, θ1).

    Args:
        load: F L²/(E I) of a dead force across the undeformed axis.
    """

    def modulus(slope: float) -> tuple[float, float]:
        m = (1 + math.sin(slope)) / 2
        return m, math.asin(1 / math.sqrt(2 * m))

    def miss(slope: float) -> float:
        m, start = modulus(slope)
        return ellipk(m) - ellipkinc(start, m) - math.sqrt(load)

    slope = brentq(miss, 1e-12, math.pi / 2 - 1e-12, xtol=1e-15)
    m, start = modulus(slope)
    deflection = 1 - 2 / math.sqrt(load) * (ellipe(m) - ellipeinc(start, m))
    return deflection, math.sqrt(2 * math.sin(slope) / load)


def heavy(load: float) -> tuple[float, float]:
    """(drop, distance along the undeformed axis) of the tip over L, clamped horizontally.

    EI φ'' = -w s cos φ for the slope φ at the distance s from the free end, φ'(0) = 0; the slope
    of the tip makes it vanish at the clamp.

    Args:
        load: w L³/(E I) of the weight w per length.
    """

    def walk(tip: float) -> list[float]:
        found = solve_ivp(
            lambda s, y: [y[1], -load * s * math.cos(y[0]), math.cos(y[0]), math.sin(y[0])],
            (0.0, 1.0),
            [tip, 0.0, 0.0, 0.0],
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
        return found.y[:, -1].tolist()

    slope = brentq(lambda tip: walk(tip)[0], 1e-9, math.pi / 2, xtol=1e-14)
    _, _, along, drop = walk(slope)
    return drop, along
