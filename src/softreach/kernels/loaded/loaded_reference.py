"""The reference of loaded rods: theory (61), in the directors, from tip to base, on one page.

The fast kernels walk in the frames of the unloaded arm and by another method; they are held to
these functions, which take plain functions of Z.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Section", "walk"]

Array = NDArray[np.float64]


class Section(NamedTuple):
    """An arm at one station under forces along one direction."""

    stretch: float
    """ζ̂ [-]."""
    growth: float
    """η [-], per length of which curvature is."""
    curvature: Array
    """û [1/m], shape (3,)."""
    compliance: Array
    """(1/K1, 1/K1, 1/K3) [1/(N m²)], shape (3,)."""
    axial: float
    """1/K0 [1/N]."""
    force: float
    """w, all that pulls beyond the section [N]."""


def rates(at: Section, g: Array, m: Array, y: Array) -> tuple[Array, Array, Array]:
    """dG/dZ, dm/dZ and dy/dZ, with n = w G.

    G' = -ω × G, m' = -ω × m - ζ e3 × n, y' = -ω × y - ζ e3, where ω = η (û + K⁻¹m) and
    ζ = ζ̂ + η n3/K0.
    """
    omega = at.growth * (at.curvature + at.compliance * m)
    along = np.array([0.0, 0.0, at.stretch + at.growth * at.force * g[2] * at.axial])
    push = np.cross(along, at.force * g)
    return -np.cross(omega, g), -np.cross(omega, m) - push, -np.cross(omega, y) - along


def walk(
    section: Callable[[float], Section], length: float, g: Array, m: Array, steps: int
) -> tuple[Array, Array, Array]:
    """G, m and the tip as the base sees them, from G and m at the tip, by RK4.

    Args:
        section: The arm at Z [m].
        length: L [m].
        g: Direction of the forces in the directors of the tip, shape (3,).
        m: Moment on the tip in its directors [N m], shape (3,).
        steps: Even steps from tip to base.
    """
    x, h = np.stack([g, m, np.zeros(3)]), -length / steps
    for z in length + h * np.arange(steps):
        k1 = np.stack(rates(section(z), *x))
        k2 = np.stack(rates(section(z + h / 2), *(x + h / 2 * k1)))
        k3 = np.stack(rates(section(z + h / 2), *(x + h / 2 * k2)))
        k4 = np.stack(rates(section(max(z + h, 0.0)), *(x + h * k3)))
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x[0], x[1], x[2]
