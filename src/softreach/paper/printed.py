"""Appendices A and B as they are printed, to be held against what softreach computes."""

from __future__ import annotations

import numpy as np

__all__ = ["delta0", "delta1", "delta3", "rotation"]


def delta0(ratio: float, taper: float, helical_angle: float, poisson_ratio: float) -> float:
    """δ0 of Appendix A for R2 = 1 [-], as printed.

    Args:
        ratio: R1/R2 [-].
        taper: φ [rad], not 0.
        helical_angle: α [rad], neither 0 nor ±φ.
        poisson_ratio: ν [-].
    """
    p, a = np.tan(taper) ** 2, np.tan(helical_angle) ** 2
    inner = ratio**2
    rise = (1 + inner * p) * (1 + a) / ((1 + p) * (1 + inner * a))
    stretch = 2 * (inner - 1) * poisson_ratio
    return float(stretch - 2 * (1 + poisson_ratio) / (p - a) * np.log(rise))


def delta1(ratio: float, taper: float, helical_angle: float, poisson_ratio: float) -> float:
    """δ1 = δ2 of Appendix A for R2 = 1 [-], as printed; arguments as for `delta0`."""
    p, a, nu = np.tan(taper), np.tan(helical_angle), poisson_ratio
    cubes = (ratio**3 - 1) * nu
    first = 3 * (1 + nu) * (np.arctan(ratio * p) - np.arctan(p)) * a + cubes * p**3 * a
    second = 3 * (1 + nu) * (np.arctan(ratio * a) - np.arctan(a)) + cubes * a**3
    return float(2 / (p * a * (p**2 - a**2)) * (first - p * second))


def delta3(ratio: float, taper: float, helical_angle: float, *, corrected: bool = False) -> float:
    """δ3 of Appendix A for R2 = 1 [-], as printed, or corrected: its 3 before the T's alone.

    Args:
        ratio: R1/R2 [-].
        taper: φ [rad], not 0.
        helical_angle: α [rad], neither 0 nor ±φ.
        corrected: Whether to move the 3 from before the bracket to before the arctangents.
    """
    p, a = np.tan(taper), np.tan(helical_angle)
    root = np.sqrt(complex(p**2 - a**2))

    def s(radius: float) -> complex:
        return root * np.sqrt(1 + p**2 * radius**2)

    def t(radius: float) -> complex:
        return np.arctan((a + 1j * p**2 * radius) / s(radius))

    arctangents = (t(-ratio) + t(ratio) - t(-1) - t(1)) * p**2
    roots = 6 * a * (s(1) - s(ratio))
    total = 3 * arctangents + roots if corrected else 3 * (arctangents + roots)
    return float((total / (p**2 * a**2 * root)).real)


def rotation(radius: float, taper: float, helical_angle: float, z: float) -> float:
    """Θ̃2 of Appendix B [rad], as printed.

    Args:
        radius: R2(0) [m].
        taper: φ [rad], not 0.
        helical_angle: α [rad].
        z: Station Z [m].
    """
    ratio = 1 - z * np.tan(taper) / radius
    return float(-np.tan(helical_angle) / np.sin(taper) * np.log(ratio))
