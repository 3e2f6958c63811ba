"""An arm as a rod of PyElastica, whose rest strains follow the activations.

PyElastica's rods bend between the middles of elements. A fixed element of hardly any length stands
for the base, so that the arm bends from there on, at second order in the length of elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.tables import Tables, tables
from softreach.models.chain import MOST_BODIES, Elements, check_simulated, elements_of
from softreach.support.arguments import as_integer
from softreach.support.arrays import as_rows
from softreach.support.errors import NotPossible, check_installed

_SHORT = 1e-3  # length of the fixed element over that of the next
_SHEAR = 27.0 / 28.0 / 3.0  # shear stiffness over K0 that PyElastica takes for rubber


@dataclass(frozen=True, eq=False)
class ElasticaArm:
    """An arm as a rod of PyElastica."""

    arm: Manipulator
    """The design."""
    rod: Any
    """Its `CosseratRod`, in m, kg and s. The last node is the tip."""
    _elements: Elements
    _table: Tables

    @property
    def time_step(self) -> float:
        """A step of time [s], a third of what PyElastica's steppers bear at this activation."""
        rod = self.rod
        lengths, inertia = rod.rest_lengths[1:], rod.mass_second_moment_of_inertia[0, 0, 1:]
        moving = 4.0 * rod.shear_matrix[2, 2, 1:] / lengths / rod.mass[1:-1].min()
        bending = 4.0 * rod.bend_matrix.max(axis=(0, 1)) / rod.rest_voronoi_lengths
        turning = (bending + rod.shear_matrix[0, 0, 1:] * lengths) / inertia
        return float(2.0 / 3.0 / np.sqrt(np.maximum(moving, turning).max()))

    def add_to(self, simulator: Any) -> None:
        """Append the rod to a simulator, clamp it at its base, and let gravity act on it.

        Args:
            simulator: A `BaseSystemCollection` with `Constraints` and `Forcing`.
        """
        elastica: Any = import_module("elastica")
        simulator.append(self.rod)
        base = {"constrained_position_idx": (0, 1), "constrained_director_idx": (0,)}
        simulator.constrain(self.rod).using(elastica.FixedConstraint, **base)
        if self.arm.loads is not None:
            gravity = np.array(self.arm.loads.gravity)
            simulator.add_forcing_to(self.rod).using(elastica.GravityForces, acc_gravity=gravity)

    def activate(self, activation: ArrayLike) -> None:
        """Set the strains at rest, also while a simulation runs.

        PyElastica softens what is stretched, as if matter kept its volume. Stiffness is set so that
        this counts from the arm without loads, and is K/η there as in theory (57).

        Args:
            activation: γ [unit of each input], shape (bundles,); what exceeds a bound is the bound.

        Raises:
            InvalidInput: Another shape, or a number that is not finite.
        """
        count = self.arm.bundles
        given = as_rows("activation", activation, count, f"{count} numbers")[0]
        gamma = np.clip(given, *self.arm.bounds.T)
        rod, table, elements, section = self.rod, self._table, self._elements, self.arm.section
        stretch = elements.inside(1.0 + table.extension @ gamma)
        growth = 1.0 + table.rest_length_factor @ gamma
        rest = self.arm.rest.curvature(table.stations / self.arm.length)
        turn = elements.between(growth[:, None] * (rest + table.curvature @ gamma))[:-1]
        stiffness = self.arm.stiffness_at(table.stations)
        compliance = section.in_directors(growth[:, None] / section.resistance(stiffness))
        bending = np.linalg.inv(elements.between(compliance)[:-1]).T
        axial = stretch / elements.inside(growth / stiffness.axial)
        lengths, gaps = np.append(rod.rest_lengths[0], stretch), rod.rest_voronoi_lengths
        rod.rest_kappa[:] = turn.T / gaps
        rod.bend_matrix[:] = bending * gaps * ((lengths[1:] + lengths[:-1]) / (2.0 * gaps)) ** 3
        rod.rest_sigma[2, 1:] = stretch / rod.rest_lengths[1:] - 1.0
        rod.shear_matrix[2, 2, 1:] = axial
        rod.shear_matrix[(0, 1), (0, 1), 1:] = _SHEAR * axial


def pyelastica(arm: Manipulator, *, elements: int = 50) -> ElasticaArm:
    """The arm as a rod for PyElastica 1.0 or newer, whose rest strains follow the activations.

    Curvature, twist and extension at rest are those of theory (7) and (86), as those of an arm
    without loads; the stiffness is that of its sections. Sections shear as those of rubber, which
    softreach leaves out. A payload is mass of the last node.

    Args:
        arm: The design. It has Young's moduli and densities, and neither drives, rigid pieces,
            guides, tendons driven by length nor forces beside gravity and a payload at the tip.
        elements: Elements of the rod, up to a few more where parts of the arm begin or end.

    Raises:
        InvalidDesign: A modulus or a density is missing, or an activation within the bounds would
            shorten the arm to nothing.
        InvalidInput: An argument is out of its range.
        NotPossible: The arm has what no such rod has; the sentence names it.
        MissingExtra: PyElastica is not installed.
    """
    arm, count = a_manipulator("arm", arm), as_integer("elements", elements, 2, MOST_BODIES)
    check_simulated(arm, "a rod of PyElastica")
    if arm.rigid_pieces or (arm.loads and any(arm.loads.payload_arm)):
        raise NotPossible("a rod of PyElastica has no rigid pieces and no payload beside its tip")
    check_installed("elastica")
    cut = elements_of(arm, count)
    model = ElasticaArm(arm, _rod(arm, cut), cut, tables(arm, cut.stations))
    model.activate(np.zeros(arm.bundles))
    return model


def _rod(arm: Manipulator, cut: Elements) -> Any:
    """A straight rod of the elements and the fixed one, of the masses of the arm."""
    elastica: Any = import_module("elastica")
    masses = cut.inside(arm.section.mass_per_length_at(arm.profile, cut.stations))
    ends = np.append(-_SHORT * cut.edges[1], cut.edges)
    lengths, axes = np.diff(ends), arm.base.rotation.T
    radii = arm.profile.radius(np.append(0.0, cut.nodes))
    weights = np.append(_SHORT * masses[0], masses)
    rod = elastica.CosseratRod.straight_rod(
        len(lengths),
        start=arm.base.position + ends[0] * axes[2],
        direction=axes[2],
        normal=axes[0].copy(),
        base_length=arm.length,
        base_radius=radii,
        density=weights / (np.pi * radii**2 * lengths),
        youngs_modulus=1e6,  # `activate` sets the stiffness
        position=np.asarray(arm.base.position)[:, None] + ends * axes[2][:, None],
    )
    rod.mass[-1] += arm.loads.payload if arm.loads else 0.0
    turning = weights * arm.section.gyration_at(arm.profile, np.append(0.0, cut.nodes))
    inertia = np.array([turning, turning, 2.0 * turning])
    rod.mass_second_moment_of_inertia[range(3), range(3)] = inertia
    rod.inv_mass_second_moment_of_inertia[range(3), range(3)] = 1.0 / inertia
    return rod
