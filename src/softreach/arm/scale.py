"""Scale of an arm: its mass, and warnings of a length that may be in another unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from softreach.arm.profile import Profile
from softreach.arm.section import Section

__all__ = ["body_mass", "scale_warnings"]

_LONG = 10.0
"""Length from which mm may be meant [m]."""
_SLENDER = 5.0
"""Least L/R2(0) of a slender arm [-]."""
_WIDE = 1.0
"""Outer radius from which mm may be meant [m]."""

# Exact for the square of a cubic, which is the mass of a piece of any profile.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def body_mass(profile: Profile, section: Section) -> float:
    """Mass of the body of an arm [kg].

    Raises:
        InvalidDesign: A layer without a density.
    """
    ends = {0.0, *profile.breakpoints, profile.length}
    ends.update(profile.length * x for x in section.breaks)
    ends = np.array(sorted(ends))
    half = 0.5 * np.diff(ends)[:, None]
    z = ends[:-1, None] + half * (1.0 + _NODES)
    per_length = section.mass_per_length_at(profile, z)
    return float(np.sum(half * _WEIGHTS * per_length))


def scale_warnings(profile: Profile, section: Section) -> tuple[str, ...]:
    """One line for a length that looks like one in mm, and one for an arm that is not slender."""
    return (*_long(profile, section), *_stout(profile))


def _long(profile: Profile, section: Section) -> Iterator[str]:
    length = profile.length
    if length >= _LONG:
        known = not section.density_faults("")
        heavy = f" and weighs {body_mass(profile, section):.3g} kg" if known else ""
        yield (
            f"the arm is {length:g} m long{heavy}; if that is meant in mm: lengths are in m, "
            f"{length:g} mm are {length / 1e3:g}"
        )


def _stout(profile: Profile) -> Iterator[str]:
    radius = float(profile.radius(0.0))
    slenderness = profile.length / radius
    if slenderness < _SLENDER:
        meant = f"lengths are in m, {radius:g} mm are {radius / 1e3:g}"
        cause = f"if that is meant in mm: {meant}" if radius >= _WIDE else "is it a diameter?"
        yield (
            f"the arm is {slenderness:.3g} times as long as its outer radius at the base, "
            f"{radius:g} m, and the theory is one of slender arms, {_SLENDER:g} times or more; "
            f"{cause}"
        )
