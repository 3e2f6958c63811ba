"""The loaded rod: an arm under gravity, payload and forces, and whether its rest is stable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.loads import Loads
from softreach.arm.tables import tables
from softreach.kernels.rod.tips import LANES
from softreach.rod.arm_rod import ArmRod
from softreach.rod.equilibrium import LATER_RUNGS, Solver
from softreach.rod.found_equilibria import Equilibria, Response
from softreach.rod.frames import Frames, StrainRange, Strains, TipMotions, position_slopes
from softreach.rod.free import FreeRod
from softreach.rod.linear_strains import linear_strains
from softreach.rod.load_phase import check_phase
from softreach.rod.load_tables import ArmBody, Body, LoadTables
from softreach.rod.loaded_steps import (
    Differences,
    checked,
    fewest_steps,
    shape_differences,
    tip_differences,
)
from softreach.rod.never_at_rest import none_of, too_heavy
from softreach.rod.pilot import pilot_activations
from softreach.rod.tip_map import BLOCK
from softreach.support import parallel
from softreach.support.errors import InvalidInput

__all__ = ["LoadedRod"]

Array = NDArray[np.float64]

_BLOCK = BLOCK // 8  # samples per task


@dataclass(frozen=True, repr=False)
class LoadedRod(ArmRod):
    """r' = ζ d3, dᵢ' = ζ̂ u × dᵢ with u = û + K⁻¹m, ζ = ζ̂ (1 + n3/K0), theory (57), (58).

    It is shot from the tip.
    The equilibrium is the one that an arm comes to which is activated first and loaded slowly then.
    """

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return True

    @property
    def loads(self) -> Loads:
        """What acts on the arm beside its actuators."""
        return self.arm.loads or Loads(gravity=(0.0, 0.0, 0.0))

    @property
    def body(self) -> Body:
        """How the arm yields and what it weighs."""
        return ArmBody(self.arm)

    @cached_property
    def tables(self) -> LoadTables:
        """What the kernels read.

        Raises:
            InvalidInput: Loads so heavy that no walk from tip to base keeps its digits.
        """
        tables = LoadTables(self.arm, self.loads, self.body)
        check_phase(self.arm, tables.phase)
        return tables

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs; see `loaded_steps` for the rule."""
        return checked(self._fewest_steps)

    @cached_property
    def _fewest_steps(self) -> int | InvalidInput:
        """Steps with which `tol` holds for tips, or why there are none, theory (72)."""
        return self._fewest(self.tables.phase.fewest_steps, tip_differences)

    @cached_property
    def _fewest_shape_steps(self) -> int | InvalidInput:
        """Steps with which `tol` holds all along the arm."""
        return self._fewest(self.steps, shape_differences)

    @property
    def _shape_steps(self) -> int:
        return checked(self._fewest_shape_steps)

    @cached_property
    def _shape_solver(self) -> Solver:
        return self._solver_of(self._shape_steps)

    def _fewest(self, steps: int, differences: Differences) -> int | InvalidInput:
        gamma = pilot_activations(self.arm, self.box)
        found = fewest_steps(self._solver_of, gamma, steps, differences)
        return found or max(steps, FreeRod(self.arm, self.tol).steps)

    def _solver_of(self, steps: int) -> Solver:
        return Solver(self.tables, steps, self.tol)

    @property
    def solver(self) -> Solver:
        """What finds equilibria with the steps that `tol` needs."""
        return self._solver

    @cached_property
    def _solver(self) -> Solver:
        return self._solver_of(self.steps).with_starts(self.box)

    def equilibria(self, activations: ArrayLike) -> Equilibria:
        """Tips with their status, the margin of stability, and how each was found.

        What is to be searched again is gathered from all samples, so that kernels get whole blocks.
        """
        gamma, solver = self.box.check(activations), self._solver
        found = solver.empty(len(gamma))
        blocks = parallel.blocks(len(gamma), _BLOCK)
        parallel.run(partial(solver.direct, gamma[b], found.of(b)) for b in blocks)
        for rung in LATER_RUNGS:
            rows = solver.doubtful(found, rung)
            blocks = parallel.blocks(len(rows), LANES)
            parallel.run(partial(solver.again, gamma, rows[b], rung, found) for b in blocks)
        return found

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation, shape (n,)."""
        return self.equilibria(activations).status

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        out[:] = self._solver.find(gamma).tips

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        found = self._solver.find(gamma)
        out[:], status[:] = found.tips, found.status

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place."""
        self.fill_slopes_and_status(gamma, tips, slopes, status=np.empty(len(gamma), np.int8))

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """`fill_slopes`, and the `TipStatus` (n,) of each, on the calling thread."""
        response = self._solver.respond(gamma)
        tips[:], status[:] = response.tips, response.status
        position_slopes(tips, response.twists, slopes)

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        response = self._responses(activations)
        return response.tips, response.twists

    def compliance(self, activations: ArrayLike) -> Array:
        """∂r/∂F [m/N]: how a tip yields to a small dead force on it, shape (n, 3, 3)."""
        return self._responses(activations, compliance=True).compliance

    def tip_motions(self, activations: ArrayLike) -> TipMotions:
        """Positions and directions of the tips with their derivatives, in one pass over rods."""
        found = self._responses(activations, directions=True)
        slopes = np.empty_like(found.twists[:, :3])
        position_slopes(found.tips, found.twists, slopes)
        return TipMotions(found.tips, slopes, found.directions, found.twists[:, 3:])

    def _responses(
        self, activations: ArrayLike, *, compliance: bool = False, directions: bool = False
    ) -> Response:
        gamma, solver = self.box.check(activations), self._solver
        found = Response.empty(
            len(gamma), self.box.bundles, compliance=compliance, directions=directions
        )

        def fill(block: slice) -> None:
            response = solver.respond(gamma[block], compliance=compliance, directions=directions)
            for all_values, values in zip(found, response, strict=True):
                all_values[block] = values

        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), _BLOCK))
        return found

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        gamma, z = self.box.check(activations), self.check_stations(stations)
        return self._shape_solver.shapes(gamma, z).frames

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """(û + K⁻¹m) ζ̂/ζ and ζ = ζ̂ (1 + n3/K0) at stations Z [m] as a function of activations.

        Curvature is per length as it is, stretched by loads too, so that dᵢ' = ζ u × dᵢ.
        """
        z = self.check_stations(stations, ascending=False)
        of_shapes = self.strains_of_shapes(z)
        ascending, back = np.unique(z, return_inverse=True)

        def strains(activations: ArrayLike) -> Strains:
            gamma = self.box.check(activations)
            shape = self._shape_solver.shapes(gamma, ascending)
            return of_shapes(gamma, shape.moment[:, back], shape.force[:, back])

        return strains

    def strains_of_shapes(self, z: Array) -> Callable[[Array, Array, Array], Strains]:
        """The strains at stations Z [m] as a function of activations, and of m and n there."""
        table, (axial, bending, torsion) = tables(self.arm, z), self.body.compliance(z)
        yielded = np.stack([bending, bending, torsion], axis=1)

        def strains(gamma: Array, moment: Array, force: Array) -> Strains:
            rest, stretch = linear_strains(table, gamma), 1.0 + force[..., 2] * axial
            u = rest.curvature + moment * yielded
            return Strains(u / stretch[..., None], rest.extension * stretch)

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] over the pilot of the activation box.

        Unlike those of a free rod they are no bounds: others may strain it a little more.

        Raises:
            InvalidInput: None of the pilot has an equilibrium.
        """
        gamma = pilot_activations(self.arm, self.box)
        found = self.strains_at(stations)(gamma)
        if np.isnan(found.extension).all():
            raise too_heavy(none_of(len(gamma), "an equilibrium"))
        bend = np.hypot(found.curvature[..., 0], found.curvature[..., 1])
        return StrainRange(
            np.stack([np.zeros(bend.shape[1]), np.nanmax(bend, axis=0)], axis=1),
            _range(found.curvature[..., 2]),
            _range(found.extension),
        )


def _range(values: Array) -> Array:
    return np.stack([np.nanmin(values, axis=0), np.nanmax(values, axis=0)], axis=1)
