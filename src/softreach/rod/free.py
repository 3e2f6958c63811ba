"""The free rod: no load but its actuators, so that activations alone decide its shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.tables import Tables, ends_over, tables
from softreach.kernels.rod import frames, jacobian
from softreach.kernels.rod import slopes as derivatives
from softreach.kernels.rod import tips as rod
from softreach.rod.activation_box import ActivationBox
from softreach.rod.arm_rod import ArmRod
from softreach.rod.linearization import Linearization
from softreach.rod.steps import StepRule
from softreach.rod.tip_map import (
    Frames,
    Status,
    StrainRange,
    Strains,
    TipStatus,
    drop,
    position_slopes,
)
from softreach.support import parallel
from softreach.support.lazy import lazy

Array = NDArray[np.float64]

_HEADINGS = 720


@dataclass(frozen=True, repr=False)
class FreeRod(ArmRod):
    """r' = ζ d3, dᵢ' = η Uγ × dᵢ with ζ = 1 + z·γ, in Magnus steps of order 6: (18)."""

    @lazy
    def rule(self) -> StepRule:
        """Rule by which the arm is cut into steps."""
        return StepRule(self.arm, self.box)

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs, those that end at breakpoints included."""
        return len(self.rule.edges(self._fineness)) - 1

    @lazy
    def _fineness(self) -> int:
        """Uniform steps in S, of which none may be longer."""
        return self.fixed_steps or self.rule.steps_for(self.tol)

    @lazy
    def _shape_steps(self) -> int:
        """Steps with which `tol` holds all along the arm, and directors lose no digits."""
        return self.fixed_steps or max(self._fineness, self.rule.steps_for_shapes(self.tol))

    @lazy
    def _table(self) -> Array:
        return self.rule.packed_nodes(self._fineness)

    def _prepare(self) -> None:
        self._table  # noqa: B018

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
        """Put tips, and what else is asked for, into place: theory (25) and (31)."""
        if twists is not None:
            jacobian.jacobians(self._table, gamma, tips, twists)
            if slopes is not None:
                position_slopes(tips, twists, slopes)
        elif slopes is not None:
            derivatives.slopes(self._table, gamma, tips, slopes)
        else:
            rod.tips(self._table, gamma, tips)
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
        return self._linearization.error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        return self._linearization.errors(centers, half_widths)

    @lazy
    def _linearization(self) -> Linearization:
        return Linearization(self.arm, self.box)

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        gamma, lost = self.with_arms(self.box.check(activations))
        z = self.check_stations(stations)
        is_tip = len(z) == 1 and z[0] == self.length
        packed = self.rule.packed_stations
        table, ends = self._tip_table if is_tip else packed(z, self._shape_steps)
        result = Frames(np.empty((len(gamma), len(z), 3)), np.empty((len(gamma), len(z), 3, 3)))
        parallel.run(
            partial(frames.frames, table, ends, gamma[b], result.position[b], result.directors[b])
            for b in parallel.blocks(len(gamma), 1024)
        )
        if status is not None:
            status[:] = TipStatus.STABLE
        drop(lost, status, *result)
        return result

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        """u = Uγ η/ζ and ζ = 1 + z·γ at stations Z [m] as a function of activations: theory (7)."""
        table = tables(self.arm, self.check_stations(stations, ascending=False))

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            gamma, lost = self.with_arms(self.box.check(activations))
            strain = per_length(*linear_strains(table, gamma))
            if status is not None:
                status[:] = TipStatus.STABLE
            drop(lost, status, *strain)
            return strain

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        z = self.check_stations(stations, ascending=False)
        return strain_range(tables(self.arm, z), self.box)

    @lazy
    def _tip_table(self) -> tuple[Array, NDArray[np.int64]]:
        steps = max(self._fineness, self.rule.fewest_for_frames)
        return self.rule.packed_stations(np.array([self.length]), steps)


class LinearStrains(NamedTuple):
    """Strains that are linear in the activations, (n, station) of each."""

    curvature: Array
    """Uγ [1/m] in the directors, per length of η."""
    extension: Array
    """ζ = 1 + z·γ [-]."""
    growth: Array
    """η [-], what fibers and muscles make of the length of matter at rest: theory (7)."""


def linear_strains(table: Tables, gamma: Array) -> LinearStrains:
    """Uγ, ζ and η at the stations of a table.

    Samples vary fastest in memory, so that all values at one station lie side by side. The sum runs
    over the bundles in their order, whatever BLAS and its threads would do.

    Args:
        table: z and U, and the part of z in η.
        gamma: Activations, shape (n, bundles).
    """
    parts = [table.curvature, table.extension[:, None]]
    parts += [] if table.growth is table.extension else [table.growth[:, None]]
    rows, bundles = np.concatenate(parts, axis=1), np.ascontiguousarray(gamma.T)
    columns = rows.shape[1]
    total, term = np.empty((len(rows), columns, len(gamma))), np.empty((columns, len(gamma)))
    if not len(bundles):
        total[:] = 0.0
    for row, out in zip(
        rows if len(bundles) else (), total, strict=False
    ):  # station by station, so that terms stay cached
        np.multiply(row[:, :1], bundles[0], out=out)
        for j in range(1, len(bundles)):
            out += np.multiply(row[:, j : j + 1], bundles[j], out=term)
    total[:, 3:] += 1.0
    extension = total[:, 3].T
    growth = extension if table.growth is table.extension else total[:, 4].T
    return LinearStrains(np.moveaxis(total[:, :3], 2, 0), extension, growth)


def per_length(curvature: Array, extension: Array, growth: Array) -> Strains:
    """Strains with curvature per length as it is, from curvature per length of η."""
    if growth is not extension:
        curvature = curvature * (growth / extension)[..., None]
    return Strains(curvature, extension)


def strain_range(table: Tables, box: ActivationBox) -> StrainRange:
    """Ranges of the strains of all activations in a box; where η is not ζ, bounds of them."""
    bounds = np.stack([box.low, box.high], axis=1)
    most, torsion = _most_bending(table.curvature[:, :2], bounds), table.curvature[:, 2]
    bending, torsion = np.stack([np.zeros_like(most), most], axis=1), ends_over(torsion, bounds)
    extension = 1.0 + ends_over(table.extension, bounds)
    if table.growth is not table.extension:  # η/ζ = 1 - (ζ - η)/ζ
        forces = ends_over(table.extension - table.growth, bounds)
        ratio = 1.0 - _products(forces, 1.0 / extension)
        bending, torsion = bending * ratio[:, :1], _products(torsion, ratio)
    return StrainRange(bending, torsion, extension)


def _products(first: Array, second: Array) -> Array:
    """Least and largest products of numbers from two ranges, shape (station, 2)."""
    all_ends = (first[:, :, None] * second[:, None]).reshape(len(first), 4)
    return np.stack([all_ends.min(axis=1), all_ends.max(axis=1)], axis=1)


def _most_bending(plane: Array, bounds: Array) -> Array:
    """An upper bound of √(u1² + u2²): the support of (u1, u2) toward many headings."""
    heading = np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
    toward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    along = np.einsum("hc,scb->shb", toward, plane)
    support = (along[..., None] * bounds).max(-1).sum(-1)
    return support.max(axis=1) / np.cos(np.pi / _HEADINGS)
