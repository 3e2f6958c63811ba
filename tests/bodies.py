"""What arms are made of, for tests of loaded rods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softreach.arm import Loads, Manipulator


def rubber(arm: Manipulator, loads: Loads, young: float = 1e6, density: float = 1000.0):
    """The arm of one heavy elastic material throughout, under loads."""
    ring = arm.section.rings[0]
    material = ring.material.replace(young_modulus=young, density=density)
    section = arm.section.replace(rings=(ring.replace(material=material),))
    return arm.replace(section=section, loads=loads)


@dataclass(frozen=True)
class Uniform:
    """The same everywhere."""

    yields: tuple[float, float, float]
    mass: float

    def compliance(self, z):
        return tuple(np.full(np.shape(z), c) for c in self.yields)

    def mass_per_length(self, z):
        return np.full(np.shape(z), self.mass)


def uniform(bending, axial=np.inf, torsion=None, mass=0.0):
    """The body of an untapered rod from its stiffnesses."""
    return Uniform((1.0 / axial, 1.0 / bending, 1.0 / (torsion or bending)), mass)
