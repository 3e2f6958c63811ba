"""Numbers that another program printed: the README of ActiveFilaments.jl.

ActiveFilaments.jl, by the theory's authors, integrates the same rod in Julia with an adaptive
method. Its README, section "Computing an activated configuration", prints position and directors of
one filament at Z = L/10 (https://github.com/LivingMatterLab/ActiveFilaments.jl, commit 0bf8286).
"""

from __future__ import annotations

import numpy as np

from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Pieces,
    Ring,
    Section,
    designs,
)
from softreach.rod.free import FreeRod
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


def test_the_same_filament_in_layers_of_one_material_is_it_too():
    """Its rings as ActiveFilaments.jl has them, with E = 1 MPa; the core in two parts here."""
    rubber = Material(young_modulus=1e6, poisson_ratio=0.5)
    rings = (
        Ring(inner_ratio=0.2, outer_ratio=0.6, material=rubber, name="inner"),
        Ring(inner_ratio=0.6, material=rubber, name="outer"),
    )
    sectors = FiberArchitecture(
        helical_angle=Pieces(stations_over_length=(0, 0.05, 1), values=(np.pi / 10, np.pi / 10)),
        extent=np.radians(30),
        bundles=3,
        ring="outer",
        activation_bounds=(-2.0, 0.0),
    )
    filament = Manipulator(
        profile=LinearTaper(length=1.0, outer_radius=1 / 16),
        section=Section(rings=rings, core=rubber),
        actuators=(sectors,),
    )
    position, directors = FreeRod(filament, 1e-12).frames([[-2.0, -1.3, 0.0]], [0.1])
    np.testing.assert_allclose(position[0, 0], POSITION, rtol=0, atol=1e-12)
    np.testing.assert_allclose(directors[0, 0], DIRECTORS, rtol=0, atol=1e-12)
