"""Numbers that another program printed: the README of ActiveFilaments.jl.

ActiveFilaments.jl, by the theory's authors, integrates the same rod in Julia with an adaptive
method. Its README, section "Computing an activated configuration", prints position and directors of
one filament at Z = L/10 (https://github.com/LivingMatterLab/ActiveFilaments.jl, commit 0bf8286).
"""

from __future__ import annotations

import numpy as np

from softreach.arm import designs
from softreach.rod.kinematics import configuration

POSITION = [0.010887432435510243, 0.010588028536001756, 0.08230390930976722]
DIRECTORS = [
    [0.9378971336343721, -0.3068269347479843, -0.16188328769080979],
    [0.24481737934065784, 0.9160122985605073, -0.31778281838178346],
    [0.24579141053584871, 0.25841575222701285, 0.9342418752698606],
]


def test_an_activated_filament_is_that_of_active_filaments_jl():
    """L = 1 m, R2 = L/16, R1 = 0.6 R2, ν = 1/2; three sectors of 30° from the x-axis on."""
    shape = configuration(designs.filament(), [-2.0, -1.3, 0.0], stations=[0.1], tol=1e-12)
    np.testing.assert_allclose(shape.position[0], POSITION, rtol=0, atol=1e-12)
    np.testing.assert_allclose(shape.directors[0], DIRECTORS, rtol=0, atol=1e-12)
