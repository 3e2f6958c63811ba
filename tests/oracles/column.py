"""Self-weight under which an upright column buckles: Greenhill (1881), and tapered ones by Ritz.

j are zeros of Bessel functions.
"""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jv

from tests.oracles.rod import Number

Array = NDArray[np.float64]


def greenhill() -> float:
    """μ g L³/(E I) of a uniform column: (3 j/2)², j the first zero of J(-1/3)."""
    zero = brentq(lambda x: jv(-1 / 3, x), 1.0, 2.5, xtol=1e-15)
    return (3 * zero / 2) ** 2


def cone() -> float:
    """μ g L³/(E I) at the base of a full cone: 3 j²/4, j the first zero of J3."""
    zero = brentq(lambda x: jv(3, x), 5.0, 7.0, xtol=1e-15)
    return 3 * zero**2 / 4


def buckling_gravity(
    length: float, bending: Number, mass: Number, *, payload: float = 0.0, functions: int = 16
) -> float:
    """Gravity at which a column loses its stability [m/s²].

    The energy ½ ∫ K1 φ'² - W φ² dZ of a small slope φ(Z), φ(0) = 0, with the weight W beyond Z,
    over polynomials.

    Args:
        length: [m].
        bending: K1(Z) [N m²].
        mass: Mass per length [kg/m].
        payload: Mass at the tip [kg].
        functions: Number of polynomials.
    """
    nodes, weights = leggauss(60)
    z, w = length * (1 + nodes) / 2, length * weights / 2
    stiff = np.array([bending(s) for s in z])
    beyond = np.array([payload + _mass_beyond(s, length, mass) for s in z])
    slope = [Polynomial([0, 1]) * _legendre(k, length) for k in range(functions)]
    phi = np.array([f(z) for f in slope])
    rate = np.array([f.deriv()(z) for f in slope])
    elastic, weight = (rate * (w * stiff)) @ rate.T, (phi * (w * beyond)) @ phi.T
    return float(1 / eigh(weight, elastic, eigvals_only=True)[-1])


def _legendre(degree: int, length: float) -> Polynomial:
    return Legendre.basis(degree, domain=[0, length]).convert(kind=Polynomial)


def _mass_beyond(z: float, length: float, mass: Number) -> float:
    nodes, weights = leggauss(20)
    half = (length - z) / 2
    return float(half * weights @ [mass(s) for s in z + half * (1 + nodes)])
