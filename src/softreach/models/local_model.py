"""How an arm moves, yields and vibrates about its posture at one activation.

Flexibility F, moves of masses by unit forces, is the linear response of the loaded arm.
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
from softreach.models.chain import elements_of
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.rod.rods import ArmMap, as_tip_map
from softreach.stiffness import tip_compliance, yielding_rod
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidDesign, NotPossible, Range

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class LocalModel:
    """An arm near an equilibrium, linearized, in the frame of the world.

    A change δγ of activation and a force f on the tip move the tip by Σ q `tip_modes`, where
    q̈ + 2ζω q̇ + ω² q = ω² `gains`·δγ + `tip_modes`·f for each mode, ω = 2π `frequencies`.
    """

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
    frequencies: Array
    """The first six natural frequencies, without damping [Hz], shape (mode,)."""
    tip_modes: Array
    """Movement of the tip in each mode of unit modal mass [1/√kg], shape (mode, 3)."""
    gains: Array
    """q of each mode at rest [√kg m per unit of each activation], shape (mode, bundle)."""
    mass: Array
    """M of the kinetic energy ½ γ̇·Mγ̇ [kg m² per unit of two inputs], shape (bundle, bundle)."""
    damping_ratio: float
    """ζ of all modes, as given [-]."""
    error: float
    """Largest error of the frequencies, relative [-], an estimate from half the masses."""

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
            "tip_mode": (("mode", "axis"), self.tip_modes, {"units": "kg-0.5"}),
            "gain": (("mode", "bundle"), self.gains),
        }
        names = {"axis": list(schema.AXES), **schema.bundle_coordinates(self.arm)}
        attrs = {**schema.provenance(self.arm), "damping_ratio": self.damping_ratio}
        return xr.Dataset(values, names, attrs)

    def __str__(self) -> str:
        most, _, least = np.linalg.svd(self.compliance)[1]
        tip, each = self.arm.length_unit.place(self.tip), (f"{f:.4g}" for f in self.frequencies)
        head = f"tip {tip}, yields by {least:.3g} to {most:.3g} m/N"
        return f"{head}; {', '.join(each)} Hz (error {self.error:.0e})"


def local_model(arm: Manipulator, activation: ArrayLike, damping_ratio: float = 0.05) -> LocalModel:
    """How an arm moves, yields and vibrates about its posture at an activation.

    Tensions and pressures are held. Sections have rotary inertia and do not shear.

    Args:
        arm: The design, with moduli and densities or measured sections. Of loads it may have
            gravity, a payload and forces that keep their direction.
        activation: γ [unit of each input], shape (bundles,).
        damping_ratio: ζ of all modes [-], from 0 up to 1 (critical).

    Raises:
        InvalidInput: An argument is out of its range or has another shape; or other loads.
        InvalidDesign: A modulus or a density is missing.
        NotPossible: The arm has no stable posture there, or no mass.
    """
    section, why = a_manipulator("arm", arm).section, "for a local model"
    damping = as_number("damping_ratio", damping_ratio, Range(0.0, 1.0))
    if faults := section.modulus_faults(why) + section.density_faults(why):
        raise InvalidDesign(faults)
    known = as_tip_map(arm if arm.loads else arm.replace(loads=Loads(gravity=(0.0, 0.0, 0.0))))
    x = known.check_activations("activation", as_floats("activation", activation)[None])
    (tip,), (jacobian,) = known.tips_and_slopes(x)
    if not np.isfinite(tip).all():
        raise NotPossible("the arm has no stable posture at this activation: lighten its loads")
    (compliance,), coarse = tip_compliance(known, x), _modes(known, x, 2)[0]
    modes = _modes(known, x, 4)
    change = modes[0][: len(coarse)] / coarse[: len(modes[0])] - 1.0
    error = float(np.abs(change).max()) / 3.0  # falls with the square of the nodes, or faster
    return LocalModel(arm, x[0], tip, jacobian, compliance, *modes, damping, error)


def _modes(known: ArmMap, x: Array, nodes: int) -> tuple[Array, Array, Array, Array]:
    """Frequencies, movements of the tip, gains and the mass of a `LocalModel`."""
    flexibility, tip, slopes, masses = _moves(known, x, nodes)
    root = np.sqrt(masses)[:, None]
    squares, shapes = np.linalg.eigh(root * (flexibility + flexibility.T) * root.T / 2.0)
    first = np.flatnonzero(squares > 1e-12 * squares[-1])[:-7:-1]
    if not len(first):
        raise NotPossible("the arm has no mass: give its materials densities, or it a payload")
    squares, moved = squares[first], root * shapes[:, first]  # 1/ω² and M φ, with φ = ω² F M φ
    tip_modes = known.pose.directions_to_world((tip @ moved / squares).T)
    frequencies, gains = 0.5 / math.pi / np.sqrt(squares), moved.T @ slopes
    return frequencies, tip_modes, gains, slopes.T @ (root**2 * slopes)


def _moves(known: ArmMap, x: Array, nodes: int) -> tuple[Array, Array, Array, Array]:
    """F of masses, of the tip under forces on them, ∂r/∂γ of the masses, and these.

    Each has six rows: it moves along the axes of the base and turns about its directors.
    """
    rod, (inner, of_drives) = yielding_rod(known), known.inputs.with_slopes(x)
    z, masses = _masses(rod.arm, nodes)
    table = node_tables(rod.arm, z, step_grid(rod.arm, z, max(48, rod.steps)))
    state = rod_state(rod, inner, table)
    directors, lever = state.place_directors[0], table.lever @ state.tip_directors[0]
    moves, turns, _ = linear_response(table, state, _unit_loads(table, directors))
    moves, tip, bundles = moves[0].copy(), moves[0, -1], inner.shape[1]
    moves[-1] += np.cross(turns[0, -1], lever, axis=0)
    rows = np.concatenate([moves, directors @ turns[0]], axis=1).reshape(6 * len(z), -1)
    slopes = rows[:, :bundles] if of_drives is None else rows[:, :bundles] @ of_drives[0]
    return rows[:, bundles:], tip[:, bundles:], slopes, masses.ravel()


def _masses(arm: Manipulator, nodes: int) -> tuple[Array, Array]:
    """Z of Gauss nodes of elements and of the tip [m], masses and inertia there, (node, 6)."""
    edges, gauss = elements_of(arm, 12).edges[:, None], np.polynomial.legendre.leggauss(nodes)
    width = np.diff(edges, axis=0) / 2.0
    z = (edges[:-1] + width * (1.0 + gauss[0])).ravel()
    masses = (width * gauss[1]).ravel() * arm.section.mass_per_length_at(arm.profile, z)
    turning = masses * arm.section.gyration_at(arm.profile, z)
    rows = np.column_stack([masses, masses, masses, turning, turning, 2.0 * turning])
    payload = arm.loads.payload if arm.loads else 0.0
    return np.append(z, arm.length), np.vstack([rows, payload * np.repeat([1.0, 0.0], 3)])


def _unit_loads(table: NodeTables, directors: Array) -> list[NodeTables]:
    """Forces along the axes of the base and moments about the directors, at each place."""
    none, tip, loads = NodeTables(*map(np.zeros_like, table)), table.places[-1], list[NodeTables]()
    for z, own in zip(table.places, directors, strict=True):
        before = table.stations < z
        for axis in np.eye(3):
            force = np.multiply.outer(before, axis)
            loads.append(none._replace(force=force, weight=(z == tip) * axis))
        loads += [none._replace(moment=np.multiply.outer(before, axis)) for axis in own]
    return loads
