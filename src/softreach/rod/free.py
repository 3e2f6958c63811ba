"""The free rod: no load but its actuators, so that activations alone decide its shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.tables import tables
from softreach.kernels.rod import frames, jacobian
from softreach.kernels.rod import tips as rod
from softreach.rod.linear_strains import linear_strains, strain_range
from softreach.rod.linearization import Linearization
from softreach.rod.steps import StepRule
from softreach.rod.tip_map import (
    ArmRod,
    Frames,
    Status,
    StrainRange,
    Strains,
    TipStatus,
    position_slopes,
)
from softreach.support import parallel

__all__ = ["FreeRod"]

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class FreeRod(ArmRod):
    """r' = ζ d3, dᵢ' = ζ u × dᵢ with ζ = 1 + z·γ, u = Uγ, in Magnus steps of order 6: (18)."""

    @cached_property
    def rule(self) -> StepRule:
        """How the arm is cut into steps."""
        return StepRule(self.arm, self.box)

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs, those that end at breakpoints included."""
        return len(self.rule.edges(self._fineness)) - 1

    @cached_property
    def _fineness(self) -> int:
        """Uniform steps in S, of which none may be longer."""
        return self.rule.steps_for(self.tol)

    @cached_property
    def _shape_steps(self) -> int:
        """Steps with which `tol` holds all along the arm, and directors lose no digits."""
        return max(self._fineness, self.rule.steps_for_shapes(self.tol))

    @cached_property
    def _table(self) -> Array:
        return self.rule.packed_nodes(self._fineness)

    def _prepare(self) -> None:
        self._table  # noqa: B018

    def fill(
        self,
        gamma: Array,
        tips: Array,
        slopes: Array | None = None,
        twists: Array | None = None,
        status: Status | None = None,
        directions: Array | None = None,
    ) -> None:
        """Put tips, and what else is asked for, into place: theory (25) and (31)."""
        derivatives = slopes if twists is None else twists
        if derivatives is None:
            rod.tips(self._table, gamma, tips)
        else:
            jacobian.jacobians(self._table, gamma, tips, derivatives)
        if slopes is not None and twists is not None:
            position_slopes(tips, twists, slopes)
        if status is not None:
            status[:] = TipStatus.STABLE
        if directions is not None:
            place, directors = np.empty((len(gamma), 1, 3)), np.empty((len(gamma), 1, 3, 3))
            frames.frames(*self._tip_table, gamma, place, directors)
            directions[:] = directors[:, 0, 2]

    def farthest(self) -> float:
        """No tip is farther from the base than this [m], the length of the longest arm."""
        return self._linearization.longest_arm

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self._linearization.error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        return self._linearization.errors(centers, half_widths)

    @cached_property
    def _linearization(self) -> Linearization:
        return Linearization(self.arm, self.box)

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        gamma, z = self.box.check(activations), self.check_stations(stations)
        table, ends = self._station_table(z)
        found = Frames(np.empty((len(gamma), len(z), 3)), np.empty((len(gamma), len(z), 3, 3)))
        parallel.run(
            partial(frames.frames, table, ends, gamma[b], found.position[b], found.directors[b])
            for b in parallel.blocks(len(gamma), 1024)
        )
        if status is not None:
            status[:] = TipStatus.STABLE
        return found

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        """u = Uγ and ζ = 1 + z·γ at stations Z [m] as a function of activations: theory (7)."""
        table = tables(self.arm, self.check_stations(stations, ascending=False))

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            if status is not None:
                status[:] = TipStatus.STABLE
            return linear_strains(table, self.box.check(activations))

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """What the strains at stations Z [m] can be within the activation box."""
        z = self.check_stations(stations, ascending=False)
        return strain_range(tables(self.arm, z), self.box)

    def _station_table(self, z: Array) -> tuple[Array, NDArray[np.int64]]:
        """Packed tables with a step boundary at every station, and the steps up to each."""
        if len(z) == 1 and z[0] == self.length:
            return self._tip_table
        return self.rule.packed_stations(z, self._shape_steps)

    @cached_property
    def _tip_table(self) -> tuple[Array, NDArray[np.int64]]:
        steps = max(self._fineness, self.rule.fewest_for_frames)
        return self.rule.packed_stations(np.array([self.length]), steps)
