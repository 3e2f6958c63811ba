"""The bend of 45 degrees under a force out of its plane.

K.-J. Bathe and S. Bolourchi, Large displacement analysis of three-dimensional beam structures,
International Journal for Numerical Methods in Engineering 14, 961-986 (1979): a cantilever along
45 degrees of a circle of the radius 100, section 1 × 1, E = 1e7, ν = 0, with the torsional
stiffness of the polar moment, and a dead force of 600 at the tip, across the circle's plane.
"""

import math

from tests.oracles.rod import Loads, Rod

TIP = (15.685078, 53.468598, 47.151294)
"""Toward the center of the circle, along the force, along the tangent of the base; inextensible.

Published elements, which shear and stretch, give (15.8, 53.4, 47.2).
"""


def bend(axial: float = 1e13) -> tuple[Rod, Loads]:
    """The bend and its load; x toward the center, y along the force, z along the base.

    Args:
        axial: K0; 1e7 is that of the section, the default all but inextensible.
    """
    stiffness = 1e7 / 12
    rod = Rod(
        length=100 * math.pi / 4,
        axial=lambda z: axial,
        bending=lambda z: stiffness,
        torsion=lambda z: stiffness,
        curvature=lambda z: (0.0, 0.01, 0.0),
    )
    return rod, Loads(tip_force=(0.0, 600.0, 0.0))
