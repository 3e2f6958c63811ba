"""Tendons driven by length, or held by guides, on an arm under loads."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from softreach.arm.number import fields_of
from softreach.arm.tables import Works, quadrature
from softreach.arm.tensions import LengthLaw, PulledTendons
from softreach.rod.free import ArmRod
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.rod.tip_map import InvalidLoads
from softreach.support.arrays import Array
from softreach.support.lazy import lazy

_PIECES = 8  # of the arm, on which its strains are smooth
_STEPS = 48  # of the linear response
_DIFFERENCE = 1e-4  # of the widest range, for derivatives


@dataclass(frozen=True)
class LoadedTendons(PulledTendons):
    """Works on the strains of equilibria under loads."""

    law: LengthLaw = field(compare=False)
    """That of the arm without loads."""
    rod: ArmRod
    """The map of the inner arm under loads, accurate enough for s."""

    def works(self, inner: Array, which: Works) -> Array:
        z, force, moment = self._known.get(which) or self._loads(which)
        strains = self.rod.strains(inner, z)
        turn = (strains.curvature * strains.extension[..., None]).reshape(len(inner), 1, -1)
        # One product for each sample, so that none depends on those beside it.
        work = np.matmul(strains.extension[:, None] - 1.0, force) + np.matmul(turn, moment)
        return work[:, 0]

    @lazy
    def _known(self) -> dict[Works, tuple[Array, Array, Array]]:
        return {}

    def _loads(self, which: Works) -> tuple[Array, Array, Array]:
        arm = self.law.arm
        turns = [
            abs(each.value_on("revolution", arm.profile, arm.section))
            for each in arm.actuators
            if "revolution" in fields_of(type(each))
        ]
        z, weights, _ = quadrature(arm, _PIECES + int(max(turns, default=0.0)))
        force, moment = which.loads_at(z, weights)
        self._known[which] = z, force, moment.reshape(3 * len(z), len(which.columns))
        return self._known[which]

    def continued_from(self, inner: Array, frames: Array | None = None) -> LoadedTendons:
        """Those of the arm in its posture at activations of the inner arm, shape (k, bundles)."""
        rod = self.rod.continued_from(inner, frames)
        assert isinstance(rod, ArmRod)
        return replace(self, rod=rod)

    def work_slopes(self, inner: Array, each: list[Works]) -> list[Array]:
        """Derivatives of works, (n, work, bundle) each; NaN where activations are."""
        counts = [len(which.columns) for which in each]
        slopes = np.full((len(inner), sum(counts), inner.shape[1]), np.nan)
        known = ~np.isnan(inner).any(axis=1)
        slopes[known] = self._slopes(inner[known], each)
        return np.split(slopes, np.cumsum(counts)[:-1], axis=1)

    def _slopes(self, inner: Array, each: list[Works]) -> Array:
        """Exact where loads have a linear response, else by central differences."""
        if self._table is not None:
            z = self._table.stations
            loads = [which.loads_at(z.ravel(), np.ones(z.size)) for which in each]
            unit = [np.concatenate([moment, force[:, None]], axis=1) for force, moment in loads]
            unit_loads = np.concatenate(unit, axis=2).reshape(*z.shape, 4, -1)
            state = rod_state(self.rod, inner, self._table)
            return linear_response(self._table, state, [], unit_loads).works
        widths = _DIFFERENCE * self.rod.box.widths
        slopes = np.zeros((len(inner), sum(len(which.columns) for which in each), len(widths)))
        for k in np.flatnonzero(widths > 0):
            ends = [inner.copy(), inner.copy()]
            ends[0][:, k] -= widths[k]
            ends[1][:, k] += widths[k]
            s = [np.hstack([self.works(end, which) for which in each]) for end in ends]
            slopes[..., k] = (s[1] - s[0]) / (2.0 * widths[k])
        return slopes

    @lazy
    def _table(self) -> NodeTables | None:
        """Tables for the linear response."""
        arm, nowhere = self.rod.arm, np.empty(0)
        try:
            grid = step_grid(arm, nowhere, max(_STEPS, self.rod.steps))
            return node_tables(arm, nowhere, grid)
        except InvalidLoads:  # that it does not know
            return None
