"""The loaded rod: an arm under gravity, payload and forces, and the stability of its equilibria."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.loads import Loads
from softreach.arm.tables import tables
from softreach.kernels.lanes import LANES
from softreach.rod.arm_rod import ArmRod
from softreach.rod.free import FreeRod, linear_strains, per_length
from softreach.rod.loaded.held import held_over
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.shapes import Shapes
from softreach.rod.loaded.shooting import Equilibria
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.steps import (
    UNJUDGED,
    Differences,
    check_steps,
    checked,
    fewest_steps,
    shape_differences,
    tip_differences,
)
from softreach.rod.loaded.tables import ArmBody, Body, LoadTables
from softreach.rod.steps import pilot_activations
from softreach.rod.tip_map import (
    BLOCK,
    Frames,
    Held,
    Status,
    StrainRange,
    Strains,
    TipStatus,
    drop,
    has_tip,
    loads_too_heavy,
    no_equilibrium_message,
    position_slopes,
    sampled_range,
)
from softreach.support import parallel
from softreach.support.lazy import lazy

__all__ = ["LoadedRod"]

Array = NDArray[np.float64]

_BLOCK = BLOCK // 8  # samples per task
_OF_LINES = 32 * LANES  # samples per task that follows branches


@dataclass(frozen=True, repr=False)
class LoadedRod(ArmRod):
    """r' = ζ d3, dᵢ' = η u × dᵢ with u = û + K⁻¹m, ζ = ζ̂ + η n3/K0, theory (57), (58).

    It is shot from the tip.
    The equilibrium is the posture that the arm comes to when it hangs first and is then activated.
    """

    @property
    def supports_unstable(self) -> bool:
        return True

    @lazy
    def loads(self) -> Loads:
        """Loads on the arm beside its actuators, in the frame of the base."""
        loads = self.arm.loads or Loads(gravity=(0.0, 0.0, 0.0))
        return loads.seen_from(self.arm.base)

    @property
    def body(self) -> Body:
        """Compliance and weight of the arm."""
        return ArmBody(self.arm)

    @lazy
    def tables(self) -> LoadTables:
        """Tables for the kernels.

        Raises:
            InvalidInput: Loads so heavy that no number of steps resolves what they do.
        """
        tables = LoadTables(self.arm, self.loads, self.body)
        check_steps(self.arm, tables.phase)
        return tables

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs for tips; see `rod.loaded.steps` for the rule.

        Raises:
            InvalidInput: None is enough.
        """
        return checked(self._tip_steps, self.tol)

    @lazy
    def _tip_steps(self) -> int | None:
        """Steps with which `tol` holds for tips, if any are enough, theory (72)."""
        return self._fewest(self.tables.phase.fewest_steps, tip_differences)

    @lazy
    def _shape_steps(self) -> int | None:
        """Steps with which `tol` holds all along the arm, if any are enough."""
        return self._fewest(self.steps, shape_differences)

    def _fewest(self, steps: int, differences: Differences) -> int | None:
        gamma = pilot_activations(self.arm, self.box)
        enough = fewest_steps(self._solver_of, gamma, steps, differences)
        return max(steps, self.unloaded_steps) if enough == UNJUDGED else enough

    @lazy
    def unloaded_steps(self) -> int:
        """Steps that `tol` needs without loads."""
        return FreeRod(self.arm, self.tol).steps

    def _solver_of(self, steps: int) -> Solver:
        return Solver(self.tables, steps, self.tol)

    @lazy
    def solver(self) -> Solver:
        """Solver with the steps that `tol` needs for tips."""
        return self._solver_of(self.steps)

    @lazy
    def postures(self) -> Postures:
        """Postures, with starts on a grid over the box where that is worth it."""
        return Postures.of(self.solver).with_flood()

    @lazy
    def _shape_solver(self) -> Solver:
        return self._solver_of(checked(self._shape_steps, self.tol))

    @lazy
    def _mirrored(self) -> Postures:
        return self.postures.mirrored.with_flood()

    def in_steps(self, steps: int) -> Self:
        vars(self).update(_tip_steps=steps, _shape_steps=steps)
        return self

    def _prepare(self) -> None:
        self.postures  # noqa: B018

    def continued_from(self, gamma: Array) -> LoadedRod:
        frame = self.equilibria(gamma).frame
        postures = self.postures.continued_from(gamma, frame)
        rod = _ContinuedRod(self.arm, self.tol)
        vars(rod).update({"origin": self, **vars(self), "postures": postures})
        return rod

    def equilibria(self, activations: ArrayLike) -> Equilibria:
        """Tips with their status, the margin of stability, and how each was found.

        What is to be searched again is gathered from all samples, so that kernels get whole blocks.
        """
        self.prepare()
        gamma, lost = self.with_arms(self.box.check(activations))
        postures, equilibria = self.postures, self.solver.empty(len(gamma))
        blocks = parallel.blocks(len(gamma), _BLOCK)
        parallel.run(partial(postures.direct, gamma, b, equilibria) for b in blocks)
        rows = np.flatnonzero(equilibria.status != TipStatus.STABLE)
        blocks = parallel.blocks(len(rows), _OF_LINES)
        parallel.run(partial(postures.by_line, gamma, rows[b], equilibria) for b in blocks)
        drop(lost, equilibria.status, equilibria.tips, equilibria.margin)
        return equilibria

    def fill(
        self,
        gamma: Array,
        tips: Array,
        slopes: Array | None = None,
        *,
        twists: Array | None = None,
        status: Status | None = None,
        directions: Array | None = None,
    ) -> None:
        """Put tips, and what else is asked for, into place; each equilibrium is found once."""
        known = self.postures.find(gamma)
        if slopes is not None or twists is not None or directions is not None:
            response = self.solver.respond(gamma, known, directions=directions is not None)
            if slopes is not None:
                position_slopes(response.tips, response.twists, slopes)
            if twists is not None:
                twists[:] = response.twists
            if directions is not None:
                directions[:] = response.directions
        tips[:] = known.tips
        if status is not None:
            status[:] = known.status

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held:
        self.prepare()
        return held_over(self.postures, self._mirrored, gamma, sizes)

    def compliance(self, activations: ArrayLike) -> Array:
        """∂r/∂F [m/N]: how a tip yields to a small dead force on it, shape (n, 3, 3)."""
        self.prepare()
        gamma, solver = self.box.check(activations), self.solver
        compliance = np.empty((len(gamma), 3, 3))

        def fill(block: slice) -> None:
            known = self.postures.find(gamma[block])
            compliance[block] = solver.respond(gamma[block], known, compliance=True).compliance

        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), _BLOCK))
        return compliance

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        gamma, z = self.box.check(activations), self.check_stations(stations)
        return self.shapes(gamma, z, status).frames

    def shapes(self, gamma: Array, z: Array, status: Status | None) -> Shapes:
        """Shapes at ascending stations; each equilibrium is found once."""
        gamma, lost = self.with_arms(gamma)
        known = self.equilibria(gamma)
        shapes = self._shape_solver.shapes(gamma, z, known, status=status)
        if status is not None:
            gone = np.isnan(shapes.frames.position[:, 0, 0])
            status[gone & has_tip(status)] = TipStatus.UNDECIDED
        drop(lost, status, *shapes.frames, shapes.moment, shapes.force)
        return shapes

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        """(û + K⁻¹m) η/ζ and ζ = ζ̂ + η n3/K0 at stations Z [m] as a function of activations.

        Curvature is per length as it is, stretched by loads too, so that dᵢ' = ζ u × dᵢ.
        """
        z = self.check_stations(stations, ascending=False)
        of_shapes = self.strains_of_shapes(z)
        ascending, back = np.unique(z, return_inverse=True)

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            gamma = self.box.check(activations)
            shape = self.shapes(gamma, ascending, status)
            return of_shapes(gamma, shape.moment[:, back], shape.force[:, back])

        return strains

    def strains_of_shapes(self, z: Array) -> Callable[[Array, Array, Array], Strains]:
        """The strains at stations Z [m] as a function of activations, and of m and n there."""
        table, (axial, bending, torsion) = tables(self.arm, z), self.body.compliance(z)
        yielded = np.stack([bending, bending, torsion], axis=1)

        def strains(gamma: Array, moment: Array, force: Array) -> Strains:
            u, extension, growth = linear_strains(table, gamma)
            extension = extension + growth * force[..., 2] * axial
            return per_length(u + moment * yielded, extension, growth)

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] over the pilot of the activation box.

        Unlike those of a free rod they are no bounds: others may strain it a little more.

        Raises:
            InvalidInput: None of the pilot has an equilibrium.
        """
        gamma = pilot_activations(self.arm, self.box)
        strains = self.strains_at(stations)(gamma)
        if np.isnan(strains.extension).all():
            raise loads_too_heavy(no_equilibrium_message(len(gamma), "an equilibrium"))
        return sampled_range(strains)


class _ContinuedRod(LoadedRod):
    """The same arm with other postures; equal to itself alone, since these count."""

    origin: LoadedRod

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    @lazy
    def _shape_solver(self) -> Solver:
        return self.origin._shape_solver
