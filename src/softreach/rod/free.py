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
from softreach.rod.arm_rod import ArmRod
from softreach.rod.frames import Frames, StrainRange, Strains
from softreach.rod.linear_strains import linear_strains, strain_range
from softreach.rod.linearization import Linearization
from softreach.rod.steps import StepRule
from softreach.rod.tip_map import BLOCK
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

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        rod.tips(self._table, gamma, out)

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place: theory (31)."""
        jacobian.jacobians(self._table, gamma, tips, slopes)

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        gamma = self.box.check(activations)
        tips, twists = np.empty((len(gamma), 3)), np.empty((len(gamma), 6, self.box.bundles))
        parallel.run(
            partial(jacobian.jacobians, self._table, gamma[b], tips[b], twists[b])
            for b in parallel.blocks(len(gamma), BLOCK // 8)
        )
        return tips, twists

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

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        gamma, z = self.box.check(activations), self.check_stations(stations)
        table, ends = self._station_table(z)
        found = Frames(np.empty((len(gamma), len(z), 3)), np.empty((len(gamma), len(z), 3, 3)))
        parallel.run(
            partial(frames.frames, table, ends, gamma[b], found.position[b], found.directors[b])
            for b in parallel.blocks(len(gamma), 1024)
        )
        return found

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """u = Uγ and ζ = 1 + z·γ at stations Z [m] as a function of activations: theory (7)."""
        table = tables(self.arm, self.check_stations(stations, ascending=False))
        return lambda activations: linear_strains(table, self.box.check(activations))

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
