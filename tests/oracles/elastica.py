"""Inextensible cantilevers: elliptic integrals, shooting in the angle, and a helix."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

Array = NDArray[np.float64]


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


def tip_loaded_with_moment(load: float, moment: float) -> tuple[float, float]:
    """(deflection, distance along the undeformed axis) of the tip over L.

    The first integral ½ φ'² + load sin φ of the slope φ, by quadrature.

    Args:
        load: F L²/(E I) of a dead force across the undeformed axis.
        moment: M L/(E I) on the tip, not 0, that bends the same way.
    """

    def integral(weight, tip: float) -> float:
        def inverse_curvature(slope: float) -> float:
            squared = moment**2 + 2 * load * (math.sin(tip) - math.sin(slope))
            return weight(slope) / math.sqrt(squared)

        return quad(inverse_curvature, 0.0, tip, epsabs=1e-13, epsrel=1e-13)[0]

    slope = brentq(lambda tip: integral(lambda _: 1.0, tip) - 1, 1e-9, math.pi / 2, xtol=1e-14)
    return integral(math.sin, slope), integral(math.cos, slope)


class Helix:
    """A straight rod along z that a force F along an axis e and a moment at the tip wind around e.

    Its curvature κ and torsion τ per length before the load are constant, and so is the twist u3.
    With m = K1 κ b + K3 u3 t the balance m' + ζ t × F e = 0 asks for K3 u3 - K1 τ = ζ F/√(κ² + τ²).
    The base has t = e_z and b = e_y.

    Args:
        curvature: κ [1/m].
        torsion: τ [1/m].
        force: F along the axis [N].
        bending: K1 [N m²].
        twisting: K3 [N m²].
        axial: K0 [N].
    """

    def __init__(
        self,
        curvature: float,
        torsion: float,
        force: float,
        *,
        bending: float,
        twisting: float,
        axial: float,
    ) -> None:
        self.rate = math.hypot(curvature, torsion)
        self.axis = np.array([0.0, curvature, torsion]) / self.rate
        self.force = force * self.axis
        self.stretch = 1.0 + self.force[2] / axial
        twist = bending * torsion + self.stretch * force / self.rate
        self.base_moment = np.array([0.0, bending * curvature, twist])

    def turned(self, vector: Array, length: float) -> Array:
        """A vector of the base as the frame of the helix carries it."""
        along = self.axis * (self.axis @ vector)
        across, angle = vector - along, self.rate * length
        return along + math.cos(angle) * across + math.sin(angle) * np.cross(self.axis, across)

    def moment(self, length: float) -> Array:
        """m [N m]; at the tip what must act there."""
        return self.turned(self.base_moment, length)

    def place(self, length: float) -> Array:
        """r [m]."""
        up = np.array([0.0, 0.0, 1.0])
        along = self.axis * self.axis[2]
        angle = self.rate * length
        around = math.sin(angle) * (up - along) + (1 - math.cos(angle)) * np.cross(self.axis, up)
        return self.stretch * (length * along + around / self.rate)


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
