"""How an arm moves, yields and vibrates about its posture at one activation.

Flexibility F, movements of masses by unit forces on them, is the linear response of the posture,
which weight bends, stiffens or softens: √M F √M has the eigenvalues 1/ω².
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach import schema
from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.models.chain import NODES, WEIGHTS, chain_of
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.rod.rods import ArmMap, as_tip_map
from softreach.stiffness import tip_compliance, yielding_rod
from softreach.support.arguments import as_number
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, NotPossible, Range

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class LocalModel:
    """An arm near an equilibrium, in the frame of the world: it moves, yields and vibrates."""

    arm: Manipulator
    """The design."""
    activation: Array
    """γ, inputs of the arm [unit of each], shape (bundle,)."""
    tip: Array
    """r [m], shape (3,)."""
    jacobian: Array
    """∂r/∂γ of the tip at rest [m per unit of each activation], shape (3, bundle)."""
    compliance: Array
    """∂r/∂F of the tip at rest [m/N], shape (3, 3), as `tip_compliance`."""
    mass: Array
    """∫ (∂r/∂γ)ᵀ (∂r/∂γ) dm, with which ½ γ̇·Mγ̇ is the kinetic energy of an arm that follows its
    activations [kg m² per unit of two activations], shape (bundle, bundle)."""
    frequencies: Array
    """Natural frequencies without damping, lowest first [Hz], shape (mode,)."""
    tip_modes: Array
    """Movement of the tip in each mode of unit modal mass [1/√kg], shape (mode, 3)."""
    damping: float
    """Viscosity over stiffness [s]."""
    error: float
    """Largest error of the frequencies, relative [-], an estimate from half the masses."""

    @property
    def damping_ratios(self) -> Array:
        """ζ of each mode, damping times ω/2 [-], shape (mode,)."""
        return math.pi * self.damping * self.frequencies

    def to_dataset(self) -> xr.Dataset:
        """All numbers over `axis`, `bundle` and `mode`."""
        import xarray as xr

        values = {
            "activation": ("bundle", self.activation),
            "tip": ("axis", self.tip, {"units": "m"}),
            "jacobian": (("axis", "bundle"), self.jacobian),
            "compliance": (("axis", "force"), self.compliance, {"units": "m/N"}),
            "mass": (("bundle", "other_bundle"), self.mass),
            "frequency": ("mode", self.frequencies, {"units": "Hz", "error": self.error}),
            "damping_ratio": ("mode", self.damping_ratios, {"units": "1"}),
            "tip_mode": (("mode", "axis"), self.tip_modes, {"units": "kg-0.5"}),
        }
        names = {"axis": list(schema.AXES), **schema.bundle_coordinates(self.arm)}
        return xr.Dataset(values, names, schema.provenance(self.arm) | {"damping": self.damping})

    def __str__(self) -> str:
        most, _, least = np.linalg.svd(self.compliance)[1]
        tip, error = self.arm.length_unit.place(self.tip), f"frequencies to {self.error:.0e}"
        head = f"tip {tip}, yields by {least:.3g} to {most:.3g} m/N; {error}:"
        pairs = zip(self.frequencies, self.damping_ratios, strict=True)
        return "\n  ".join([head, *(f"{f:.4g} Hz, damping ratio {z:.2g}" for f, z in pairs)])


def local_model(arm: Manipulator, activation: ArrayLike, damping: float = 0.05) -> LocalModel:
    """How an arm moves, yields and vibrates about its posture at an activation.

    Tensions and pressures are held. Sections have no rotary inertia and do not shear, so that modes
    of mere torsion are missing. There are six frequencies, or fewer of an arm almost without mass.

    Args:
        arm: The design, with moduli and densities or measured sections. Of loads it may have
            gravity, a payload and forces that keep their direction.
        activation: γ [unit of each input], shape (bundles,).
        damping: Viscosity over stiffness of the arm [s], as of `mujoco`.

    Raises:
        InvalidInput: An argument is out of its range or has another shape; or other loads.
        InvalidDesign: A modulus or a density is missing.
        NotPossible: The arm has no stable posture there, or no mass.
    """
    section, why = a_manipulator("arm", arm).section, "for a local model"
    damping = as_number("damping", damping, Range(0.0, 10.0, unit="s"))
    if faults := section.modulus_faults(why) + section.density_faults(why):
        raise InvalidDesign(faults)
    known = as_tip_map(arm if arm.loads else arm.replace(loads=Loads(gravity=(0.0, 0.0, 0.0))))
    x = known.check_activations("activation", [activation])
    (tip,), (jacobian,) = known.tips_and_slopes(x)
    if not np.isfinite(tip).all():
        raise NotPossible("the arm has no stable posture at this activation: lighten its loads")
    (compliance,), (coarse, *_) = tip_compliance(known, x), _modes(known, x, 4)
    natural, modes, mass = _modes(known, x, 8)
    change = natural[: len(coarse)] / coarse[: len(natural)] - 1.0
    error = float(np.abs(change).max()) / 3.0  # falls with the square of the elements, or faster
    return LocalModel(arm, x[0], tip, jacobian, compliance, mass, natural, modes, damping, error)


def _modes(known: ArmMap, x: Array, elements: int) -> tuple[Array, Array, Array]:
    """Frequencies, movements of the tip, and the mass of a `LocalModel`."""
    flexibility, tip, slopes, masses = _moves(known, x, elements)
    root = np.sqrt(masses)[:, None]
    squares, shapes = np.linalg.eigh(root * (flexibility + flexibility.T) * root.T / 2.0)
    first = np.flatnonzero(squares > 1e-12 * squares[-1])[:-7:-1]
    if not len(first):
        raise NotPossible("the arm has no mass: give its materials densities, or it a payload")
    squares, moved = squares[first], root * shapes[:, first]  # 1/ω² and M φ, with φ = ω² F M φ
    tip_modes = known.pose.directions_to_world((tip @ moved / squares).T)
    return 0.5 / math.pi / np.sqrt(squares), tip_modes, slopes.T @ (root**2 * slopes)


def _moves(known: ArmMap, x: Array, elements: int) -> tuple[Array, Array, Array, Array]:
    """F of masses, of the tip under forces on them, ∂r/∂γ of the masses, and these, each thrice."""
    rod, (inner, of_drives) = yielding_rod(known), known.inputs.with_slopes(x)
    z, masses = _masses(rod.arm, elements)
    table = node_tables(rod.arm, z, step_grid(rod.arm, z, max(48, rod.steps)))
    state = rod_state(rod, inner, table)
    moves, turns, _ = linear_response(table, state, _unit_forces(table))
    moves, tip, bundles = moves[0].copy(), moves[0, -1], inner.shape[1]
    moves[-1] += np.cross(turns[0, -1], table.lever @ state.tip_directors[0], axis=0)
    rows = moves.reshape(3 * len(z), -1)
    slopes = rows[:, :bundles] if of_drives is None else rows[:, :bundles] @ of_drives[0]
    return rows[:, bundles:], tip[:, bundles:], slopes, np.repeat(masses, 3)


def _masses(arm: Manipulator, elements: int) -> tuple[Array, Array]:
    """Z of Gauss nodes of elements and of the tip [m], and the masses there [kg]."""
    edges = chain_of(arm, elements).edges[:, None]
    width = np.diff(edges, axis=0) / 2.0
    z = (edges[:-1] + width * (1.0 + NODES)).ravel()
    masses = (width * WEIGHTS).ravel() * arm.section.mass_per_length_at(arm.profile, z)
    return np.append(z, arm.length), np.append(masses, arm.loads.payload if arm.loads else 0.0)


def _unit_forces(table: NodeTables) -> list[NodeTables]:
    none, tip = NodeTables(*map(np.zeros_like, table)), table.places[-1]
    return [
        none._replace(force=np.multiply.outer(table.stations < z, axis), weight=(z == tip) * axis)
        for z in table.places
        for axis in np.eye(3)
    ]
