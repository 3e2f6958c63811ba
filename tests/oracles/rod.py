"""A rod and what acts on it, as the oracles of loaded rods take them."""

from collections.abc import Callable
from dataclasses import dataclass

from numpy.typing import ArrayLike

Number = Callable[[float], float]
Vector = Callable[[float], ArrayLike]
Triple = tuple[float, float, float]

ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Rod:
    """A rod clamped at Z = 0: its shape without loads, what it resists and what it weighs."""

    length: float
    """[m]."""
    axial: Number
    """K0(Z) [N]."""
    bending: Number
    """K1(Z) [N m²]."""
    torsion: Number
    """K3(Z) [N m²]."""
    across: Number | None = None
    """K2(Z) [N m²]; K1 if None."""
    angle: float = 0.0
    """Of the axes of K1 and K2 about d3, from d1 and d2 [rad]."""
    mass: Number = lambda z: 0.0
    """Mass per length Z [kg/m]."""
    stretch: Number = lambda z: 1.0
    """ζ̂(Z) [-]."""
    rest_length_factor: Number | None = None
    """η(Z) [-], what of ζ̂ changes the length of matter at rest; all of it if None."""
    curvature: Vector = lambda z: ZERO
    """û(Z) per length of η, in the directors [1/m]."""
    breaks: tuple[float, ...] = ()
    """Where these are not smooth [m]."""
    base: tuple[Triple, Triple, Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """d1, d2, d3 at the base, in the fixed frame."""

    def grown(self, z: float) -> float:
        """η(Z) [-]."""
        return (self.rest_length_factor or self.stretch)(z)


@dataclass(frozen=True, kw_only=True)
class PointLoad:
    """A dead force and moment on one section, in the fixed frame."""

    place: float
    """Z [m], inside the rod."""
    force: Triple = ZERO
    """[N]."""
    moment: Triple = ZERO
    """[N m]."""


@dataclass(frozen=True, kw_only=True)
class Loads:
    """What acts on a rod, in the fixed frame unless it follows the tip."""

    gravity: Triple = ZERO
    """[m/s²]."""
    payload: float = 0.0
    """Mass at the tip [kg]."""
    lever: Triple = ZERO
    """From the tip to the payload, in the directors of the tip [m]."""
    tip_force: Triple = ZERO
    """[N]."""
    tip_moment: Triple = ZERO
    """[N m]."""
    following_force: Triple = ZERO
    """On the tip, in its directors [N]."""
    following_moment: Triple = ZERO
    """On the tip, in its directors [N m]."""
    points: tuple[PointLoad, ...] = ()
    force_per_length: Vector = lambda z: ZERO
    """f(Z) per length Z [N/m]."""
